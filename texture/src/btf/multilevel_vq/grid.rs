//! The grid of directions a texel is brought to: light in onion slices, view in polar angle and azimuth.
//!
//! The light is seen from the azimuth φ of the view: `t` along it and `s` across it, or the other way round ([`Axis`]).
//! Between the poles A and B, where `s = ±1`, the hemisphere is cut into slices of constant α:
//!
//! ```text
//! s = sin β,   α = atan2(t, z),   (s, t, z) = (s, √(1 − s²) sin α, √(1 − s²) cos α)
//! ```
//!
//! α and s are uniform, hence all `n_α · n_β` cells have the solid angle `2π / (n_α n_β)`. The arccosine of the
//! paper's equation 3 loses the sign of α and leaves its domain by rounding. At the poles α is 0.
//!
//! Polar angles of the view are uniform from 0 to that of the outermost measured ring, both included, and held beyond; azimuths
//! are uniform and wrap. Between nodes everything is interpolated linearly: the 16 corners of [`Place`].

use nalgebra::Vector3;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Below this distance from the axis A–B, α is noise.
const POLE: f32 = 1e-7;
/// Cells of the light's hemisphere per light of a measurement as dense that covers it all: 11 × 11 for the 81 of Bonn.
const CELLS_PER_LIGHT: f64 = 1.1;
/// Most cells along a side that data are given.
const MOST_CELLS: f64 = 24.0;
/// Measured views per squared number of polar angles; with four azimuths to a polar angle 6 × 24 for the 81 of Bonn, the
/// rings and the azimuths of the outermost.
const VIEWS_PER_RING: f64 = 2.25;
/// Least weight of a polar angle, mean 1: the zenith is a sliver of the hemisphere, but what is looked at most.
const LEAST_WEIGHT: f32 = 0.25;

/// Where the poles A and B of the light's hemisphere lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// A–B is perpendicular to the azimuth of the view: mirror directions lie in the middle of the slices.
    #[default]
    Perpendicular,
    /// A–B lies along the azimuth of the view: mirror directions lie on one slice.
    Along,
}

/// How finely directions are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Slices of the light's hemisphere, 1..=255 as all below.
    pub alpha: usize,
    /// Cells of a slice.
    pub beta: usize,
    /// Polar angles of the view.
    pub theta: usize,
    /// Azimuths of the view.
    pub phi: usize,
    /// The last polar angle of the view, degrees, 1..=90.
    pub rim_deg: u8,
    /// Where the slices meet.
    pub axis: Axis,
}

/// One axis between two nodes: `(1 − t) · low + t · high`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Between {
    pub(super) low: u32,
    pub(super) high: u32,
    pub(super) t: f32,
}

/// Where a pair of light and view falls.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Place {
    pub(super) theta: Between,
    pub(super) phi: Between,
    /// Slice and cell of the light as seen from either azimuth.
    pub(super) light: [[Between; 2]; 2],
}

impl Between {
    /// Weights of both nodes.
    pub(super) fn weights(self) -> [f32; 2] {
        [1.0 - self.t, self.t]
    }

    /// Both nodes.
    pub(super) fn nodes(self) -> [usize; 2] {
        [self.low as usize, self.high as usize]
    }

    /// `at` counts nodes from 0; held at both ends.
    #[inline]
    fn held(at: f32, count: usize) -> Self {
        let last = (count - 1) as u32;
        let at = at.clamp(0.0, last as f32);
        let low = (at as u32).min(last.saturating_sub(1));
        Self { low, high: (low + 1).min(last), t: at - low as f32 }
    }

    /// The same on a circle; `at` within one turn of it.
    #[inline]
    fn wrapped(at: f32, count: usize) -> Self {
        let count = count as u32;
        let at = if at < 0.0 { at + count as f32 } else { at };
        let low = (at as u32).min(count - 1);
        Self { low, high: if low + 1 == count { 0 } else { low + 1 }, t: (at - low as f32).min(1.0) }
    }
}

impl Grid {
    /// The paper's.
    pub const PAPER: Self = Self { alpha: 11, beta: 11, theta: 7, phi: 16, rim_deg: 90, axis: Axis::Perpendicular };

    /// As fine as measured directions are: 11 × 11 × 6 × 24 for those of Bonn. A single view has one node, whatever
    /// its azimuth.
    pub fn of(views: &[Vector3<f64>], lights: &[Vector3<f64>]) -> Self {
        let lowest = |all: &[Vector3<f64>]| all.iter().map(|d| d.z.clamp(0.0, 1.0)).fold(1.0, f64::min);
        let covered = (1.0 - lowest(lights)).max(f64::EPSILON);
        let cells = (CELLS_PER_LIGHT * lights.len() as f64 / covered).sqrt().round().clamp(1.0, MOST_CELLS) as usize;
        let side = if lights.len() == 1 { 1 } else { cells };
        let rings = (views.len() as f64 / VIEWS_PER_RING).sqrt().round().clamp(2.0, 60.0) as usize;
        let [theta, phi] = if views.len() == 1 { [1, 1] } else { [rings, 4 * rings] };
        let rim_deg = lowest(views).acos().to_degrees().round().clamp(1.0, 90.0) as u8;
        Self { alpha: side, beta: side, theta, phi, rim_deg, axis: Axis::default() }
    }

