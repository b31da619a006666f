//! Known answers and invariants of the atlas.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod atlas_shapes;

use atlas_shapes::*;
use geometry::atlas::{PushPull, rasterize};
use geometry::mesh::{TaubinOptions, taubin_smooth};
use geometry::{Mesh, SimplifyOptions, UnwrapOptions, Unwrapped, simplify, unwrap_mesh};
use nalgebra::{Point2, Point3, Vector3};
use proptest::prelude::*;
use std::time::Instant;

fn unwrap(mesh: &Mesh, side: usize) -> Unwrapped {
    unwrap_mesh(mesh, &UnwrapOptions::new(texel_size(mesh, side))).unwrap()
}

/// What every atlas must be: inside the unit square, every face upright (clockwise in v-down
/// coordinates), no texel centre in two faces, charts apart by the gutter.
fn check_atlas(u: &Unwrapped, gutter: f64) {
    let t = &u.mesh;
    assert!(t.uvs.iter().all(|uv| (0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y)));
    assert!(t.atlas_size.iter().all(|s| s % 16 == 0));
    let size = t.atlas_size.map(|s| s as f64);
    let texel = |v: u32| Point2::new(t.uvs[v as usize].x * size[0], t.uvs[v as usize].y * size[1]);
    let mut covered = vec![0_u8; 4 * t.atlas_size[0] * t.atlas_size[1]];
    for (face, f) in t.mesh.faces.iter().enumerate() {
        let [a, b, c] = f.map(texel);
        let flat = -(b - a).perp(&(c - a));
        assert!(flat > 0.0, "face {face} has area {flat}");
        // Strict interior test at twice the resolution: shared edges do not count.
        let low = a.inf(&b).inf(&c) * 2.0;
        let high = a.sup(&b).sup(&c) * 2.0;
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let p = Point2::new(x as f64 + 0.5013, y as f64 + 0.4987) / 2.0;
                let inside = [(a, b), (b, c), (c, a)].iter().all(|(p0, p1)| -(p1 - p0).perp(&(p - p0)) > 1e-9);
                if inside {
                    covered[y * 2 * t.atlas_size[0] + x] += 1;
                }
            }
        }
    }
    assert!(covered.iter().all(|&c| c <= 1), "{} overlaps", covered.iter().filter(|&&c| c > 1).count());
    charts_keep_apart(u, gutter);
}

/// No texel of one chart within `gutter` (less rounding to centres) of one of another along x or y.
fn charts_keep_apart(u: &Unwrapped, gutter: f64) {
    let texels = rasterize(&u.mesh);
    let [w, h] = texels.size;
    let mut chart = vec![u32::MAX; w * h];
    for t in texels.texels.iter().filter(|t| t.inside) {
        chart[t.y as usize * w + t.x as usize] = u.mesh.face_charts[t.face as usize];
    }
    let reach = gutter as usize;
    for y in 0..h {
        for x in 0..w {
            let own = chart[y * w + x];
            for d in 1..reach {
                for (ox, oy) in [(x + d, y), (x, y + d)] {
                    if own != u32::MAX && ox < w && oy < h {
                        let other = chart[oy * w + ox];
                        assert!(other == own || other == u32::MAX, "charts {own} and {other} at {x}, {y}");
                    }
                }
            }
        }
    }
}

fn picture(u: &Unwrapped, name: &str) {
    let Ok(folder) = std::env::var("ATLAS_PICTURES") else { return };
    let texels = rasterize(&u.mesh);
    let mut image = image::RgbImage::new(texels.size[0] as u32, texels.size[1] as u32);
    for t in &texels.texels {
        let c = u.mesh.face_charts[t.face as usize].wrapping_mul(2_654_435_761);
        let shade = if t.inside { 0 } else { 90 };
        let color = [c >> 24, c >> 16, c >> 8].map(|c| ((c & 127) as u8 + 128) - shade);
        image.put_pixel(t.x, t.y, image::Rgb(color));
    }
    image.save(format!("{folder}/{name}.png")).unwrap();
}

