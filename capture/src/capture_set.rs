//! A capture: calibrated frames on disk, and the views loaded from them.

use crate::{Camera, CaptureError, Image, MaskSource, formats, load, masks, write};
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};

/// An axis-aligned box in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub min: Point3<f64>,
    /// The corner with the largest coordinates.
    pub max: Point3<f64>,
}

/// Calibrated frames of one object.
#[derive(Clone, Debug)]
pub struct Capture {
    /// In file order; views are chosen by their position here.
    pub frames: Vec<Frame>,
    /// The object's box, where the source gives one.
    pub aabb: Option<Aabb>,
    /// Metres per world unit, where known.
    pub unit: Option<f64>,
    /// Where the silhouettes come from; the same for all frames.
    pub mask_source: MaskSource,
}

/// One calibrated photograph on disk.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The image file.
    pub image_path: PathBuf,
    /// The silhouette file, where there is one.
    pub mask_path: Option<PathBuf>,
    /// Intrinsics and pose; its size is the image's.
    pub camera: Camera,
    /// Unit direction towards the light, in the world, where known.
    pub light_direction: Option<Vector3<f64>>,
    /// Relative exposure, where known.
    pub exposure: Option<f64>,
}

/// How views are loaded.
#[derive(Clone, Copy, Debug)]
pub struct LoadOptions {
    /// Whole factor by which images, mattes and cameras are reduced (area average).
    pub downscale: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { downscale: 1 }
    }
}

/// A photograph in memory, with all that later stages need to know of it.
#[derive(Clone, Debug)]
pub struct View {
    /// Position of its frame in the capture.
    pub index: usize,
    /// File stem of its image.
    pub name: String,
    /// 8-bit sRGB as photographed (alpha composited on black where the file has one).
    pub image: Image<[u8; 3]>,
    /// Coverage of each pixel by the object, 255 = all; the object is where it is ≥ 128.
    pub matte: Image<u8>,
    /// Whether nothing of the object lies outside the frame: then outside is background,
    /// otherwise unknown.
    pub is_complete: bool,
    /// Intrinsics and pose, for exactly this image size.
    pub camera: Camera,
}

impl Aabb {
    /// The centre.
    pub fn center(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Edge lengths.
    pub fn size(&self) -> Vector3<f64> {
        self.max - self.min
    }

    /// Length of the space diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().norm()
    }

    /// The smallest box around `points`; `None` without points.
    pub fn around(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        points.into_iter().fold(None, |found: Option<Self>, p| {
            Some(found.map_or(Self { min: p, max: p }, |b| Self { min: b.min.inf(&p), max: b.max.sup(&p) }))
        })
    }
}

impl Capture {
    /// Reads a calibrated folder of any known kind, or the calibration file in it: `transforms.json`,
    /// COLMAP text or binary, Middlebury `*_par.txt`, projection matrices as text or MATLAB file.
    /// Finds the masks under every spelling in use. Images are not decoded, and need not exist as long
    /// as the calibration says their size.
    ///
    /// # Errors
    /// Names the file, what is wrong with it and what to do; a folder that is no capture lists what was
    /// looked for.
    pub fn read(path: &Path) -> Result<Self, CaptureError> {
        let mut capture = formats::read(path)?;
        capture.mask_source = masks::find(&mut capture.frames)?;
        Ok(capture)
    }

    /// Says whether a capture can be written to `dir`, before any work is done: nothing is there, or a capture that will
    /// be replaced.
    ///
    /// # Errors
    /// Where `dir` holds something that is no capture.
    pub fn check_place(dir: &Path) -> Result<(), CaptureError> {
        write::check_replaceable(dir)
    }

    /// Writes `transforms.json` (nerfstudio convention), `images/` and `masks/` to the folder `dir`,
    /// which appears whole or not at all. An earlier capture of that name is replaced.
    ///
    /// # Errors
    /// When a source file is missing, the disk is full, or `dir` holds something that is no capture.
    pub fn write(&self, dir: &Path) -> Result<(), CaptureError> {
        write::write(self, None, &[], dir)
    }

    /// As [`Capture::write`], with `mattes` (one per frame, of its size) in place of the given masks.
    ///
    /// # Errors
    /// As [`Capture::write`], and when the number of mattes is not that of the frames.
    pub fn write_with_mattes(&self, mattes: &[Image<u8>], dir: &Path) -> Result<(), CaptureError> {
        write::write(self, Some(mattes), &[], dir)
    }

    /// As [`Capture::write_with_mattes`], with a report beside the capture: `report.html` and `report.json`.
    ///
    /// # Errors
    /// As [`Capture::write_with_mattes`].
    pub fn write_with_report(
        &self,
        mattes: &[Image<u8>],
        html: &str,
        json: &str,
        dir: &Path,
    ) -> Result<(), CaptureError> {
        let files = [("report.html", html.as_bytes()), ("report.json", json.as_bytes())];
        write::write(self, Some(mattes), &files, dir)
    }

    /// The same capture with its masks and alpha channels ignored: silhouettes will be found in the
    /// photographs.
    pub fn without_masks(mut self) -> Self {
        self.frames.iter_mut().for_each(|frame| frame.mask_path = None);
        self.mask_source = MaskSource::Automatic;
        self
    }

    /// Loads the frames at the given positions, in the given order.
    ///
    /// # Errors
    /// Names the file that is missing, truncated, of another size than its camera, or empty.
    pub fn load_views(&self, positions: &[usize], options: &LoadOptions) -> Result<Vec<View>, CaptureError> {
        load::load_views(self, positions, options)
    }

    /// Loads every frame, in file order.
    ///
    /// # Errors
    /// As [`Capture::load_views`].
    pub fn load_all_views(&self, options: &LoadOptions) -> Result<Vec<View>, CaptureError> {
        let all: Vec<usize> = (0..self.frames.len()).collect();
        self.load_views(&all, options)
    }
}
