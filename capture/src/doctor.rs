//! Checks a capture, and names the likely cause where something is off.

use crate::outlines::outline_offset;
use crate::votes::{Votes, nearest_to_rays, rough_box};
use crate::{Aabb, Camera, Capture, Image, MaskSource, View};
use nalgebra::{Matrix3, Point2, Point3, Vector3};
use rayon::prelude::*;
use serde::Serialize;

/// What a check found. Serialises flat, with units in the names.
#[derive(Clone, Debug, Serialize)]
pub struct CaptureCheck {
    /// Frames in the capture.
    pub frames: usize,
    /// Frames whose pixels were looked at.
    pub frames_checked: usize,
    /// Size of the first image, pixels.
    pub width: usize,
    /// Size of the first image, pixels.
    pub height: usize,
    /// Where the silhouettes come from.
    pub mask_source: MaskSource,
    /// Two corners of the object's box: the capture's, or where the silhouettes put it. `None` where
    /// neither is known.
    pub aabb: Option<[[f64; 3]; 2]>,
    /// Whether the capture gives that box.
    pub aabb_is_given: bool,
    /// Checked frames with the centre of the box in front of the camera.
    pub center_in_front: usize,
    /// Checked frames with the centre of the box in front and inside the frame.
    pub center_in_frame: usize,
    /// Mean over the checked frames of the IoU of silhouette and reprojected coarse hull. The hull is of
    /// 128 cells: 0.95 is good, a bad camera lies well below the others. 0 without a hull.
    pub silhouette_iou: f64,
    /// Share of rays just inside a silhouette that meet the silhouettes of (nearly) all other frames.
    pub silhouette_consistency: f64,
    /// The same with all principal points moved by half a pixel up and left, and down and right.
    pub consistency_half_pixel: [f64; 2],
    /// Whole pixels by which the silhouettes' outlines lie outside of the edges in the pictures, on the whole; negative:
    /// inside. `None` where no edge follows them within 11 pixels.
    pub outline_offset_px: Option<i32>,
    /// How the cameras stand about the object.
    pub layout: Layout,
    /// Each checked frame.
    pub views: Vec<ViewCheck>,
    /// Likely causes of what is off, each a sentence; empty when all is well.
    pub findings: Vec<String>,
}

/// What a check found for one frame.
#[derive(Clone, Debug, Serialize)]
pub struct ViewCheck {
    /// Position in the capture.
    pub index: usize,
    /// File stem of the image.
    pub name: String,
    /// Whether the centre of the object's box is in front of the camera.
    pub center_in_front: bool,
    /// Whether it is seen inside the frame.
    pub center_in_frame: bool,
    /// Whether nothing of the object leaves the frame.
    pub is_complete: bool,
    /// IoU of silhouette and reprojected coarse hull; 0 without a hull.
    pub silhouette_iou: f64,
}

/// How the cameras stand about the object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Layout {
    /// Ring, dome or otherwise.
    pub kind: LayoutKind,
    /// Largest angle between the directions to two cameras, degrees.
    pub spread_deg: f64,
    /// Median angle from a camera to its nearest neighbour, degrees.
    pub step_deg: f64,
}

/// The kind of a [`Layout`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LayoutKind {
    /// On one circle of directions, as a turntable before one camera gives.
    Ring,
    /// Spread over a part of the sphere.
    Dome,
    /// All directions within 30 degrees.
    OneSided,
    /// Fewer than three cameras.
    Few,
}

