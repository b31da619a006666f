//! Whether a mesh is what later steps rely on: closed, oriented, manifold.

use super::Mesh;
use crate::GeometryError;

/// What is found in a mesh. Counts refer to vertices that some face uses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MeshCheck {
    /// Vertices that some face uses.
    pub vertices: usize,
    /// Vertices that no face uses.
    pub isolated_vertices: usize,
    /// Faces.
    pub triangles: usize,
    /// Parts connected by shared vertices.
    pub components: usize,
    /// Vertices − edges + faces: 2 for every sphere, 0 for every torus.
    pub euler: i64,
    /// Edges of one face only.
    pub boundary_edges: usize,
    /// Edges of more than two faces.
    pub nonmanifold_edges: usize,
    /// Edges that two faces run through in the same direction.
    pub inconsistent_edges: usize,
    /// Vertices whose faces do not form one fan.
    pub nonmanifold_vertices: usize,
    /// Faces with a repeated vertex, or without area (below 1e-12 of the squared diagonal of the box).
    pub degenerate_faces: usize,
    /// Faces that repeat another one's three vertices.
    pub duplicate_faces: usize,
    /// Whether the mesh is a closed, consistently oriented 2-manifold with at least one face.
    /// Thin faces do not count against it.
    pub closed_manifold: bool,
    /// Signed volume; that of the enclosed solid where `closed_manifold` holds.
    pub volume: f64,
}

impl Mesh {
    /// Checks connectivity and orientation. Sorting dominates: `O(n log n)`.
    ///
    /// # Errors
    /// A face refers to a vertex that is not there, or a position is not finite.
    pub fn check(&self) -> Result<MeshCheck, GeometryError> {
        self.check_input()?;
        let edges = EdgeCounts::of(self);
        let links = vertex_links(self);
        let used = links.starts.windows(2).filter(|w| w[1] > w[0]).count();
        let repeated = self.faces.iter().filter(|f| has_repeated_vertex(f)).count();
        let nonmanifold_vertices =
            (0..self.positions.len()).filter(|&v| !is_one_fan(links.of(v), &mut Vec::new())).count();
        let [boundary_edges, nonmanifold_edges, inconsistent_edges] =
            [edges.boundary, edges.nonmanifold, edges.inconsistent];
        let faults = boundary_edges + nonmanifold_edges + inconsistent_edges + nonmanifold_vertices + repeated;
        Ok(MeshCheck {
            vertices: used,
            isolated_vertices: self.positions.len() - used,
            triangles: self.faces.len(),
            components: self.components().1,
            euler: used as i64 - edges.all as i64 + self.faces.len() as i64,
            boundary_edges,
            nonmanifold_edges,
            inconsistent_edges,
            nonmanifold_vertices,
            degenerate_faces: self.degenerate_faces(),
            duplicate_faces: self.duplicate_faces(),
            closed_manifold: faults == 0 && !self.faces.is_empty(),
            volume: self.signed_volume(),
        })
    }

