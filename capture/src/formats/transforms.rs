//! `transforms.json` of nerfstudio, instant-ngp and the original NeRF; ours is nerfstudio's with a few
//! optional keys (`aabb`, `unit`, `skew`, `light_direction`, `exposure`).
//!
//! `transform_matrix` maps camera to world with OpenGL axes (x right, y up, z back). The principal point
//! counts from the corner of the first pixel, as `cx = w / 2` of a centred camera says.

use super::{capture, checked_camera, find_image, image_and_size, read_text};
use crate::{Aabb, Camera, Capture, CaptureError, Distortion, Frame, Intrinsics};
use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file as a whole; keys of a lens may stand here, or in each frame, or in both.
#[derive(Debug, Default, Deserialize, Serialize)]
pub(crate) struct TransformsFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) aabb: Option<[[f64; 3]; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<f64>,
    #[serde(flatten)]
    pub(crate) lens: LensKeys,
    pub(crate) frames: Vec<FrameKeys>,
}

#[derive(Debug, Default, Deserialize, Serialize)]
pub(crate) struct FrameKeys {
    pub(crate) file_path: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) mask_path: Option<String>,
    #[serde(flatten)]
    pub(crate) lens: LensKeys,
    pub(crate) transform_matrix: Vec<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) light_direction: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) exposure: Option<f64>,
}

macro_rules! lens_keys {
    ($($key:ident),*) => {
        /// What describes a lens; a frame's own keys go before the shared ones.
        #[derive(Clone, Debug, Default, Deserialize, Serialize)]
        pub(crate) struct LensKeys {
            #[serde(skip_serializing_if = "Option::is_none")]
            pub(crate) camera_model: Option<String>,
            #[serde(skip_serializing_if = "Option::is_none")]
            pub(crate) is_fisheye: Option<bool>,
            $(#[serde(skip_serializing_if = "Option::is_none")] pub(crate) $key: Option<f64>,)*
        }

        impl LensKeys {
            fn or(&self, shared: &Self) -> Self {
                Self {
                    camera_model: self.camera_model.clone().or_else(|| shared.camera_model.clone()),
                    is_fisheye: self.is_fisheye.or(shared.is_fisheye),
                    $($key: self.$key.or(shared.$key),)*
                }
            }
        }
    };
}

lens_keys!(w, h, fl_x, fl_y, cx, cy, skew, k1, k2, k3, k4, p1, p2, camera_angle_x, camera_angle_y, x_fov, y_fov);

pub(super) fn read(file: &Path) -> Result<Capture, CaptureError> {
    let text = read_text(file)?;
    let parsed: TransformsFile = serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|error| {
        let nan = if text.contains("NaN") { " (NaN is no JSON number)" } else { "" };
        CaptureError::invalid(file, format!("is no transforms file: {error}{nan}"), "write it again")
    })?;
    let frames = parsed.frames.iter().enumerate().map(|(i, keys)| read_frame(file, i, keys, &parsed.lens));
    let frames = frames.collect::<Result<Vec<_>, _>>()?;
    let unit = parsed.unit;
    if unit.is_some_and(|u| !u.is_finite() || u <= 0.0) {
        return Err(CaptureError::invalid(file, "\"unit\" is not positive", "give the metres per world unit"));
    }
    Ok(Capture { aabb: read_box(file, parsed.aabb)?, unit, ..capture(frames) })
}

fn read_frame(file: &Path, index: usize, keys: &FrameKeys, shared: &LensKeys) -> Result<Frame, CaptureError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let place = format!("frame {index} ({})", super::shortened(&keys.file_path));
    let lens = keys.lens.or(shared);
    let (image_path, width, height) = match (lens.w, lens.h) {
        (Some(w), Some(h)) => {
            let written = folder.join(keys.file_path.replace('\\', "/"));
            (find_image(folder, &keys.file_path).unwrap_or(written), w as usize, h as usize)
        }
        _ => image_and_size(file, folder, &keys.file_path)?,
    };
    let intrinsics = intrinsics(file, &place, &lens, width, height)?;
    let camera = read_pose(file, &place, intrinsics, &keys.transform_matrix)?;
    let mask_path = keys.mask_path.as_ref().map(|m| folder.join(m.replace('\\', "/")));
    let light_direction = keys.light_direction.map(|l| light(file, &place, Vector3::from(l))).transpose()?;
    if keys.exposure.is_some_and(|e| !e.is_finite() || e <= 0.0) {
        return Err(CaptureError::invalid(file, format!("{place}: \"exposure\" is not positive"), "correct it"));
    }
    Ok(Frame { image_path, mask_path, camera, light_direction, exposure: keys.exposure })
}

fn intrinsics(
    file: &Path,
    place: &str,
    lens: &LensKeys,
    width: usize,
    height: usize,
) -> Result<Intrinsics, CaptureError> {
    if let Some(fault) = unsupported(lens) {
        let remedy = "undistort the images first, or calibrate with the OPENCV model";
        return Err(CaptureError::invalid(file, format!("{place}: {fault}"), remedy));
    }
    let from_angle = |size: usize, angle: f64| 0.5 * size as f64 / (0.5 * angle).tan();
    let angle_x = lens.camera_angle_x.or(lens.x_fov.map(f64::to_radians));
    let angle_y = lens.camera_angle_y.or(lens.y_fov.map(f64::to_radians));
    let fx = lens.fl_x.or(angle_x.map(|a| from_angle(width, a)));
    let fy = lens.fl_y.or(angle_y.map(|a| from_angle(height, a)));
    let (Some(fx), Some(fy)) = (fx.or(fy), fy.or(fx)) else {
        let fault = format!("{place}: neither fl_x nor camera_angle_x is given");
        return Err(CaptureError::invalid(file, fault, "add the focal length in pixels as \"fl_x\""));
    };
    let or_zero = |v: Option<f64>| v.unwrap_or(0.0);
    Ok(Intrinsics {
        fx,
        fy,
        skew: or_zero(lens.skew),
        cx: lens.cx.unwrap_or(0.5 * width as f64),
        cy: lens.cy.unwrap_or(0.5 * height as f64),
        distortion: Distortion {
            k1: or_zero(lens.k1),
            k2: or_zero(lens.k2),
            k3: or_zero(lens.k3),
            p1: or_zero(lens.p1),
            p2: or_zero(lens.p2),
        },
        width,
        height,
    })
}

