//! Making a closed oriented surface a 2-manifold without moving anything.
//!
//! Where four or more faces meet at an edge, or two fans at a vertex, sheets touch. They are told
//! apart as if shrunk by ε towards their inside: around an edge each face is paired with the first
//! one met when turning through the solid; corners that pairs connect become one vertex. Positions
//! may repeat then; the surface as a set of points is the same.
//! Source: Guéziec, Taubin, Lazarus, Horn 2001 ("cutting and stitching"), the cutting half.

use super::Mesh;
use super::half_edge::{Sets, end, next, start};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Two half-edges of each edge, in both directions.
type Edge = (Vec<u32>, Vec<u32>);

/// The mesh with touching sheets told apart. Faces without three different vertices, and pairs of
/// faces glued back to back, are dropped; unused vertices too. Edges with an unequal number of faces
/// in both directions keep a border.
pub fn separate_sheets(mesh: &Mesh) -> Mesh {
    let faces = without_cancelled(&mesh.faces);
    let mut edges: BTreeMap<[u32; 2], Edge> = BTreeMap::new();
    for half_edge in 0..3 * faces.len() as u32 {
        let (a, b) = (start(&faces, half_edge), end(&faces, half_edge));
        let edge = edges.entry([a.min(b), a.max(b)]).or_default();
        if a < b { edge.0.push(half_edge) } else { edge.1.push(half_edge) }
    }
    let mut corners = Sets::new(3 * faces.len());
    for (ends, (forward, backward)) in edges {
        for (h, t) in pairs(mesh, &faces, ends, &forward, backward) {
            corners.join(h, next(t));
            corners.join(next(h), t);
        }
    }
    renumbered(mesh, &faces, corners)
}

/// Faces with three different vertices, less those that cancel with one of opposite orientation.
fn without_cancelled(faces: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let proper = |f: &[u32; 3]| f[0] != f[1] && f[1] != f[2] && f[2] != f[0];
    let key = |f: &[u32; 3]| {
        let mut sorted = *f;
        sorted.sort_unstable();
        let even = [[0, 1, 2], [1, 2, 0], [2, 0, 1]].iter().any(|p| p.map(|k| f[k]) == sorted);
        (sorted, even)
    };
    let mut balance: BTreeMap<[u32; 3], i32> = BTreeMap::new();
    for f in faces.iter().filter(|f| proper(f)) {
        let (sorted, even) = key(f);
        *balance.entry(sorted).or_default() += if even { 1 } else { -1 };
    }
    let mut kept = Vec::with_capacity(faces.len());
    for f in faces.iter().filter(|f| proper(f)) {
        let (sorted, even) = key(f);
        let sign = if even { 1 } else { -1 };
        let left = balance.get_mut(&sorted).filter(|left| **left * sign > 0);
        if let Some(left) = left {
            *left -= sign;
            kept.push(*f);
        }
    }
    kept
}

/// Pairs the half-edges of one edge; with two faces there is nothing to choose.
fn pairs(
    mesh: &Mesh,
    faces: &[[u32; 3]],
    [a, b]: [u32; 2],
    forward: &[u32],
    mut backward: Vec<u32>,
) -> Vec<(u32, u32)> {
    if let ([h], [t]) = (forward, backward.as_slice()) {
        return vec![(*h, *t)];
    }
    let origin = mesh.positions[a as usize];
    let axis = (mesh.positions[b as usize] - origin).try_normalize(0.0).unwrap_or_else(Vector3::z);
    let opposite = |h: u32| {
        let r = mesh.positions[start(faces, next(next(h))) as usize] - origin;
        r - axis * axis.dot(&r)
    };
    let mut found = Vec::new();
    for &h in forward {
        let from = opposite(h);
        // The outside of a forward face lies in the direction axis × r, so the solid in the other.
        let turn = |t: u32| {
            let to = opposite(t);
            let angle = -axis.dot(&from.cross(&to)).atan2(from.dot(&to));
            if angle > 0.0 { angle } else { angle + std::f64::consts::TAU }
        };
        let first = (0..backward.len()).min_by(|&i, &j| turn(backward[i]).total_cmp(&turn(backward[j])));
        if let Some(i) = first {
            found.push((h, backward.remove(i)));
        }
    }
    found
}

/// One vertex per set of corners, in the order of first use by ascending corner.
fn renumbered(mesh: &Mesh, faces: &[[u32; 3]], mut corners: Sets) -> Mesh {
    let mut number = vec![u32::MAX; 3 * faces.len()];
    let mut positions = Vec::new();
    let mut out = Vec::with_capacity(faces.len());
    for (f, face) in faces.iter().enumerate() {
        out.push([0, 1, 2].map(|k| {
            let set = corners.find((3 * f + k) as u32) as usize;
            if number[set] == u32::MAX {
                number[set] = positions.len() as u32;
                positions.push(mesh.positions[face[k] as usize]);
            }
            number[set]
        }));
    }
    Mesh { positions, faces: out }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    /// Eight corners from `low` to `high`, twelve faces, outward.
    fn cube(low: [f64; 3], high: [f64; 3]) -> Mesh {
        let corner = |i: usize| Point3::from([0, 1, 2].map(|k| if i >> k & 1 == 1 { high[k] } else { low[k] }));
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        Mesh { positions: (0..8).map(corner).collect(), faces }
    }

    fn welded(meshes: [Mesh; 2]) -> Mesh {
        let mut all = Mesh::default();
        for mesh in meshes {
            let ids: Vec<u32> = mesh
                .positions
                .iter()
                .map(|p| {
                    let known = all.positions.iter().position(|q| q == p);
                    known.unwrap_or_else(|| {
                        all.positions.push(*p);
                        all.positions.len() - 1
                    }) as u32
                })
                .collect();
            all.faces.extend(mesh.faces.iter().map(|f| f.map(|v| ids[v as usize])));
        }
        all
    }

    #[test]
    fn cubes_that_share_an_edge_become_two() {
        let touching = welded([cube([0.0; 3], [1.0; 3]), cube([1.0, 1.0, 0.0], [2.0, 2.0, 1.0])]);
        assert_eq!(touching.check().unwrap().nonmanifold_edges, 1);
        let apart = separate_sheets(&touching).check().unwrap();
        assert!(apart.closed_manifold && apart.components == 2 && (apart.volume - 2.0).abs() < 1e-12, "{apart:?}");
    }

    #[test]
    fn cubes_that_share_a_corner_become_two() {
        let touching = welded([cube([0.0; 3], [1.0; 3]), cube([1.0; 3], [2.0; 3])]);
        assert_eq!(touching.check().unwrap().nonmanifold_vertices, 1);
        let apart = separate_sheets(&touching).check().unwrap();
        assert!(apart.closed_manifold && apart.components == 2, "{apart:?}");
    }

    #[test]
    fn faces_glued_back_to_back_vanish() {
        let mut mesh = cube([0.0; 3], [1.0; 3]);
        mesh.faces.extend([[0, 1, 7], [7, 1, 0], [3, 3, 4]]);
        let clean = separate_sheets(&mesh);
        assert!(clean.faces.len() == 12 && clean.check().unwrap().closed_manifold, "{:?}", clean.faces);
    }
}