#[test]
fn a_hull_unfolds_into_few_charts() {
    let mesh = hull_like(20_000);
    let start = Instant::now();
    let u = unwrap(&mesh, 1024);
    eprintln!("{} faces, {:?}, {:?} {:#?}", mesh.faces.len(), start.elapsed(), u.mesh.atlas_size, u.report);
    picture(&u, "hull");
    check_atlas(&u, 4.0);
    assert_eq!(u.mesh.mesh.faces.len() + u.report.dropped_degenerate, mesh.faces.len());
    assert!((10..=80).contains(&u.report.charts), "{} charts", u.report.charts);
    // 0.64 to 0.65 at 1024² with 4 texels of gutter; xatlas reaches 0.638 on a hull.
    assert!(u.report.fill_ratio >= 0.63, "{}", u.report.fill_ratio);
}

/// Notches of a noisy border, rings around tunnels and shards once made 472 charts of this one.
#[test]
fn a_noisy_hull_of_high_genus_unfolds_into_few_charts() {
    let mesh = noisy_hull(16_000);
    let check = mesh.check().unwrap();
    let start = Instant::now();
    let u = unwrap(&mesh, 1024);
    eprintln!("{check:?} {:?}, {:?} {:#?}", start.elapsed(), u.mesh.atlas_size, u.report);
    picture(&u, "noisy_hull");
    check_atlas(&u, 4.0);
    assert!(check.components as i64 - check.euler / 2 >= 10, "genus: {check:?}");
    assert!(u.report.charts <= 130, "{} charts", u.report.charts);
    assert!(u.report.stretch_l2 < 1.05 && u.report.seam_length < 60.0, "{:?}", u.report);
}

#[test]
fn a_cube_has_six_charts() {
    for n in [1, 8] {
        let u = unwrap(&cube(n), 256);
        picture(&u, "cube");
        check_atlas(&u, 4.0);
        assert_eq!(u.report.charts, 6);
        assert!((u.report.stretch_l2 - 1.0).abs() < 1e-9);
    }
}

#[test]
fn sphere_and_torus_unfold() {
    for (name, mesh) in [("sphere", sphere(40)), ("torus", torus(80, 40))] {
        let u = unwrap(&mesh, 512);
        eprintln!("{name} {:#?}", u.report);
        picture(&u, name);
        check_atlas(&u, 4.0);
        assert!(u.report.charts <= 30);
    }
}

#[test]
fn a_plane_stays_as_it_is() {
    let u = unwrap(&grid(20, 10, false, |i, j| Point3::new(i as f64, j as f64 * 1.5, 3.0)), 256);
    check_atlas(&u, 4.0);
    assert_eq!(u.report.charts, 1);
    assert!((u.report.stretch_l2 - 1.0).abs() < 1e-10 && u.report.area_ratio < 1.0 + 1e-8);
}

/// Positions through the atlas stay on the mesh, and every bilinear tap of a point on it is listed.
#[test]
fn texels_show_the_surface_they_cover() {
    let u = unwrap(&sphere(30), 256);
    let texels = rasterize(&u.mesh);
    let positions = texels.positions(&u.mesh);
    let normals = texels.normals(&u.mesh);
    assert!(texels.texels.is_sorted_by_key(|t| (t.y, t.x)));
    for ((t, p), n) in texels.texels.iter().zip(&positions).zip(&normals) {
        assert!((p.coords.norm() - 1.0).abs() < 0.006 && n.dot(&p.coords) > 0.99);
        assert!(t.barycentric.iter().all(|&w| w >= 0.0) && (t.barycentric.iter().sum::<f32>() - 1.0).abs() < 1e-5);
    }
    let mask = texels.mask();
    let [w, h] = texels.size;
    for f in 0..u.mesh.mesh.faces.len() {
        let uv = u.mesh.mesh.faces[f].map(|v| u.mesh.uvs[v as usize]);
        for [a, b] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.4, 0.6], [0.3, 0.3], [0.99, 0.01]] {
            let p = uv[0] + (uv[1] - uv[0]) * a + (uv[2] - uv[0]) * b;
            let (x, y) = (p.x * w as f64 - 0.5, p.y * h as f64 - 0.5);
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                // A tap of weight 0 is not read.
                let weight = |x: f64, i: i32| if i == 0 { 1.0 - x.fract() } else { x.fract() };
                if weight(x, i) * weight(y, j) > 1e-9 {
                    assert!(mask[(y as usize + j as usize) * w + x as usize + i as usize], "{x} {y}");
                }
            }
        }
    }
}