fn unsupported(lens: &LensKeys) -> Option<String> {
    let known = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV", "PERSPECTIVE"];
    if let Some(model) = lens.camera_model.as_deref().filter(|m| !known.contains(m)) {
        return Some(format!("the camera model '{}' is not supported", super::shortened(model)));
    }
    if lens.is_fisheye == Some(true) {
        return Some("fisheye lenses are not supported".into());
    }
    lens.k4.filter(|&k| k != 0.0).map(|k| format!("the coefficient k4 = {k} is not supported"))
}

fn read_pose(file: &Path, place: &str, intrinsics: Intrinsics, rows: &[Vec<f64>]) -> Result<Camera, CaptureError> {
    let is_affine = rows.get(3).is_none_or(|r| r.as_slice() == [0.0, 0.0, 0.0, 1.0]);
    if !(3..=4).contains(&rows.len()) || rows.iter().any(|r| r.len() != 4) || !is_affine {
        let fault = format!("{place}: transform_matrix is not 4×4 with last row 0 0 0 1");
        return Err(CaptureError::invalid(file, fault, "write the camera-to-world matrix row by row"));
    }
    // Camera axes are the columns; y up → down, z back → forward.
    let world_from_camera = Matrix3::from_fn(|i, j| if j == 0 { rows[i][j] } else { -rows[i][j] });
    let center = Vector3::new(rows[0][3], rows[1][3], rows[2][3]);
    let rotation = world_from_camera.transpose();
    let camera = checked_camera(file, place, intrinsics, rotation, center)?;
    Ok(Camera { translation: -(camera.rotation * center), ..camera })
}

fn light(file: &Path, place: &str, direction: Vector3<f64>) -> Result<Vector3<f64>, CaptureError> {
    direction.try_normalize(1e-12).filter(|d| d.iter().all(|v| v.is_finite())).ok_or_else(|| {
        CaptureError::invalid(file, format!("{place}: \"light_direction\" has no length"), "give a direction")
    })
}

fn read_box(file: &Path, corners: Option<[[f64; 3]; 2]>) -> Result<Option<Aabb>, CaptureError> {
    let Some([a, b]) = corners else { return Ok(None) };
    let (min, max) = (Point3::from(a), Point3::from(b));
    if (0..3).all(|i| min[i].is_finite() && max[i].is_finite() && min[i] < max[i]) {
        return Ok(Some(Aabb { min, max }));
    }
    Err(CaptureError::invalid(file, "\"aabb\" is empty", "give the smaller corner first, then the larger"))
}

/// The file that [`read`] reads back; paths are relative to its folder.
pub(crate) fn to_file(capture: &Capture, images: &[PathBuf], masks: &[Option<PathBuf>]) -> TransformsFile {
    let first = capture.frames.first().map(|f| lens_of(&f.camera.intrinsics)).unwrap_or_default();
    let is_shared = capture.frames.windows(2).all(|f| f[0].camera.intrinsics == f[1].camera.intrinsics);
    let frames = capture.frames.iter().zip(images).zip(masks);
    let frames = frames.map(|((frame, image), mask)| FrameKeys {
        file_path: slashed(image),
        mask_path: mask.as_deref().map(slashed),
        lens: if is_shared { LensKeys::default() } else { lens_of(&frame.camera.intrinsics) },
        transform_matrix: matrix_rows(&frame.camera),
        light_direction: frame.light_direction.map(Into::into),
        exposure: frame.exposure,
    });
    TransformsFile {
        aabb: capture.aabb.map(|b| [b.min.into(), b.max.into()]),
        unit: capture.unit,
        lens: if is_shared { first } else { LensKeys::default() },
        frames: frames.collect(),
    }
}

fn lens_of(i: &Intrinsics) -> LensKeys {
    LensKeys {
        camera_model: Some("OPENCV".into()),
        w: Some(i.width as f64),
        h: Some(i.height as f64),
        fl_x: Some(i.fx),
        fl_y: Some(i.fy),
        cx: Some(i.cx),
        cy: Some(i.cy),
        skew: (i.skew != 0.0).then_some(i.skew),
        k1: Some(i.distortion.k1),
        k2: Some(i.distortion.k2),
        p1: Some(i.distortion.p1),
        p2: Some(i.distortion.p2),
        k3: (i.distortion.k3 != 0.0).then_some(i.distortion.k3),
        ..LensKeys::default()
    }
}

fn matrix_rows(camera: &Camera) -> Vec<Vec<f64>> {
    let (r, center) = (camera.rotation, camera.center());
    // `0.0 - x` rather than `-x`: no minus before a zero in the file.
    let row = |i: usize| vec![r[(0, i)], 0.0 - r[(1, i)], 0.0 - r[(2, i)], center[i]];
    vec![row(0), row(1), row(2), vec![0.0, 0.0, 0.0, 1.0]]
}

fn slashed(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}
