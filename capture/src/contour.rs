//! Sub-pixel silhouette contours by marching squares.
//!
//! A matte samples coverage at pixel centres. Its bilinear interpolant crosses one half along closed
//! curves; here they are polygons with every vertex on an edge of the lattice of pixel centres, at
//! most two segments per lattice cell, and the object always on the side where
//! `(q − p) × (r − p) > 0` for a segment `p → q` and an object point `r` (image axes: x right, y down).
//! Outlines of the object so have positive signed area, outlines of holes negative.
//!
//! Saddles follow the asymptotic decider (Nielson, Hamann: *The asymptotic decider: resolving the
//! ambiguity in marching cubes*, Visualization 1991): the two object corners are joined where the
//! bilinear saddle value is at least one half.
//!
//! A binary matte says only between which two pixel centres the outline passes. [`BinaryMatte::Fit`]
//! takes the smoothest curve (least bending) through those gaps: each vertex slides along its own
//! lattice edge, so topology and order stay and the curve does not shrink as it would under a blur.

use crate::Image;
use nalgebra::{Point2, Vector2};
use std::ops::Range;

/// What surrounds the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surround {
    /// Nothing of the object is outside the frame.
    Background,
    /// The object may go on outside: the frame edge is no outline. Contours are then the outlines of
    /// background regions, and a point that no contour surrounds is object.
    Object,
}

/// How a matte with two levels only is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BinaryMatte {
    /// Every crossing half-way between the two pixel centres: 0.24 px RMS on a disc.
    Midpoints,
    /// Gaussian blur of this standard deviation in pixels before the crossings are found. Moves an
    /// outline of curvature κ by about σ²κ/2 towards its centre of curvature; at most 0.7.
    Blur(f64),
    /// The curve of least bending through the gaps between object and background pixels.
    Fit,
}

/// How contours are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourOptions {
    /// What surrounds the frame.
    pub surround: Surround,
    /// Reading of binary mattes; mattes with more than two levels are taken as they are.
    pub binary: BinaryMatte,
    /// Offset in pixels, positive outwards: the level set of the exact distance to the contour.
    pub grow_px: f64,
}

/// Closed polygons around the object in half-integer pixel coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Contours {
    points: Vec<Point2<f64>>,
    loops: Vec<Range<usize>>,
    touches_border: bool,
    surround: Surround,
}

impl Default for ContourOptions {
    fn default() -> Self {
        Self { surround: Surround::Background, binary: BinaryMatte::Fit, grow_px: 0.0 }
    }
}

impl Contours {
    /// Contours of a matte that shows the whole object, at level 127.5.
    pub fn from_matte(matte: &Image<u8>) -> Self {
        Self::with_options(matte, &ContourOptions::default())
    }

    /// Contours of a matte at level 127.5, then offset by `grow_px`. A growth that is not finite counts
    /// as none; growth is limited to ±64 px.
    pub fn with_options(matte: &Image<u8>, options: &ContourOptions) -> Self {
        let grow = if options.grow_px.is_finite() { options.grow_px.clamp(-64.0, 64.0) } else { 0.0 };
        let pad = 2 + grow.max(0.0).ceil() as usize;
        let binary = is_binary(matte);
        let mut field = Field::from_matte(matte, pad, options.surround);
        if let (true, BinaryMatte::Blur(sigma)) = (binary, options.binary) {
            field.blur(sigma.clamp(0.0, 0.7));
        }
        let mut traced = field.trace();
        if binary && options.binary == BinaryMatte::Fit {
            traced.fit(pad as u32, matte.width() as u32, matte.height() as u32);
        }
        if grow != 0.0 {
            field.values = field.distances(&traced, grow);
            traced = field.trace();
        }
        Self {
            points: traced.vertices.iter().map(|v| v.point(pad)).collect(),
            loops: traced.loops,
            touches_border: touches_border(matte),
            surround: options.surround,
        }
    }

    /// The closed polygons; the last point of each connects to its first.
    pub fn loops(&self) -> impl Iterator<Item = &[Point2<f64>]> {
        self.loops.iter().map(|range| &self.points[range.clone()])
    }

