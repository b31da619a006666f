//! How fast things go on this machine, each against what bounds it.

pub mod object;
pub mod playback;
mod player;
