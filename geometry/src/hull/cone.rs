//! The cone of one silhouette, and where an axis-parallel ray is inside it.
//!
//! A contour segment and the camera centre span a facet of the cone. Seen along the ray direction the
//! cone is a fan of half-lines from the camera centre, a ray is a point, and the ray meets a facet where
//! the point lies in the facet's wedge: one sign test per contour vertex. All rays of one family see the
//! same fan, so the facets are sorted by angle into buckets once (the "pencil"), and a ray looks at
//! its own bucket only.
//!
//! This is the exact ray–cone test of Marching Intersections (Tarini et al., *Marching Intersections: an
//! efficient approach to shape-from-silhouette*, VMV 2002) in world instead of image coordinates: a
//! facet is a set of half-lines in front of the camera, so nothing behind it can carve.

use super::grid::Grid;
use crate::GeometryError;
use capture::{BinaryMatte, ContourOptions, Contours, Intrinsics, Surround, View};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use std::cmp::Ordering;

/// All half-lines from a camera centre through its silhouette.
#[derive(Clone, Debug)]
pub(super) struct Cone {
    pub(super) center: Point3<f64>,
    pub(super) forward: Vector3<f64>,
    /// Directions (any length, positive along the optical axis) through the ends of each contour segment.
    facets: Vec<[Vector3<f64>; 2]>,
    /// Whether what the contours do not surround is inside: the frame edge does not carve.
    is_open: bool,
}

/// One cone as seen by all rays along one axis, in grid units.
#[derive(Debug)]
pub(super) struct Pencil<'a> {
    facets: &'a [[Vector3<f64>; 2]],
    is_open: bool,
    /// The ray's axis and the two across.
    axes: [usize; 3],
    center: [f64; 3],
    forward: [f64; 3],
    /// Direction across the rays that has pseudo-angle zero: towards the middle of the grid.
    zero: [f64; 2],
    low: f64,
    buckets_per_unit: f64,
    starts: Vec<u32>,
    members: Vec<u32>,
}

/// The axes across each axis, in ascending order.
pub(super) const ACROSS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

impl Cone {
    /// # Errors
    /// The view has no silhouette, or a camera that is not finite.
    pub(super) fn new(view: &View, binary: BinaryMatte, grow_px: f64) -> Result<Self, GeometryError> {
        check(view)?;
        let surround = if view.is_complete { Surround::Background } else { Surround::Object };
        let contours = Contours::with_options(&view.matte, &ContourOptions { surround, binary, grow_px });
        let world_from_camera = view.camera.rotation.transpose();
        let intrinsics = &view.camera.intrinsics;
        let direction = |p: Point2<f64>| world_from_camera * direction_in_camera(intrinsics, p);
        let mut facets = Vec::with_capacity(contours.len());
        for polygon in contours.loops() {
            let directions: Vec<_> = polygon.iter().map(|&p| direction(p)).collect();
            let n = directions.len();
            facets.extend((0..n).map(|i| [directions[i], directions[(i + 1) % n]]));
        }
        Ok(Self { center: view.camera.center(), forward: view.camera.forward(), facets, is_open: !view.is_complete })
    }

    /// Whether this cone removes nothing.
    pub(super) fn is_unconstrained(&self) -> bool {
        self.is_open && self.facets.is_empty()
    }
}

fn check(view: &View) -> Result<(), GeometryError> {
    let (camera, i) = (&view.camera, &view.camera.intrinsics);
    let fail =
        |fault: String, remedy| Err(GeometryError::View { index: view.index, name: view.name.clone(), fault, remedy });
    let d = i.distortion;
    let numbers = [i.fx, i.fy, i.skew, i.cx, i.cy, d.k1, d.k2, d.k3, d.p1, d.p2];
    let pose = camera.rotation.iter().chain(camera.translation.iter());
    if !numbers.iter().chain(pose).all(|v| v.is_finite()) || i.fx <= 0.0 || i.fy <= 0.0 {
        return fail("the camera is not finite or has no focal length".into(), "correct its calibration");
    }
    if (camera.rotation.determinant() - 1.0).abs() > 1e-2 {
        return fail("the pose is not a rotation".into(), "correct its calibration (mirrored axes?)");
    }
    let [w, h] = [view.matte.width(), view.matte.height()];
    if [w, h] != [i.width, i.height] {
        let fault = format!("the mask is {w}×{h}, the camera {}×{}", i.width, i.height);
        return fail(fault, "give the mask the size of its image");
    }
    if !view.matte.pixels().iter().any(|&m| m >= 128) {
        return fail("the silhouette is empty".into(), "leave this view out or correct its mask");
    }
    Ok(())
}

