//! Every frame of the footage, with what is known of it.

use capture::Camera;
use capture::calibrate::{Calibration, Motion, Turntable};
use capture::choose::PoseSource;
use capture::footage::FrameSource;
use capture::silhouette::Print;

/// One frame of the footage.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Where it comes from.
    pub source: FrameSource,
    /// As [`capture::choose::sharpness`] says; 0 where it was not looked at.
    pub sharpness: f64,
    /// Standard deviation of the blur at the edges of the board, in pixels, where enough of it is seen.
    pub blur_px: Option<f64>,
    /// How far the picture moved since the frame before.
    pub motion: f64,
    /// World to pixels, where known.
    pub camera: Option<Camera>,
    /// How it is known.
    pub pose: PoseSource,
    /// Turn of the table in radians, unwrapped.
    pub angle: Option<f64>,
    /// Standard deviation of that turn in radians, where it was estimated.
    pub angle_deviation: Option<f64>,
    /// For how long the camera stood where it did in this frame: position among the standpoints; `None` in hand.
    pub standpoint: Option<usize>,
    /// Corners of the board that were used.
    pub corners: usize,
    /// Distance of these corners from where the camera puts them, root of the mean square; 0 without any.
    pub rms_px: f64,
    /// Why the frame cannot be used, in words.
    pub fault: Option<String>,
}

impl Shot {
    /// A frame of which no camera is known.
    pub(super) fn bare(source: FrameSource, sharpness: f64) -> Self {
        Self {
            source,
            sharpness,
            blur_px: None,
            motion: 0.0,
            camera: None,
            pose: PoseSource::Missing,
            angle: None,
            angle_deviation: None,
            standpoint: None,
            corners: 0,
            rms_px: 0.0,
            fault: None,
        }
    }

    /// Gives the frame its camera from elsewhere, where there is one.
    pub(super) fn set_camera(&mut self, camera: Option<Camera>) {
        self.camera = camera;
        self.pose = if camera.is_some() { PoseSource::Measured } else { PoseSource::Missing };
    }
}

/// Where the camera stood while the table turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standpoint {
    /// Position of the film or folder.
    pub take: usize,
    /// Its azimuth about the axis at angle 0 of the table, radians; `None` where no angles are known.
    pub azimuth: Option<f64>,
}

/// The frames of the footage, and what is known of all of them.
#[derive(Clone, Debug, Default)]
pub struct Shots {
    /// In the order of the footage.
    pub shots: Vec<Shot>,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Where the camera stood, one place after the other; none of a camera that was carried.
    pub standpoints: Vec<Standpoint>,
    /// What the board told, if there was one.
    pub calibration: Option<Calibration>,
    /// The board, as it was recognised or given, and where it lies.
    pub print: Option<Print>,
    /// What told the cameras, in words.
    pub told_by: String,
    /// Metres per world unit, where known.
    pub unit: Option<f64>,
    /// Whether the object stands on something flat in the world's plane z = 0, and reaches up from it.
    pub has_plane: bool,
    /// What will show in the model.
    pub findings: Vec<String>,
    /// What is good to know.
    pub notes: Vec<String>,
}

impl Shots {
    /// How many films and folders the frames are from.
    pub fn takes(&self) -> usize {
        self.shots.iter().map(|shot| shot.source.take + 1).max().unwrap_or(0)
    }

    /// The turntable, if it was one.
    pub fn turntable(&self) -> Option<&Turntable> {
        match &self.calibration.as_ref()?.motion {
            Motion::Turntable(turntable) => Some(turntable),
            Motion::FreeHand => None,
        }
    }

    /// What calibration found, line by line: for those who get no report.
    pub(super) fn found(&self) -> Vec<String> {
        let Some(calibration) = &self.calibration else { return Vec::new() };
        let mut found = vec![self.told_by.clone(), lens_note(calibration)];
        found.extend(self.findings.iter().chain(&self.notes).cloned());
        found
    }

    /// Whether the table turns about the world's z, by the angles of the shots.
    pub fn has_axis(&self) -> bool {
        self.shots.iter().any(|shot| shot.angle.is_some())
    }
}

/// The lens, and how well the cameras fit.
pub(super) fn lens_note(calibration: &Calibration) -> String {
    let lens = &calibration.intrinsics;
    format!("lens: f {:.1} px, centre ({:.1}, {:.1}), {:.2} px RMS", lens.fx, lens.cx, lens.cy, calibration.rms_px)
}
