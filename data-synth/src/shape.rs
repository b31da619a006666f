//! Building closed meshes from loops of vertices.
//!
//! A loop is a cycle of vertex indices, counter-clockwise seen from outside (from above, for loops
//! around the z axis). Faces between loops share their vertices, so what is built from one loop to
//! the next and capped at both ends is one closed manifold.

use geometry::Mesh;
use nalgebra::{Point3, Vector3};

/// A mesh under construction with a part number per face.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshBuilder {
    /// What has been built.
    pub(crate) mesh: Mesh,
    /// The part each face belongs to.
    pub(crate) parts: Vec<u8>,
    /// The part of the faces to come.
    pub(crate) part: u8,
}

impl MeshBuilder {
    /// Adds vertices; positions are rounded to single precision, so that what is traced and what is
    /// written to disk are the same surface.
    pub(crate) fn ring(&mut self, points: impl IntoIterator<Item = [f64; 3]>) -> Vec<u32> {
        let first = self.mesh.positions.len() as u32;
        let rounded = points.into_iter().map(|p| Point3::from(p.map(|c| f64::from(c as f32))));
        self.mesh.positions.extend(rounded);
        (first..self.mesh.positions.len() as u32).collect()
    }

    /// The four corners of a rectangle around the z axis.
    pub(crate) fn rectangle(&mut self, half: [f64; 2], z: f64) -> Vec<u32> {
        let [x, y] = half;
        self.ring([[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]])
    }

    /// Adds one triangle.
    pub(crate) fn face(&mut self, face: [u32; 3]) {
        self.mesh.faces.push(face);
        self.parts.push(self.part);
    }

    /// A band of quads from loop `a` to loop `b` of the same length, `b` above `a`, facing outward.
    pub(crate) fn walls(&mut self, a: &[u32], b: &[u32]) {
        for i in 0..a.len().min(b.len()) {
            let j = (i + 1) % a.len();
            self.face([a[i], a[j], b[j]]);
            self.face([a[i], b[j], b[i]]);
        }
    }

    /// Walls through all `loops` in turn.
    pub(crate) fn loft(&mut self, loops: &[Vec<u32>]) {
        for pair in loops.windows(2) {
            self.walls(&pair[0], &pair[1]);
        }
    }

    /// Closes a convex loop.
    pub(crate) fn cap(&mut self, ring: &[u32]) {
        for i in 1..ring.len().saturating_sub(1) {
            self.face([ring[0], ring[i], ring[i + 1]]);
        }
    }

    /// Closes a convex loop facing the other way.
    pub(crate) fn cap_reversed(&mut self, ring: &[u32]) {
        for i in 1..ring.len().saturating_sub(1) {
            self.face([ring[0], ring[i + 1], ring[i]]);
        }
    }

    /// Fills between an outer and an inner convex loop in one plane, seen counter-clockwise.
    /// Of the two ways to go on, the one with the shorter diagonal is taken.
    pub(crate) fn annulus(&mut self, outer: &[u32], inner: &[u32]) {
        self.bridge(outer, inner, false);
    }

    /// [`MeshBuilder::annulus`] facing the other way.
    pub(crate) fn annulus_reversed(&mut self, outer: &[u32], inner: &[u32]) {
        self.bridge(outer, inner, true);
    }

    fn bridge(&mut self, outer: &[u32], inner: &[u32], reversed: bool) {
        let (n, m) = (outer.len(), inner.len());
        let Some((start_o, start_i)) = self.closest(outer, inner) else { return };
        let at_outer = |k: usize| outer[(start_o + k) % n];
        let at_inner = |k: usize| inner[(start_i + k) % m];
        let (mut o, mut i) = (0, 0);
        while o < n || i < m {
            let next_outer = self.distance(at_outer(o + 1), at_inner(i));
            let next_inner = self.distance(at_outer(o), at_inner(i + 1));
            let take_outer = i >= m || (o < n && next_outer < next_inner);
            let face = if take_outer {
                o += 1;
                [at_outer(o - 1), at_outer(o), at_inner(i)]
            } else {
                i += 1;
                [at_outer(o), at_inner(i), at_inner(i - 1)]
            };
            self.face(if reversed { [face[0], face[2], face[1]] } else { face });
        }
    }

    fn closest(&self, outer: &[u32], inner: &[u32]) -> Option<(usize, usize)> {
        let pairs = (0..outer.len()).flat_map(|o| (0..inner.len()).map(move |i| (o, i)));
        pairs.min_by(|a, b| self.distance(outer[a.0], inner[a.1]).total_cmp(&self.distance(outer[b.0], inner[b.1])))
    }