    /// All segments `p → q`, loop by loop.
    pub fn segments(&self) -> impl Iterator<Item = [Point2<f64>; 2]> + '_ {
        self.loops().flat_map(|l| (0..l.len()).map(move |i| [l[i], l[(i + 1) % l.len()]]))
    }

    /// Number of segments, which is also the number of vertices.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no contour: the matte is all object or all background.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Signed area in square pixels: outlines minus holes. Negative area under [`Surround::Object`] is
    /// that of the background regions.
    pub fn area(&self) -> f64 {
        self.segments().map(|[p, q]| 0.5 * (p.x * q.y - q.x * p.y)).sum()
    }

    /// Whether some pixel of the outermost ring is object.
    pub fn touches_border(&self) -> bool {
        self.touches_border
    }

    /// What was taken to surround the frame.
    pub fn surround(&self) -> Surround {
        self.surround
    }

    /// Whether a point lies in the silhouette, by parity of crossings on a half-line.
    pub fn contains(&self, point: Point2<f64>) -> bool {
        let crossings = self
            .segments()
            .filter(|[p, q]| (p.y > point.y) != (q.y > point.y))
            .filter(|[p, q]| point.x < p.x + (q.x - p.x) * (point.y - p.y) / (q.y - p.y))
            .count();
        (crossings % 2 == 1) != (self.surround == Surround::Object)
    }
}

/// Whether only two levels occur.
fn is_binary(matte: &Image<u8>) -> bool {
    let mut seen = [false; 256];
    matte.pixels().iter().for_each(|&v| seen[v as usize] = true);
    seen.iter().filter(|&&s| s).count() <= 2
}

/// Whether some pixel of the outermost ring is object.
fn touches_border(matte: &Image<u8>) -> bool {
    let (w, h) = (matte.width(), matte.height());
    if w == 0 || h == 0 {
        return false;
    }
    let object = |v: &u8| *v >= 128;
    matte.row(0).iter().any(object)
        || matte.row(h - 1).iter().any(object)
        || (0..h).any(|y| object(&matte.at(0, y)) || object(&matte.at(w - 1, y)))
}

/// Samples on a lattice, level zero, positive in the object. Node (x, y) is the centre of pixel
/// (x − pad, y − pad).
struct Field {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

/// A contour vertex on a lattice edge that starts at node (x, y) and runs along +x or +y.
#[derive(Clone, Copy, Debug)]
struct EdgePoint {
    x: u32,
    y: u32,
    along_y: bool,
    /// Position on the edge, in [0, 1].
    s: f64,
}

/// Vertices sorted by loop.
struct Traced {
    vertices: Vec<EdgePoint>,
    loops: Vec<Range<usize>>,
}

impl EdgePoint {
    /// In lattice coordinates.
    fn position(&self) -> Vector2<f64> {
        Vector2::new(f64::from(self.x), f64::from(self.y)) + self.axis() * self.s
    }

    fn axis(&self) -> Vector2<f64> {
        if self.along_y { Vector2::y() } else { Vector2::x() }
    }

    /// In pixel coordinates.
    fn point(&self, pad: usize) -> Point2<f64> {
        Point2::from(self.position() - Vector2::repeat(pad as f64 - 0.5))
    }
}

impl Field {
    fn from_matte(matte: &Image<u8>, pad: usize, surround: Surround) -> Self {
        let (width, height) = (matte.width() + 2 * pad, matte.height() + 2 * pad);
        let outside = if surround == Surround::Object { 127.5 } else { -127.5 };
        let mut values = vec![outside; width * height];
        for y in 0..matte.height() {
            let start = (y + pad) * width + pad;
            let row = &mut values[start..start + matte.width()];
            row.iter_mut().zip(matte.row(y)).for_each(|(v, &m)| *v = f32::from(m) - 127.5);
        }
        Self { width, height, values }
    }

