//! A synthetic capture as a folder: `transforms.json` (nerfstudio convention), `images/`, `masks/`,
//! and the true surface as `truth.ply`. The folder appears whole or not at all.

use crate::error::SynthError;
use crate::synth::SynthCapture;
use capture::{Aabb, Camera, Image, View};
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
        folder.finish(&self.mesh, &self.aabb, &[])
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

    /// Adds the true surface and `more` documents by name, and makes the folder appear.
    pub(crate) fn finish(self, mesh: &Mesh, aabb: &Aabb, more: &[(&str, Value)]) -> Result<(), SynthError> {
        let (inner, dir) = (self.inner(), &self.dir);
        write_bytes(&inner.join("truth.ply"), &ply(mesh))?;
        let mut document = self.lens;
        document["unit"] = json!(1.0);
        document["aabb"] = json!([aabb.min.coords.as_slice(), aabb.max.coords.as_slice()]);
        document["frames"] = Value::Array(self.frames);
        write_json(&inner.join("transforms.json"), &document)?;
        for (name, document) in more {
            write_json(&inner.join(name), document)?;
        }
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
fn opengl_world_from_camera(camera: &Camera) -> Matrix4<f64> {
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

fn image_path(name: &str) -> String {
    format!("images/{name}.png")
}

fn mask_path(name: &str) -> String {
    format!("masks/{name}.png")
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

fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> SynthError {
    let path = path.to_owned();
    move |source| SynthError::Io { path, source }
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
