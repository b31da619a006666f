//! The photographs of a capture beside a model: the nearest one, in the picture of any eye.

use crate::Error;
use capture::{Camera, Capture, Frame, Image, read_rgb};
use nalgebra::{Point2, Point3};
use rayon::prelude::*;

/// Pictures that are kept, in bytes.
const MOST_BYTES: usize = 256 << 20;

/// Photographs, read as they are asked for.
#[derive(Debug)]
pub struct Photographs {
    frames: Vec<Frame>,
    /// The last ones read, the last first.
    kept: Vec<(usize, Image<[u8; 3]>)>,
    /// The last one asked for, where it cannot be read, and why: it is not tried again at every frame.
    failed: Option<(usize, String)>,
}

impl Photographs {
    /// Those of a capture; none is read yet.
    pub fn new(capture: Capture) -> Self {
        Self { frames: capture.frames, kept: Vec::new(), failed: None }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The camera of one of them.
    pub fn camera(&self, index: usize) -> Option<&Camera> {
        self.frames.get(index).map(|frame| &frame.camera)
    }

    /// Its file's name.
    pub fn name(&self, index: usize) -> String {
        let name = self.frames.get(index).and_then(|frame| frame.image_path.file_name());
        name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
    }

    /// The one taken in the direction nearest to that of `eye` from `centre`.
    pub fn nearest(&self, eye: &Point3<f64>, centre: &Point3<f64>) -> Option<usize> {
        let toward = (eye - centre).try_normalize(0.0)?;
        let off = |frame: &Frame| {
            let direction = (frame.camera.center() - centre).try_normalize(0.0)?;
            Some(-direction.dot(&toward)).filter(|cosine| cosine.is_finite())
        };
        let known = self.frames.iter().enumerate().filter_map(|(k, frame)| Some((k, off(frame)?)));
        known.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }

    /// Its pixels. One that cannot be read is tried again after another was asked for.
    ///
    /// # Errors
    /// Names the file that cannot be read, or is not of the size the capture says.
    pub fn picture(&mut self, index: usize) -> Result<&Image<[u8; 3]>, Error> {
        self.failed = self.failed.take().filter(|(failed, _)| *failed == index);
        if let Some((_, fault)) = &self.failed {
            return Err(Error::Failed(fault.clone()));
        }
        if let Some(at) = self.kept.iter().position(|(kept, _)| *kept == index) {
            self.kept[..=at].rotate_right(1);
        } else {
            let picture = self.read(index).inspect_err(|fault| self.failed = Some((index, fault.to_string())))?;
            self.kept.insert(0, (index, picture));
            let sizes = self.kept.iter().map(|(_, picture)| 3 * picture.pixels().len());
            let filled = sizes.scan(0, |sum, size| {
                *sum += size;
                Some(*sum)
            });
            let count = filled.take_while(|&bytes| bytes <= MOST_BYTES).count();
            self.kept.truncate(count.max(1));
        }
        Ok(&self.kept[0].1)
    }

    fn read(&self, index: usize) -> Result<Image<[u8; 3]>, Error> {
        let none = || Error::Arguments(format!("--capture: there is no photograph {index}; it has {}", self.len()));
        let frame = self.frames.get(index).ok_or_else(none)?;
        let picture = read_rgb(&frame.image_path)?;
        let (i, size) = (&frame.camera.intrinsics, [picture.width(), picture.height()]);
        if size != [i.width, i.height] {
            return Err(Error::Failed(format!(
                "{}: {} × {} pixels, where the capture says {} × {}; give the picture it was calibrated with",
                frame.image_path.display(),
                size[0],
                size[1],
                i.width,
                i.height,
            )));
        }
        Ok(picture)
    }
}

/// A picture that `from` took, as if it were painted on the plane through `centre` that faces `camera`: the picture itself
/// where the two are one, and about in place where they are near. `background` is behind it.
pub fn through_plane(
    picture: &Image<[u8; 3]>,
    from: &Camera,
    centre: &Point3<f64>,
    camera: &Camera,
    background: [u8; 3],
) -> Image<[u8; 4]> {
    let i = &camera.intrinsics;
    let (width, height) = (i.width, i.height);
    let (eye, to_world) = (camera.center(), camera.rotation.transpose());
    let depth = camera.to_camera(centre).z;
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    let mut seen = Image::filled(width, height, opaque(background));
    if depth.is_nan() || depth <= 0.0 || picture.pixels().is_empty() {
        return seen;
    }
    seen.pixels_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let plane = i.plane_from_pixel(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
            let point = eye + to_world * plane.push(1.0) * depth;
            let found = from.project(&point).and_then(|found| look_up(picture, found.pixel));
            *pixel = opaque(found.unwrap_or(background));
        }
    });
    seen
}

