//! Meshes that atlas tests and benchmarks unfold.

#![allow(dead_code, reason = "every test binary uses some of it")]
#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

use geometry::{Mesh, SimplifyOptions, simplify};
use nalgebra::{Point3, Vector3};
use std::collections::HashMap;

/// The texel size at which the mesh's area fills about 70 % of an atlas of `side` texels.
pub(crate) fn texel_size(mesh: &Mesh, side: usize) -> f64 {
    (area(mesh) / 0.7).sqrt() / side as f64
}

pub(crate) fn area(mesh: &Mesh) -> f64 {
    (0..mesh.faces.len()).map(|f| mesh.face_area_vector(f).norm() / 2.0).sum()
}

/// A ball on a ring, with grooves, cut by planes as a hull is, and noise of a third of a grid cell;
/// simplified to `faces` triangles.
pub(crate) fn hull_like(faces: usize) -> Mesh {
    let n = 72;
    let fine = marching_tetrahedra(n, 1.6, |p| hull_field(p) + 0.3 * 3.2 / n as f64 * noise(p * 30.0));
    simplify(&fine, &SimplifyOptions { target_faces: faces, max_error: None }).unwrap().mesh
}

/// What real silhouettes leave: the shape of [`hull_like`] pierced by tunnels, with noise of a whole grid
/// cell and specks that float around it; simplified to `faces` triangles. Genus 12 in 12 parts.
pub(crate) fn noisy_hull(faces: usize) -> Mesh {
    let n = 80;
    let field = |p: Vector3<f64>| {
        let tunnels = 1.0 - (9.0 * p.x).sin() * (9.0 * p.y).cos() + 0.2 * (7.0 * p.z).sin();
        let speck = (p - Vector3::new(-0.9, 0.9, 1.0)).norm() - 0.15;
        let solid = hull_field(p).max(0.12 * (0.35 - tunnels)).min(speck);
        solid + 3.2 / n as f64 * (0.7 * noise(p * 24.0) + 0.5 * noise(p * 11.0))
    };
    let fine = marching_tetrahedra(n, 1.6, field);
    simplify(&fine, &SimplifyOptions { target_faces: faces, max_error: None }).unwrap().mesh
}

/// Negative inside.
fn hull_field(p: Vector3<f64>) -> f64 {
    let ball = (p - Vector3::new(0.0, 0.0, 0.45)).norm() - 0.6 + 0.03 * (9.0 * p.x).sin() * (9.0 * p.y).sin();
    let ring = ((p.x.hypot(p.y) - 0.9).powi(2) + (p.z + 0.2).powi(2)).sqrt() - 0.35;
    let planes = (0..7).map(|i| {
        let angle = f64::from(i) * 0.9;
        p.x * angle.cos() + p.y * angle.sin() - 1.15
    });
    planes.fold(ball.min(ring), f64::max)
}

/// Smooth noise in [-1, 1], from a hash of lattice points.
fn noise(p: Vector3<f64>) -> f64 {
    let cell = p.map(f64::floor);
    let t = (p - cell).map(|x| x * x * (3.0 - 2.0 * x));
    let corner = |i: usize| {
        let d = Vector3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64);
        let weight: f64 = (0..3).map(|k| if d[k] > 0.0 { t[k] } else { 1.0 - t[k] }).product();
        let key = (cell + d).map(|x| x as i64);
        let mut h =
            (key.x.wrapping_mul(73_856_093) ^ key.y.wrapping_mul(19_349_663) ^ key.z.wrapping_mul(83_492_791)) as u64;
        h = (h ^ (h >> 31)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        weight * ((h >> 40) as f64 / f64::from(1 << 23) - 1.0)
    };
    (0..8).map(corner).sum()
}