    /// How much each polar angle of the view counts, mean 1: the solid angle of its band, but not below
    /// [`LEAST_WEIGHT`] before that.
    pub(super) fn view_weights(&self) -> Vec<f32> {
        let step = self.rim() / (self.theta - 1).max(1) as f32;
        let band = |k: usize| ((k as f32 - 0.5) * step).max(0.0).cos() - ((k as f32 + 0.5) * step).min(FRAC_PI_2).cos();
        let bands: Vec<f32> = (0..self.theta).map(band).collect();
        let mean = |all: &[f32]| all.iter().sum::<f32>() / all.len() as f32;
        let raised: Vec<f32> = bands.iter().map(|b| (b / mean(&bands)).max(LEAST_WEIGHT)).collect();
        raised.iter().map(|w| w / mean(&raised)).collect()
    }

    fn rim(&self) -> f32 {
        f32::from(self.rim_deg).to_radians()
    }

    /// Cells of the light's hemisphere.
    pub fn cells(&self) -> usize {
        self.alpha * self.beta
    }

    /// Nodes of the view.
    pub fn nodes(&self) -> usize {
        self.theta * self.phi
    }

    /// Slice and sine of β of a unit vector towards the light, as seen from azimuth 0 of the view.
    #[inline]
    pub fn onion(&self, light: &Vector3<f32>) -> [f32; 2] {
        let [s, other] = match self.axis {
            Axis::Perpendicular => [light.y, light.x],
            Axis::Along => [light.x, light.y],
        };
        let at_pole = other.abs() + light.z.abs() < POLE;
        [if at_pole { 0.0 } else { atan2(other, light.z.max(0.0)) }, s.clamp(-1.0, 1.0)]
    }

    /// The unit vector of a slice and a sine of β: the inverse of [`Grid::onion`].
    #[inline]
    pub fn direction(&self, alpha: f32, s: f32) -> Vector3<f32> {
        let radius = ((1.0 - s) * (1.0 + s)).max(0.0).sqrt();
        let [sin, cos] = sin_cos(alpha);
        let (other, z) = (radius * sin, (radius * cos).max(0.0));
        match self.axis {
            Axis::Perpendicular => Vector3::new(other, s, z),
            Axis::Along => Vector3::new(s, other, z),
        }
    }

    /// The middle of a cell.
    pub(super) fn cell_direction(&self, slice: usize, cell: usize) -> Vector3<f32> {
        let alpha = PI * (slice as f32 + 0.5) / self.alpha as f32 - FRAC_PI_2;
        self.direction(alpha, 2.0 * (cell as f32 + 0.5) / self.beta as f32 - 1.0)
    }

    /// The azimuth of a node of the view.
    pub(super) fn azimuth(&self, phi: usize) -> f32 {
        TAU * phi as f32 / self.phi as f32
    }

    /// The direction of a node of the view.
    pub(super) fn node_direction(&self, theta: usize, phi: usize) -> Vector3<f32> {
        let theta = self.rim() * theta as f32 / (self.theta - 1).max(1) as f32;
        let (sin, cos) = self.azimuth(phi).sin_cos();
        Vector3::new(theta.sin() * cos, theta.sin() * sin, theta.cos())
    }

    /// Polar angle and azimuth of the view between nodes.
    #[inline]
    pub(super) fn view_place(&self, view: &Vector3<f32>) -> [Between; 2] {
        let radius = (view.x * view.x + view.y * view.y).sqrt();
        let theta = atan2(radius, view.z.max(0.0)) * ((self.theta - 1) as f32 / self.rim());
        let phi = if radius > 0.0 { atan2(view.y, view.x) * (self.phi as f32 / TAU) } else { 0.0 };
        [Between::held(theta, self.theta), Between::wrapped(phi, self.phi)]
    }

    /// Slice and cell between centres, of a light as seen from azimuth 0.
    #[inline]
    pub(super) fn light_place(&self, light: &Vector3<f32>) -> [Between; 2] {
        let [alpha, s] = self.onion(light);
        let alpha = (alpha / PI + 0.5) * self.alpha as f32 - 0.5;
        let s = (s + 1.0) * 0.5 * self.beta as f32 - 0.5;
        [Between::held(alpha, self.alpha), Between::held(s, self.beta)]
    }
}

/// A direction turned about the normal by minus the angle whose cosine and sine are given.
#[inline]
pub(super) fn turned(d: &Vector3<f32>, [cos, sin]: [f32; 2]) -> Vector3<f32> {
    Vector3::new(cos * d.x + sin * d.y, cos * d.y - sin * d.x, d.z)
}

/// Sine and cosine within 10⁻⁷ over -π/2..π/2: their series, cut.
#[inline]
fn sin_cos(x: f32) -> [f32; 2] {
    let q = x * x;
    let sin =
        1.0 + q * (-1.0 / 6.0 + q * (1.0 / 120.0 + q * (-1.0 / 5040.0 + q * (1.0 / 362_880.0 - q / 39_916_800.0))));
    let cos = 1.0
        - q * (0.5
            - q * (1.0 / 24.0
                - q * (1.0 / 720.0 - q * (1.0 / 40_320.0 - q * (1.0 / 3_628_800.0 - q / 479_001_600.0)))));
    [x * sin, cos]
}

/// Within 10⁻⁶ of the arctangent, continuous, 0 at (0, 0); the library's takes a multiple of its time.
#[inline]
pub(super) fn atan2(y: f32, x: f32) -> f32 {
    let (ay, ax) = (y.abs(), x.abs());
    let (small, large) = (ay.min(ax), ay.max(ax));
    let t = small / large.max(f32::MIN_POSITIVE);
    let q = t * t;
    // Hastings, "Approximations for Digital Computers", 1955, sheet 13.
    let series = 0.999_999_33
        + q * (-0.333_298_56
            + q * (0.199_465_36
                + q * (-0.139_085_34
                    + q * (0.096_420_04 + q * (-0.055_909_89 + q * (0.021_861_23 - q * 0.004_054_058))))));
    let angle = t * series;
    let angle = if ay > ax { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    angle.copysign(y)
}