/// The viewing direction of a pixel. Beyond the fold of a lens model there is none: then that of
/// the nearest pixel towards the principal point that has one.
fn direction_in_camera(intrinsics: &Intrinsics, pixel: Point2<f64>) -> Vector3<f64> {
    let plane = |s: f64| {
        let seen = intrinsics.plane_from_pixel(pixel) * s;
        intrinsics.distortion.undistort(seen).filter(|p| p.iter().all(|v| v.is_finite()))
    };
    let found = plane(1.0).unwrap_or_else(|| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..30 {
            let middle = 0.5 * (low + high);
            if plane(middle).is_some() { low = middle } else { high = middle }
        }
        plane(low).unwrap_or_else(Vector2::zeros)
    });
    Vector3::new(found.x, found.y, 1.0)
}

/// Slack when facets are put into buckets, in buckets: far more than the rounding of an angle.
const BUCKET_SLACK: f64 = 1e-6;

impl<'a> Pencil<'a> {
    pub(super) fn new(cone: &'a Cone, axis: usize, grid: &Grid) -> Self {
        let [b, c] = ACROSS[axis];
        let center = grid.from_world(&cone.center);
        let middle = [0, 1, 2].map(|a| 0.5 * (grid.low[a] + grid.high[a]));
        let towards = Vector2::new(middle[b] - center[b], middle[c] - center[c]);
        let zero = towards.try_normalize(1e-9).unwrap_or_else(Vector2::x);
        let mut pencil = Self {
            facets: &cone.facets,
            is_open: cone.is_open,
            axes: [axis, b, c],
            center,
            forward: [axis, b, c].map(|a| cone.forward[a]),
            zero: [zero.x, zero.y],
            low: 0.0,
            buckets_per_unit: 0.0,
            starts: vec![0, 0],
            members: Vec::new(),
        };
        pencil.fill();
        pencil
    }

    /// Sorts the facets into buckets of equal pseudo-angle, about two facets to a bucket.
    fn fill(&mut self) {
        let [_, b, c] = self.axes;
        let ranges: Vec<[f64; 2]> = self
            .facets
            .iter()
            .map(|facet| {
                let [p, q] = facet.map(|v| self.pseudo_angle(v[b], v[c]));
                // More than half a turn apart: the short way leads across the cut at ±2. Exactly half a
                // turn: through the vanishing point, that is, any angle.
                if (p - q).abs() >= 2.0 - 1e-9 { [-2.0, 2.0] } else { [p.min(q), p.max(q)] }
            })
            .collect();
        self.low = ranges.iter().map(|r| r[0]).fold(f64::INFINITY, f64::min);
        let high = ranges.iter().map(|r| r[1]).fold(f64::NEG_INFINITY, f64::max);
        if ranges.is_empty() {
            return;
        }
        let buckets = (ranges.len() / 2).clamp(1, 1 << 16);
        self.buckets_per_unit = buckets as f64 / (high - self.low).max(1e-300);
        let last = buckets - 1;
        let bucket = |v: f64, slack: f64| (((v - self.low) * self.buckets_per_unit + slack) as usize).min(last);
        let covered: Vec<_> = ranges.iter().map(|r| bucket(r[0], -BUCKET_SLACK)..=bucket(r[1], BUCKET_SLACK)).collect();
        (self.starts, self.members) = sort_into_buckets(&covered, buckets);
    }

    /// Grows with the angle of (`b`, `c`) from `zero`, from −2 to 2 over one turn; no transcendental.
    fn pseudo_angle(&self, b: f64, c: f64) -> f64 {
        let [zb, zc] = self.zero;
        let (x, y) = (zb * b + zc * c, zb * c - zc * b);
        let p = y / (x.abs() + y.abs());
        match (x >= 0.0, y >= 0.0) {
            (true, _) => p,
            (false, true) => 2.0 - p,
            (false, false) => -2.0 - p,
        }
    }

    /// The facets that the ray at (`b`, `c`) relative to the camera centre can meet.
    fn candidates(&self, b: f64, c: f64) -> &[u32] {
        let at = (self.pseudo_angle(b, c) - self.low) * self.buckets_per_unit;
        let buckets = self.starts.len() - 1;
        // The comparison is false for NaN: no facets at all.
        if !(at >= -BUCKET_SLACK && at <= buckets as f64 + BUCKET_SLACK) {
            return &[];
        }
        let bucket = (at as usize).min(buckets - 1);
        &self.members[self.starts[bucket] as usize..self.starts[bucket + 1] as usize]
    }