#[test]
fn a_fill_is_linear_smooth_and_exact_where_known() {
    let size = [53, 37];
    let n = size[0] * size[1];
    let known: Vec<bool> = (0..n).map(|i| (i % size[0] / 9 + i / size[0] / 7) % 3 == 0).collect();
    let fill = PushPull::new(size, &known);
    let noise = |seed: usize| -> Vec<f32> {
        (0..2 * n).map(|i| ((i * 7919 + seed * 104_729) % 1000) as f32 / 1000.0).collect()
    };
    let (a, b) = (noise(1), noise(2));
    let filled = |mut image: Vec<f32>| {
        fill.apply(&mut image, 2);
        image
    };
    let sum = filled(a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect());
    let (fa, fb) = (filled(a.clone()), filled(b));
    assert!((0..2 * n).all(|i| (sum[i] - (2.0 * fa[i] - fb[i])).abs() < 1e-5));
    assert!((0..2 * n).filter(|i| known[i / 2]).all(|i| fa[i] == a[i]));
    let constant: Vec<f32> = (0..2 * n).map(|i| if known[i / 2] { 0.25 } else { f32::NAN }).collect();
    assert!(filled(constant).iter().all(|v| (v - 0.25).abs() < 1e-6));
}

#[test]
fn the_atlas_does_not_depend_on_threads_or_units() {
    let mesh = hull_like(6000);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let u = unwrap(&mesh, 512);
            (rasterize(&u.mesh), u.mesh)
        })
    };
    let one = on(1);
    assert!(one == on(2) && one == on(3));
    for scale in [1e-6, 1e6, 0.37] {
        let scaled = Mesh { positions: mesh.positions.iter().map(|p| p * scale).collect(), faces: mesh.faces.clone() };
        let u = unwrap(&scaled, 512);
        assert_eq!(u.mesh.face_charts, one.1.face_charts);
        assert!(u.mesh.uvs.iter().zip(&one.1.uvs).all(|(a, b)| (a - b).norm() < 1e-9), "at {scale}");
    }
}

#[test]
fn broken_meshes_are_refused_or_repaired_with_counts() {
    let options = UnwrapOptions::new(0.02);
    let with = |change: &dyn Fn(&mut Mesh)| {
        let mut mesh = cube(3);
        change(&mut mesh);
        unwrap_mesh(&mesh, &options)
    };
    let message = |change: &dyn Fn(&mut Mesh)| with(change).unwrap_err().to_string();
    assert!(message(&|m| m.positions[1].x = f64::NAN).contains("1 of 56 vertices are not finite"));
    assert!(message(&|m| m.faces[4][2] = 99).contains("1 of 108 faces name a vertex beyond"));
    assert!(message(&|m| m.faces.clear()).contains("none of the mesh's 0 faces"));
    assert!(message(&|m| m.faces.iter_mut().for_each(|f| f[1] = f[0])).contains("none of the mesh's 108"));

    let flat = with(&|m| m.faces.extend([[0, 1, 1], [0, 0, 0]])).unwrap();
    assert_eq!((flat.report.dropped_degenerate, flat.report.charts), (2, 6));
    let twice = with(&|m| m.faces.push([m.faces[0][1], m.faces[0][2], m.faces[0][0]])).unwrap();
    assert_eq!((twice.report.dropped_duplicates, twice.report.charts), (1, 6));
    let miswound = with(&|m| m.faces[0].swap(0, 1)).unwrap();
    assert_eq!(miswound.report.miswound_edges, 3);
    let crowded = with(&|m| {
        m.positions.push(Point3::new(2.0, 2.0, 2.0));
        m.faces.push([m.faces[0][0], m.faces[0][1], 56]);
    });
    assert_eq!(crowded.as_ref().unwrap().report.crowded_edges, 1);
    let isolated = with(&|m| m.positions.push(Point3::new(50.0, 0.0, 0.0))).unwrap();
    for u in [flat, twice, miswound, crowded.unwrap(), isolated] {
        check_atlas(&u, 4.0);
    }
}

