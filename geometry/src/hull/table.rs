//! Surface patches of a cell from the signs of its eight corners.
//!
//! Corner (dx, dy, dz) has number `dx + 2 dy + 4 dz`. Edge numbers:
//!
//! | edges | along | number |
//! |---|---|---|
//! | 0–3 | x | `dy + 2 dz` |
//! | 4–7 | y | `4 + dx + 2 dz` |
//! | 8–11 | z | `8 + dx + 2 dy` |
//!
//! On every face the crossed edges are connected by a rule that knows the four signs of that face only
//! (two diagonal inside corners stay apart), so both cells at a face draw the same segments and no
//! crack can open. The segments chain to closed loops; a loop is triangulated without diagonals
//! between two edges of one face, the only ones the neighbour cell could draw too. Every surface vertex
//! then has one cycle of triangles around it: the surface is a closed oriented 2-manifold.

use std::sync::LazyLock;

/// Triangles of all 256 sign patterns, as edge numbers, counter-clockwise from outside.
pub(super) struct Table {
    starts: [usize; 257],
    triangles: Vec<[u8; 3]>,
}

/// The table, made at first use.
pub(super) static TABLE: LazyLock<Table> = LazyLock::new(Table::generate);

/// Corners of each face, counter-clockwise seen from outside the cell.
const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

impl Table {
    /// The triangles of a pattern: bit i set where corner i is inside.
    pub(super) fn triangles(&self, pattern: usize) -> &[[u8; 3]] {
        &self.triangles[self.starts[pattern]..self.starts[pattern + 1]]
    }

    fn generate() -> Self {
        let mut table = Self { starts: [0; 257], triangles: Vec::new() };
        for pattern in 0..256 {
            for polygon in loops(pattern) {
                table.triangles.extend(triangulate(&polygon).unwrap_or_default());
            }
            table.starts[pattern + 1] = table.triangles.len();
        }
        table
    }
}

/// The edge between two neighbouring corners.
fn edge_between(p: usize, q: usize) -> usize {
    let low = p.min(q);
    let [dx, dy, dz] = [low & 1, low >> 1 & 1, low >> 2 & 1];
    match p ^ q {
        1 => dy + 2 * dz,
        2 => 4 + dx + 2 * dz,
        _ => 8 + dx + 2 * dy,
    }
}

/// The directed segments of a face: from where the walk around it enters the inside to where it leaves.
fn face_segments(face: &[usize; 4], pattern: usize) -> Vec<[usize; 2]> {
    let inside = |i: usize| pattern >> face[i % 4] & 1 == 1;
    let edge = |i: usize| edge_between(face[i % 4], face[(i + 1) % 4]);
    // Each run of inside corners is cut off by itself.
    (0..4)
        .filter(|&i| !inside(i) && inside(i + 1))
        .filter_map(|i| (i + 1..i + 4).find(|&j| inside(j) && !inside(j + 1)).map(|j| [edge(i), edge(j)]))
        .collect()
}

/// The closed loops of crossed edges of a pattern.
fn loops(pattern: usize) -> Vec<Vec<usize>> {
    let mut next = [None; 12];
    for [from, to] in FACES.iter().flat_map(|face| face_segments(face, pattern)) {
        next[from] = Some(to);
    }
    let mut found = Vec::new();
    for start in 0..12 {
        let mut polygon = Vec::new();
        let mut at = start;
        while let Some(to) = next[at].take() {
            polygon.push(at);
            at = to;
        }
        if !polygon.is_empty() {
            found.push(polygon);
        }
    }
    found
}

/// Whether two edges lie on one face of the cell.
fn share_face(e: usize, f: usize) -> bool {
    let on = |face: &[usize; 4], e: usize| (0..4).any(|i| edge_between(face[i], face[(i + 1) % 4]) == e);
    FACES.iter().any(|face| on(face, e) && on(face, f))
}

/// A triangulation without diagonals between edges of one face, the one with the shortest diagonals for
/// crossings at the middle of their edges; `None` where there is none, which occurs for no pattern.
fn triangulate(polygon: &[usize]) -> Option<Vec<[u8; 3]>> {
    best_triangulation(polygon).map(|(_, triangles)| triangles)
}

fn best_triangulation(polygon: &[usize]) -> Option<(f64, Vec<[u8; 3]>)> {
    let n = polygon.len();
    if n < 3 {
        return Some((0.0, Vec::new()));
    }
    // The triangle on the side from the last to the first vertex has its apex at `apex`.
    let candidates = (1..n - 1).filter_map(|apex| {
        let cost_left = diagonal_cost(polygon[0], polygon[apex], apex == 1)?;
        let cost_right = diagonal_cost(polygon[apex], polygon[n - 1], apex == n - 2)?;
        let (left, mut triangles) = best_triangulation(&polygon[..=apex])?;
        let (right, more) = best_triangulation(&polygon[apex..])?;
        triangles.extend(more);
        triangles.push([polygon[0] as u8, polygon[apex] as u8, polygon[n - 1] as u8]);
        Some((left + right + cost_left + cost_right, triangles))
    });
    candidates.reduce(|best, other| if other.0 < best.0 { other } else { best })
}

/// Squared length of a diagonal, zero for a side, `None` where it is forbidden.
fn diagonal_cost(e: usize, f: usize, is_side: bool) -> Option<f64> {
    if is_side {
        return Some(0.0);
    }
    let middle = |e: usize| {
        let (u, v) = ((e & 1) as f64, (e >> 1 & 1) as f64);
        [[0.5, u, v], [u, 0.5, v], [u, v, 0.5]][e / 4]
    };
    let (p, q) = (middle(e), middle(f));
    (!share_face(e, f)).then(|| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_patterns_have_loops_of_three_to_seven_and_a_safe_triangulation() {
        let mut counts = [0; 8];
        for pattern in 0..256 {
            let mut triangles = 0;
            for polygon in loops(pattern) {
                counts[polygon.len()] += 1;
                assert_eq!(triangulate(&polygon).unwrap().len(), polygon.len() - 2, "pattern {pattern}");
                triangles += polygon.len() - 2;
            }
            assert_eq!(TABLE.triangles(pattern).len(), triangles);
            let crossed = (0..8).flat_map(|c| [1, 2, 4].map(|d| (c, c ^ d))).filter(|(c, d)| c < d);
            let crossed = crossed.filter(|(c, d)| (pattern >> c ^ pattern >> d) & 1 == 1).count();
            assert_eq!(loops(pattern).iter().map(Vec::len).sum::<usize>(), crossed);
        }
        // Enumerated independently.
        assert_eq!(counts[3..], [144, 66, 72, 52, 24]);
    }

    #[test]
    fn cells_on_both_sides_of_a_face_draw_the_same_segments_in_opposite_directions() {
        // Face x = 1 of one cell is face x = 0 of the next.
        let (right, left) = (&FACES[1], &FACES[0]);
        for signs in 0..1usize << 12 {
            let near: usize = (0..8).map(|c| (signs >> ((c & 1) * 4 + (c >> 1)) & 1) << c).sum();
            let far: usize = (0..8).map(|c| (signs >> ((c & 1) * 4 + 4 + (c >> 1)) & 1) << c).sum();
            // Edges of the far cell's face, named as in the near cell: along y 4 + dx + 2dz, along z 8 + dx + 2dy.
            let mut reversed: Vec<_> = face_segments(left, far).iter().map(|[from, to]| [to + 1, from + 1]).collect();
            let mut segments = face_segments(right, near);
            segments.sort_unstable();
            reversed.sort_unstable();
            assert_eq!(segments, reversed);
        }
    }
}
