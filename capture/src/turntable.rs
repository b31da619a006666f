//! A turntable without a board: one calibrated camera, an axis and the angles give the camera of every frame.
//!
//! The object turns and the camera stands; in the object's world the object stands and the camera goes around it. What
//! was at `X` in the first frame is at `c + R(a, θ) (X − c)` in another, for the axis through `c` along `a`, and the
//! camera `x = R₀ X + t₀` sees it there: `x = R₀ R(a, θ) X + R₀ (c − R(a, θ) c) + t₀`.

use crate::formats::images_in;
use crate::{Camera, Capture, CaptureError, Frame, masks, pixels};
use nalgebra::{Point3, Rotation3, Unit, Vector3};
use std::path::{Path, PathBuf};

/// The axis of a turntable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// A point on it, world units.
    pub point: Point3<f64>,
    /// Its direction; the object turns right-handed about it.
    pub direction: Unit<Vector3<f64>>,
}

/// How far the table had turned in each frame.
#[derive(Clone, Debug, PartialEq)]
pub enum TableAngles {
    /// By the same angle from frame to frame, radians.
    Step(f64),
    /// By these angles since the camera was calibrated, radians, one per frame in the order of their names.
    List(Vec<f64>),
    /// By the angle since the camera was calibrated, radians, beside the name of the image, with its extension or without.
    Named(Vec<(String, f64)>),
}

/// The camera that sees the object at rest as `camera` sees it turned by `angle` radians.
pub fn turned_camera(camera: &Camera, axis: &Axis, angle: f64) -> Camera {
    let turn = Rotation3::from_axis_angle(&axis.direction, angle);
    let shift = axis.point - turn * axis.point;
    Camera {
        rotation: camera.rotation * turn.matrix(),
        translation: camera.rotation * shift + camera.translation,
        ..*camera
    }
}

/// A capture of the images in `folder` (in the order of their names), with masks under any known spelling. Named angles
/// of images that are not there are read over. The camera and the axis are taken as they are given.
///
/// # Errors
/// Names the folder without images, the image whose size is not the camera's, the image without an angle or with two,
/// the folder whose angles are too few, too many or not finite, and the image without a mask where others have one.
pub fn turntable_capture(
    folder: &Path,
    camera: &Camera,
    axis: &Axis,
    angles: &TableAngles,
) -> Result<Capture, CaptureError> {
    let images = images_in(folder)?;
    if images.is_empty() {
        return Err(CaptureError::invalid(folder, "holds no images", "give the folder of the photographs"));
    }
    let angles = angle_of_each(folder, angles, &images)?;
    images.iter().try_for_each(|image| check_size(image, camera))?;
    let frame = |(image_path, angle): (PathBuf, f64)| Frame {
        image_path,
        mask_path: None,
        camera: turned_camera(camera, axis, angle),
        light_direction: None,
        exposure: None,
    };
    let mut frames: Vec<Frame> = images.into_iter().zip(angles).map(frame).collect();
    let mask_source = masks::find(&mut frames)?;
    Ok(Capture { frames, aabb: None, unit: None, mask_source })
}

/// Reads angles: a text of lines, the last word of each an angle in degrees, after the name of its image or after
/// nothing. `#` starts a comment.
///
/// # Errors
/// Names the line that holds no angle, and lines of which only some have names.
pub fn read_table_angles(file: &Path) -> Result<TableAngles, CaptureError> {
    let text = std::fs::read_to_string(file).map_err(|e| CaptureError::io(file, e))?;
    let mut lines = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let Some(word) = line.split_whitespace().next_back() else { continue };
        let name = line[..line.len() - word.len()].trim();
        let angle = word.trim_end_matches('°').parse::<f64>().ok().filter(|angle| angle.is_finite());
        let angle = angle.ok_or_else(|| {
            let fault = format!("line {}: '{}' is no angle", number + 1, word.chars().take(40).collect::<String>());
            CaptureError::invalid(
                file,
                fault,
                "write one angle in degrees a line, after the name of its image if you like",
            )
        })?;
        lines.push((name.to_owned(), angle.to_radians()));
    }
    let named = lines.iter().filter(|(name, _)| !name.is_empty()).count();
    if named != 0 && named != lines.len() {
        let fault = format!("{named} of {} lines name an image", lines.len());
        return Err(CaptureError::invalid(file, fault, "name an image in each line, or in none"));
    }
    if named > 0 {
        return Ok(TableAngles::Named(lines));
    }
    Ok(TableAngles::List(lines.into_iter().map(|(_, angle)| angle).collect()))
}

