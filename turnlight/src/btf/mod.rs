//! Coded materials judged: size, error and speed of one ([`evaluate`]), and of all codecs side by side
//! ([`compare`]).

mod compare;
mod delta;
mod evaluate;
mod page;
mod plot;
mod record;
mod sheet;
mod speed;

pub use compare::{CodecComparison, CodecRun, CompareOptions, compare, text};
pub use delta::Delta;
pub use evaluate::{Evaluation, as_coded, evaluate};
pub use page::html;
pub use record::FitRecord;
pub use sheet::{DIFFERENCE_GAIN, sheet};
pub use speed::{Speed, speed};