/// Checks `capture` by means of some or all of its views.
pub fn check(capture: &Capture, views: &[View]) -> CaptureCheck {
    let pairs: Vec<(&Camera, &Image<u8>)> = views.iter().map(|v| (&v.camera, &v.matte)).collect();
    let object_box = capture.aabb.or_else(|| rough_box(&pairs));
    let center = object_box.map(|b| b.center());
    let ious = hull_ious(object_box.as_ref(), &pairs);
    let views_checked: Vec<ViewCheck> =
        views.iter().zip(&ious).map(|(view, &iou)| check_view(view, center.as_ref(), iou)).collect();
    let count = |f: fn(&ViewCheck) -> bool| views_checked.iter().filter(|v| f(v)).count();
    let consistency = |shift: f64| object_box.map_or(0.0, |b| ray_consistency(&b, &pairs, shift));
    let first = capture.frames.first().map(|f| f.camera.intrinsics);
    let mut found = CaptureCheck {
        frames: capture.frames.len(),
        frames_checked: views.len(),
        width: first.map_or(0, |i| i.width),
        height: first.map_or(0, |i| i.height),
        mask_source: capture.mask_source,
        aabb: object_box.map(|b| [b.min.into(), b.max.into()]),
        aabb_is_given: capture.aabb.is_some(),
        center_in_front: count(|v| v.center_in_front),
        center_in_frame: count(|v| v.center_in_frame),
        silhouette_iou: ious.iter().sum::<f64>() / ious.len().max(1) as f64,
        silhouette_consistency: consistency(0.0),
        consistency_half_pixel: [consistency(-0.5), consistency(0.5)],
        outline_offset_px: outline_offset(views),
        layout: layout(views, center),
        views: views_checked,
        findings: Vec::new(),
    };
    found.findings = findings(&found, views, &pairs);
    found
}

fn check_view(view: &View, center: Option<&Point3<f64>>, silhouette_iou: f64) -> ViewCheck {
    let projected = center.and_then(|c| view.camera.project(c));
    ViewCheck {
        index: view.index,
        name: view.name.clone(),
        center_in_front: center.is_some_and(|c| view.camera.to_camera(c).z > 0.0),
        center_in_frame: projected.is_some_and(|p| view.camera.in_frame(p.pixel)),
        is_complete: view.is_complete,
        silhouette_iou,
    }
}

/// IoU of each silhouette with the coarse hull of all, reprojected.
fn hull_ious(object_box: Option<&Aabb>, views: &[(&Camera, &Image<u8>)]) -> Vec<f64> {
    let Some(object_box) = object_box else { return vec![0.0; views.len()] };
    let margin = object_box.size() * 0.05;
    let search = Aabb { min: object_box.min - margin, max: object_box.max + margin };
    let votes = Votes::count(&search, 128, views);
    // A single bad view must not carve all away.
    let cells = votes.object(0.9);
    let iou = |(camera, matte): &(&Camera, &Image<u8>)| {
        let (shape, cell) = votes.project(&cells, camera);
        // The projection covers whole cells: half of one too much.
        let shape = crate::erode(&shape, 0.6 * cell);
        let both = shape.pixels().iter().zip(matte.pixels()).map(|(&a, &b)| (a >= 128, b >= 128));
        let (and, or) = both.fold((0, 0), |(and, or), (a, b)| (and + usize::from(a && b), or + usize::from(a || b)));
        and as f64 / or.max(1) as f64
    };
    views.par_iter().map(iou).collect()
}

/// Outlines this many pixels from the edges in the pictures are worth a word.
const LARGEST_OFFSET: i32 = 3;

/// Rays of a view that are followed in the consistency test.
const RAYS: usize = 40;

/// Share of rays through the outermost pixels of silhouettes on which some point is inside all but one in
/// twenty of the silhouettes that have it in their frame. `shift` moves every principal point right and
/// down. Sub-pixel: mattes are interpolated.
fn ray_consistency(object_box: &Aabb, views: &[(&Camera, &Image<u8>)], shift: f64) -> f64 {
    let moved: Vec<(Camera, &Image<u8>)> = views
        .iter()
        .map(|(camera, matte)| {
            let mut camera = **camera;
            camera.intrinsics.cx += shift;
            camera.intrinsics.cy += shift;
            (camera, *matte)
        })
        .collect();
    let counts = moved.par_iter().map(|(camera, matte)| {
        let pixels = edge_pixels(matte);
        let step = pixels.len().div_ceil(RAYS).max(1);
        let rays = pixels.iter().step_by(step).filter_map(|p| camera.ray(*p));
        rays.fold((0, 0), |(met, all), ray| (met + usize::from(meets(&ray, object_box, &moved)), all + 1))
    });
    let (met, all) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    met as f64 / all.max(1) as f64
}

/// Centres of object pixels with background on one side and object on the other.
fn edge_pixels(matte: &Image<u8>) -> Vec<Point2<f64>> {
    let (width, height) = (matte.width(), matte.height());
    let mut found = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width.saturating_sub(1) {
            let is_object = |x: usize, y: usize| matte.at(x, y) >= 128;
            let is_edge = is_object(x - 1, y) != is_object(x + 1, y) || is_object(x, y - 1) != is_object(x, y + 1);
            if is_object(x, y) && is_edge {
                found.push(Point2::new(x as f64 + 0.5, y as f64 + 0.5));
            }
        }
    }
    found
}