fn angle_of_each(folder: &Path, angles: &TableAngles, images: &[PathBuf]) -> Result<Vec<f64>, CaptureError> {
    let angles: Vec<f64> = match angles {
        TableAngles::Step(step) => (0..images.len()).map(|i| step * i as f64).collect(),
        TableAngles::List(list) => list.clone(),
        TableAngles::Named(named) => images.iter().map(|image| named_angle(image, named)).collect::<Result<_, _>>()?,
    };
    if angles.len() != images.len() {
        let fault = format!("holds {} images, {} angles are given", images.len(), angles.len());
        return Err(CaptureError::invalid(folder, fault, "give one angle for each image"));
    }
    if angles.iter().any(|angle| !angle.is_finite()) {
        return Err(CaptureError::invalid(folder, "is given an angle that is not finite", "correct it"));
    }
    Ok(angles)
}

/// The angle beside the image's name: as it is, else without extension, else with another one.
fn named_angle(image: &Path, named: &[(String, f64)]) -> Result<f64, CaptureError> {
    let is_whole = |name: &Path| name.file_name() == image.file_name();
    let is_stem = |name: &Path| name.file_name() == image.file_stem();
    let has_stem = |name: &Path| name.file_stem() == image.file_stem();
    let spellings: [&dyn Fn(&Path) -> bool; 3] = [&is_whole, &is_stem, &has_stem];
    let under = |is_it: &dyn Fn(&Path) -> bool| -> Vec<f64> {
        named.iter().filter(|(name, _)| is_it(Path::new(name))).map(|(_, angle)| *angle).collect()
    };
    let found = spellings.into_iter().map(under).find(|angles| !angles.is_empty()).unwrap_or_default();
    let fault = match found[..] {
        [angle] => return Ok(angle),
        [] => "is given no angle",
        _ => "is given more than one angle",
    };
    Err(CaptureError::invalid(image, fault, "write its name and its angle in one line of the angles"))
}

