//! The truth beside a film: a capture folder as any synthetic one, and in its `truth.json` what a
//! capture cannot say.

use super::{Footage, frame_name};
use crate::error::SynthError;
use crate::write::{CaptureFolder, image_path, intrinsics, opengl_world_from_camera, rows};
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
        folder.finish(&footage.mesh, &footage.aabb, &footage.truth())
    }
}

impl Footage {
    /// What `truth.json` says; `docs/synthetic-footage.md` says what it means.
    pub fn truth(&self) -> Value {
        let options = &self.options;
        let frame = |k: usize| {
            json!({
                "file_path": image_path(&frame_name(k)),
                "transform_matrix": rows(&opengl_world_from_camera(&self.cameras[k])),
                "time_s": k as f64 / options.fps,
                "angle_deg": self.angles[k].to_degrees(),
                "exposure": self.exposure(k),
            })
        };
        let noise = options
            .sensor_noise
            .map(|noise| json!({ "full_well": noise.full_well, "read_electrons": noise.read_electrons }));
        json!({
            "scene": self.scene.name(),
            "seed": options.seed,
            "fps": options.fps,
            "axis": { "point": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 1.0] },
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
            "motion_blur_deg": options.motion_blur_deg,
            "frames": (0..options.frames).map(frame).collect::<Vec<_>>(),
        })
    }
}
