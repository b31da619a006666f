//! Materials against closed forms.

use super::*;
use capture::btf::bonn_directions;
use geometry::Mesh;
use std::f32::consts::PI;
use std::f64::consts::TAU;
use std::sync::Arc;
use texture::btf::{DirectionSet, Frame, Synthesizer};

/// A material in closed form: texel, light, view.
struct Closed<F> {
    frame: Frame,
    of: F,
}

impl<F: Fn(usize, &Vector3<f32>, &Vector3<f32>) -> [f32; 3] + Send + Sync> Sampler for Closed<F> {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        (self.of)(texel, light, view)
    }
}

impl<F: Fn(usize, &Vector3<f32>, &Vector3<f32>) -> [f32; 3] + Send + Sync> Synthesizer for Closed<F> {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn picture(&self, size: [usize; 2], _: u64, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        (0..size[0] * size[1]).flat_map(|texel| (self.of)(texel, light, view)).collect()
    }
}

fn frame(width: usize, height: usize) -> Frame {
    let all = Arc::new(DirectionSet::new(&bonn_directions()));
    Frame { width, height, views: all.clone(), lights: all }
}

/// Radiance of white paint times `albedo`, linear, with the cosine.
fn matt(albedo: [f32; 3]) -> impl Sampler {
    Closed { frame: frame(4, 4), of: move |_, light: &Vector3<f32>, _: &Vector3<f32>| albedo.map(|a| a * light.z / PI) }
}

fn coat(sampler: &dyn Sampler, tile_size: f64) -> Coat<'_> {
    let (encoding, exposure) = (Encoding::Linear, 1.0);
    Coat { charts: &[0], tile_size, sampler, encoding, exposure, includes_cosine: true }
}

/// A sheet over the unit square of the atlas; u turned by `turn` over it.
fn sheet(cells: usize, turn: f64, point: impl Fn(f64, f64) -> Point3<f64>) -> TexturedMesh {
    let (mut mesh, mut uvs) = (Mesh::default(), Vec::new());
    for (j, i) in (0..=cells).flat_map(|j| (0..=cells).map(move |i| (j, i))) {
        let (s, t) = (i as f64 / cells as f64, j as f64 / cells as f64);
        mesh.positions.push(point(s, t));
        let (x, y) = (s - 0.5, t - 0.5);
        // Counter-clockwise on the page, where v points down.
        let (x, y) = (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
        uvs.push(Point2::new(0.5 + x, 0.5 - y));
    }
    for (j, i) in (0..cells).flat_map(|j| (0..cells).map(move |i| (j, i))) {
        let at = |dj: usize, di: usize| ((j + dj) * (cells + 1) + i + di) as u32;
        mesh.faces.extend([[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]]);
    }
    let face_charts = vec![0; mesh.faces.len()];
    TexturedMesh { mesh, uvs, face_charts, atlas_size: [256, 256] }
}

/// [0, 1]² × 0, facing +z, x along u and y up the page.
fn plane(turn: f64) -> TexturedMesh {
    sheet(2, turn, |s, t| Point3::new(s, t, 0.0))
}

fn ball(cells: usize) -> TexturedMesh {
    sheet(cells, 0.0, |s, t| {
        let (azimuth, polar) = (TAU * s, 0.5 * TAU * (1.0 - t));
        Point3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos())
    })
}

/// Linear radiance at a place of a face.
fn radiance(coats: &Coats<'_>, lights: &[Light], face: usize, weights: [f64; 3], eye: [f64; 3]) -> [f32; 3] {
    let uvs = corners(coats.mesh, face).unwrap().uvs;
    let uv = Point2::from(mean(&uvs.map(|p| Vector3::new(p.x, p.y, 0.0)), &weights).xy());
    let lighting = Lighting { lights: lights.to_vec(), stops: 0.0 };
    let lit = Lit { coats, lighting: &lighting };
    lit.radiance(&Spot { face, uv, side: 1e-4 }, &eye.into()).unwrap()
}

#[test]
fn matt_paint_on_a_ball_follows_the_cosine_down_to_the_terminator() {
    let (mesh, paint) = (ball(96), matt([0.8, 0.4, 0.2]));
    let coats = Coats::new(&mesh, &[coat(&paint, 0.3)]);
    let toward = Vector3::new(0.3, -0.5, 0.8).normalize();
    let light = Light::Directional { toward, irradiance: [PI, 1.0, 2.0] };
    let mut grazing = 0;
    for face in (0..mesh.mesh.faces.len()).step_by(7) {
        let [a, b, c] = mesh.mesh.corners(face);
        let normal = (a.coords + b.coords + c.coords).normalize();
        let Some(eye) = (normal.z.abs() < 0.99).then_some(normal * 5.0) else { continue };
        let cosine = normal.dot(&toward).max(0.0) as f32;
        grazing += usize::from(cosine > 0.0 && cosine < 0.25);
        let found = radiance(&coats, &[light], face, [1.0 / 3.0; 3], eye.into());
        for (found, expected) in found.iter().zip([0.8 * PI, 0.4, 0.4]) {
            // Normals interpolated over flat faces are off by some 0.007.
            assert!((found - expected * cosine / PI).abs() < 0.01, "{found} at {normal}");
        }
    }
    assert!(grazing > 50);
}

