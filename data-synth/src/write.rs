//! A synthetic capture as a folder: `transforms.json` (nerfstudio convention), `images/`, `masks/`, and
//! beside it what a capture does not know: the true surface as `truth.ply`, true cameras and exposures as
//! `truth.json`, and on request what each view shows by pixel as `truth/NNNN.exr`. The folder appears whole
//! or not at all.
//!
//! Channels of the EXR files: `R G B` mean radiance (linear sRGB, white at 1, object on black), `A` coverage,
//! `Z` distance along the optical axis in metres (infinite off the object), `NX NY NZ` the unit normal in the
//! world, `noise` the renderer's standard error in levels of 255 of sRGB. 32-bit floats.

use crate::error::{SynthError, io_error};
use crate::film::Effort;
use crate::synth::{LightFrame, SynthCapture, TruthMaps};
use capture::{Aabb, Camera, Image, View};
use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Vec2, WritableImage};
use geometry::Mesh;
use image::{ExtendedColorType, ImageFormat};
use nalgebra::{Matrix4, Vector3};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

impl SynthCapture {
    /// Writes the capture folder `dir`, which must not exist yet or be empty.
    ///
    /// # Errors
    /// [`SynthError::Exists`] where the folder holds something, otherwise names the file that could
    /// not be written.
    pub fn write(&self, dir: impl AsRef<Path>) -> Result<(), SynthError> {
        let mut folder = CaptureFolder::create(dir.as_ref())?;
        for (view, light) in self.views.iter().zip(&self.light_directions) {
            folder.add(view, light)?;
        }
        for (view, truth) in self.views.iter().zip(&self.truths) {
            truth.maps.as_ref().map(|maps| folder.add_maps(&view.name, maps)).transpose()?;
        }
        folder.finish(&self.mesh, &self.aabb, &self.truth())
    }
}

/// A capture folder under construction, a view at a time. Dropped without [`CaptureFolder::finish`], it leaves
/// nothing.
#[derive(Debug)]
pub(crate) struct CaptureFolder {
    dir: PathBuf,
    staging: TempDir,
    /// The keys of the lens, from the first view.
    lens: Value,
    frames: Vec<Value>,
}

impl CaptureFolder {
    /// Starts a folder that will appear at `dir`, which must not exist yet or be empty.
    pub(crate) fn create(dir: &Path) -> Result<Self, SynthError> {
        if is_occupied(dir) {
            return Err(SynthError::Exists { path: dir.to_owned() });
        }
        let parent = dir.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(parent).map_err(io_error(parent))?;
        // Beside the target, so that the rename stays on one file system; gone if we fail.
        let staging =
            tempfile::Builder::new().prefix(".turnlight-synth-").tempdir_in(parent).map_err(io_error(parent))?;
        for sub in ["images", "masks"] {
            let path = staging.path().join("capture").join(sub);
            fs::create_dir_all(&path).map_err(io_error(&path))?;
        }
        Ok(Self { dir: dir.to_owned(), staging, lens: json!({}), frames: Vec::new() })
    }

    /// Writes picture and matte of a view lit from the unit direction `light`.
    pub(crate) fn add(&mut self, view: &View, light: &Vector3<f64>) -> Result<(), SynthError> {
        let inner = self.inner();
        write_rgb(&inner.join(image_path(&view.name)), &view.image)?;
        write_grey(&inner.join(mask_path(&view.name)), &view.matte)?;
        if self.frames.is_empty() {
            self.lens = intrinsics(&view.camera);
        }
        self.frames.push(json!({
            "file_path": image_path(&view.name),
            "mask_path": mask_path(&view.name),
            "transform_matrix": rows(&opengl_world_from_camera(&view.camera)),
            "light_direction": [light.x, light.y, light.z],
        }));
        Ok(())
    }

    fn add_maps(&self, name: &str, maps: &TruthMaps) -> Result<(), SynthError> {
        let folder = self.inner().join("truth");
        fs::create_dir_all(&folder).map_err(io_error(&folder))?;
        write_maps(&self.inner().join(truth_path(name)), maps)
    }

    /// Adds the true surface and what `truth.json` says, and makes the folder appear.
    pub(crate) fn finish(self, mesh: &Mesh, aabb: &Aabb, truth: &Value) -> Result<(), SynthError> {
        let (inner, dir) = (self.inner(), &self.dir);
        write_bytes(&inner.join("truth.ply"), &ply(mesh))?;
        let mut document = self.lens;
        document["unit"] = json!(1.0);
        document["aabb"] = json!([aabb.min.coords.as_slice(), aabb.max.coords.as_slice()]);
        document["frames"] = Value::Array(self.frames);
        write_json(&inner.join("transforms.json"), &document)?;
        write_json(&inner.join("truth.json"), truth)?;
        if dir.is_dir() {
            // Empty, as checked at the start; some systems do not rename over a folder.
            fs::remove_dir(dir).map_err(io_error(dir))?;
        }
        fs::rename(&inner, dir).map_err(io_error(dir))
    }

    fn inner(&self) -> PathBuf {
        self.staging.path().join("capture")
    }
}

