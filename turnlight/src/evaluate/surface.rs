//! Figures that need the surface: jumps across facet borders, and jumpiness along a path.

use capture::{Camera, Image, View};
use geometry::DepthMap;
use geometry::depth::NO_FACE;
use nalgebra::{Point3, Rotation3, Unit, Vector3};
use rayon::prelude::*;
use render::path::up_axis;
use texture::{Bake, Model};

/// Step of the path along which playback is watched.
const STEP_DEG: f64 = 1.0;
/// Arcs the path consists of, spread around the object, and eyes on each.
const ARCS: usize = 5;
const EYES: usize = 6;
/// Surface points watched.
const POINTS: usize = 20_000;
/// Neighbouring pixels farther apart in depth than this many pixel widths are on different surfaces.
const CONTINUITY_PX: f64 = 4.0;

/// The facet borders seen in each held-out view, and the points watched along a path.
pub(super) struct Probes {
    borders: Vec<Vec<Pair>>,
    points: Vec<Probe>,
    path: Vec<Point3<f64>>,
}

/// Two neighbouring pixels on both sides of a border, as positions in the frame.
type Pair = [usize; 2];

/// A surface point: its texel, place and normal.
struct Probe {
    texel: usize,
    position: Point3<f64>,
    normal: Vector3<f64>,
}

impl Probes {
    /// `views` are those that will be rendered; the path orbits as `training` cameras did.
    pub(super) fn new(bake: &Bake<'_>, training: &[View], views: &[View]) -> Self {
        let borders = views.par_iter().map(|view| borders(bake, view)).collect();
        let surface = &bake.surface;
        let step = surface.len().div_ceil(POINTS).max(1);
        let probe = |i: usize| Probe {
            texel: surface.index[i] as usize,
            position: surface.positions[i],
            normal: surface.normals[i],
        };
        Self { borders, points: (0..surface.len()).step_by(step).map(probe).collect(), path: path(bake, training) }
    }

    /// Mean absolute jump across the facet borders of the `i`-th view, less the same in its photograph,
    /// in % of 255. `None` where no border is seen.
    pub(super) fn seam(&self, i: usize, view: &View, frame: &Image<[u8; 4]>) -> Option<f64> {
        let rendered = frame.pixels();
        let photograph = view.image.pixels();
        let jumps: Vec<f64> = (self.borders[i].iter())
            .filter(|pair| pair.iter().all(|&p| rendered[p][3] == 255))
            .map(|&[p, q]| {
                (0..3).map(|c| jump(rendered[p][c], rendered[q][c]) - jump(photograph[p][c], photograph[q][c])).sum()
            })
            .collect();
        (!jumps.is_empty()).then(|| jumps.iter().sum::<f64>() / (3 * jumps.len()) as f64 / 2.55)
    }

    /// Mean absolute second difference of intensity at the surface points that face the eye, over a
    /// path in steps of 1°, in % of 255. Points hidden behind others count too. `None` without a path.
    pub(super) fn temporal(&self, model: &Model) -> Option<f64> {
        let (mut sum, mut count) = (0.0, 0_usize);
        for arc in self.path.chunks_exact(EYES) {
            let seen: Vec<Vec<[f32; 3]>> = arc.iter().map(|eye| self.intensities(model, eye)).collect();
            for (i, eyes) in arc.windows(3).enumerate() {
                let [before, now, after] = [&seen[i], &seen[i + 1], &seen[i + 2]];
                for (p, _) in self.points.iter().enumerate().filter(|(_, probe)| probe.faces(eyes)) {
                    let second = |c: usize| f64::from((before[p][c] - 2.0 * now[p][c] + after[p][c]).abs());
                    sum += (0..3).map(second).sum::<f64>();
                    count += 3;
                }
            }
        }
        (count > 0).then(|| sum / count as f64 / 2.55)
    }

    /// What a viewer at `eye` sees at each point, in 0..=255.
    fn intensities(&self, model: &Model, eye: &Point3<f64>) -> Vec<[f32; 3]> {
        let atlas = model.atlas(eye);
        self.points.iter().map(|probe| atlas.pixels()[probe.texel].map(|v| v.clamp(0.0, 255.0))).collect()
    }
}

impl Probe {
    fn faces(&self, eyes: &[Point3<f64>]) -> bool {
        eyes.iter().all(|eye| self.normal.dot(&(eye - self.position)) > 0.0)
    }
}

fn jump(a: u8, b: u8) -> f64 {
    f64::from(a.abs_diff(b))
}

/// Pairs of neighbouring object pixels on one surface but in two facets.
fn borders(bake: &Bake<'_>, view: &View) -> Vec<Pair> {
    let map = DepthMap::render_with_faces(&bake.mesh.mesh, &view.camera);
    let Some(faces) = &map.faces else { return Vec::new() };
    let (width, height) = (faces.width(), faces.height());
    if [view.image.width(), view.image.height()] != [width, height] {
        return Vec::new();
    }
    let facet = |p: usize| match faces.pixels()[p] {
        NO_FACE => None,
        _ if view.matte.pixels()[p] < 128 => None,
        face => Some(bake.facets.of_face[face as usize]),
    };
    let depths = map.depth.pixels();
    let is_border = |p: usize, q: usize| {
        let (Some(a), Some(b)) = (facet(p), facet(q)) else { return false };
        let pixel_width = f64::from(depths[p]) / view.camera.intrinsics.fx.abs();
        a != b && f64::from((depths[p] - depths[q]).abs()) <= CONTINUITY_PX * pixel_width
    };
    let mut pairs = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let p = y * width + x;
            let beside = (x + 1 < width).then_some(p + 1);
            let below = (y + 1 < height).then_some(p + width);
            pairs.extend([beside, below].into_iter().flatten().filter(|&q| is_border(p, q)).map(|q| [p, q]));
        }
    }
    pairs
}

/// Eyes on arcs around the object, at the distance and elevation of the first training camera.
fn path(bake: &Bake<'_>, training: &[View]) -> Vec<Point3<f64>> {
    let cameras: Vec<Camera> = training.iter().map(|view| view.camera).collect();
    let (Some(up), Some(first), Some(aabb)) = (up_axis(&cameras), cameras.first(), bake.mesh.mesh.aabb()) else {
        return Vec::new();
    };
    let Some(axis) = Unit::try_new(up, 0.0) else { return Vec::new() };
    let outward = first.center() - aabb.center();
    let eye = |arc: usize, i: usize| {
        let angle_deg = 360.0 / ARCS as f64 * arc as f64 + STEP_DEG * i as f64;
        aabb.center() + Rotation3::from_axis_angle(&axis, angle_deg.to_radians()) * outward
    };
    (0..ARCS).flat_map(|arc| (0..EYES).map(move |i| (arc, i))).map(|(arc, i)| eye(arc, i)).collect()
}