    fn distance(&self, a: u32, b: u32) -> f64 {
        nalgebra::distance(&self.mesh.positions[a as usize], &self.mesh.positions[b as usize])
    }
}

/// Shading normals at the corners of every face: the area-weighted mean of the faces around the
/// vertex that turn away by less than `crease_rad`.
pub(crate) fn corner_normals(mesh: &Mesh, crease_rad: f64) -> Vec<[Vector3<f32>; 3]> {
    let mut around = vec![Vec::new(); mesh.positions.len()];
    for (f, corners) in mesh.faces.iter().enumerate() {
        corners.iter().for_each(|&v| around[v as usize].push(f));
    }
    let area: Vec<_> = (0..mesh.faces.len()).map(|f| mesh.face_area_vector(f)).collect();
    let unit: Vec<_> = area.iter().map(|a| a.try_normalize(0.0).unwrap_or_default()).collect();
    let limit = crease_rad.cos();
    let normal = |f: usize, v: u32| {
        let near = around[v as usize].iter().filter(|&&g| unit[g].dot(&unit[f]) >= limit);
        near.map(|&g| area[g]).sum::<Vector3<f64>>().try_normalize(0.0).unwrap_or(unit[f]).cast()
    };
    mesh.faces.iter().enumerate().map(|(f, corners)| corners.map(|v| normal(f, v))).collect()
}

/// A sphere around the origin from `n` rings of `2 n` points: for tests with closed forms.
#[cfg(test)]
pub(crate) fn sphere(radius: f64, n: usize) -> Mesh {
    let mut b = MeshBuilder::default();
    let circle = |k: usize| {
        let (s, c) = (std::f64::consts::PI * k as f64 / n as f64).sin_cos();
        (0..2 * n).map(move |i| {
            let (sp, cp) = (std::f64::consts::PI * i as f64 / n as f64).sin_cos();
            [radius * s * cp, radius * s * sp, -radius * c]
        })
    };
    let rings: Vec<_> = (1..n).map(|k| b.ring(circle(k))).collect();
    let poles = b.ring([[0.0, 0.0, -radius], [0.0, 0.0, radius]]);
    b.loft(&rings);
    for i in 0..2 * n {
        let j = (i + 1) % (2 * n);
        b.face([poles[0], rings[0][j], rings[0][i]]);
        b.face([poles[1], rings[n - 2][i], rings[n - 2][j]]);
    }
    b.mesh
}

/// Whether every edge belongs to exactly two faces that run along it in opposite directions.
#[cfg(test)]
pub(crate) fn is_closed(mesh: &Mesh) -> bool {
    let mut edges = std::collections::BTreeMap::new();
    for &[a, b, c] in &mesh.faces {
        for e in [(a, b), (b, c), (c, a)] {
            *edges.entry(e).or_insert(0) += 1;
        }
    }
    let good = |(&(a, b), &n): (&(u32, u32), &i32)| n == 1 && edges.get(&(b, a)) == Some(&1);
    for e in edges.iter().filter(|&e| !good(e)).take(6) {
        eprintln!("bad edge at {:?}", mesh.positions[e.0.0 as usize]);
    }
    edges.iter().all(good)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_annulus_covers_the_difference_of_areas_once() {
        let mut b = MeshBuilder::default();
        let outer = b.rectangle([2.0, 3.0], 0.0);
        let circle = |i| {
            let (s, c) = (std::f64::consts::TAU * f64::from(i) / 48.0).sin_cos();
            [1.5 * c, 1.5 * s, 0.0]
        };
        let inner = b.ring((0..48).map(circle));
        b.annulus(&outer, &inner);
        let areas: Vec<f64> = (0..b.mesh.faces.len()).map(|f| b.mesh.face_area_vector(f).z / 2.0).collect();
        let expected = 24.0 - 0.5 * 48.0 * 2.25 * (std::f64::consts::TAU / 48.0).sin();
        assert!(areas.iter().all(|&a| a > 0.0));
        assert!((areas.iter().sum::<f64>() - expected).abs() < 1e-5);
    }

    #[test]
    fn the_sphere_is_closed_and_faces_outward() {
        let mesh = sphere(1.0, 48);
        assert!(is_closed(&mesh));
        assert!((mesh.signed_volume() / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
    }
}
