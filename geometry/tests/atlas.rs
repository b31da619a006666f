//! Known answers and invariants of the atlas (METHODS.md E.3, E.7).

mod atlas_shapes;

use atlas_shapes::*;
use geometry::atlas::rasterize;
use geometry::{Mesh, UnwrapOptions, Unwrapped, unwrap_mesh};
use nalgebra::{Point2, Point3};

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
    let start = std::time::Instant::now();
    let u = unwrap(&mesh, 1024);
    eprintln!("{} faces, {:?}, {:?} {:#?}", mesh.faces.len(), start.elapsed(), u.mesh.atlas_size, u.report);
    picture(&u, "hull");
    check_atlas(&u, 4.0);
    assert_eq!(u.mesh.mesh.faces.len() + u.report.dropped_degenerate, mesh.faces.len());
    assert!((10..=80).contains(&u.report.charts), "{} charts", u.report.charts);
    assert!(u.report.fill_ratio >= 0.65, "{}", u.report.fill_ratio);
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
