//! The mesh whose vertices are split where charts part.

use super::clean::Clean;
use super::place::Placed;
use crate::mesh::{Mesh, TexturedMesh};
use crate::param::FlatChart;
use nalgebra::Point2;

/// Faces in input order, vertices chart by chart; also per vertex the input's.
pub(super) fn assemble(input: &Mesh, clean: &Clean, charts: &[FlatChart], placed: &Placed) -> (TexturedMesh, Vec<u32>) {
    let [width, height] = placed.size.map(|s| s as f64);
    let mut faces = vec![[0; 3]; clean.kept.len()];
    let mut face_charts = vec![0; clean.kept.len()];
    let (mut sources, mut uvs) = (Vec::new(), Vec::new());
    for ((chart, texels), number) in charts.iter().zip(&placed.texels).zip(0_u32..) {
        let base = sources.len() as u32;
        for (&face, corners) in chart.patch.faces.iter().zip(&chart.patch.corners) {
            faces[face as usize] = corners.map(|v| base + v);
            face_charts[face as usize] = number;
        }
        sources.extend(&chart.patch.sources);
        uvs.extend(texels.iter().map(|t| Point2::new(t.x / width, t.y / height)));
    }
    let positions = sources.iter().map(|&v| input.positions[v as usize]).collect();
    (TexturedMesh { mesh: Mesh { positions, faces }, uvs, face_charts, atlas_size: placed.size }, sources)
}
