//! Where charts lie in the atlas, and how many texels they get.

use super::UnwrapOptions;
use super::pack::{Shape, pack};
use crate::error::GeometryError;
use crate::param::FlatChart;
use nalgebra::{Point2, Vector2};
use rayon::prelude::*;

/// Attempts at a density; each lowers it by a few percent at least.
const ATTEMPTS: usize = 60;

/// Charts with their place.
pub(super) struct Placed {
    /// Per chart and vertex, in texels of the atlas, y down.
    pub(super) texels: Vec<Vec<Point2<f64>>>,
    pub(super) size: [usize; 2],
    /// Texels per unit of the flat charts.
    pub(super) density: f64,
    pub(super) fill_ratio: f64,
}

/// Places charts at `density` texels per unit, or less where the atlas would get too large.
pub(super) fn place(charts: &[FlatChart], density: f64, options: &UnwrapOptions) -> Result<Placed, GeometryError> {
    let upright: Vec<Upright> = charts.par_iter().map(Upright::new).collect();
    let area: f64 = charts.iter().map(|c| c.patch.area()).sum();
    let longest = upright.iter().map(|u| u.size.x.max(u.size.y)).fold(0.0, f64::max);
    let limit = options.max_atlas_px as f64;
    // Nothing fits above these two, so larger masks are never built.
    let mut density = density.min(limit / area.sqrt()).min(limit / longest);
    let mut smallest = usize::MAX;
    for _ in 0..ATTEMPTS {
        let (placed, side) = place_at(charts, &upright, density, area, options);
        if side <= options.max_atlas_px {
            return Ok(placed);
        }
        // Charts below a texel are all gutter: nothing gets smaller.
        if side >= smallest && density * longest < 1.0 {
            break;
        }
        smallest = smallest.min(side);
        density *= (limit / side as f64).clamp(0.5, 0.97);
    }
    let fault = format!("{} charts need an atlas of {smallest} texels a side at any density", charts.len());
    let remedy = format!("allow more than {} texels, narrow the gutter, or simplify the mesh", options.max_atlas_px);
    Err(GeometryError::degenerate(fault, remedy))
}

/// One attempt, and the longer side of its atlas.
fn place_at(
    charts: &[FlatChart],
    upright: &[Upright],
    density: f64,
    area: f64,
    options: &UnwrapOptions,
) -> (Placed, usize) {
    let cell = cell_size(area.sqrt() * density, charts.len());
    let pad = options.gutter_px.div_ceil(2) as f64;
    let shape = |(chart, upright): (&FlatChart, &Upright)| upright.shape(chart, density, pad, cell);
    let shapes: Vec<Shape> = charts.par_iter().zip(upright).map(shape).collect();
    let packed = pack(&shapes, 16_usize.div_ceil(cell));
    let size = packed.size.map(|s| s * cell);
    let texels = upright.iter().zip(&shapes).zip(&packed.places);
    let texels = texels.map(|((upright, shape), place)| {
        let corner = Vector2::new(place.x as f64, place.y as f64);
        let turn = |p: &Point2<f64>| shape.turned(upright.texel(p, density, pad) / cell as f64, place.turns) + corner;
        upright.points.iter().map(|p| turn(p) * cell as f64).map(Point2::from).collect()
    });
    let fill_ratio = area * density * density / (size[0] * size[1]) as f64;
    (Placed { texels: texels.collect(), size, density, fill_ratio }, size[0].max(size[1]))
}

/// Texels per packing cell: small for small charts, which waste half a cell all around, and large for
/// large atlases, whose search costs the cube of the cells per side. A power of two, so that mip levels
/// of charts align.
fn cell_size(side: f64, charts: usize) -> usize {
    let chart_side = side / (charts as f64).sqrt();
    let finest = match side as usize {
        0..400 => 1,
        400..1300 => 2,
        1300..3000 => 4,
        _ => 8,
    };
    // Crowds of small charts take finer cells; their search is cheap, for they fill the first rows.
    finest.min(((chart_side / 12.0).max(1.0) as usize).next_power_of_two())
}

/// A chart turned into its smallest rectangle, whose lower left corner is the origin; y up.
struct Upright {
    points: Vec<Point2<f64>>,
    size: Vector2<f64>,
}

impl Upright {
    fn new(chart: &FlatChart) -> Self {
        let outline: Vec<_> = chart.patch.border.iter().map(|e| chart.flat[e[0] as usize]).collect();
        let x = smallest_rectangle(&outline);
        let turn = |p: &Point2<f64>| Point2::new(x.dot(&p.coords), x.perp(&p.coords));
        let turned: Vec<_> = chart.flat.iter().map(turn).collect();
        let low = turned.iter().fold(turned[0], |low, p| low.inf(p));
        let high = turned.iter().fold(turned[0], |high, p| high.sup(p));
        Self { points: turned.iter().map(|p| Point2::from(p - low)).collect(), size: high - low }
    }

    /// In texels, y down, `pad` from the upper left corner.
    fn texel(&self, p: &Point2<f64>, density: f64, pad: f64) -> Vector2<f64> {
        Vector2::new(p.x * density + pad, (self.size.y - p.y) * density + pad)
    }

    /// The cells within `pad` texels of the chart.
    fn shape(&self, chart: &FlatChart, density: f64, pad: f64, cell: usize) -> Shape {
        let cells = |p: &Point2<f64>| Point2::from(self.texel(p, density, pad) / cell as f64);
        let points: Vec<_> = self.points.iter().map(cells).collect();
        let cells = |length: f64| ((length * density + 2.0 * pad) / cell as f64).ceil().max(1.0) as usize;
        let triangles = chart.patch.corners.iter().map(|t| t.map(|v| points[v as usize]));
        Shape::covering(cells(self.size.x), cells(self.size.y), triangles, pad / cell as f64)
    }
}

/// The direction of the long side of the smallest rectangle around points: it lies along an edge of
/// their convex hull (Freeman, Shapira 1975).
fn smallest_rectangle(points: &[Point2<f64>]) -> Vector2<f64> {
    let hull = convex_hull(points);
    let mut best = (f64::INFINITY, Vector2::x());
    for i in 0..hull.len() {
        let Some(x) = (hull[(i + 1) % hull.len()] - hull[i]).try_normalize(0.0) else { continue };
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for p in &hull {
            let turned = Vector2::new(x.dot(&p.coords), x.perp(&p.coords));
            (low, high) = (low.inf(&turned), high.sup(&turned));
        }
        let size = high - low;
        // A clear improvement only, so that rounding does not choose between the sides of a square.
        if size.x * size.y < best.0 * (1.0 - 1e-6) {
            best = (size.x * size.y, if size.x >= size.y { x } else { Vector2::new(-x.y, x.x) });
        }
    }
    best.1
}

/// Andrew's monotone chain.
fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<Point2<f64>> = Vec::new();
    for half in 0..2 {
        let base = hull.len();
        for &p in &sorted {
            while hull.len() >= base + 2
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp(&(p - hull[hull.len() - 1])) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        if half == 0 {
            sorted.reverse();
        }
    }
    hull
}
