//! What a mesh, a model or a capture holds.

use crate::Error;
use capture::doctor::CaptureCheck;
use capture::{Aabb, View};
use geometry::depth::silhouette_iou;
use geometry::{GeometryError, Mesh};
use rayon::prelude::*;
use serde::Serialize;
use texture::{Appearance, MaterialLayer, Model};

/// A box, corner by corner.
pub type Corners = [[f64; 3]; 2];

/// What a mesh holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshFacts {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Parts connected by shared vertices.
    pub components: usize,
    /// Vertices − edges + faces.
    pub euler: i64,
    /// Whether it is a closed, consistently oriented 2-manifold.
    pub closed_manifold: bool,
    /// Signed volume in cubic world units.
    pub volume: f64,
    /// Its box; `None` of an empty mesh.
    pub aabb: Option<Corners>,
}

/// What a model holds.
#[derive(Clone, Debug, Serialize)]
pub struct ModelFacts {
    /// Its mesh, as one surface: vertices that the atlas splits count once.
    #[serde(flatten)]
    pub mesh: MeshFacts,
    /// The appearance it carries.
    pub method: &'static str,
    /// Facets with a basis of their own; none of a lumigraph.
    pub facets: usize,
    /// Layers of each facet.
    pub ranks: Vec<usize>,
    /// Width and height of the atlas in texels.
    pub atlas: [usize; 2],
    /// Charts of the atlas, which materials are laid on.
    pub charts: usize,
    /// Materials in place of the appearance.
    pub materials: Vec<MaterialFacts>,
    /// Bytes, part by part.
    pub bytes: PartBytes,
}

/// What a material of a model holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaterialFacts {
    /// What was measured.
    pub name: String,
    /// The codec.
    pub codec: &'static str,
    /// The charts it lies on.
    pub charts: Vec<u32>,
    /// World units across a repetition.
    pub tile_size: f64,
    /// As stored.
    pub bytes: u64,
}

/// Bytes of a model file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PartBytes {
    /// The whole file.
    pub file: u64,
    /// Layers, weights and directions, as stored.
    pub appearance: u64,
    /// Materials, as stored.
    pub materials: u64,
    /// Mesh, preview and description.
    pub rest: u64,
    /// The appearance as raw 8-bit layers; not in the file.
    pub appearance_raw: u64,
}

/// What a mesh holds.
///
/// # Errors
/// Where a face refers to a vertex that is not there, or a position is not finite.
pub fn mesh_facts(mesh: &Mesh) -> Result<MeshFacts, GeometryError> {
    let check = mesh.check()?;
    Ok(MeshFacts {
        vertices: check.vertices,
        triangles: check.triangles,
        components: check.components,
        euler: check.euler,
        closed_manifold: check.closed_manifold,
        volume: check.volume,
        aabb: mesh.aabb().map(corners),
    })
}

/// What a model holds.
///
/// # Errors
/// Where the mesh is broken.
pub fn model_facts(model: &Model) -> Result<ModelFacts, Error> {
    let bytes = model.bytes()?;
    let ranks: Vec<usize> = match &model.appearance {
        Appearance::Layers(layers) => layers.facets.iter().map(|facet| facet.rank).collect(),
        Appearance::Lumigraph(..) => Vec::new(),
    };
    Ok(ModelFacts {
        mesh: mesh_facts(&welded(&model.mesh.mesh))?,
        method: model.method.name(),
        facets: ranks.len(),
        ranks,
        atlas: model.mesh.atlas_size,
        charts: model.mesh.face_charts.iter().max().map_or(0, |&chart| chart as usize + 1),
        materials: model.materials.iter().map(material_facts).collect(),
        bytes: PartBytes {
            file: bytes.file,
            appearance: bytes.appearance,
            materials: bytes.materials,
            rest: bytes.file.saturating_sub(bytes.appearance + bytes.materials),
            appearance_raw: bytes.appearance_raw,
        },
    })
}

fn material_facts(layer: &MaterialLayer) -> MaterialFacts {
    MaterialFacts {
        name: layer.material.name.clone(),
        codec: layer.material.codec.kind().name(),
        charts: layer.charts.clone(),
        tile_size: layer.tile_size,
        bytes: layer.coded.len() as u64,
    }
}

