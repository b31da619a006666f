//! From crossings to a closed mesh.
//!
//! Whether a node is inside is read off the x-rays alone (an odd number of crossings at or before
//! it). The crossings of the other two families are then reconciled edge by edge:
//!
//! | signs of the edge's ends | crossings on the edge | taken as |
//! |---|---|---|
//! | differ | one or more | the outermost one of the right direction |
//! | differ | none of the right direction | a conflict: next to the node this family sees otherwise |
//! | same | even | a feature thinner than a cell: its pairs are lost |
//! | same | odd | a conflict: none |
//!
//! One crossing where signs differ and none elsewhere is what the table of patches needs for a closed
//! manifold, whatever rounding did. Planes of nodes are kept as bits, two at a time.

use super::grid::Grid;
use super::rays::RaySet;
use super::table::TABLE;
use crate::Mesh;
use nalgebra::Point3;
use rayon::prelude::*;

/// What reconciliation met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reconciled {
    pub(super) conflicts: usize,
    pub(super) lost_pairs: usize,
}

/// The node an edge starts at and its axis.
type Edge = ([usize; 3], usize);

/// How near to a node a vertex may come, in cells: distinct vertices stay apart.
const MARGIN: f64 = 1e-4;

/// The mesh in world units.
pub(super) fn extract(sets: &[RaySet; 3], grid: &Grid) -> (Mesh, Reconciled) {
    let planes = grid.nodes[2];
    let counts: Vec<usize> =
        (0..planes).into_par_iter().map_init(|| Slab::new(grid), |slab, k| slab.load(sets, k).len()).collect();
    let mut first = Vec::with_capacity(planes + 1);
    first.push(0usize);
    counts.iter().for_each(|count| first.push(first[first.len() - 1] + count));
    let parts: Vec<Part> = (0..planes)
        .into_par_iter()
        .map_init(|| Slab::new(grid), |slab, k| slab.polygonize(sets, grid, k, &first))
        .collect();
    let mut mesh = Mesh::default();
    mesh.positions.reserve_exact(first[planes]);
    mesh.faces.reserve_exact(parts.iter().map(|p| p.faces.len()).sum());
    let mut reconciled = lost_and_odd(sets);
    for part in parts {
        mesh.positions.extend(part.positions);
        mesh.faces.extend(part.faces);
        reconciled.conflicts += part.conflicts;
    }
    (mesh, reconciled)
}

/// Vertices and faces of one slab.
struct Part {
    positions: Vec<Point3<f64>>,
    faces: Vec<[u32; 3]>,
    conflicts: usize,
}

/// The cells between two planes of nodes. Vertex numbers stand in dense arrays that are written only
/// where signs change and read only there, so they are never cleared.
struct Slab {
    nodes: [usize; 3],
    words: usize,
    /// Node bits of the lower and upper plane, rows of whole words.
    bits: [Vec<u64>; 2],
    /// Vertex numbers on x- and y-edges of both planes and on the z-edges between.
    ids: [Vec<u32>; 5],
}

impl Slab {
    fn new(grid: &Grid) -> Self {
        let [nx, ny, _] = grid.nodes;
        let words = nx.div_ceil(64);
        let ids = std::array::from_fn(|_| vec![0; nx * ny]);
        Self { nodes: grid.nodes, words, bits: std::array::from_fn(|_| vec![0; words * ny]), ids }
    }

    /// Fills both planes of the slab above plane `k` and lists the edges that belong to plane `k`: its x-
    /// and y-edges and the z-edges above it, where signs change.
    fn load(&mut self, sets: &[RaySet; 3], k: usize) -> Vec<Edge> {
        self.fill_plane(sets, k, 0);
        self.fill_plane(sets, k + 1, 1);
        let mut edges = self.plane_edges(k, 0);
        for j in 0..self.nodes[1] {
            self.changes(self.row(0, j), self.row(1, j), |i| edges.push(([i, j, k], 2)));
        }
        edges
    }

    fn row(&self, plane: usize, j: usize) -> &[u64] {
        &self.bits[plane][j * self.words..(j + 1) * self.words]
    }

    fn fill_plane(&mut self, sets: &[RaySet; 3], k: usize, plane: usize) {
        let bits = &mut self.bits[plane];
        bits.fill(0);
        if k >= self.nodes[2] {
            return;
        }
        for j in 0..self.nodes[1] {
            let row = &mut bits[j * self.words..(j + 1) * self.words];
            for pair in sets[0].ray(j, k).chunks_exact(2) {
                set_bits(row, pair[0].ceil() as usize, pair[1].ceil() as usize);
            }
        }
    }