    /// Separable Gaussian, cut at three standard deviations; the border repeats.
    fn blur(&mut self, sigma: f64) {
        let radius = (3.0 * sigma).ceil() as isize;
        if radius == 0 {
            return;
        }
        let kernel: Vec<f64> = (-radius..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
        let sum: f64 = kernel.iter().sum();
        let kernel: Vec<f32> = kernel.iter().map(|k| (k / sum) as f32).collect();
        let (w, h) = (self.width as isize, self.height as isize);
        for horizontal in [true, false] {
            let source = self.values.clone();
            let at = |x: isize, y: isize| source[(y.clamp(0, h - 1) * w + x.clamp(0, w - 1)) as usize];
            for y in 0..h {
                for x in 0..w {
                    let taps = kernel.iter().zip(-radius..=radius);
                    self.values[(y * w + x) as usize] =
                        taps.map(|(k, d)| k * if horizontal { at(x + d, y) } else { at(x, y + d) }).sum();
                }
            }
        }
    }

    fn at(&self, x: usize, y: usize) -> f64 {
        f64::from(self.values[y * self.width + x])
    }

    /// Marching squares, one row of cells at a time.
    fn trace(&self) -> Traced {
        let mut links = Links::default();
        let mut upper = self.row_crossings(0, &mut links);
        for y in 0..self.height.saturating_sub(1) {
            let lower = self.row_crossings(y + 1, &mut links);
            let mut left = self.crossing(0, y, true, &mut links);
            for x in 0..self.width - 1 {
                let right = self.crossing(x + 1, y, true, &mut links);
                // Around the cell: top, right, bottom, left.
                let edges = [upper[x], right, lower[x], left];
                if edges.iter().any(|&e| e != NONE) {
                    self.link_cell(x, y, edges, &mut links);
                }
                left = right;
            }
            upper = lower;
        }
        links.into_loops()
    }

    fn row_crossings(&self, y: usize, links: &mut Links) -> Vec<u32> {
        (0..self.width.saturating_sub(1)).map(|x| self.crossing(x, y, false, links)).collect()
    }

    /// The vertex on one lattice edge, `NONE` where both ends are on one side. A sample on the level
    /// counts as object.
    fn crossing(&self, x: usize, y: usize, along_y: bool, links: &mut Links) -> u32 {
        let a = self.at(x, y);
        let b = if along_y { self.at(x, y + 1) } else { self.at(x + 1, y) };
        if (a >= 0.0) == (b >= 0.0) {
            return NONE;
        }
        links.vertices.push(EdgePoint { x: x as u32, y: y as u32, along_y, s: a / (a - b) });
        links.next.push(NONE);
        (links.vertices.len() - 1) as u32
    }

    /// Links the crossings of one cell. Walking around the cell, a segment starts where the walk leaves
    /// the object and ends where it enters it.
    fn link_cell(&self, x: usize, y: usize, edges: [u32; 4], links: &mut Links) {
        let corners = [self.at(x, y), self.at(x + 1, y), self.at(x + 1, y + 1), self.at(x, y + 1)];
        let inside = corners.map(|v| v >= 0.0);
        let leaves = |e: usize| inside[e] && !inside[(e + 1) % 4];
        if edges.contains(&NONE) {
            let enters = |e: usize| !inside[e] && inside[(e + 1) % 4];
            if let (Some(from), Some(to)) = ((0..4).find(|&e| leaves(e)), (0..4).find(|&e| enters(e))) {
                links.next[edges[from] as usize] = edges[to];
            }
            return;
        }
        let [a, b, c, d] = corners;
        let saddle = (a * c - b * d) / (a + c - b - d);
        // Joined: cut off the background corner after the leaving edge; apart: the object corner before.
        let turn = if saddle >= 0.0 { 1 } else { 3 };
        for from in (0..4).filter(|&e| leaves(e)) {
            links.next[edges[from] as usize] = edges[(from + turn) % 4];
        }
    }

    /// Signed distance to the contour, positive inside, plus `grow`; exact where the result can change
    /// sign, a constant of the right sign elsewhere. The sign comes from the field itself.
    fn distances(&self, traced: &Traced, grow: f64) -> Vec<f32> {
        let band = grow.abs() + 2.0;
        let mut squared = vec![(band * band) as f32; self.values.len()];
        for range in &traced.loops {
            let vertices = &traced.vertices[range.clone()];
            for i in 0..vertices.len() {
                let (p, q) = (vertices[i].position(), vertices[(i + 1) % vertices.len()].position());
                self.stamp_segment(p, q, band, &mut squared);
            }
        }
        let signed = |(v, d2): (&f32, &f32)| v.signum() * d2.sqrt() + grow as f32;
        self.values.iter().zip(&squared).map(signed).collect()
    }

    fn stamp_segment(&self, p: Vector2<f64>, q: Vector2<f64>, band: f64, squared: &mut [f32]) {
        let (low, high) = (p.inf(&q), p.sup(&q));
        let first = |v: f64| (v - band).ceil().max(0.0) as usize;
        let end = |v: f64, n: usize| ((v + band).floor() + 1.0).clamp(0.0, n as f64) as usize;
        let direction = q - p;
        let inverse = 1.0 / direction.norm_squared().max(1e-30);
        for y in first(low.y)..end(high.y, self.height) {
            for x in first(low.x)..end(high.x, self.width) {
                let to_node = Vector2::new(x as f64, y as f64) - p;
                let s = (to_node.dot(&direction) * inverse).clamp(0.0, 1.0);
                let d2 = (to_node - direction * s).norm_squared() as f32;
                let slot = &mut squared[y * self.width + x];
                *slot = slot.min(d2);
            }
        }
    }
}

const NONE: u32 = u32::MAX;

/// Vertices in scan order with their successors.
#[derive(Default)]
struct Links {
    vertices: Vec<EdgePoint>,
    next: Vec<u32>,
}

impl Links {
    fn into_loops(self) -> Traced {
        let mut next = self.next;
        let mut vertices = Vec::with_capacity(next.len());
        let mut loops = Vec::new();
        for start in 0..next.len() {
            let first = vertices.len();
            let mut at = start;
            while next[at] != NONE {
                vertices.push(self.vertices[at]);
                at = std::mem::replace(&mut next[at], NONE) as usize;
            }
            if vertices.len() > first {
                loops.push(first..vertices.len());
            }
        }
        Traced { vertices, loops }
    }
}

impl Traced {
    /// Slides every vertex along its lattice edge to the curve of least bending. The frame edge stays:
    /// there the outline is not seen, and the frame is known exactly.
    fn fit(&mut self, pad: u32, width: u32, height: u32) {
        let in_frame = |x: u32, y: u32| (pad..pad + width).contains(&x) && (pad..pad + height).contains(&y);
        let free = |v: &EdgePoint| {
            let (dx, dy) = if v.along_y { (0, 1) } else { (1, 0) };
            in_frame(v.x, v.y) && in_frame(v.x + dx, v.y + dy)
        };
        for range in &self.loops {
            let vertices = &mut self.vertices[range.clone()];
            let free: Vec<bool> = vertices.iter().map(free).collect();
            if vertices.len() >= 5 && free.contains(&true) {
                fit_loop(vertices, &free);
            }
        }
    }
}

/// Sweeps of the fit. A step of a digital line of slope 1/20 spreads over 20 px; bending relaxes with
/// the fourth power of the wavelength.
const FIT_SWEEPS: usize = 100;
/// Over-relaxation of the fit; below 2 for convergence.
const FIT_RELAXATION: f64 = 1.5;
/// How near to a pixel centre a fitted vertex may come, in pixels. Keeps neighbours on different edges
/// of one cell apart.
const FIT_MARGIN: f64 = 0.02;

/// Projected Gauss–Seidel on `Σ wᵢ |rᵢ|²`, `rᵢ = xᵢ − (1−λᵢ) xᵢ₋₁ − λᵢ xᵢ₊₁`, with λ from the arc lengths
/// of the previous sweep (so that points unevenly spread on a line bend nothing).
fn fit_loop(vertices: &mut [EdgePoint], free: &[bool]) {
    let n = vertices.len();
    let mut x: Vec<Vector2<f64>> = vertices.iter().map(EdgePoint::position).collect();
    for _ in 0..FIT_SWEEPS {
        let shape: Vec<[f64; 2]> = (0..n).map(|i| bend_shape(x[(i + n - 1) % n], x[i], x[(i + 1) % n])).collect();
        for i in (0..n).filter(|&i| free[i]) {
            let [h, p, q, r] = [(i + n - 2) % n, (i + n - 1) % n, (i + 1) % n, (i + 2) % n];
            let bend = |l: usize, m: usize, r: usize| x[m] - x[l] * (1.0 - shape[m][0]) - x[r] * shape[m][0];
            let [wi, wp, wq] = [shape[i][1], shape[p][1], shape[q][1]];
            let (lp, lq) = (shape[p][0], 1.0 - shape[q][0]);
            let slope = bend(p, i, q) * wi - bend(h, p, i) * (wp * lp) - bend(i, q, r) * (wq * lq);
            let curvature = wi + wp * lp * lp + wq * lq * lq;
            let axis = vertices[i].axis();
            let step = FIT_RELAXATION * slope.dot(&axis) / curvature;
            let s = (vertices[i].s - step).clamp(FIT_MARGIN, 1.0 - FIT_MARGIN);
            x[i] += axis * (s - vertices[i].s);
            vertices[i].s = s;
        }
    }
}

/// λ and the weight of the bending term of the middle of three points: the discrete
/// `κ² ds` with `κ = 2 |r| / (l₁ l₂)`, lengths kept from zero.
fn bend_shape(before: Vector2<f64>, at: Vector2<f64>, after: Vector2<f64>) -> [f64; 2] {
    let (l1, l2) = ((at - before).norm().max(0.2), (after - at).norm().max(0.2));
    [l1 / (l1 + l2), (l1 + l2) / (l1 * l2).powi(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact-enough area coverage of a disc: 16 × 16 samples a pixel.
    fn disc(size: usize, center: [f64; 2], radius: f64, samples: usize) -> Image<u8> {
        let mut matte = Image::filled(size, size, 0u8);
        for y in 0..size {
            for x in 0..size {
                let at = |i: usize, o: usize| o as f64 + (i as f64 + 0.5) / samples as f64;
                let inside = (0..samples * samples)
                    .filter(|i| (at(i % samples, x) - center[0]).hypot(at(i / samples, y) - center[1]) <= radius)
                    .count();
                matte.set(x, y, (inside as f64 * 255.0 / (samples * samples) as f64).round() as u8);
            }
        }
        matte
    }

    /// RMS and mean of the radial error of the vertices.
    fn radial_error(contours: &Contours, center: [f64; 2], radius: f64) -> [f64; 2] {
        let errors: Vec<f64> =
            contours.segments().map(|[p, _]| (p.x - center[0]).hypot(p.y - center[1]) - radius).collect();
        let n = errors.len() as f64;
        [(errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(), errors.iter().sum::<f64>() / n]
    }

    #[test]
    fn disc_with_coverage_is_found_to_a_twentieth_of_a_pixel() {
        let center = [63.7, 65.2];
        let contours = Contours::from_matte(&disc(128, center, 40.3, 16));
        let [rms, mean] = radial_error(&contours, center, 40.3);
        assert!(rms < 0.06, "rms {rms}");
        assert!(mean.abs() < 0.005, "mean {mean}");
        let area = std::f64::consts::PI * 40.3 * 40.3;
        assert!((contours.area() / area - 1.0).abs() < 1e-3);
        assert!(!contours.touches_border());
    }

    #[test]
    fn fit_beats_midpoints_and_blur_on_a_binary_disc() {
        let center = [63.7, 65.2];
        let matte = disc(128, center, 40.3, 1);
        let error = |binary| {
            let options = ContourOptions { binary, ..ContourOptions::default() };
            radial_error(&Contours::with_options(&matte, &options), center, 40.3)
        };
        let [mid, blur, fit] = [BinaryMatte::Midpoints, BinaryMatte::Blur(0.7), BinaryMatte::Fit].map(error);
        println!("midpoints {mid:?}, blur {blur:?}, fit {fit:?}");
        assert!(mid[0] < 0.3, "{mid:?}");
        assert!(fit[0] < 0.6 * blur[0], "fit {fit:?}, blur {blur:?}");
        assert!(fit[1].abs() < 0.03, "{fit:?}");
    }

    #[test]
    fn growth_moves_the_outline_by_what_was_asked() {
        let center = [63.7, 65.2];
        for grow_px in [-1.3, -0.5, 0.5, 2.25, 7.0] {
            let options = ContourOptions { grow_px, ..ContourOptions::default() };
            let contours = Contours::with_options(&disc(128, center, 40.3, 16), &options);
            let [rms, mean] = radial_error(&contours, center, 40.3 + grow_px);
            assert!(rms < 0.06 && mean.abs() < 0.02, "{grow_px}: rms {rms}, mean {mean}");
        }
    }

    #[test]
    fn growth_reaches_past_the_frame() {
        let options = ContourOptions { grow_px: 3.0, ..ContourOptions::default() };
        let contours = Contours::with_options(&Image::filled(20, 10, 255), &options);
        // The corners of the frame are cut off by half a pixel first: each loses 1/8 + 3 (1 − √½) px².
        let cut = 4.0 * (0.125 + 3.0 * (1.0 - 0.5f64.sqrt()));
        let expected = 26.0 * 16.0 - (4.0 - std::f64::consts::PI) * 9.0 - cut;
        assert!((contours.area() - expected).abs() < 1.0, "{} against {expected}", contours.area());
    }

    #[test]
    fn hole_is_oriented_against_the_outline() {
        let mut matte = Image::filled(20, 20, 0u8);
        (4..16).for_each(|y| (4..16).for_each(|x| matte.set(x, y, 255)));
        (8..12).for_each(|y| (8..12).for_each(|x| matte.set(x, y, 0)));
        let options = ContourOptions { binary: BinaryMatte::Midpoints, ..ContourOptions::default() };
        let contours = Contours::with_options(&matte, &options);
        assert_eq!(contours.loops().count(), 2);
        // Each corner of a square on the lattice is cut by 1/8 of a pixel; of the hole it is added.
        assert!((contours.area() - (144.0 - 0.5 - 16.0 + 0.5)).abs() < 1e-9, "{}", contours.area());
        assert!(contours.contains(Point2::new(5.0, 10.0)) && !contours.contains(Point2::new(10.0, 10.0)));
    }

    #[test]
    fn saddles_give_closed_loops() {
        for (low, high) in [(0, 255), (100, 255), (0, 140)] {
            let mut matte = Image::filled(9, 7, low);
            (0..63).filter(|i| i % 2 == 0).for_each(|i| matte.set(i % 9, i / 9, high));
            let contours = Contours::from_matte(&matte);
            assert!(contours.loops().all(|l| l.len() >= 3));
            assert!(contours.area() > 0.0 && contours.touches_border());
        }
    }

    #[test]
    fn all_object_and_all_background() {
        let full = Contours::from_matte(&Image::filled(8, 6, 255));
        assert_eq!(full.loops().count(), 1);
        assert!(full.touches_border() && (full.area() - 48.0).abs() < 1.0);
        let empty = Contours::from_matte(&Image::filled(8, 6, 0));
        assert!(empty.is_empty() && !empty.touches_border());
        let options = ContourOptions { surround: Surround::Object, ..ContourOptions::default() };
        assert!(Contours::with_options(&Image::filled(8, 6, 255), &options).is_empty());
        let carved = Contours::with_options(&Image::filled(8, 6, 0), &options);
        assert!(carved.area() < -40.0 && carved.contains(Point2::new(-3.0, 2.0)));
    }

    #[test]
    fn tiny_images() {
        for (w, h) in [(0, 0), (1, 1), (1, 5), (5, 1), (2, 2)] {
            for value in [0, 127, 128, 255] {
                let contours = Contours::from_matte(&Image::filled(w, h, value));
                assert_eq!(contours.is_empty(), value < 128 || w * h == 0);
            }
        }
    }
}
