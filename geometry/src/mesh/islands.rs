//! Connected parts of a mesh.

use super::Mesh;
use super::half_edge::Sets;

/// The mesh without connected parts whose area is less than `share` of the whole; the largest part
/// always stays. Silhouettes that disagree by a pixel leave crumbs around thin places: they cost
/// charts and carry no texture. Also says how many parts went.
pub fn without_islands(mesh: &Mesh, share: f64) -> (Mesh, usize) {
    let mut parts = Sets::new(mesh.positions.len());
    for &[a, b, c] in &mesh.faces {
        parts.join(a, b);
        parts.join(b, c);
    }
    let mut area = vec![0.0; mesh.positions.len()];
    let part_of_face: Vec<u32> = mesh.faces.iter().map(|f| parts.find(f[0])).collect();
    for (face, &part) in part_of_face.iter().enumerate() {
        area[part as usize] += mesh.face_area_vector(face).norm();
    }
    let largest = area.iter().copied().fold(0.0, f64::max);
    let bound = (share * area.iter().sum::<f64>()).min(largest);
    let is_kept = |part: u32| area[part as usize] >= bound;
    let gone = (0..mesh.positions.len()).filter(|&p| area[p] > 0.0 && area[p] < bound).count();
    let faces = mesh.faces.iter().zip(&part_of_face).filter(|&(_, &part)| is_kept(part)).map(|(f, _)| *f);
    (compacted(mesh, faces.collect()), gone)
}

/// `faces` of `mesh` with only the vertices they use, in their order.
fn compacted(mesh: &Mesh, mut faces: Vec<[u32; 3]>) -> Mesh {
    let mut number = vec![u32::MAX; mesh.positions.len()];
    faces.iter().flatten().for_each(|&v| number[v as usize] = 0);
    let mut positions = Vec::new();
    for (v, slot) in number.iter_mut().enumerate().filter(|(_, slot)| **slot == 0) {
        *slot = positions.len() as u32;
        positions.push(mesh.positions[v]);
    }
    faces.iter_mut().flatten().for_each(|v| *v = number[*v as usize]);
    Mesh { positions, faces }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn crumbs_go_and_the_object_stays() {
        let tetrahedron = |at: f64, size: f64| {
            let p = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            p.map(|q| Point3::new(at + size * q[0], size * q[1], size * q[2]))
        };
        let faces = |first: u32| [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|f: [u32; 3]| f.map(|v| v + first));
        let positions = [tetrahedron(5.0, 0.01), tetrahedron(0.0, 1.0)].concat();
        let mesh = Mesh { positions, faces: [faces(0), faces(4)].concat() };
        let (kept, gone) = without_islands(&mesh, 0.01);
        assert_eq!((kept.faces.len(), kept.positions.len(), gone), (4, 4, 1));
        assert_eq!(kept.positions[0], Point3::origin());
        assert_eq!(without_islands(&kept, 10.0).1, 0, "the largest part stays whatever the share");
    }
}