    /// The x- and then the y-edges of one plane where signs change, row by row.
    fn plane_edges(&self, k: usize, plane: usize) -> Vec<Edge> {
        let mut edges = Vec::new();
        let mut shifted = vec![0; self.words];
        for j in 0..self.nodes[1] {
            let row = self.row(plane, j);
            for w in 0..self.words {
                shifted[w] = row[w] >> 1 | row.get(w + 1).map_or(0, |next| next << 63);
            }
            self.changes(row, &shifted, |i| edges.push(([i, j, k], 0)));
        }
        for j in 0..self.nodes[1] - 1 {
            self.changes(self.row(plane, j), self.row(plane, j + 1), |i| edges.push(([i, j, k], 1)));
        }
        edges
    }

    fn changes(&self, a: &[u64], b: &[u64], mut found: impl FnMut(usize)) {
        a.iter().zip(b).enumerate().for_each(|(w, (a, b))| each_bit(a ^ b, |bit| found(w * 64 + bit)));
    }

    fn inside(&self, plane: usize, i: usize, j: usize) -> bool {
        self.row(plane, j)[i / 64] >> (i % 64) & 1 == 1
    }

    fn polygonize(&mut self, sets: &[RaySet; 3], grid: &Grid, k: usize, first: &[usize]) -> Part {
        let edges = self.load(sets, k);
        let mut part = Part { positions: Vec::with_capacity(edges.len()), faces: Vec::new(), conflicts: 0 };
        for (n, &(node, axis)) in edges.iter().enumerate() {
            self.number(node, axis, 0, first[k] + n);
            let starts_inside = self.inside(0, node[0], node[1]);
            let found = cross_edge(sets, node, axis, starts_inside);
            part.conflicts += usize::from(found.is_conflict);
            let mut at = node.map(|i| i as f64);
            at[axis] += found.fraction;
            part.positions.push(grid.to_world(at));
        }
        if k + 1 < self.nodes[2] {
            let above = self.plane_edges(k + 1, 1);
            above.iter().enumerate().for_each(|(n, &(node, axis))| self.number(node, axis, 1, first[k + 1] + n));
            self.add_faces(&mut part.faces);
        }
        part
    }

    fn number(&mut self, node: [usize; 3], axis: usize, plane: usize, id: usize) {
        let array = if axis == 2 { 4 } else { 2 * plane + axis };
        self.ids[array][node[1] * self.nodes[0] + node[0]] = id as u32;
    }

    /// Triangles of all cells that are neither all inside nor all outside, found 64 at a time.
    fn add_faces(&self, faces: &mut Vec<[u32; 3]>) {
        for j in 0..self.nodes[1] - 1 {
            let rows = [self.row(0, j), self.row(0, j + 1), self.row(1, j), self.row(1, j + 1)];
            let any = |w: usize| rows.iter().fold(0, |acc, r| acc | r.get(w).unwrap_or(&0));
            let all = |w: usize| rows.iter().fold(!0, |acc, r| acc & r.get(w).unwrap_or(&0));
            for w in 0..self.words {
                let any_pair = any(w) | any(w) >> 1 | any(w + 1) << 63;
                let all_pair = all(w) & (all(w) >> 1 | all(w + 1) << 63);
                each_bit(any_pair & !all_pair, |bit| self.add_cell(w * 64 + bit, j, faces));
            }
        }
    }

    fn add_cell(&self, i: usize, j: usize, faces: &mut Vec<[u32; 3]>) {
        if i + 1 >= self.nodes[0] {
            return;
        }
        let corner = |c: usize| usize::from(self.inside(c >> 2, i + (c & 1), j + (c >> 1 & 1))) << c;
        let pattern: usize = (0..8).map(corner).sum();
        let at = |i: usize, j: usize| j * self.nodes[0] + i;
        let id = |edge: u8| {
            let e = usize::from(edge);
            let (u, v) = (e & 1, e >> 1 & 1);
            match e / 4 {
                0 => self.ids[2 * v][at(i, j + u)],
                1 => self.ids[2 * v + 1][at(i + u, j)],
                _ => self.ids[4][at(i + u, j + v)],
            }
        };
        faces.extend(TABLE.triangles(pattern).iter().map(|triangle| triangle.map(id)));
    }
}

fn each_bit(mut word: u64, mut found: impl FnMut(usize)) {
    while word != 0 {
        found(word.trailing_zeros() as usize);
        word &= word - 1;
    }
}

