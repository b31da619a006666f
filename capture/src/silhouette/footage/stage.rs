//! What is known of how footage was taken.

use crate::votes::nearest_to_rays;
use crate::{Aabb, Board, Camera, CaptureError, Image, Ray};
use nalgebra::{Isometry3, Point3, Vector3};

/// Hands out a frame by its position; asked several times for each, from several threads.
pub type FetchFrame<'a> = dyn Fn(usize) -> Result<Image<[u8; 3]>, CaptureError> + Sync + 'a;

/// Frames in a segment that make the room known.
const LEAST_OF_SEGMENT: usize = 4;

/// Probes of the print along a side of a texel.
const PROBES: usize = 4;

/// The longer side of a thumbnail is at least this, in pixels.
const THUMBNAIL: usize = 320;

/// The print on the target.
#[derive(Clone, Copy, Debug)]
pub struct Print {
    /// What is printed.
    pub board: Board,
    /// World to board coordinates; the board lies in the world's plane z = 0.
    pub board_from_world: Isometry3<f64>,
}

impl Print {
    /// Share of a square of side `side` (metres) about a place of the plane that is dark; `None` beside the pattern,
    /// where there may be anything.
    pub(super) fn dark_share(&self, place: [f64; 2], side: f64) -> Option<f32> {
        let at = |[x, y]: [f64; 2]| (self.board_from_world * Point3::new(x, y, 0.0)).xy();
        let [width, height] = self.board.size();
        let middle = at(place);
        let is_inside = middle.x > side && middle.y > side && middle.x < width - side && middle.y < height - side;
        if !is_inside {
            return None;
        }
        let offset = |k: usize| ((k as f64 + 0.5) / PROBES as f64 - 0.5) * side;
        let probes = (0..PROBES * PROBES).map(|k| [place[0] + offset(k % PROBES), place[1] + offset(k / PROBES)]);
        let dark = probes.filter(|&probe| self.board.is_dark(at(probe))).count();
        Some(dark as f32 / (PROBES * PROBES) as f32)
    }
}

/// What is known of how the footage was taken.
#[derive(Clone, Debug, Default)]
pub struct StageSetup {
    /// One per frame: in the world of the object, which is at rest there even if it turns in the room.
    pub cameras: Vec<Camera>,
    /// Per frame the segment during which the camera stood still in the room, counted from 0; `None` where it was
    /// in hand.
    pub segments: Vec<Option<usize>>,
    /// Whether the object stands on a flat, printed or plain target in z = 0, and is all in z > 0.
    pub has_plane: bool,
    /// What is printed on the target, where that is known.
    pub print: Option<Print>,
    /// Per segment a picture of the stage without object and platter; may be shorter than there are segments.
    pub clean_plates: Vec<Option<Image<[u8; 3]>>>,
    /// A box around the object, where known.
    pub aabb: Option<Aabb>,
    /// What the frames are called in findings; their positions where it is empty.
    pub numbers: Vec<usize>,
}

impl StageSetup {
    pub(super) fn check(&self) -> Result<(), CaptureError> {
        let fault = |fault: String, remedy: &str| Err(CaptureError::Stage { fault, remedy: remedy.to_owned() });
        if self.cameras.len() != self.segments.len() {
            let counts = format!("{} cameras for {} segments", self.cameras.len(), self.segments.len());
            return fault(counts, "give one of each for every frame");
        }
        // More would ask for a plate each, and a typing error for gigabytes.
        if let Some(segment) = self.segments.iter().flatten().find(|s| **s >= self.cameras.len()) {
            return fault(format!("there is no segment {segment}"), "count segments from 0, without gaps");
        }
        let size = |c: &Camera| (c.intrinsics.width, c.intrinsics.height);
        for (i, plate) in self.clean_plates.iter().enumerate() {
            let Some(plate) = plate else { continue };
            let member = self.segments.iter().position(|s| *s == Some(i)).map(|frame| size(&self.cameras[frame]));
            if member.is_some_and(|size| size != (plate.width(), plate.height())) {
                let sizes = format!("the clean plate of segment {i} is {}x{}", plate.width(), plate.height());
                return fault(sizes, "take it with the camera and the size of the frames");
            }
        }
        Ok(())
    }

    /// Whether anything but the backdrop's colour can tell the object.
    pub(super) fn has_plates(&self) -> bool {
        self.cameras.len() >= 3 && (self.has_plane || (0..self.segment_count()).any(|s| self.is_still(s)))
    }

    pub(super) fn segment_count(&self) -> usize {
        self.segments.iter().flatten().max().map_or(0, |last| last + 1)
    }

    /// Whether the room of a segment can be known.
    pub(super) fn is_still(&self, segment: usize) -> bool {
        self.segments.iter().filter(|s| **s == Some(segment)).count() >= LEAST_OF_SEGMENT
            || self.clean_plates.get(segment).is_some_and(Option::is_some)
    }

    /// The same for thumbnails.
    pub(super) fn reduced(&self, factor: usize) -> Self {
        let plate = |plate: &Option<Image<[u8; 3]>>| plate.as_ref().map(|p| crate::load::reduced(p, factor));
        Self {
            cameras: self.cameras.iter().map(|c| c.downscaled(factor)).collect(),
            clean_plates: self.clean_plates.iter().map(plate).collect(),
            ..self.clone()
        }
    }
}

/// The whole factor that leaves thumbnails.
pub(super) fn thumbnail_factor(cameras: &[Camera]) -> usize {
    let shortest = cameras.iter().map(|c| c.intrinsics.width.max(c.intrinsics.height)).min().unwrap_or(0);
    (shortest / THUMBNAIL).max(1)
}

/// Where the object may be: the given box, or all that the cameras look at. `None` where they look at nothing in
/// common.
pub(super) fn search_box(setup: &StageSetup) -> Option<Aabb> {
    let mut found = match setup.aabb {
        Some(given) => given,
        None => looked_at(setup)?,
    };
    if setup.has_plane {
        found.min.z = found.min.z.max(0.0);
    }
    (found.size().min() > 0.0).then_some(found)
}

/// A cube about the point nearest to all optical axes, as large as the narrowest view of it.
fn looked_at(setup: &StageSetup) -> Option<Aabb> {
    let axes: Vec<Ray> = setup.cameras.iter().map(|c| Ray { origin: c.center(), direction: c.forward() }).collect();
    let center = nearest_to_rays(&axes).or_else(|| on_target(setup, &axes))?;
    let radius = |c: &Camera| {
        let depth = c.project(&center)?.depth;
        let i = &c.intrinsics;
        Some(0.5 * depth * (i.width as f64 / i.fx).min(i.height as f64 / i.fy))
    };
    let mut radii: Vec<f64> = setup.cameras.iter().filter_map(radius).collect();
    radii.sort_by(f64::total_cmp);
    let radius = *radii.get(radii.len() / 2)?;
    let half = Vector3::repeat(radius);
    Some(Aabb { min: center - half, max: center + half })
}

/// For cameras that all look the same way.
fn on_target(setup: &StageSetup, axes: &[Ray]) -> Option<Point3<f64>> {
    let axis = axes.first().filter(|_| setup.has_plane)?;
    let t = -axis.origin.z / axis.direction.z;
    (t.is_finite() && t > 0.0).then(|| axis.origin + axis.direction * t)
}