/// Slivers, single triangles, rings, spirals, crowds.
#[test]
fn hard_shapes_unfold() {
    let triangle = Mesh {
        positions: vec![Point3::origin(), Point3::new(3.0, 0.0, 0.0), Point3::new(0.0, 4.0, 0.0)],
        faces: vec![[0, 1, 2]],
    };
    let sliver = Mesh {
        positions: vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.5, 1e-4, 0.0)],
        faces: vec![[0, 1, 2]],
    };
    let ring = grid(60, 3, true, |i, j| {
        let a = std::f64::consts::TAU * i as f64 / 60.0;
        Point3::new(a.cos(), a.sin(), [0.0, 0.3, 0.6][j])
    });
    // Without the wrap of its rows the ring is an open band, whose pins would coincide if it stayed closed.
    let band = Mesh {
        faces: ring
            .faces
            .iter()
            .filter(|f| !(f.iter().any(|&v| v < 60) && f.iter().any(|&v| v >= 120)))
            .copied()
            .collect(),
        ..ring
    };
    let spiral = grid(3000, 1, false, |i, j| {
        let a = i as f64 * 0.05;
        let r = 1.0 + 0.02 * a + 0.01 * j as f64;
        Point3::new(r * a.cos(), r * a.sin(), 0.0)
    });
    let helicoid = grid(600, 4, false, |i, j| {
        let a = i as f64 * 0.1;
        Point3::new((0.5 + j as f64 * 0.1) * a.cos(), (0.5 + j as f64 * 0.1) * a.sin(), 0.08 * a)
    });
    for (name, mesh) in
        [("triangle", triangle), ("sliver", sliver), ("band", band), ("spiral", spiral), ("helicoid", helicoid)]
    {
        let u = unwrap(&mesh, 200);
        eprintln!("{name}: {} charts, {} splits, {:?}", u.report.charts, u.report.splits, u.mesh.atlas_size);
        picture(&u, name);
        check_atlas(&u, 4.0);
    }
}

#[test]
fn a_crowd_of_tiny_charts_fits_or_is_refused_with_the_size_needed() {
    let mut mesh = Mesh::default();
    for i in 0..5000 {
        let corner = Point3::new((i % 71) as f64, (i / 71) as f64, 0.0);
        let base = mesh.positions.len() as u32;
        mesh.positions.extend([corner, corner + Vector3::new(0.5, 0.0, 0.0), corner + Vector3::new(0.0, 0.5, 0.1)]);
        mesh.faces.push([base, base + 1, base + 2]);
    }
    let start = Instant::now();
    let u = unwrap_mesh(&mesh, &UnwrapOptions::new(0.1)).unwrap();
    eprintln!("5000 charts: {:?} {:?} {}", start.elapsed(), u.mesh.atlas_size, u.report.fill_ratio);
    check_atlas(&u, 4.0);
    let small = UnwrapOptions { max_atlas_px: 512, ..UnwrapOptions::new(0.01) };
    let start = Instant::now();
    let u = unwrap_mesh(&mesh, &small).unwrap();
    eprintln!("squeezed: {:?} {:?} {}", start.elapsed(), u.mesh.atlas_size, u.report.texel_size);
    assert!(u.mesh.atlas_size.iter().all(|&s| s <= 512) && u.report.texel_size > 0.01);
    let message = unwrap_mesh(&mesh, &UnwrapOptions { max_atlas_px: 256, ..small }).unwrap_err().to_string();
    assert!(message.contains("texels a side at any density"), "{message}");
}

/// A cylinder patch unrolls to its own lengths, a hemisphere stays conformal.
#[test]
fn developable_and_round_patches_have_known_maps() {
    let cylinder = grid(40, 20, false, |i, j| {
        let a = i as f64 * 0.03;
        Point3::new(a.cos(), a.sin(), j as f64 * 0.05)
    });
    let u = unwrap(&cylinder, 256);
    assert_eq!(u.report.charts, 1);
    assert!((u.report.stretch_l2 - 1.0).abs() < 1e-6 && u.report.area_ratio < 1.0 + 1e-4, "{:?}", u.report);
}

