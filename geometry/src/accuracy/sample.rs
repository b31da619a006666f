//! Points spread evenly over a surface.

use crate::Mesh;
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// One point at random in each of `count` equal shares of the area, in the order of the faces. Faces without
/// area get none; a mesh without area has no points.
pub(super) fn sample_surface(mesh: &Mesh, count: usize, seed: u64) -> Vec<Point3<f64>> {
    let mut area = 0.0;
    let up_to: Vec<f64> = (0..mesh.faces.len())
        .map(|face| {
            area += mesh.face_area_vector(face).norm();
            area
        })
        .collect();
    if area <= 0.0 {
        return Vec::new();
    }
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut face = 0;
    let point = |i: usize| {
        let at = (i as f64 + rng.random::<f64>()) / count as f64 * area;
        while face + 1 < up_to.len() && up_to[face] <= at {
            face += 1;
        }
        let [a, b, c] = mesh.corners(face);
        // Uniform on the triangle: the root turns the square of the distance from `a` into a share of area.
        let root = rng.random::<f64>().sqrt();
        let v = rng.random::<f64>();
        a + (b - a) * (root * (1.0 - v)) + (c - a) * (root * v)
    };
    (0..count).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle of area 3, one without area, one of area 1 in the plane z = 1.
    fn uneven() -> Mesh {
        let positions = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.0], [2.0, 0.0, 1.0]];
        let mut positions = positions.map(Point3::from).to_vec();
        positions.push(Point3::new(0.0, 1.0, 1.0));
        Mesh { positions, faces: vec![[0, 1, 2], [0, 0, 1], [3, 4, 5]] }
    }

    #[test]
    fn every_area_gets_its_share() {
        let points = sample_surface(&uneven(), 4000, 7);
        assert_eq!(points.iter().filter(|p| p.z == 0.0).count(), 3000);
        let large = points.iter().filter(|p| p.z == 0.0).map(|p| p.coords);
        let mean = large.sum::<nalgebra::Vector3<f64>>() / 3000.0;
        assert!((mean.x - 2.0 / 3.0).abs() < 0.03 && (mean.y - 1.0).abs() < 0.05, "{mean}: the centroid");
        assert!(points.iter().all(|p| p.x >= 0.0 && p.y >= 0.0));
    }

    #[test]
    fn the_seed_decides_where() {
        assert_eq!(sample_surface(&uneven(), 50, 1), sample_surface(&uneven(), 50, 1));
        assert_ne!(sample_surface(&uneven(), 50, 1), sample_surface(&uneven(), 50, 2));
        assert!(sample_surface(&Mesh::default(), 50, 1).is_empty());
    }
}