/// Sets bits `from..to`.
fn set_bits(row: &mut [u64], from: usize, to: usize) {
    for w in from / 64..to.div_ceil(64).min(row.len()) {
        let low = from.saturating_sub(w * 64);
        let high = (to - w * 64).min(64);
        row[w] |= (!0 << low) & (!0 >> (64 - high));
    }
}

/// The position of a vertex on its edge, from 0 at the start.
struct Found {
    fraction: f64,
    is_conflict: bool,
}

/// The two coordinates that name the ray through an edge.
fn ray_of(node: [usize; 3], axis: usize) -> [usize; 2] {
    super::cone::ACROSS[axis].map(|a| node[a])
}

/// The number of the edge a crossing lies on: from the node before it to the first node at or after it.
fn edge_of(crossing: f64) -> usize {
    (crossing.ceil() as usize).saturating_sub(1)
}

/// The crossing of an edge whose ends differ.
fn cross_edge(sets: &[RaySet; 3], node: [usize; 3], axis: usize, starts_inside: bool) -> Found {
    let [b, c] = ray_of(node, axis);
    let ray = sets[axis].ray(b, c);
    let edge = node[axis];
    let from = ray.partition_point(|&t| t <= edge as f64);
    let to = from + ray[from..].iter().take_while(|&&t| edge_of(t) == edge).count();
    // Crossings alternate from entering (even): of several the outermost is the first to enter, the last to leave.
    let chosen = if starts_inside { (from..to).rev().find(|n| n % 2 == 1) } else { (from..to).find(|n| n % 2 == 0) };
    let fraction = |t: f64| (t - edge as f64).clamp(MARGIN, 1.0 - MARGIN);
    match chosen {
        Some(n) => Found { fraction: fraction(ray[n]), is_conflict: (to - from) % 2 == 0 },
        None => {
            let start_is_overruled = (from % 2 == 1) != starts_inside;
            Found { fraction: if start_is_overruled { MARGIN } else { 1.0 - MARGIN }, is_conflict: true }
        }
    }
}

/// Counts crossings on edges whose ends agree.
fn lost_and_odd(sets: &[RaySet; 3]) -> Reconciled {
    let node_inside = |node: [usize; 3]| {
        let ray = sets[0].ray(node[1], node[2]);
        ray.partition_point(|&t| t <= node[0] as f64) % 2 == 1
    };
    let count_ray = |axis: usize, b: usize, c: usize, crossings: &[f64]| {
        let mut counted = Reconciled::default();
        for group in crossings.chunk_by(|s, t| edge_of(*s) == edge_of(*t)) {
            let [across_b, across_c] = super::cone::ACROSS[axis];
            let mut node = [0; 3];
            (node[across_b], node[across_c], node[axis]) = (b, c, edge_of(group[0]));
            let mut end = node;
            end[axis] += 1;
            if node_inside(node) == node_inside(end) {
                counted.conflicts += group.len() % 2;
                counted.lost_pairs += group.len() / 2;
            }
        }
        counted
    };
    let add = |a: Reconciled, b: Reconciled| Reconciled {
        conflicts: a.conflicts + b.conflicts,
        lost_pairs: a.lost_pairs + b.lost_pairs,
    };
    (0..3)
        .map(|axis| {
            let counts = sets[axis].occupied().map(|(b, c, crossings)| count_ray(axis, b, c, crossings));
            counts.reduce(Reconciled::default, add)
        })
        .fold(Reconciled::default(), add)
}

#[cfg(test)]
mod tests {
    use super::*;
    use capture::Aabb;

    /// A small deterministic generator (Knuth's MMIX constants), in [0, 1).
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    fn grid(cells: f64) -> Grid {
        Grid::new(&Aabb { min: Point3::origin(), max: Point3::new(cells, cells, cells) }, 1.0)
    }

    fn assert_closed(mesh: &Mesh) {
        let check = mesh.check().unwrap();
        assert!(mesh.faces.is_empty() || (check.closed_manifold && check.degenerate_faces == 0), "{check:?}");
        assert!(check.euler % 2 == 0 && check.volume >= 0.0);
    }