fn meets(ray: &crate::Ray, object_box: &Aabb, views: &[(Camera, &Image<u8>)]) -> bool {
    let middle = (object_box.center() - ray.origin).dot(&ray.direction);
    let half = 0.6 * object_box.diagonal();
    // About half a pixel where the object fills the frame.
    let steps = 400;
    (0..=steps).any(|i| {
        let depth = middle + half * (2.0 * f64::from(i) / f64::from(steps) - 1.0);
        let point = ray.origin + ray.direction * depth;
        let allowed = views.len() / 20;
        let mut outside = 0;
        views.iter().all(|(camera, matte)| {
            let is_out =
                camera.project(&point).is_some_and(|p| interpolated(matte, p.pixel).is_some_and(|v| v < 127.0));
            outside += usize::from(is_out);
            outside <= allowed
        })
    })
}

/// The matte between pixel centres, bilinear; `None` outside the frame.
fn interpolated(matte: &Image<u8>, pixel: Point2<f64>) -> Option<f64> {
    let inside = |v: f64, size: usize| v >= 0.0 && v < size as f64;
    if !(inside(pixel.x, matte.width()) && inside(pixel.y, matte.height())) {
        return None;
    }
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let at = |dx: isize, dy: isize| f64::from(matte.at_clamped(x.floor() as isize + dx, y.floor() as isize + dy));
    let top = at(0, 0) * (1.0 - fx) + at(1, 0) * fx;
    let bottom = at(0, 1) * (1.0 - fx) + at(1, 1) * fx;
    Some(top * (1.0 - fy) + bottom * fy)
}

fn layout(views: &[View], center: Option<Point3<f64>>) -> Layout {
    let axes: Vec<_> =
        views.iter().map(|v| crate::Ray { origin: v.camera.center(), direction: v.camera.forward() }).collect();
    let center = center.or_else(|| nearest_to_rays(&axes)).unwrap_or_else(Point3::origin);
    let to_camera = |v: &View| (v.camera.center() - center).try_normalize(1e-300);
    let directions: Vec<Vector3<f64>> = views.iter().filter_map(to_camera).collect();
    if directions.len() < 3 {
        return Layout { kind: LayoutKind::Few, spread_deg: 0.0, step_deg: 0.0 };
    }
    let angle = |a: &Vector3<f64>, b: &Vector3<f64>| a.cross(b).norm().atan2(a.dot(b)).to_degrees();
    let mut spread_deg = 0.0_f64;
    let mut steps: Vec<f64> = Vec::new();
    for (i, a) in directions.iter().enumerate() {
        let others = directions.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, b)| angle(a, b));
        let (nearest, farthest) = others.fold((180.0_f64, 0.0_f64), |(n, f), d| (n.min(d), f.max(d)));
        steps.push(nearest);
        spread_deg = spread_deg.max(farthest);
    }
    steps.sort_by(f64::total_cmp);
    Layout { kind: layout_kind(&directions, spread_deg), spread_deg, step_deg: steps[steps.len() / 2] }
}

/// Directions on one circle lie in a plane: their scatter about the mean has a vanishing eigenvalue.
fn layout_kind(directions: &[Vector3<f64>], spread_deg: f64) -> LayoutKind {
    if spread_deg < 30.0 {
        return LayoutKind::OneSided;
    }
    let mean = directions.iter().sum::<Vector3<f64>>() / directions.len() as f64;
    let scatter: Matrix3<f64> = directions.iter().map(|d| (d - mean) * (d - mean).transpose()).sum();
    let off_plane = (scatter.symmetric_eigenvalues().min().max(0.0) / directions.len() as f64).sqrt();
    // Three degrees: a turntable that wobbles is still a ring.
    if off_plane < 0.05 { LayoutKind::Ring } else { LayoutKind::Dome }
}