    /// Writes into `inside` the intervals of the ray through lattice point (`b`, `c`) that this view does
    /// not carve, ascending, in grid units along the axis.
    pub(super) fn intervals(&self, b: f64, c: f64, toggles: &mut Vec<f64>, inside: &mut Vec<f64>) {
        let [_, axis_b, axis_c] = self.axes;
        let (mut db, dc) = (b - self.center[axis_b], c - self.center[axis_c]);
        // A ray through the camera centre projects to a point; its neighbour stands for it.
        if db.abs() + dc.abs() < 1e-9 {
            db = 1e-7;
        }
        toggles.clear();
        inside.clear();
        for &facet in self.candidates(db, dc) {
            toggles.extend(self.meet(&self.facets[facet as usize], db, dc));
        }
        sort_few(toggles);
        let starts_inside = self.add_camera_plane(db, dc, toggles);
        if starts_inside {
            inside.push(f64::NEG_INFINITY);
        }
        inside.extend_from_slice(toggles);
        if inside.len() % 2 == 1 {
            inside.push(f64::INFINITY);
        }
    }

    /// Where the ray meets a facet. Half-open in the sign at its two ends, so that closed contours give
    /// an even count even through vertices and along edges.
    #[inline]
    fn meet(&self, facet: &[Vector3<f64>; 2], db: f64, dc: f64) -> Option<f64> {
        let [a, b, c] = self.axes;
        let [p, q] = facet;
        let ep = db * p[c] - dc * p[b];
        let eq = db * q[c] - dc * q[b];
        if (ep < 0.0) == (eq < 0.0) {
            return None;
        }
        let s = ep / (ep - eq);
        let (vb, vc) = (p[b] + s * (q[b] - p[b]), p[c] + s * (q[c] - p[c]));
        let along = db * vb + dc * vc;
        // Otherwise the half-line leaves to the other side.
        (along > 0.0).then(|| {
            let va = p[a] + s * (q[a] - p[a]);
            self.center[a] + va * (db * db + dc * dc) / along
        })
    }

    /// Adds the crossing of the plane through the camera centre, behind which nothing carves, and says
    /// whether the ray starts inside. The state is known where the ray comes out of that plane: there it
    /// projects to infinity, outside every contour.
    fn add_camera_plane(&self, db: f64, dc: f64, toggles: &mut Vec<f64>) -> bool {
        let [fa, fb, fc] = self.forward;
        let across = fb * db + fc * dc;
        if fa.abs() < 1e-12 {
            if across <= 0.0 {
                toggles.clear();
                return true;
            }
            return self.is_open;
        }
        let plane = self.center[self.axes[0]] - across / fa;
        let odd = toggles.len() % 2 == 1;
        if fa > 0.0 {
            toggles.iter_mut().for_each(|t| *t = t.max(plane));
            if !self.is_open {
                toggles.insert(0, plane);
            }
            true
        } else {
            toggles.iter_mut().for_each(|t| *t = t.min(plane));
            if !self.is_open {
                toggles.push(plane);
            }
            self.is_open != odd
        }
    }
}

/// Counting sort: `starts[i]..starts[i + 1]` are the members of bucket `i`, ascending.
fn sort_into_buckets(covered: &[std::ops::RangeInclusive<usize>], buckets: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = vec![0u32; buckets + 1];
    covered.iter().flat_map(Clone::clone).for_each(|bucket| starts[bucket + 1] += 1);
    (0..buckets).for_each(|i| starts[i + 1] += starts[i]);
    let mut next = starts.clone();
    let mut members = vec![0u32; starts[buckets] as usize];
    for (facet, range) in covered.iter().enumerate() {
        for bucket in range.clone() {
            members[next[bucket] as usize] = facet as u32;
            next[bucket] += 1;
        }
    }
    (starts, members)
}

/// Insertion sort: a ray seldom meets more than four facets of a cone.
fn sort_few(values: &mut [f64]) {
    if values.len() > 32 {
        values.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        return;
    }
    for i in 1..values.len() {
        let mut j = i;
        while j > 0 && values[j - 1] > values[j] {
            values.swap(j - 1, j);
            j -= 1;
        }
    }
}