impl SynthCapture {
    /// What faults hide: the cameras that took the views, and how bright each came out.
    fn truth(&self) -> Value {
        let frame = |(view, truth): (&View, &crate::synth::ViewTruth)| {
            json!({
                "file_path": image_path(&view.name),
                "transform_matrix": rows(&opengl_world_from_camera(&truth.camera)),
                "exposure": truth.exposure,
                "maps": truth.maps.is_some().then(|| truth_path(&view.name)),
            })
        };
        let (options, faults) = (&self.options, &self.options.faults);
        let (samples, noise) = match options.effort {
            Effort::Samples(samples) => (Some(samples), None),
            Effort::Noise(levels) => (None, Some(levels)),
        };
        json!({
            "scene": self.scene.name(),
            "seed": options.seed,
            "samples": samples,
            "noise_levels": noise,
            "surfaces": options.surfaces,
            "light": match options.light { LightFrame::Room => "room", LightFrame::Object => "object" },
            "faults": {
                "sensor_full_well_electrons": faults.sensor_noise.map(|n| n.full_well),
                "sensor_read_electrons": faults.sensor_noise.map(|n| n.read_electrons),
                "exposure_drift_stops": faults.exposure_drift_stops,
                "camera_jitter_deg": faults.camera_jitter_deg,
                "calibration_error_px": faults.calibration_error_px,
                "matte_grow_px": faults.matte_grow_px,
                "matte_holes": faults.matte_holes,
                "motion_blur_deg": faults.motion_blur_deg,
                "distortion_k1": faults.distortion_k1,
            },
            "noise_rms_levels": self.report.noise_rms,
            "frames": self.views.iter().zip(&self.truths).map(frame).collect::<Vec<_>>(),
        })
    }
}

fn write_maps(path: &Path, maps: &TruthMaps) -> Result<(), SynthError> {
    let size = Vec2(maps.depth.width(), maps.depth.height());
    let plane = |name: &str, values: Vec<f32>| AnyChannel::new(name, FlatSamples::F32(values));
    let of = |image: &Image<[f32; 3]>, k: usize| image.pixels().iter().map(|p| p[k]).collect();
    let scalar = |image: &Image<f32>| image.pixels().to_vec();
    let mut channels =
        vec![plane("A", scalar(&maps.coverage)), plane("Z", scalar(&maps.depth)), plane("noise", scalar(&maps.noise))];
    for (k, [color, normal]) in [["R", "NX"], ["G", "NY"], ["B", "NZ"]].into_iter().enumerate() {
        channels.extend([plane(color, of(&maps.radiance, k)), plane(normal, of(&maps.normal, k))]);
    }
    let image = exr::prelude::Image::from_channels(size, AnyChannels::sort(channels.into_iter().collect()));
    let mut out = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut out).map_err(|source| SynthError::Maps { path: path.to_owned(), source })?;
    write_bytes(path, out.get_ref())
}

/// The shared lens; our pixel centres are at half integers, as nerfstudio's are.
pub(crate) fn intrinsics(camera: &Camera) -> Value {
    let i = camera.intrinsics;
    json!({
        "camera_model": "OPENCV",
        "fl_x": i.fx, "fl_y": i.fy, "cx": i.cx, "cy": i.cy, "w": i.width, "h": i.height,
        "k1": i.distortion.k1, "k2": i.distortion.k2, "k3": i.distortion.k3,
        "p1": i.distortion.p1, "p2": i.distortion.p2,
    })
}

/// Camera to world with OpenGL axes (y up, z back).
pub(crate) fn opengl_world_from_camera(camera: &Camera) -> Matrix4<f64> {
    let flip = nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let mut m = Matrix4::identity();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(&(camera.rotation.transpose() * flip));
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&camera.center().coords);
    m
}