#[test]
fn samples_without_the_cosine_get_it() {
    let mesh = plane(0.0);
    let even = Closed { frame: frame(1, 1), of: |_, _: &Vector3<f32>, _: &Vector3<f32>| [0.25; 3] };
    let coats = Coats::new(&mesh, &[Coat { includes_cosine: false, exposure: 0.5, ..coat(&even, 1.0) }]);
    for polar in [0.0_f64, 0.7, 1.4, 1.57, 1.6] {
        let light = Light::Directional { toward: Vector3::new(polar.sin(), 0.0, polar.cos()), irradiance: [2.0; 3] };
        let found = radiance(&coats, &[light], 0, [0.2, 0.3, 0.5], [0.0, 0.0, 9.0]);
        assert!((f64::from(found[0]) - polar.cos().max(0.0)).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn a_lamp_falls_with_the_square_and_lights_add_up() {
    let (mesh, white) = (plane(0.0), matt([1.0; 3]));
    let coats = Coats::new(&mesh, &[coat(&white, 1.0)]);
    let at = |height: f64| Light::point(Point3::new(0.5, 0.5, height), &Point3::new(0.5, 0.5, 0.0));
    let middle = |lights: &[Light]| radiance(&coats, lights, 0, [1.0, 0.0, 0.0], [0.5, 0.5, 4.0])[0];
    // Corner 0 of face 0 is the origin, 0.5² + 0.5² + h² away from the lamp.
    for height in [0.3, 1.0, 7.0] {
        let r2: f64 = 0.5 + height * height;
        let expected = height * height / r2 * (height / r2.sqrt());
        assert!((f64::from(middle(&[at(height)])) - expected).abs() < 1e-5);
    }
    let both = middle(&[at(0.3), at(1.0)]);
    assert!((both - middle(&[at(0.3)]) - middle(&[at(1.0)])).abs() < 1e-6);
    let inside = Light::Point { position: Point3::origin(), intensity: [1.0; 3] };
    assert_eq!(middle(&[inside, at(-1.0)]), 0.0);
}

#[test]
fn frames_are_right_handed_and_turn_with_the_texture() {
    let compass = Closed {
        frame: frame(2, 2),
        of: |_, light: &Vector3<f32>, _: &Vector3<f32>| [0.5 + 0.5 * light.x, 0.5 + 0.5 * light.y, light.z],
    };
    let toward = Vector3::new(0.48, 0.36, 0.8);
    for turn in [0.0, 0.4, 1.9, -2.5] {
        let mesh = plane(turn);
        let frame = Frames::new(&mesh).at(&mesh, 1, &[0.3, 0.3, 0.4]).unwrap();
        assert!((frame.tangent.cross(&frame.bitangent) - frame.normal).norm() < 1e-12);
        let coats = Coats::new(&mesh, &[coat(&compass, 0.1)]);
        let light = Light::Directional { toward, irradiance: [1.0; 3] };
        let found = radiance(&coats, &[light], 1, [0.3, 0.3, 0.4], [0.5, 0.5, 9.0]);
        // The texture is turned by `turn` against the plane, so directions are within it.
        let (x, y) = (toward.x * turn.cos() - toward.y * turn.sin(), toward.x * turn.sin() + toward.y * turn.cos());
        let expected = [0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.8];
        assert!((0..3).all(|c| (f64::from(found[c]) - expected[c]).abs() < 1e-6), "{found:?} {expected:?}");
    }
}

#[test]
fn a_mirrored_atlas_and_the_other_side_turn_nothing_over() {
    // Columns are bright to the right, rows to the bottom, of the tile's own page.
    let page = Closed {
        frame: frame(4, 4),
        of: |texel, light: &Vector3<f32>, _: &Vector3<f32>| {
            [(texel % 4) as f32, (texel / 4) as f32, 9.0 + 9.0 * light.y]
        },
    };
    let light = |z: f64| [Light::Directional { toward: Vector3::new(0.0, 0.6, z), irradiance: [1.0; 3] }];
    let mesh = plane(0.0);
    let coats = Coats::new(&mesh, &[coat(&page, 1.0)]);
    let straight = radiance(&coats, &light(0.8), 0, [0.6, 0.3, 0.1], [0.0, 0.0, 5.0]);
    assert!((straight[2] - 14.4).abs() < 1e-4, "{straight:?}");
    let mut mirrored = mesh.clone();
    mirrored.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    let other = radiance(&Coats::new(&mirrored, &[coat(&page, 1.0)]), &light(0.8), 0, [0.6, 0.3, 0.1], [0.0, 0.0, 5.0]);
    // One period up and down the page is the same place.
    assert!((0..3).all(|c| (straight[c] - other[c]).abs() < 1e-4), "{straight:?} {other:?}");
    let behind = radiance(&coats, &light(-0.8), 0, [0.6, 0.3, 0.1], [0.0, 0.0, -5.0]);
    assert!((behind[0] - straight[0]).abs() < 1e-5 && (behind[2] - 3.6).abs() < 1e-4, "{behind:?}");
    assert_eq!(radiance(&coats, &light(0.8), 0, [0.6, 0.3, 0.1], [0.0, 0.0, -5.0]), [0.0; 3]);
}

#[test]
fn repetitions_join_without_a_seam() {
    let size = 16;
    let waves = Closed {
        frame: frame(size, size),
        of: move |texel, _: &Vector3<f32>, _: &Vector3<f32>| {
            let wave = |k: usize| 0.5 + 0.5 * (TAU as f32 * (k as f32 + 0.5) / size as f32).sin();
            [wave(texel % size), wave(texel / size), 1.0]
        },
    };
    let mesh = plane(0.0);
    let coats = Coats::new(&mesh, &[coat(&waves, 0.25)]);
    let light = Light::Directional { toward: Vector3::z(), irradiance: [1.0; 3] };
    let row: Vec<f32> = (0..1000)
        .map(|i| radiance(&coats, &[light], 0, [1.0 - i as f64 / 1000.0, i as f64 / 1000.0, 0.0], [0.5, 0.5, 3.0])[0])
        .collect();
    // Two periods over half the unit: the sine's steepest slope is 4π a unit of length, its samples' no more.
    let steepest = row.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
    assert!(steepest < 1.01 * 2.0 * PI / 1000.0, "{steepest}");
    assert!(row.iter().any(|v| *v < 0.02) && row.iter().any(|v| *v > 0.98));
}

/// Radiance of a flat sheet under a light from above, with a footprint of `side` texels of a tile that `sampler` answers
/// for, at `column` texels from its left.
fn under_footprint(sampler: &dyn Sampler, side: f64, column: f64) -> [f32; 3] {
    let mesh = plane(0.0);
    // As many texels of the tile on the unit square as it has: texture coordinates count tiles.
    let coats = Coats::new(&mesh, &[coat(sampler, 1.0)]);
    let width = sampler.frame().width as f64;
    let light = Light::Directional { toward: Vector3::z(), irradiance: [1.0; 3] };
    let lighting = Lighting { lights: vec![light], stops: 0.0 };
    let spot = Spot { face: 0, uv: Point2::new(column / width, 0.37), side: side / width };
    Lit { coats: &coats, lighting: &lighting }.radiance(&spot, &Point3::new(0.5, 0.5, 50.0)).unwrap()
}

/// Black and white columns.
fn stripes(size: [usize; 2], width: usize) -> impl Sampler {
    let of = move |texel: usize, _: &Vector3<f32>, _: &Vector3<f32>| [((texel % size[0]) / width % 2) as f32; 3];
    Closed { frame: frame(size[0], size[1]), of }
}

#[test]
fn fine_stripes_under_a_large_footprint_are_their_mean() {
    for (size, sides) in [([32, 32], 3.1..1000.0), ([64, 16], 3.1..1000.0), ([256, 256], 12.1..1000.0)] {
        let sampler = stripes(size, 1);
        for k in 0..60 {
            let side = sides.start * 1.1_f64.powi(k);
            let found = under_footprint(&sampler, side.min(sides.end), 0.713 * f64::from(k));
            assert!((found[0] - 0.5).abs() < 1e-5, "{found:?} under {side} of {size:?}");
        }
    }
    // Of sides that cannot be halved, what is left over counts as well.
    for (size, mean) in [([5, 3], 0.4), ([33, 7], 16.0 / 33.0), ([1, 9], 0.0)] {
        let found = under_footprint(&stripes(size, 1), 500.0, 3.3);
        assert!((found[0] - mean).abs() < 1e-5, "{found:?} of {size:?}");
    }
}

#[test]
fn a_footprint_that_grows_or_moves_changes_nothing_at_once() {
    let sampler = stripes([32, 32], 8);
    let mut before = under_footprint(&sampler, 0.5, 3.7)[0];
    for k in 1..500 {
        let found = under_footprint(&sampler, 0.5 * 1.01_f64.powi(k), 3.7)[0];
        // Where three stripes become one and a half cells of two, two thirds become a half.
        assert!((found - before).abs() < 1.01 / 6.0, "from {before} to {found} at {k}");
        before = found;
    }
    for side in [3.2, 6.5, 12.4, 25.0] {
        let row: Vec<f32> = (0..3200).map(|i| under_footprint(&sampler, side, 0.01 * f64::from(i))[0]).collect();
        let steepest = row.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f32::max);
        // Black leaves on one side, white comes in on the other.
        assert!(f64::from(steepest) < 1.01 * 0.01 / side, "{steepest} under {side}");
    }
}

#[test]
fn a_small_footprint_asks_texel_by_texel() {
    /// Says nothing of whole pictures.
    struct Texels<S>(S);
    impl<S: Sampler> Sampler for Texels<S> {
        fn frame(&self) -> &Frame {
            self.0.frame()
        }
        fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
            self.0.value(texel, light, view)
        }
        fn picture(&self, _: &Vector3<f32>, _: &Vector3<f32>) -> Vec<f32> {
            vec![9.0; 3 * self.0.frame().texels()]
        }
    }
    let (whole, texels) = (stripes([32, 32], 3), Texels(stripes([32, 32], 3)));
    for k in 0..50 {
        let (side, column) = (0.06 * f64::from(k), 0.713 * f64::from(k));
        assert_eq!(under_footprint(&whole, side, column), under_footprint(&texels, side, column), "{side}");
    }
    assert!((under_footprint(&texels, 3.1, 0.3)[0] - 9.0).abs() < 1e-4);
}

#[test]
fn an_eye_along_the_surface_looks_no_lower_than_was_measured() {
    let heights = Closed {
        frame: frame(1, 1),
        of: |_, light: &Vector3<f32>, view: &Vector3<f32>| [view.z, light.z, view.norm()],
    };
    let mesh = plane(0.0);
    let coats = Coats::new(&mesh, &[coat(&heights, 1.0)]);
    let light = Light::Directional { toward: Vector3::new(1.0, 0.0, 1e-9), irradiance: [1e9; 3] };
    let lowest = 75.0_f32.to_radians().cos();
    for eye in [[9.0, 0.5, 0.01], [9.0, 0.5, 1e-12], [1e9, 0.5, 0.0]] {
        let found = radiance(&coats, &[light], 0, [0.2, 0.3, 0.5], eye);
        assert!((found[0] / found[2] - lowest).abs() < 1e-4, "{found:?}");
        assert!(found[1].is_finite() && found[1] > 0.0);
    }
}

#[test]
fn a_synthesized_material_is_interpolated_between_measured_directions() {
    let linear =
        Closed { frame: frame(2, 3), of: |texel, l: &Vector3<f32>, v: &Vector3<f32>| [0.1 * texel as f32, l.z, v.z] };
    let kept = SynthesizedTile::new(&linear, [2, 3], 7);
    let directions = bonn_directions();
    let (a, b) = (directions[30].cast(), directions[70].cast());
    let found = kept.value(3, &a, &b);
    assert!((found[0] - 0.3).abs() < 1e-4 && (found[1] - a.z).abs() < 1e-4 && (found[2] - b.z).abs() < 1e-4);
    let between = kept.value(0, &Vector3::new(0.3, 0.2, 0.93).normalize(), &b);
    assert!((between[1] - 0.93).abs() < 0.03, "{between:?}");
}

#[test]
fn what_is_broken_is_black_and_nothing_panics() {
    let white = matt([1.0; 3]);
    let mut meshes = vec![plane(0.0); 5];
    meshes[0].mesh.positions.fill(Point3::origin());
    meshes[1].uvs.fill(Point2::origin());
    meshes[2].mesh.positions[0].x = f64::NAN;
    meshes[3].mesh.faces[0][1] = 999;
    meshes[4].face_charts.clear();
    for mesh in &meshes {
        for tile_size in [0.0, -1.0, f64::NAN, 1e-300, 1e300] {
            let coats = Coats::new(mesh, &[coat(&white, tile_size)]);
            let lights = [Light::directional(Vector3::z()), Light::directional(Vector3::zeros())];
            let lighting = Lighting { lights: lights.to_vec(), stops: f32::INFINITY };
            let lit = Lit { coats: &coats, lighting: &lighting };
            for uv in [0.3, f64::NAN, 1e300] {
                let spot = Spot { face: 0, uv: Point2::new(uv, uv), side: uv };
                assert!(lit.colour(&spot, &Point3::new(0.0, uv, 1.0)).iter().all(|v| (0.0..=255.0).contains(v)));
            }
        }
    }
}