    /// Crossings half-way between nodes of different sign.
    fn sets_of(grid: &Grid, inside: impl Fn([usize; 3]) -> bool + Sync) -> [RaySet; 3] {
        [0, 1, 2].map(|axis| {
            let [b, c] = super::super::cone::ACROSS[axis];
            RaySet::from_rays(axis, grid, |ib, ic| {
                let at = |i: usize| {
                    let mut node = [0; 3];
                    (node[axis], node[b], node[c]) = (i, ib, ic);
                    inside(node)
                };
                (0..grid.nodes[axis] - 1).filter(|&i| at(i) != at(i + 1)).map(|i| i as f64 + 0.5).collect()
            })
        })
    }

    #[test]
    fn one_node_inside_is_an_octahedron() {
        let grid = grid(2.0);
        let (mesh, reconciled) = extract(&sets_of(&grid, |node| node == [2, 2, 2]), &grid);
        assert_eq!((mesh.positions.len(), mesh.faces.len()), (6, 8));
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-12);
        assert_eq!(reconciled, Reconciled::default());
    }

    #[test]
    fn random_sign_fields_are_closed_manifolds() {
        let mut state = 7;
        for density in [0.1, 0.3, 0.5, 0.7, 0.9] {
            for _ in 0..40 {
                let grid = grid(6.0);
                let n = grid.nodes;
                let bits: Vec<bool> = (0..n[0] * n[1] * n[2]).map(|_| random(&mut state) < density).collect();
                let rim = |p: [usize; 3]| (0..3).any(|a| p[a] == 0 || p[a] == n[a] - 1);
                let inside = |p: [usize; 3]| !rim(p) && bits[(p[2] * n[1] + p[1]) * n[0] + p[0]];
                let (mesh, reconciled) = extract(&sets_of(&grid, inside), &grid);
                assert_closed(&mesh);
                assert_eq!(reconciled, Reconciled::default());
            }
        }
    }

    /// Families that know nothing of each other: the worst that rounding could do, and far beyond it.
    #[test]
    fn contradicting_families_still_give_a_closed_manifold() {
        let mut state = 11;
        for _ in 0..100 {
            let grid = grid(7.0);
            let sets = [0, 1, 2].map(|axis| {
                let seed = (random(&mut state) * 1e15) as u64;
                RaySet::from_rays(axis, &grid, |b, c| {
                    let mut state = seed + (b * 1000 + c) as u64;
                    let count = 2 * (random(&mut state) * 4.0) as usize;
                    let in_box = grid.spans(0, b) && grid.spans(0, c);
                    let mut ts: Vec<f64> = (0..if in_box { count } else { 0 })
                        .map(|_| (random(&mut state) * 70.0).round() / 10.0 + 1.5)
                        .collect();
                    ts.sort_by(f64::total_cmp);
                    ts
                })
            });
            assert_closed(&extract(&sets, &grid).0);
        }
    }

    #[test]
    fn noise_on_every_crossing_keeps_the_sphere_closed() {
        let grid = grid(20.0);
        let sphere = |axis: usize| {
            let [b, c] = super::super::cone::ACROSS[axis];
            RaySet::from_rays(axis, &grid, move |ib, ic| {
                let mut state = (axis * 10000 + ib * 100 + ic) as u64;
                let (db, dc) = (ib as f64 - 11.0, ic as f64 - 11.0);
                let left = 64.0 - db * db - dc * dc;
                let noise = |state: &mut u64| 2e-6 * (random(state) - 0.5);
                let _ = (b, c);
                if left <= 0.0 {
                    return Vec::new();
                }
                vec![11.0 - left.sqrt() + noise(&mut state), 11.0 + left.sqrt() + noise(&mut state)]
            })
        };
        // Radius 8 on a lattice: many crossings fall exactly on nodes before the noise.
        let (mesh, reconciled) = extract(&[sphere(0), sphere(1), sphere(2)], &grid);
        assert_closed(&mesh);
        assert_eq!(mesh.check().unwrap().euler, 2);
        assert!(reconciled.conflicts > 0);
    }

    #[test]
    fn a_comb_thinner_than_a_cell_is_lost_in_pairs() {
        let grid = grid(8.0);
        let mut sets = sets_of(&grid, |p| (3..7).contains(&p[0]) && (3..7).contains(&p[1]) && (3..7).contains(&p[2]));
        sets[2] = RaySet::from_rays(2, &grid, |b, c| {
            let within = (3..7).contains(&b) && (3..7).contains(&c);
            if within { vec![2.5, 4.2, 4.4, 4.6, 4.8, 6.5] } else { Vec::new() }
        });
        let (mesh, reconciled) = extract(&sets, &grid);
        assert_closed(&mesh);
        assert_eq!(reconciled, Reconciled { conflicts: 0, lost_pairs: 32 });
    }
}
