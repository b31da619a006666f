//! Binary glTF 2.0. All triangles of the default scene, in world space; external files are not
//! followed. Accessors are decoded here, with every bound checked: the readers of the `gltf` crate
//! trust theirs.

use super::{EXPORT_AGAIN, Fault, Parsed, fault};
use crate::mesh::Mesh;
use gltf::accessor::{DataType, Dimensions};
use gltf_json as json;
use json::validation::{Checked, USize64};
use nalgebra::{Matrix4, Point2, Point3};

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Fault> {
    if !bytes.starts_with(b"glTF") {
        return Err(fault("does not begin with `glTF`", "check that the file is a GLB file"));
    }
    // The reader of the `gltf` crate subtracts the header's 12 bytes from this length unchecked.
    if bytes.get(8..12).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes) < 12 {
        return Err(fault("has a header that is cut off or says so", EXPORT_AGAIN));
    }
    refuse_wild_positions(bytes)?;
    let file = gltf::Gltf::from_slice(bytes).map_err(|e| fault(format!("is not a GLB file: {e}"), EXPORT_AGAIN))?;
    let blob = file.blob.as_deref().unwrap_or_default();
    let mut reader = Reader { blob, parsed: Parsed { split: true, ..Parsed::default() }, uvs: true, visits: 0 };
    let scene = file.default_scene().or_else(|| file.scenes().next());
    // Every node has one parent at most: more visits than nodes mean a circle.
    let limit = file.nodes().len();
    for node in scene.iter().flat_map(gltf::Scene::nodes) {
        reader.node(&node, &Matrix4::identity(), limit)?;
    }
    if !reader.uvs {
        reader.parsed.corner_uvs.clear();
    }
    Ok(reader.parsed)
}

/// The validation of `gltf-json` (1.4.1) looks positions up before it has checked that they are there.
fn refuse_wild_positions(bytes: &[u8]) -> Result<(), Fault> {
    let no_file = |e: &dyn std::fmt::Display| fault(format!("is not a GLB file: {e}"), EXPORT_AGAIN);
    let glb = gltf::Glb::from_slice(bytes).map_err(|e| no_file(&e))?;
    let root = json::Root::from_slice(&glb.json).map_err(|e| no_file(&e))?;
    let attributes = root.meshes.iter().flat_map(|mesh| &mesh.primitives).flat_map(|p| p.attributes.values());
    match attributes.map(json::Index::value).find(|&index| index >= root.accessors.len()) {
        Some(index) => Err(fault(format!("accessor {index} is missing"), EXPORT_AGAIN)),
        None => Ok(()),
    }
}

struct Reader<'a> {
    blob: &'a [u8],
    parsed: Parsed,
    /// All primitives so far had UVs.
    uvs: bool,
    visits: usize,
}