/// How well a mesh fits each silhouette.
pub fn silhouette_ious(mesh: &Mesh, views: &[View]) -> Vec<f64> {
    views.par_iter().map(|view| silhouette_iou(mesh, view)).collect()
}

/// The same surface with vertices at one place joined.
fn welded(mesh: &Mesh) -> Mesh {
    let key = |v: u32| mesh.positions[v as usize].coords.map(f64::to_bits);
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    order.sort_by(|&a, &b| key(a).iter().cmp(key(b).iter()).then(a.cmp(&b)));
    let mut first: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for pair in order.windows(2).filter(|pair| key(pair[0]) == key(pair[1])) {
        first[pair[1] as usize] = first[pair[0] as usize];
    }
    Mesh { positions: mesh.positions.clone(), faces: mesh.faces.iter().map(|f| f.map(|v| first[v as usize])).collect() }
}

fn corners(aabb: Aabb) -> Corners {
    [aabb.min.into(), aabb.max.into()]
}

/// What a capture holds, in words.
pub fn capture_text(format: &str, check: &CaptureCheck) -> String {
    let mut lines = vec![
        format!("{format}: {} views, the first of {} × {} pixels", check.frames, check.width, check.height),
        check.mask_source.to_string(),
        format!("cameras: {:?}, {:.1}° apart", check.layout.kind, check.layout.step_deg).to_lowercase(),
    ];
    if let Some([min, max]) = check.aabb {
        let source = if check.aabb_is_given { "given" } else { "from the silhouettes" };
        lines.push(format!("box ({source}): {min:.4?} to {max:.4?}"));
    }
    let leaving: Vec<usize> = check.views.iter().filter(|view| !view.is_complete).map(|view| view.index).collect();
    if !leaving.is_empty() {
        lines.push(format!("the object leaves the frame in views {leaving:?}"));
    }
    lines.push(format!("silhouettes agree with a coarse hull of them to {:.3} (IoU)", check.silhouette_iou));
    if let Some(off) = check.outline_offset_px {
        lines.push(match off {
            0 => "their outlines lie on the edges in the pictures".to_owned(),
            1.. => format!("their outlines lie {off} pixels outside of the edges in the pictures"),
            _ => format!("their outlines lie {} pixels inside of the edges in the pictures", -off),
        });
    }
    match check.findings.as_slice() {
        [] => lines.push("nothing looks wrong".to_owned()),
        findings => lines.extend(findings.iter().map(|finding| format!("warning: {finding}"))),
    }
    lines.join("\n")
}

impl MeshFacts {
    /// In words.
    pub fn text(&self) -> String {
        let closed = if self.closed_manifold { "closed manifold" } else { "not a closed manifold" };
        let mut text = format!(
            "mesh: {} vertices, {} triangles, {} components, Euler number {}, {closed}, volume {:.6}",
            self.vertices, self.triangles, self.components, self.euler, self.volume
        );
        if let Some([min, max]) = self.aabb {
            text.push_str(&format!("\nbox: {min:.4?} to {max:.4?}"));
        }
        text
    }
}

impl ModelFacts {
    /// In words.
    pub fn text(&self) -> String {
        let [width, height] = self.atlas;
        let mean_rank = self.ranks.iter().sum::<usize>() as f64 / self.ranks.len().max(1) as f64;
        let materials = self
            .materials
            .iter()
            .map(|m| format!("\nmaterial {} ({}, {} bytes) on {} charts", m.name, m.codec, m.bytes, m.charts.len()));
        format!(
            "{}\n{}: {} facets of {mean_rank:.1} layers in the mean, atlas {width} × {height}, {} charts{}\n\
             {} bytes: appearance {} (raw {}), mesh and preview {}",
            self.mesh.text(),
            self.method,
            self.facets,
            self.charts,
            materials.collect::<String>(),
            self.bytes.file,
            self.bytes.appearance,
            self.bytes.appearance_raw,
            self.bytes.rest
        )
    }
}
