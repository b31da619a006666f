//! Silhouettes found where none are given: in photographs before a plain backdrop ([`find_mattes`]), and in
//! footage of an object that stands on a flat target ([`find_silhouettes`]).

mod footage;
mod photographs;

pub use footage::{
    Evidence, FetchFrame, Moving, Print, SilhouetteOptions, Silhouettes, StageSetup, check_silhouettes,
    clean_plate_likeness, find_moving, find_silhouettes,
};
pub use photographs::{find_mattes, find_mattes_in_box};
