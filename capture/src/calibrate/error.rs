//! Why a camera cannot be told from what was seen.

/// A fault in the sightings or the options. Every message says what is wrong and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// An option out of its range.
    #[error("{option} is {value}; {remedy}")]
    Option {
        /// Its name.
        option: &'static str,
        /// What was given.
        value: String,
        /// What to give.
        remedy: &'static str,
    },
    /// The target's points are too few, in a line, or not numbers.
    #[error("the target {fault}; give at least four points that are not in a line")]
    Target {
        /// What is wrong with it.
        fault: String,
    },
    /// Not enough pictures show enough of the target.
    #[error(
        "{usable} of {sightings} pictures show enough of the target to tell where the camera was, {needed} are needed; \
         check that the board is the one that was filmed, film it nearer, sharper and less covered"
    )]
    TooFew {
        /// Pictures that can be used.
        usable: usize,
        /// Pictures in all.
        sightings: usize,
        /// Fewest that will do.
        needed: usize,
    },
    /// A turntable was looked for and nothing turns.
    #[error(
        "the axis is unobservable: between all pictures the target turns by {turn_deg:.1}° at most; film at least a \
         tenth of a turn, or take the pictures as free-hand"
    )]
    AxisUnobservable {
        /// Largest turn between two pictures, in degrees.
        turn_deg: f64,
    },
    /// What moves does not turn about one axis, though it was said to.
    #[error(
        "no one axis explains the pictures: {rms_px:.2} px are left about one axis, {free_px:.2} px without; \
         let the motion be found out, or take them as free-hand"
    )]
    NotATurntable {
        /// RMS with one axis, in pixels.
        rms_px: f64,
        /// RMS with a pose for each picture, in pixels.
        free_px: f64,
    },
    /// The estimate did not come to an end that means anything.
    #[error(
        "the cameras cannot be told from these corners ({fault}); check that the target is the one that was filmed"
    )]
    Failed {
        /// Where it ended.
        fault: &'static str,
    },
}