    /// # Errors
    /// A face refers to a vertex that is not there, or a position is not finite.
    pub fn check_input(&self) -> Result<(), GeometryError> {
        let n = self.positions.len();
        if let Some(v) = self.positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            let fault = format!("vertex {v} is not finite");
            return Err(GeometryError::Mesh { fault, remedy: "write finite coordinates" });
        }
        if let Some(f) = self.faces.iter().position(|f| f.iter().any(|&v| v as usize >= n)) {
            let fault = format!("face {f} refers to vertex {} of {n}", self.faces[f].iter().max().unwrap_or(&0));
            return Err(GeometryError::Mesh { fault, remedy: "indices count from 0 in memory; check the file" });
        }
        Ok(())
    }

    /// The part of each face, numbered by first appearance, and the number of parts. Parts are connected
    /// by shared vertices. Indices must be in range.
    pub fn components(&self) -> (Vec<u32>, usize) {
        let mut parents: Vec<u32> = (0..self.positions.len() as u32).collect();
        for &[a, b, c] in &self.faces {
            union(&mut parents, a, b);
            union(&mut parents, b, c);
        }
        let mut names = vec![u32::MAX; self.positions.len()];
        let mut count = 0;
        let name = |face: &[u32; 3]| {
            let name = &mut names[find(&mut parents, face[0]) as usize];
            if *name == u32::MAX {
                *name = count;
                count += 1;
            }
            *name
        };
        let parts = self.faces.iter().map(name).collect();
        (parts, count as usize)
    }

    /// Removes parts (connected by shared vertices) whose signed volume is below `fraction` of the sum of
    /// all absolute ones, small cavities too, and says how many. Order is kept; vertices no face uses go.
    /// Indices must be in range.
    pub fn remove_small_parts(&mut self, fraction: f64) -> usize {
        let (parts, count) = self.components();
        let mut volumes = vec![0.0; count];
        for (face, &part) in parts.iter().enumerate() {
            let [a, b, c] = self.corners(face);
            volumes[part as usize] += a.coords.dot(&b.coords.cross(&c.coords)) / 6.0;
        }
        let least = fraction * volumes.iter().map(|v: &f64| v.abs()).sum::<f64>();
        let is_kept: Vec<bool> = volumes.iter().map(|v| v.abs() >= least).collect();
        let removed = is_kept.iter().filter(|kept| !**kept).count();
        if removed > 0 {
            let mut part_of = parts.iter();
            self.faces.retain(|_| part_of.next().is_some_and(|&part| is_kept[part as usize]));
            self.remove_isolated_vertices();
        }
        removed
    }

    fn remove_isolated_vertices(&mut self) {
        let mut names = vec![u32::MAX; self.positions.len()];
        self.faces.iter().flatten().for_each(|&v| names[v as usize] = 0);
        (0u32..).zip(names.iter_mut().filter(|name| **name == 0)).for_each(|(kept, name)| *name = kept);
        let mut name_of = names.iter();
        self.positions.retain(|_| name_of.next().is_some_and(|&name| name != u32::MAX));
        self.faces.iter_mut().flatten().for_each(|v| *v = names[*v as usize]);
    }

    fn degenerate_faces(&self) -> usize {
        let smallest = self.aabb().map_or(0.0, |b| b.diagonal().powi(2)) * 1e-12;
        let is_degenerate =
            |f: &usize| has_repeated_vertex(&self.faces[*f]) || 0.5 * self.face_area_vector(*f).norm() <= smallest;
        (0..self.faces.len()).filter(is_degenerate).count()
    }

    fn duplicate_faces(&self) -> usize {
        let mut keys: Vec<[u32; 3]> = self.faces.iter().map(sorted).collect();
        keys.sort_unstable();
        keys.windows(2).filter(|w| w[0] == w[1]).count()
    }
}

fn sorted(face: &[u32; 3]) -> [u32; 3] {
    let mut key = *face;
    key.sort_unstable();
    key
}

fn has_repeated_vertex(&[a, b, c]: &[u32; 3]) -> bool {
    a == b || b == c || c == a
}

fn find(parents: &mut [u32], mut v: u32) -> u32 {
    while parents[v as usize] != v {
        parents[v as usize] = parents[parents[v as usize] as usize];
        v = parents[v as usize];
    }
    v
}

fn union(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

struct EdgeCounts {
    all: usize,
    boundary: usize,
    nonmanifold: usize,
    inconsistent: usize,
}

impl EdgeCounts {
    fn of(mesh: &Mesh) -> Self {
        // Low vertex, high vertex, and whether the face runs from high to low.
        let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * mesh.faces.len());
        for &[a, b, c] in &mesh.faces {
            let pairs = [(a, b), (b, c), (c, a)].into_iter().filter(|(p, q)| p != q);
            edges.extend(pairs.map(|(p, q)| (p.min(q), p.max(q), p > q)));
        }
        edges.sort_unstable();
        let mut counts = Self { all: 0, boundary: 0, nonmanifold: 0, inconsistent: 0 };
        for edge in edges.chunk_by(|e, f| (e.0, e.1) == (f.0, f.1)) {
            counts.all += 1;
            match edge {
                [_] => counts.boundary += 1,
                [e, f] => counts.inconsistent += usize::from(e.2 == f.2),
                _ => counts.nonmanifold += 1,
            }
        }
        counts
    }
}

/// For each vertex the opposite edges of its faces.
struct Links {
    starts: Vec<usize>,
    edges: Vec<[u32; 2]>,
}