#[test]
fn a_simplified_manifold_is_one() {
    let fine = marching_tetrahedra(48, 1.2, |p| (p.x.hypot(p.y) - 0.7).powi(2) + p.z * p.z - 0.09);
    for target in [5000, 400, 30] {
        let s = simplify(&fine, &SimplifyOptions { target_faces: target, max_error: None }).unwrap();
        let (v, f) = (s.mesh.positions.len() as i64, s.mesh.faces.len() as i64);
        let half_edges = geometry::mesh::half_edge::HalfEdges::new(&s.mesh.faces, s.mesh.positions.len());
        eprintln!("{} -> {f}, error {}", fine.faces.len(), s.error);
        assert!(half_edges.is_closed() && v - 3 * f / 2 + f == 0, "target {target}: not a torus");
    }
    let kept = simplify(&fine, &SimplifyOptions { target_faces: 0, max_error: Some(1e-3) }).unwrap();
    assert!(kept.error <= 1.01e-3 && kept.mesh.faces.len() > 200, "{} {}", kept.error, kept.mesh.faces.len());
    let ratio = kept.mesh.signed_volume() / fine.signed_volume();
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn simplifying_degenerate_meshes_is_refused_or_harmless() {
    let options = SimplifyOptions { target_faces: 10, max_error: None };
    let plane = grid(20, 20, false, |i, j| Point3::new(i as f64, j as f64, 0.0));
    let s = simplify(&plane, &options).unwrap();
    assert!(
        s.mesh.faces.len() <= 12 && (area(&s.mesh) - 400.0).abs() < 1e-3,
        "{} {}",
        s.mesh.faces.len(),
        area(&s.mesh)
    );
    let mut sheets = plane.clone();
    sheets.faces.extend(plane.faces.iter().map(|f| [f[0], f[2], f[1]]));
    assert!(simplify(&sheets, &options).is_ok());
    let mut broken = plane.clone();
    broken.positions[3].y = f64::NAN;
    assert!(simplify(&broken, &options).is_err());
    broken.positions[3].y = 0.0;
    broken.faces[0][0] = 9999;
    assert!(simplify(&broken, &options).is_err());
    assert!(simplify(&Mesh::default(), &options).is_err());
    let point = Mesh { positions: vec![Point3::origin(); 3], faces: vec![[0, 1, 2]; 20] };
    assert!(simplify(&point, &options).is_err());
}

/// Taubin 1995: fifty steps change a noisy sphere's volume by less than 1 %, plain smoothing by far more.
#[test]
fn taubin_smoothing_keeps_the_volume() {
    let mut noisy = cube(20);
    noisy.positions.iter_mut().for_each(|p| *p = (*p - Vector3::repeat(0.5)).coords.normalize().into());
    for (i, p) in noisy.positions.iter_mut().enumerate() {
        *p *= 1.0 + 0.02 * (((i * 7919) % 101) as f64 / 50.0 - 1.0);
    }
    let volume = noisy.signed_volume();
    let options = TaubinOptions { iterations: 50, ..TaubinOptions::default() };
    let change = (taubin_smooth(&noisy, &options).signed_volume() / volume - 1.0).abs();
    let plain =
        (taubin_smooth(&noisy, &TaubinOptions { mu: options.lambda, ..options }).signed_volume() / volume - 1.0).abs();
    assert!(change < 0.01 && plain > 10.0 * change, "{change} {plain}");
}

fn roughly_any_mesh() -> impl Strategy<Value = Mesh> {
    let point = prop::array::uniform3(-5_i32..5).prop_map(|p| Point3::from(p.map(f64::from)));
    let faces = prop::collection::vec(prop::array::uniform3(0_u32..12), 1..40);
    (prop::collection::vec(point, 12), faces).prop_map(|(positions, faces)| Mesh { positions, faces })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Any soup of triangles over few points, most of it degenerate and crowded, unfolds or is refused.
    #[test]
    fn any_soup_unfolds_or_is_refused(mesh in roughly_any_mesh()) {
        if let Ok(u) = unwrap_mesh(&mesh, &UnwrapOptions::new(1.0)) {
            check_atlas(&u, 4.0);
        }
        let _ = simplify(&mesh, &SimplifyOptions { target_faces: 4, max_error: None });
    }
}

/// Run by hand: charts, fill and seconds over sizes.
#[test]
#[ignore = "prints figures"]
fn figures() {
    for faces in [2_000, 5_000, 10_000, 20_000, 50_000, 120_000] {
        let mesh = hull_like(faces);
        for side in [512, 1024, 2048] {
            let start = Instant::now();
            let u = unwrap(&mesh, side);
            let r = &u.report;
            eprintln!(
                "{} faces {:?}: {} charts {} splits fill {:.3} stretch {:.4} ratio {:.2} seam {:.1} {:.2} s",
                mesh.faces.len(),
                u.mesh.atlas_size,
                r.charts,
                r.splits,
                r.fill_ratio,
                r.stretch_l2,
                r.area_ratio,
                r.seam_length,
                start.elapsed().as_secs_f64()
            );
        }
    }
}