impl Reader<'_> {
    fn node(&mut self, node: &gltf::Node<'_>, world_from_parent: &Matrix4<f64>, limit: usize) -> Result<(), Fault> {
        self.visits += 1;
        if self.visits > limit {
            return Err(fault(format!("node {} is its own ancestor", node.index()), EXPORT_AGAIN));
        }
        let columns = node.transform().matrix().map(|c| c.map(f64::from));
        let world_from_node = world_from_parent * Matrix4::from(columns);
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            self.primitive(&primitive, &world_from_node)?;
        }
        node.children().try_for_each(|child| self.node(&child, &world_from_node, limit))
    }

    fn primitive(&mut self, primitive: &gltf::Primitive<'_>, world_from_node: &Matrix4<f64>) -> Result<(), Fault> {
        if primitive.mode() != gltf::mesh::Mode::Triangles {
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.ok_or_else(|| fault("a primitive has no positions", EXPORT_AGAIN))?;
        let positions = self.numbers(&positions, Dimensions::Vec3)?;
        let base = self.parsed.positions.len() as u32;
        let world = |p: &[f64]| world_from_node.transform_point(&Point3::new(p[0], p[1], p[2]));
        self.parsed.positions.extend(positions.chunks_exact(3).map(world));
        let count = (positions.len() / 3) as u32;
        let indices = match primitive.indices() {
            Some(indices) => self.numbers(&indices, Dimensions::Scalar)?.into_iter().map(|i| i as u32).collect(),
            None => (0..count).collect::<Vec<_>>(),
        };
        if let Some(wild) = indices.iter().find(|&&i| i >= count) {
            return Err(fault(format!("an index is {wild}, of {count} vertices"), EXPORT_AGAIN));
        }
        let mirrored = world_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
        let faces = indices.as_chunks::<3>().0.iter().map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] });
        let faces: Vec<[u32; 3]> = faces.collect();
        self.parsed.faces.extend(faces.iter().map(|f| f.map(|v| base + v)));
        self.uvs_of(primitive, &faces)
    }

    fn uvs_of(&mut self, primitive: &gltf::Primitive<'_>, faces: &[[u32; 3]]) -> Result<(), Fault> {
        let Some(uvs) = primitive.get(&gltf::Semantic::TexCoords(0)) else {
            self.uvs = false;
            return Ok(());
        };
        let uvs = self.numbers(&uvs, Dimensions::Vec2)?;
        let uv = |v: u32| {
            let at = |i: usize| uvs.get(2 * v as usize + i).copied().unwrap_or(f64::NAN);
            Point2::new(at(0), at(1))
        };
        self.parsed.corner_uvs.extend(faces.iter().map(|f| f.map(uv)));
        Ok(())
    }

    /// All components of an accessor, normalised integers as fractions.
    fn numbers(&self, accessor: &gltf::Accessor<'_>, dimensions: Dimensions) -> Result<Vec<f64>, Fault> {
        let refuse = |what: &str| Err(fault(format!("accessor {} {what}", accessor.index()), EXPORT_AGAIN));
        if accessor.dimensions() != dimensions {
            return refuse("has the wrong type");
        }
        let (Some(view), None) = (accessor.view(), accessor.sparse()) else {
            return refuse("is sparse or empty, which is not read");
        };
        if !matches!(view.buffer().source(), gltf::buffer::Source::Bin) {
            return refuse("lies in another file, which is not followed");
        }
        let size = accessor.data_type().size() * dimensions.multiplicity();
        let stride = view.stride().unwrap_or(size).max(1);
        let bytes = view.offset().checked_add(view.length()).and_then(|end| self.blob.get(view.offset()..end));
        let bytes = bytes.and_then(|b| b.get(accessor.offset()..));
        let needed = accessor.count().checked_sub(1).and_then(|n| n.checked_mul(stride)?.checked_add(size));
        let Some(bytes) = bytes.filter(|b| needed.is_some_and(|n| n <= b.len())) else {
            return refuse("reaches beyond the end of the data");
        };
        let rows = (0..accessor.count()).map(|i| &bytes[i * stride..i * stride + size]);
        let scale = normal_scale(accessor);
        Ok(rows.flat_map(|row| components(row, accessor.data_type())).map(|x| x * scale).collect())
    }
}

fn normal_scale(accessor: &gltf::Accessor<'_>) -> f64 {
    match accessor.data_type() {
        DataType::U8 if accessor.normalized() => 1.0 / 255.0,
        DataType::U16 if accessor.normalized() => 1.0 / 65535.0,
        _ => 1.0,
    }
}

fn components(row: &[u8], data_type: DataType) -> Vec<f64> {
    let pairs = || row.as_chunks::<2>().0.iter();
    let quads = || row.as_chunks::<4>().0.iter();
    match data_type {
        DataType::I8 => row.iter().map(|&b| f64::from(b as i8)).collect(),
        DataType::U8 => row.iter().map(|&b| f64::from(b)).collect(),
        DataType::I16 => pairs().map(|&b| f64::from(i16::from_le_bytes(b))).collect(),
        DataType::U16 => pairs().map(|&b| f64::from(u16::from_le_bytes(b))).collect(),
        DataType::U32 => quads().map(|&b| f64::from(u32::from_le_bytes(b))).collect(),
        DataType::F32 => quads().map(|&b| f64::from(f32::from_le_bytes(b))).collect(),
    }
}