/// The zero surface of a field over `[-half, half]³` in n³ cells, each cut into six tetrahedra around
/// its diagonal: always a closed manifold if the field is positive on the border.
pub(crate) fn marching_tetrahedra(n: usize, half: f64, field: impl Fn(Vector3<f64>) -> f64) -> Mesh {
    let at = |i: usize| {
        let (x, y, z) = (i % (n + 1), i / (n + 1) % (n + 1), i / (n + 1) / (n + 1));
        Vector3::new(x as f64, y as f64, z as f64) * (2.0 * half / n as f64) - Vector3::repeat(half)
    };
    let values: Vec<f64> = (0..(n + 1).pow(3)).map(|i| field(at(i))).map(|f| if f == 0.0 { 1e-9 } else { f }).collect();
    let mut mesh = Mesh::default();
    let mut cut: HashMap<(usize, usize), u32> = HashMap::new();
    let step = [1, n + 1, (n + 1) * (n + 1)];
    let paths = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    for cell in (0..n.pow(3)).map(|i| (i % n) * step[0] + (i / n % n) * step[1] + (i / n / n) * step[2]) {
        for path in paths {
            let a = cell + step[path[0]];
            let b = a + step[path[1]];
            let tetrahedron = [cell, a, b, b + step[path[2]]];
            let (inside, outside): (Vec<_>, Vec<_>) = tetrahedron.into_iter().partition(|&i| values[i] < 0.0);
            let mut vertex = |i: usize, o: usize| {
                *cut.entry((i, o)).or_insert_with(|| {
                    let t = (values[i] / (values[i] - values[o])).clamp(0.02, 0.98);
                    mesh.positions.push(Point3::from(at(i) + (at(o) - at(i)) * t));
                    mesh.positions.len() as u32 - 1
                })
            };
            let corners: Vec<u32> = match (&inside[..], &outside[..]) {
                ([i], [a, b, c]) => vec![vertex(*i, *a), vertex(*i, *b), vertex(*i, *c)],
                ([a, b, c], [o]) => vec![vertex(*a, *o), vertex(*b, *o), vertex(*c, *o)],
                ([i, j], [a, b]) => vec![vertex(*i, *a), vertex(*i, *b), vertex(*j, *b), vertex(*j, *a)],
                _ => continue,
            };
            let outward = at(outside[0]) - at(inside[0]);
            for k in 1..corners.len() - 1 {
                let mut face = [corners[0], corners[k], corners[k + 1]];
                let p = face.map(|v| mesh.positions[v as usize]);
                if (p[1] - p[0]).cross(&(p[2] - p[0])).dot(&outward) < 0.0 {
                    face.swap(1, 2);
                }
                mesh.faces.push(face);
            }
        }
    }
    mesh
}

/// A sphere of latitudes and longitudes.
pub(crate) fn sphere(rings: usize) -> Mesh {
    let sectors = 2 * rings;
    let mut positions = vec![Point3::new(0.0, 0.0, 1.0)];
    for i in 1..rings {
        let theta = std::f64::consts::PI * i as f64 / rings as f64;
        positions.extend((0..sectors).map(|j| {
            let phi = std::f64::consts::TAU * j as f64 / sectors as f64;
            Point3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        }));
    }
    positions.push(Point3::new(0.0, 0.0, -1.0));
    let last = positions.len() as u32 - 1;
    let at = |i: usize, j: usize| (1 + (i - 1) * sectors + j % sectors) as u32;
    let mut faces = Vec::new();
    for j in 0..sectors {
        faces.push([0, at(1, j), at(1, j + 1)]);
        for i in 1..rings - 1 {
            faces.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            faces.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        faces.push([at(rings - 1, j), last, at(rings - 1, j + 1)]);
    }
    Mesh { positions, faces }
}

/// A torus of radii 1 and 0.4.
pub(crate) fn torus(n: usize, m: usize) -> Mesh {
    let point = |i: usize, j: usize| {
        let (u, v) = (std::f64::consts::TAU * i as f64 / n as f64, std::f64::consts::TAU * j as f64 / m as f64);
        let r = 1.0 + 0.4 * v.cos();
        Point3::new(r * u.cos(), r * u.sin(), 0.4 * v.sin())
    };
    grid(n, m, true, point)
}

/// A grid of n × m quads over `point`; closed in both directions if `wrapped`.
pub(crate) fn grid(n: usize, m: usize, wrapped: bool, point: impl Fn(usize, usize) -> Point3<f64>) -> Mesh {
    let (columns, rows) = if wrapped { (n, m) } else { (n + 1, m + 1) };
    let positions = (0..columns * rows).map(|i| point(i % columns, i / columns)).collect();
    let at = |i: usize, j: usize| (i % columns + (j % rows) * columns) as u32;
    let quads = (0..n * m).map(|i| (i % n, i / n));
    let faces = quads.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Mesh { faces: faces.collect(), positions }
}

/// The unit cube, every side in n × n quads.
pub(crate) fn cube(n: usize) -> Mesh {
    let field = |corner: Vector3<f64>, u: Vector3<f64>, v: Vector3<f64>| {
        grid(n, n, false, move |i, j| Point3::from(corner + u * (i as f64 / n as f64) + v * (j as f64 / n as f64)))
    };
    let (x, y, z, o) = (Vector3::x(), Vector3::y(), Vector3::z(), Vector3::zeros());
    let sides = [field(o, y, x), field(z, x, y), field(o, x, z), field(y, z, x), field(o, z, y), field(x, y, z)];
    let mut mesh = Mesh::default();
    let mut known: HashMap<[i64; 3], u32> = HashMap::new();
    for side in sides {
        let numbers: Vec<u32> = side
            .positions
            .iter()
            .map(|p| {
                *known.entry([p.x, p.y, p.z].map(|c| (c * n as f64).round() as i64)).or_insert_with(|| {
                    mesh.positions.push(*p);
                    mesh.positions.len() as u32 - 1
                })
            })
            .collect();
        mesh.faces.extend(side.faces.iter().map(|f| f.map(|v| numbers[v as usize])));
    }
    mesh
}
