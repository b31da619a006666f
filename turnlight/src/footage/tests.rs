//! Footage that any build reads: photographs whose cameras are known; and what is said to films where none can be read.

use super::*;
use crate::stages::Silent;
use capture::Camera;
use capture::turntable::Axis;
use data_synth::{Effort, Scene, SynthOptions, synthesize};
use nalgebra::{Point3, Vector3};
use std::io::BufWriter;
use tempfile::TempDir;

/// A folder with `capture`, whose cameras and masks are true, and `photographs` of the same names.
struct Set {
    folder: TempDir,
    capture: Capture,
}

impl Set {
    /// The alpha of the photographs is what `alpha` says of the true matte.
    fn new(alpha: impl Fn(u8) -> u8) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (width, height) = (96, 72);
        let effort = Effort::Samples(2);
        let options = SynthOptions { views: 12, width, height, effort, surfaces: 1, ..SynthOptions::default() };
        synthesize(Scene::Temple, &options).unwrap().write(folder.path().join("capture")).unwrap();
        let capture = Capture::read(&folder.path().join("capture")).unwrap();
        std::fs::create_dir(folder.path().join("photographs")).unwrap();
        for frame in &capture.frames {
            let to = folder.path().join("photographs").join(frame.image_path.file_name().unwrap());
            let image = capture::read_rgb(&frame.image_path).unwrap();
            let matte = capture::read_matte(frame.mask_path.as_ref().unwrap()).unwrap();
            write_rgba(&to, &image, &matte.map(&alpha));
        }
        Self { folder, capture }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn captured(&self, options: &FootageOptions) -> Result<(CapturedFootage, FootageReport), Error> {
        let footage = Footage::open(&[self.path("photographs")])?;
        let options = FootageOptions { cameras: CameraSource::Calibrated(self.path("capture")), ..options.clone() };
        let found = capture_footage(&footage, &options, &self.path("output"), &mut Stages::new(&Silent))?;
        let report = found.report(&footage);
        Ok((found, report))
    }
}

fn write_rgba(path: &Path, image: &Image<[u8; 3]>, alpha: &Image<u8>) {
    let file = BufWriter::new(std::fs::File::create(path).unwrap());
    let mut encoder = png::Encoder::new(file, image.width() as u32, image.height() as u32);
    encoder.set_color(png::ColorType::Rgba);
    let pixels = image.pixels().iter().zip(alpha.pixels()).flat_map(|(&[r, g, b], &a)| [r, g, b, a]);
    encoder.write_header().unwrap().write_image_data(&pixels.collect::<Vec<u8>>()).unwrap();
}

#[test]
fn the_alpha_of_photographs_is_their_mask() {
    let set = Set::new(|coverage| coverage);
    let (found, report) = set.captured(&FootageOptions::default()).unwrap();
    assert_eq!(found.kept.len(), set.capture.frames.len(), "{:?}", found.selected.dropped);
    for (frame, matte) in set.capture.frames.iter().zip(found.mattes()) {
        assert_eq!(matte, capture::read_matte(frame.mask_path.as_ref().unwrap()).unwrap());
    }
    assert_eq!(report.silhouettes, "the alpha channel of the photographs");
    // Masks that are given say more.
    let masks = Some(set.path("capture/masks"));
    let (_, report) = set.captured(&FootageOptions { masks, ..FootageOptions::default() }).unwrap();
    assert_eq!(report.silhouettes, "masks given");
}

#[test]
fn alpha_that_is_opaque_everywhere_says_nothing() {
    let set = Set::new(|_| 255);
    let (found, report) = set.captured(&FootageOptions::default()).unwrap();
    assert_eq!(report.silhouettes, "keyed by the colour of the backdrop");
    assert!(found.mattes().iter().all(|matte| matte.pixels().contains(&0)));
}

#[test]
fn a_table_that_turns_evenly_needs_one_camera() {
    let set = Set::new(|coverage| coverage);
    // The ring of the synthesizer turns about z; in the world of another camera about any axis.
    let truth: Vec<Camera> = set.capture.frames.iter().map(|frame| frame.camera).collect();
    let step = std::f64::consts::TAU / 12.0;
    let turn = |axis: Axis| EvenTurn { camera: set.path("capture"), axis, step };
    let footage = Footage::open(&[set.path("photographs")]).unwrap();
    let axis = Axis { point: Point3::origin(), direction: Vector3::z_axis() };
    let options = FootageOptions { cameras: CameraSource::Turning(turn(axis)), ..FootageOptions::default() };
    let found = capture_footage(&footage, &options, &set.path("output"), &mut Stages::new(&Silent)).unwrap();
    assert_eq!(found.capture.frames[0].camera, truth[0]);
    assert!(found.shots.has_axis() && found.shots.notes[0].contains("30° from photograph to photograph"));
    // About another axis the world is laid along it, and the first picture stays as it is.
    let axis = Axis { point: Point3::new(0.1, -0.2, 0.3), direction: -Vector3::x_axis() };
    let options = FootageOptions { cameras: CameraSource::Turning(turn(axis)), ..options };
    let shots = cameras::find_cameras(&footage, &options, &set.path("output"), &mut Stages::new(&Silent)).unwrap().0;
    let on_axis = |height: f64| axis.point + axis.direction.into_inner() * height;
    for (shot, height) in shots.shots.iter().zip([0.0, 0.1, -0.2]) {
        let seen = shot.camera.unwrap().project(&Point3::new(0.0, 0.0, height)).unwrap();
        assert!((seen.pixel - truth[0].project(&on_axis(height)).unwrap().pixel).norm() < 1e-9);
    }
}

#[test]
fn films_are_refused_with_a_remedy_where_they_are_not_built_in() {
    let set = Set::new(|coverage| coverage);
    let film = set.path("film.mp4");
    std::fs::write(&film, "a text named like a film").unwrap();
    let footage = Footage::open(&[film]).unwrap();
    for cameras in
        [CameraSource::Board, CameraSource::Calibrated(set.path("capture")), CameraSource::Colmap("true".into())]
    {
        let options = FootageOptions { cameras, ..FootageOptions::default() };
        let fault = capture_footage(&footage, &options, &set.path("output"), &mut Stages::new(&Silent)).unwrap_err();
        let words = if cfg!(feature = "video") { "is no film" } else { "--features video" };
        assert!(fault.to_string().contains("film.mp4") && fault.to_string().contains(words), "{fault}");
    }
}