/// One mesh, one node, one scene; `f32`.
pub(super) fn to_bytes(mesh: &Mesh, uvs: Option<&[Point2<f64>]>) -> Result<Vec<u8>, Fault> {
    let mut root = json::Root {
        asset: json::Asset { generator: Some("turnlight".to_owned()), ..json::Asset::default() },
        ..json::Root::default()
    };
    let mut blob = Vec::new();
    let buffer = root.push(json::Buffer {
        byte_length: USize64(0),
        uri: None,
        name: None,
        extensions: None,
        extras: json::Extras::default(),
    });
    let positions = mesh.positions.iter().flat_map(|p| p.coords.data.0[0]).map(|x| x as f32);
    let positions: Vec<f32> = positions.collect();
    let float = |data: &[f32]| data.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut add =
        |root: &mut json::Root, bytes: Vec<u8>, layout| push_accessor(root, &mut blob, buffer, &bytes, layout);
    use json::accessor::{ComponentType, Type};
    let accessor = add(&mut root, float(&positions), (Type::Vec3, ComponentType::F32));
    bound(&mut root, accessor, &positions);
    let mut attributes = std::collections::BTreeMap::new();
    attributes.insert(Checked::Valid(gltf::Semantic::Positions), accessor);
    if let Some(uvs) = uvs {
        let uvs: Vec<f32> = uvs.iter().flat_map(|uv| [uv.x as f32, uv.y as f32]).collect();
        let accessor = add(&mut root, float(&uvs), (Type::Vec2, ComponentType::F32));
        attributes.insert(Checked::Valid(gltf::Semantic::TexCoords(0)), accessor);
    }
    let indices = mesh.faces.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let indices = add(&mut root, indices, (Type::Scalar, ComponentType::U32));
    push_scene(&mut root, attributes, indices);
    root.buffers[0].byte_length = USize64(blob.len() as u64);
    let json = json::serialize::to_vec(&root).map_err(|e| fault(e.to_string(), "report this as a bug"))?;
    let header = gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 };
    let glb = gltf::binary::Glb { header, json: json.into(), bin: Some(blob.into()) };
    glb.to_vec().map_err(|e| fault(e.to_string(), "write the mesh as PLY, or simplify it"))
}

/// Appends data, aligned to 4 bytes, with a view and an accessor of its own.
fn push_accessor(
    root: &mut json::Root,
    blob: &mut Vec<u8>,
    buffer: json::Index<json::Buffer>,
    bytes: &[u8],
    (type_, component): (json::accessor::Type, json::accessor::ComponentType),
) -> json::Index<json::Accessor> {
    let offset = blob.len() as u64;
    blob.extend(bytes);
    blob.resize(blob.len().next_multiple_of(4), 0);
    let view = root.push(json::buffer::View {
        buffer,
        byte_length: USize64(bytes.len() as u64),
        byte_offset: Some(USize64(offset)),
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: json::Extras::default(),
    });
    let size = component.size() * type_.multiplicity();
    root.push(json::Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64((bytes.len() / size) as u64),
        component_type: Checked::Valid(json::accessor::GenericComponentType(component)),
        type_: Checked::Valid(type_),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
        extensions: None,
        extras: json::Extras::default(),
    })
}

/// glTF wants the box of positions.
fn bound(root: &mut json::Root, accessor: json::Index<json::Accessor>, positions: &[f32]) {
    let fold = |start: f32, pick: fn(f32, f32) -> f32| {
        let corner = positions.as_chunks::<3>().0.iter().fold([start; 3], |c, p| [0, 1, 2].map(|k| pick(c[k], p[k])));
        json::serialize::to_value(corner).ok()
    };
    let (min, max) = (fold(f32::INFINITY, f32::min), fold(f32::NEG_INFINITY, f32::max));
    let accessor = &mut root.accessors[accessor.value()];
    (accessor.min, accessor.max) = (min, max);
}

fn push_scene(
    root: &mut json::Root,
    attributes: std::collections::BTreeMap<Checked<gltf::Semantic>, json::Index<json::Accessor>>,
    indices: json::Index<json::Accessor>,
) {
    let primitive = json::mesh::Primitive {
        attributes,
        indices: Some(indices),
        material: None,
        mode: Checked::Valid(json::mesh::Mode::Triangles),
        targets: None,
        extensions: None,
        extras: json::Extras::default(),
    };
    let mesh = root.push(json::Mesh {
        primitives: vec![primitive],
        weights: None,
        name: None,
        extensions: None,
        extras: json::Extras::default(),
    });
    let node = root.push(json::Node { mesh: Some(mesh), ..json::Node::default() });
    let scene = json::Scene { nodes: vec![node], name: None, extensions: None, extras: json::Extras::default() };
    root.scene = Some(root.push(scene));
}