/// Bilinear between pixel centres; `None` outside the picture.
fn look_up(picture: &Image<[u8; 3]>, pixel: Point2<f64>) -> Option<[u8; 3]> {
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    if !(pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < width && pixel.y < height) {
        return None;
    }
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (s, t) = (x - left, y - top);
    let at = |dx: isize, dy: isize| picture.at_clamped(left as isize + dx, top as isize + dy).map(f64::from);
    let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
    Some(std::array::from_fn(|k| {
        let (above, below) = (a[k] + s * (b[k] - a[k]), c[k] + s * (d[k] - c[k]));
        (above + t * (below - above)).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::Aabb;
    use nalgebra::Vector3;
    use render::orbit::contained;
    use render::path::turntable_cameras;

    fn cameras() -> Vec<Camera> {
        let aabb = Aabb { min: [-1.0; 3].into(), max: [1.0; 3].into() };
        turntable_cameras(&aabb, None, 8, 40, 30, Vector3::z())
    }

    fn picture() -> Image<[u8; 3]> {
        let pixels = (0..1200).map(|k| [(k % 251) as u8, (k % 40 * 6) as u8, (k / 40 * 8) as u8]);
        Image::from_pixels(40, 30, pixels.collect()).unwrap()
    }

    #[test]
    fn from_its_own_camera_a_photograph_is_itself() {
        let (camera, picture) = (cameras()[0], picture());
        let seen = through_plane(&picture, &camera, &Point3::origin(), &camera, [0; 3]);
        assert_eq!(seen.map(|[r, g, b, _]| [r, g, b]), picture);
        let double = contained(&camera, [80, 60]);
        let seen = through_plane(&picture, &camera, &Point3::origin(), &double, [0; 3]);
        let mean =
            |x: usize, y: usize| (0..4).map(|k| u32::from(seen.at(2 * x + k % 2, 2 * y + k / 2)[2])).sum::<u32>() / 4;
        assert!((1..29).all(|y| mean(20, y).abs_diff(u32::from(picture.at(20, y)[2])) <= 1));
    }

    #[test]
    fn the_nearest_is_the_one_in_that_direction() {
        let frame = |camera: &Camera| Frame {
            image_path: "gone.png".into(),
            mask_path: None,
            camera: *camera,
            light_direction: None,
            exposure: None,
        };
        let frames = cameras().iter().map(frame).collect();
        let mut photographs = Photographs { frames, kept: Vec::new(), failed: None };
        for (k, camera) in cameras().iter().enumerate() {
            let eye = Point3::from(camera.center().coords * 3.0 + Vector3::new(0.1, 0.1, 0.3));
            assert_eq!(photographs.nearest(&eye, &Point3::origin()), Some(k));
        }
        assert_eq!(photographs.nearest(&Point3::origin(), &Point3::origin()), None);
        let message = photographs.picture(3).unwrap_err().to_string();
        assert!(message.contains("gone.png"), "{message}");
        assert!(photographs.picture(99).is_err());
    }
}