fn check_size(image: &Path, camera: &Camera) -> Result<(), CaptureError> {
    let (width, height) = pixels::size_of(image)?;
    let (w, h) = (camera.intrinsics.width, camera.intrinsics.height);
    if (width, height) == (w, h) {
        return Ok(());
    }
    let fault = format!("is {width}x{height}, the calibrated camera is for {w}x{h}");
    Err(CaptureError::invalid(image, fault, "use the camera these images were taken with"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, Intrinsics, MaskSource, write_matte, write_rgb};

    fn camera() -> Camera {
        let intrinsics = Intrinsics::pinhole(90.0, [32, 24]);
        let rotation = Rotation3::from_euler_angles(1.9, 0.1, 0.2).into_inner();
        Camera { intrinsics, rotation, translation: Vector3::new(0.1, 0.2, 3.0) }
    }

    fn axis() -> Axis {
        let direction = Unit::new_normalize(Vector3::new(0.1, -0.2, 1.0));
        Axis { point: Point3::new(0.3, -0.1, 0.4), direction }
    }

    #[test]
    fn a_turned_camera_sees_what_the_first_sees_of_the_turned_object() {
        let (camera, axis, angle) = (camera(), axis(), 0.7);
        let turned = turned_camera(&camera, &axis, angle);
        for x in [Point3::new(0.2, 0.1, 0.3), Point3::new(-0.1, 0.3, -0.2)] {
            let moved = axis.point + Rotation3::from_axis_angle(&axis.direction, angle) * (x - axis.point);
            let (a, b) = (turned.project(&x).unwrap(), camera.project(&moved).unwrap());
            assert!((a.pixel - b.pixel).norm() < 1e-10 && (a.depth - b.depth).abs() < 1e-12);
        }
        let on_axis = axis.point + 0.5 * axis.direction.into_inner();
        assert!((turned.project(&on_axis).unwrap().pixel - camera.project(&on_axis).unwrap().pixel).norm() < 1e-10);
        assert!((turned_camera(&turned, &axis, -angle).translation - camera.translation).norm() < 1e-12);
    }

    fn folder(images: usize, with_masks: bool) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for i in 0..images {
            write_rgb(&folder.path().join(format!("shot_{i}.png")), &Image::filled(32, 24, [9; 3])).unwrap();
            if with_masks {
                let mask = folder.path().join(format!("shot_{i}.mask.png"));
                write_matte(&mask, &Image::filled(32, 24, 255)).unwrap();
            }
        }
        folder
    }

    #[test]
    fn a_folder_and_a_step_make_a_capture() {
        let folder = folder(12, true);
        let step = TableAngles::Step(30.0_f64.to_radians());
        let capture = turntable_capture(folder.path(), &camera(), &axis(), &step).unwrap();
        assert_eq!((capture.frames.len(), capture.mask_source), (12, MaskSource::Beside));
        assert!(capture.frames[10].image_path.ends_with("shot_10.png"));
        assert_eq!(capture.frames[0].camera, turned_camera(&camera(), &axis(), 0.0));
        // Twelve steps of 30° come back to where they began.
        let back = turned_camera(&capture.frames[11].camera, &axis(), 30.0_f64.to_radians());
        assert!((back.translation - camera().translation).norm() < 1e-12);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let (three, none) = (folder(3, false), folder(0, false));
        let fault = |folder: &Path, camera: &Camera, angles: Vec<f64>| {
            let capture = turntable_capture(folder, camera, &axis(), &TableAngles::List(angles));
            capture.map(|_| ()).unwrap_err().to_string()
        };
        assert!(fault(three.path(), &camera(), vec![0.0; 2]).contains("holds 3 images, 2 angles are given"));
        assert!(fault(three.path(), &camera(), vec![f64::NAN; 3]).contains("not finite"));
        assert!(fault(three.path(), &camera().downscaled(2), vec![0.0; 3]).contains("shot_0.png: is 32x24"));
        assert!(fault(none.path(), &camera(), vec![]).contains("holds no images"));
    }

    #[test]
    fn named_angles_go_to_the_images_of_their_names() {
        let folder = folder(3, false);
        let capture = |names: &[(&str, f64)]| {
            let named = names.iter().map(|(name, angle)| ((*name).to_owned(), *angle)).collect();
            turntable_capture(folder.path(), &camera(), &axis(), &TableAngles::Named(named)).map_err(|e| e.to_string())
        };
        let names = [("shot_2.png", 0.2), ("elsewhere", 9.0), ("shot_0", 0.0), ("raw/shot_1.tif", 0.1)];
        let frames = capture(&names).unwrap().frames;
        let angles = [0.0, 0.1, 0.2].map(|angle| turned_camera(&camera(), &axis(), angle));
        assert_eq!(frames.iter().map(|f| f.camera).collect::<Vec<_>>(), angles);
        let fault = capture(&names[..3]).unwrap_err();
        assert!(fault.contains("shot_1.png: is given no angle"), "{fault}");
        let fault = capture(&[names, names].concat()).unwrap_err();
        assert!(fault.contains("shot_0.png: is given more than one angle"), "{fault}");
    }

    #[test]
    fn angles_are_read_with_and_without_names() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("angles.txt");
        let read = |text: &str| {
            std::fs::write(&file, text).unwrap();
            read_table_angles(&file).map_err(|e| e.to_string())
        };
        let list = |deg: &[f64]| Ok(TableAngles::List(deg.iter().map(|d| d.to_radians()).collect()));
        assert_eq!(read("# turn\n0\n-10.5\n\n20°\n"), list(&[0.0, -10.5, 20.0]));
        let named = [("b 10.png".to_owned(), 3_f64.to_radians()), ("b9".to_owned(), 2_f64.to_radians())];
        assert_eq!(read("b 10.png 3\nb9\t2\n"), Ok(TableAngles::Named(named.to_vec())));
        assert!(read("0\nx\n").unwrap_err().contains("line 2: 'x' is no angle"));
        assert!(read("0\na.png 1\n").unwrap_err().contains("1 of 2 lines name an image"));
        assert!(read("nan\n").is_err());
        assert_eq!(read(""), list(&[]));
    }
}
