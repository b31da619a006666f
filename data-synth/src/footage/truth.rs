//! The truth beside a film: a capture folder as any synthetic one, and `footage.json` with what a capture cannot say.

use super::Footage;
use crate::error::SynthError;
use crate::write::{CaptureFolder, intrinsics, rows};
use capture::View;
use serde_json::{Value, json};
use std::path::Path;

/// The truth of a film under construction, a frame at a time. Dropped without [`TruthFolder::finish`], it leaves
/// nothing.
#[derive(Debug)]
pub struct TruthFolder<'a> {
    footage: &'a Footage,
    folder: CaptureFolder,
}

impl<'a> TruthFolder<'a> {
    /// Starts the folder `dir`, which must not exist yet or be empty.
    ///
    /// # Errors
    /// [`SynthError::Exists`] where the folder holds something, otherwise names what could not be made.
    pub fn create(footage: &'a Footage, dir: impl AsRef<Path>) -> Result<Self, SynthError> {
        Ok(Self { footage, folder: CaptureFolder::create(dir.as_ref())? })
    }

    /// Writes the picture (before any codec) and the matte of a frame, in their order.
    ///
    /// # Errors
    /// Names the file that could not be written.
    pub fn add(&mut self, frame: &View) -> Result<(), SynthError> {
        self.folder.add(frame, &self.footage.light_direction(frame.index))
    }

    /// Makes the folder appear.
    ///
    /// # Errors
    /// Names the file that could not be written.
    pub fn finish(self) -> Result<(), SynthError> {
        let Self { footage, folder } = self;
        folder.finish(&footage.mesh, &footage.aabb, &[("footage.json", footage.document())])
    }
}

impl Footage {
    /// What `footage.json` says; `docs/synthetic-footage.md` says what it means.
    pub fn document(&self) -> Value {
        let options = &self.options;
        let angles: Vec<f64> = self.angles.iter().map(|angle| angle.to_degrees()).collect();
        let times: Vec<f64> = (0..options.frames).map(|k| k as f64 / options.fps).collect();
        let exposures: Vec<f64> = (0..options.frames).map(|k| self.exposure(k)).collect();
        let noise = options
            .sensor_noise
            .map(|noise| json!({ "full_well": noise.full_well, "read_electrons": noise.read_electrons }));
        json!({
            "scene": self.scene.name(),
            "seed": options.seed,
            "fps": options.fps,
            "times_s": times,
            "axis": { "point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0] },
            "angles_deg": angles,
            "turns": options.turns,
            "unsteadiness": options.unsteadiness,
            "elevation_deg": options.elevation_deg,
            "board": {
                "text": self.board.to_string(),
                "world_from_board": rows(&self.world_from_board.to_homogeneous()),
            },
            "backdrop": options.backdrop.name(),
            "lens": self.cameras.first().map(intrinsics),
            "sensor_noise": noise,
            "exposures": exposures,
            "motion_blur_deg": options.motion_blur_deg,
        })
    }
}