fn findings(found: &CaptureCheck, views: &[View], pairs: &[(&Camera, &Image<u8>)]) -> Vec<String> {
    let mut findings = Vec::new();
    if views.is_empty() {
        return vec!["no frame was checked".into()];
    }
    let listed = |keep: &dyn Fn(&ViewCheck) -> bool| {
        let indices: Vec<String> = found.views.iter().filter(|v| keep(v)).map(|v| v.index.to_string()).collect();
        indices.join(", ")
    };
    let is_inverted = looks_inverted(views);
    if is_inverted {
        findings.push("the masks look inverted: most of the frame borders is object; exchange black and white".into());
    }
    if found.aabb.is_none() {
        findings.push("the cameras do not look at a common point: the poses are wrong, or all from one side".into());
    }
    if !is_inverted && axes_are_flipped(found, pairs) {
        findings.push(
            "camera axes are flipped: the poses are OpenGL's (y up, z back) read as OpenCV's, or the reverse".into(),
        );
    } else if found.aabb.is_some() && found.center_in_frame < found.frames_checked {
        let out = listed(&|v| !v.center_in_frame);
        findings.push(format!(
            "the centre of the object's box is out of the frame in frames [{out}]: wrong box, or wrong poses"
        ));
    }
    if let Some(finding) = half_pixel_finding(found) {
        findings.push(finding);
    }
    if let Some(off) = found.outline_offset_px.filter(|off| !is_inverted && off.abs() >= LARGEST_OFFSET) {
        let (size, remedy) = if off > 0 { ("large", "erode") } else { ("small", "grow") };
        let off = off.abs();
        findings.push(format!("the masks are some {off} pixels too {size} all around: {remedy} them by so many"));
    }
    let cut = listed(&|v| !v.is_complete);
    if !cut.is_empty() && !is_inverted {
        findings.push(format!("the object leaves the frame in frames [{cut}]: its outside is unknown there"));
    }
    let mut ious: Vec<f64> = found.views.iter().map(|v| v.silhouette_iou).collect();
    ious.sort_by(f64::total_cmp);
    let median = ious[ious.len() / 2];
    let bad = listed(&|v| v.silhouette_iou < median - 0.2);
    if median >= 0.7 && !bad.is_empty() {
        findings.push(format!("frames [{bad}] disagree with the others: a wrong pose or a bad mask; leave them out"));
    } else if median < 0.7 && found.aabb.is_some() && findings.is_empty() {
        findings.push("the silhouettes agree on no common shape: poses and images may be in a different order".into());
    }
    findings
}

fn looks_inverted(views: &[View]) -> bool {
    let is_full = |view: &&View| {
        let m = &view.matte;
        let (w, h) = (m.width(), m.height());
        let ends = (0..w).flat_map(|x| [m.at(x, 0), m.at(x, h - 1)]);
        let sides = (0..h).flat_map(|y| [m.at(0, y), m.at(w - 1, y)]);
        ends.chain(sides).filter(|&v| v >= 128).count() > w + h
    };
    2 * views.iter().filter(is_full).count() > views.len()
}

/// Whether turning all cameras round (x stays, y and z change sign) puts the object before them and makes
/// the silhouettes agree, where now they do not.
fn axes_are_flipped(found: &CaptureCheck, pairs: &[(&Camera, &Image<u8>)]) -> bool {
    if found.silhouette_iou > 0.7 && 2 * found.center_in_front > found.frames_checked {
        return false;
    }
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let turned: Vec<Camera> = pairs
        .iter()
        .map(|(c, _)| Camera { rotation: flip * c.rotation, translation: flip * c.translation, ..**c })
        .collect();
    let views: Vec<_> = turned.iter().zip(pairs).map(|(camera, (_, matte))| (camera, *matte)).collect();
    let ious = hull_ious(rough_box(&views).as_ref(), &views);
    ious.iter().sum::<f64>() / ious.len().max(1) as f64 > found.silhouette_iou.max(0.5)
}

fn half_pixel_finding(found: &CaptureCheck) -> Option<String> {
    let [left, right] = found.consistency_half_pixel;
    // Only near-perfect calibrations can tell: on exact captures a wrong origin costs three hundredths of the
    // share (analytic_torus, nerf_lego), while errors of real ones cost ten times that whatever the origin.
    let best = left.max(right);
    let is_telling = best > 0.93 && best > found.silhouette_consistency + 0.02;
    let side = if left > right { "less" } else { "more" };
    is_telling.then(|| {
        format!("the pixel origin may be off: silhouettes agree better with principal points half a pixel {side}")
    })
}