impl Links {
    fn of(&self, vertex: usize) -> &[[u32; 2]] {
        &self.edges[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

fn vertex_links(mesh: &Mesh) -> Links {
    let n = mesh.positions.len();
    let mut starts = vec![0; n + 1];
    mesh.faces.iter().flatten().for_each(|&v| starts[v as usize + 1] += 1);
    (0..n).for_each(|v| starts[v + 1] += starts[v]);
    let mut next = starts.clone();
    let mut edges = vec![[0; 2]; starts[n]];
    for &[a, b, c] in &mesh.faces {
        for (v, edge) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            edges[next[v as usize]] = edge;
            next[v as usize] += 1;
        }
    }
    Links { starts, edges }
}

/// Whether the link of a vertex is connected and no vertex of it has more than two link edges: one
/// cycle, or one chain at a boundary.
fn is_one_fan(link: &[[u32; 2]], scratch: &mut Vec<u32>) -> bool {
    if link.is_empty() {
        return true;
    }
    scratch.clear();
    scratch.extend(link.iter().flatten());
    scratch.sort_unstable();
    if scratch.chunk_by(|a, b| a == b).any(|same| same.len() > 2) {
        return false;
    }
    scratch.dedup();
    let local = |v: u32| scratch.binary_search(&v).unwrap_or(0) as u32;
    let mut parents: Vec<u32> = (0..scratch.len() as u32).collect();
    link.iter().for_each(|&[a, b]| union(&mut parents, local(a), local(b)));
    (0..scratch.len() as u32).all(|v| find(&mut parents, v) == find(&mut parents, 0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};

    fn tetrahedron() -> Mesh {
        let positions =
            vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0), Point3::new(0.0, 0.0, 1.0)];
        Mesh { positions, faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
    }

    #[test]
    fn tetrahedron_is_a_closed_manifold() {
        let check = tetrahedron().check().unwrap();
        assert!(check.closed_manifold);
        assert_eq!((check.vertices, check.triangles, check.components, check.euler), (4, 4, 1, 2));
        assert!((check.volume - 1.0 / 6.0).abs() < 1e-15);
    }

    #[test]
    fn a_missing_face_is_a_boundary_of_three_edges() {
        let mut mesh = tetrahedron();
        mesh.faces.pop();
        let check = mesh.check().unwrap();
        assert!(!check.closed_manifold);
        assert_eq!((check.boundary_edges, check.nonmanifold_vertices, check.euler), (3, 0, 1));
    }

    #[test]
    fn a_turned_face_and_a_repeated_face_are_counted() {
        let mut mesh = tetrahedron();
        mesh.faces[0].swap(0, 1);
        let check = mesh.check().unwrap();
        assert_eq!((check.inconsistent_edges, check.closed_manifold), (3, false));
        let mut mesh = tetrahedron();
        mesh.faces.push([2, 1, 0]);
        let check = mesh.check().unwrap();
        assert_eq!((check.duplicate_faces, check.nonmanifold_edges), (1, 3));
    }

    #[test]
    fn two_tetrahedra_at_one_vertex_are_not_manifold_there() {
        let mut mesh = tetrahedron();
        mesh.positions.extend(tetrahedron().positions[1..].iter().map(|p| Point3::from(-p.coords)));
        let other = |v: u32| if v == 0 { 0 } else { v + 3 };
        mesh.faces.extend(tetrahedron().faces.iter().map(|f| [other(f[0]), other(f[2]), other(f[1])]));
        let check = mesh.check().unwrap();
        assert_eq!((check.nonmanifold_vertices, check.components, check.nonmanifold_edges), (1, 1, 0));
        assert!(!check.closed_manifold);
    }

    #[test]
    fn degenerate_faces_and_isolated_vertices_are_counted() {
        let mut mesh = tetrahedron();
        mesh.positions.push(Point3::new(0.5, 0.0, 0.0));
        mesh.faces.push([0, 4, 1]);
        mesh.faces.push([2, 2, 3]);
        mesh.positions.push(Point3::new(9.0, 9.0, 9.0));
        let check = mesh.check().unwrap();
        assert_eq!((check.degenerate_faces, check.isolated_vertices, check.closed_manifold), (2, 1, false));
    }

    #[test]
    fn small_parts_go_and_indices_stay_right() {
        let mut mesh = Mesh::default();
        for (scale, shift) in [(0.01, 5.0), (1.0, 0.0), (0.5, 9.0)] {
            let first = mesh.positions.len() as u32;
            mesh.positions.extend(tetrahedron().positions.iter().map(|p| p * scale + Vector3::repeat(shift)));
            mesh.faces.extend(tetrahedron().faces.iter().map(|f| f.map(|v| v + first)));
        }
        assert_eq!(mesh.remove_small_parts(1e-4), 1);
        let check = mesh.check().unwrap();
        assert!(check.closed_manifold && check.components == 2 && check.isolated_vertices == 0);
        assert!((check.volume - 1.125 / 6.0).abs() < 1e-12);
        assert_eq!(mesh.remove_small_parts(0.0), 0);
    }

    #[test]
    fn impossible_input_is_an_error() {
        let mut mesh = tetrahedron();
        mesh.faces.push([0, 1, 9]);
        assert!(mesh.check().unwrap_err().to_string().contains("face 4 refers to vertex 9 of 4"));
        let mut mesh = tetrahedron();
        mesh.positions[2].y = f64::NAN;
        assert!(mesh.check().unwrap_err().to_string().contains("vertex 2"));
        let empty = Mesh::default().check().unwrap();
        assert!(!empty.closed_manifold && empty.components == 0);
    }
}