pub(crate) fn rows(m: &Matrix4<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Binary PLY; vertices were rounded to `f32` when built, so this is exact.
fn ply(mesh: &Mesh) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment true surface, metres, +z up\nelement vertex {}\n\
         property float x\nproperty float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        mesh.positions.len(),
        mesh.faces.len()
    );
    let mut bytes = header.into_bytes();
    for p in &mesh.positions {
        p.iter().for_each(|&c| bytes.extend((c as f32).to_le_bytes()));
    }
    for face in &mesh.faces {
        bytes.push(3);
        face.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

pub(crate) fn image_path(name: &str) -> String {
    format!("images/{name}.png")
}

fn mask_path(name: &str) -> String {
    format!("masks/{name}.png")
}

fn truth_path(name: &str) -> String {
    format!("truth/{name}.exr")
}

fn write_rgb(path: &Path, image: &Image<[u8; 3]>) -> Result<(), SynthError> {
    encode(path, image.pixels().as_flattened(), image.width(), image.height(), ExtendedColorType::Rgb8)
}

fn write_grey(path: &Path, image: &Image<u8>) -> Result<(), SynthError> {
    encode(path, image.pixels(), image.width(), image.height(), ExtendedColorType::L8)
}

fn encode(path: &Path, bytes: &[u8], width: usize, height: usize, kind: ExtendedColorType) -> Result<(), SynthError> {
    let mut out = std::io::Cursor::new(Vec::new());
    image::write_buffer_with_format(&mut out, bytes, width as u32, height as u32, kind, ImageFormat::Png)
        .map_err(|source| SynthError::Encode { path: path.to_owned(), source })?;
    write_bytes(path, out.get_ref())
}

fn write_json(path: &Path, document: &Value) -> Result<(), SynthError> {
    write_bytes(path, format!("{document:#}\n").as_bytes())
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), SynthError> {
    fs::write(path, bytes).map_err(io_error(path))
}

fn is_occupied(dir: &Path) -> bool {
    match fs::read_dir(dir) {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) => dir.symlink_metadata().is_ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Effort, Scene, SynthOptions, synthesize};
    use nalgebra::{Point3, Vector4};

    fn small() -> SynthCapture {
        let options =
            SynthOptions { views: 2, width: 32, height: 24, effort: Effort::Samples(1), ..SynthOptions::default() };
        synthesize(Scene::Temple, &options).unwrap()
    }

    #[test]
    fn the_folder_says_what_was_filmed() {
        let capture = small();
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("deep/temple");
        capture.write(&dir).unwrap();
        let json: Value = serde_json::from_str(&fs::read_to_string(dir.join("transforms.json")).unwrap()).unwrap();
        assert_eq!(json["frames"].as_array().unwrap().len(), 2);
        let png = image::open(dir.join(json["frames"][1]["file_path"].as_str().unwrap())).unwrap().to_rgb8();
        assert_eq!(png.as_raw().as_slice(), capture.views[1].image.pixels().as_flattened());
        let mask = image::open(dir.join(json["frames"][1]["mask_path"].as_str().unwrap())).unwrap().to_luma8();
        assert_eq!(mask.as_raw().as_slice(), capture.views[1].matte.pixels());
        // Nothing is left beside it, and nothing is overwritten.
        assert_eq!(fs::read_dir(root.path().join("deep")).unwrap().count(), 1);
        assert!(matches!(capture.write(&dir), Err(SynthError::Exists { .. })));
    }

    #[test]
    fn maps_come_back_from_their_file() {
        use exr::prelude::{ReadChannels, ReadLayers, read};
        let capture = small();
        let options = SynthOptions {
            views: 2,
            width: 32,
            height: 24,
            effort: Effort::Samples(4),
            maps: true,
            ..SynthOptions::default()
        };
        let with_maps = synthesize(Scene::Temple, &options).unwrap();
        let root = tempfile::tempdir().unwrap();
        capture.write(root.path().join("without")).unwrap();
        assert!(!root.path().join("without/truth").exists());
        with_maps.write(root.path().join("with")).unwrap();
        let path = root.path().join("with/truth/0000.exr");
        let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
        let image = image.all_attributes().from_file(path).unwrap();
        let depth = image.layer_data.channel_data.list.iter().find(|c| c.name == *"Z").unwrap();
        let written = with_maps.truths[0].maps.as_ref().unwrap();
        let read: Vec<f32> = depth.sample_data.values_as_f32().collect();
        assert_eq!(read, written.depth.pixels());
        // What is met lies where the camera stands off the object, with a unit normal that faces it.
        let camera = with_maps.truths[0].camera;
        for (y, x) in (0..24).flat_map(|y| (0..32).map(move |x| (y, x))) {
            let (z, n) = (written.depth.at(x, y), Vector3::from(written.normal.at(x, y)).cast::<f64>());
            if z.is_finite() {
                let ray = camera.ray(nalgebra::Point2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap();
                assert!((n.norm() - 1.0).abs() < 1e-5 && n.dot(&ray.direction) <= 0.0);
                let p = ray.origin + ray.direction * (f64::from(z) / ray.direction.dot(&camera.forward()));
                assert!(with_maps.aabb.min.iter().zip(p.iter()).all(|(low, p)| *p > low - 1e-5));
                assert!(with_maps.aabb.max.iter().zip(p.iter()).all(|(high, p)| *p < high + 1e-5));
            }
        }
    }

    #[test]
    fn the_written_matrix_projects_as_the_camera_does() {
        let camera = small().views[1].camera;
        let p = Point3::new(0.03, -0.02, 0.09);
        let m = opengl_world_from_camera(&camera).try_inverse().unwrap();
        let c = m * Vector4::new(p.x, p.y, p.z, 1.0);
        // OpenGL: the camera looks along −z, and rows run against y.
        let pixel = camera.project(&p).unwrap().pixel;
        let i = camera.intrinsics;
        assert!((i.fx * c.x / -c.z + i.cx - pixel.x).abs() < 1e-9);
        assert!((-i.fy * c.y / -c.z + i.cy - pixel.y).abs() < 1e-9);
    }

    #[test]
    fn ply_has_the_size_its_header_promises() {
        let mesh = Scene::Temple.mesh();
        let bytes = ply(&mesh);
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        assert_eq!(bytes.len() - end, mesh.positions.len() * 12 + mesh.faces.len() * 13);
    }
}
