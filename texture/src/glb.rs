//! The file of a model: binary glTF 2.0 with the extension `TURNLIGHT_view_dependent_texture`.
//!
//! Any viewer shows the mesh with the first layer; ours reads the rest from the material's extension.
//! `docs/model-format.md` specifies it. Buffers are little-endian; every accessor has its own view.
//! Reading trusts nothing: counts are checked against the bytes that are there before anything is allocated.

use crate::TextureError;
use crate::appearance::{Lumigraph, static_texture::base_layer};
use crate::coding;
use crate::directions::{DirectionComplex, Layout};
use crate::layers::{FacetWeights, Layer, Layers};
use crate::material_layer::{self, MaterialLayer, charts_of_file};
use crate::model::{Appearance, FitOptions, Method, Model};
use crate::surface::{self, SurfaceTexels};
use geometry::{Mesh, TexturedMesh};
use gltf::binary::{Glb, Header};
use nalgebra::{Point2, Point3, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::borrow::Cow;

/// The name of our extension.
pub const EXTENSION: &str = "TURNLIGHT_view_dependent_texture";

/// Version of the extension that is written, and the only one read.
const VERSION: u32 = 1;

/// Bytes of the header of a binary glTF.
const HEADER_BYTES: u32 = 12;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const SHORT: u32 = 5122;

/// What the material's extension says; accessors and images by index.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    version: u32,
    method: String,
    atlas_size: [usize; 2],
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    layers: Vec<LayerEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    facet_map: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    facets: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    facet_centers: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    directions: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    edges: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    coefficients: Option<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    coefficient_scales: Vec<f32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    rays: Vec<RayEntry>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ring_axis: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_centers: Option<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    materials: Vec<MaterialEntry>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct MaterialEntry {
    charts: Vec<u32>,
    tile_size: f64,
    buffer_view: usize,
}

#[derive(Debug, Serialize, Deserialize)]
struct LayerEntry {
    image: usize,
    scale: f32,
    offset: f32,
}

#[derive(Debug, Serialize, Deserialize)]
struct RayEntry {
    color: usize,
    view: usize,
}

/// A glTF being written.
#[derive(Default)]
struct Writer {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    /// Bytes that belong to the appearance.
    appearance: u64,
}

impl Writer {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend_from_slice(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let mut accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        if component == SHORT {
            accessor["normalized"] = json!(true);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// An accessor of the appearance, or `None` where there is nothing to store: glTF knows no empty ones.
    fn part(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> Option<usize> {
        self.appearance += bytes.len() as u64;
        (count > 0).then(|| self.accessor(bytes, component, kind, count))
    }

    fn image(&mut self, bytes: &[u8], name: String) -> usize {
        let mime = if bytes.starts_with(&[0xff, 0xd8]) { "image/jpeg" } else { "image/png" };
        let view = self.view(bytes);
        self.images.push(json!({"bufferView": view, "mimeType": mime, "name": name}));
        self.images.len() - 1
    }

    fn part_image(&mut self, bytes: &[u8], name: String) -> usize {
        self.appearance += bytes.len() as u64;
        self.image(bytes, name)
    }
}

/// The model as one file.
pub(crate) fn write(model: &Model) -> Result<Vec<u8>, TextureError> {
    assemble(model).map(|(bytes, _)| bytes)
}

/// Bytes of the whole file and of the appearance in it.
pub(crate) fn sizes(model: &Model) -> Result<(u64, u64), TextureError> {
    assemble(model).map(|(bytes, appearance)| (bytes.len() as u64, appearance))
}

fn assemble(model: &Model) -> Result<(Vec<u8>, u64), TextureError> {
    let refused = |fault: &str| TextureError::Degenerate {
        fault: fault.to_owned(),
        remedy: "use coarser texels or fewer layers".to_owned(),
    };
    let mut w = Writer::default();
    let primitive = write_mesh(&mut w, &model.mesh);
    let (mut extension, preview) = match &model.appearance {
        Appearance::Layers(layers) => write_layers(&mut w, model, layers),
        Appearance::Lumigraph(rays, _) => write_lumigraph(&mut w, model, rays),
    }
    .ok_or_else(|| refused("a part of the model is empty or too large to be coded"))?;
    extension.materials = write_materials(&mut w, model)?;
    let extension = serde_json::to_value(extension).map_err(|e| refused(&e.to_string()))?;
    let root = root(&w, primitive, extension, preview);
    let json = serde_json::to_vec(&root).map_err(|e| refused(&e.to_string()))?;
    let length =
        u32::try_from(w.bin.len() + json.len() + 64).map_err(|e| refused(&format!("the file passes 4 GiB ({e})")))?;
    let header = Header { magic: *b"glTF", version: 2, length };
    let appearance = w.appearance;
    let glb = Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(w.bin)) };
    let bytes = glb.to_vec().map_err(|e| refused(&e.to_string()))?;
    Ok((bytes, appearance))
}

fn root(w: &Writer, primitive: Value, extension: Value, preview: usize) -> Value {
    json!({
        "asset": {"version": "2.0", "generator": concat!("turnlight ", env!("CARGO_PKG_VERSION"))},
        "extensionsUsed": ["KHR_materials_unlit", EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [{
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 1.0},
            "extensions": {"KHR_materials_unlit": {}, EXTENSION: extension},
        }],
        "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}],
        "textures": [{"source": preview, "sampler": 0}],
        "images": w.images,
        "accessors": w.accessors,
        "bufferViews": w.views,
        "buffers": [{"byteLength": w.bin.len()}],
    })
}

fn write_mesh(w: &mut Writer, mesh: &TexturedMesh) -> Value {
    let bytes = |values: &mut dyn Iterator<Item = f32>| values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let vertices = mesh.mesh.positions.len();
    let positions = bytes(&mut mesh.mesh.positions.iter().flat_map(|p| [p.x, p.y, p.z].map(|v| v as f32)));
    let position = w.accessor(&positions, FLOAT, "VEC3", vertices);
    if let Some(b) = mesh.mesh.aabb() {
        w.accessors[position]["min"] = json!([b.min.x as f32, b.min.y as f32, b.min.z as f32]);
        w.accessors[position]["max"] = json!([b.max.x as f32, b.max.y as f32, b.max.z as f32]);
    }
    let uvs = bytes(&mut mesh.uvs.iter().flat_map(|p| [p.x as f32, p.y as f32]));
    let uv = w.accessor(&uvs, FLOAT, "VEC2", vertices);
    let indices: Vec<u8> = mesh.mesh.faces.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    let index = w.accessor(&indices, UNSIGNED_INT, "SCALAR", 3 * mesh.mesh.faces.len());
    json!({"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": index, "material": 0})
}

fn blank(model: &Model) -> Extension {
    Extension {
        version: VERSION,
        method: model.method.name().to_owned(),
        atlas_size: model.mesh.atlas_size,
        layers: Vec::new(),
        facet_map: None,
        facets: None,
        facet_centers: None,
        directions: None,
        triangles: None,
        edges: None,
        coefficients: None,
        coefficient_scales: Vec::new(),
        rays: Vec::new(),
        ring_axis: None,
        camera_centers: None,
        materials: Vec::new(),
    }
}

/// Writes layers and weights; also gives the image that plain viewers show. What a first look and all weights need comes
/// first: a player in a browser shows that while the other layers are on their way.
fn write_layers(w: &mut Writer, model: &Model, layers: &Layers) -> Option<(Extension, usize)> {
    let mut e = blank(model);
    let (first, rest) = layers.layers.split_first()?;
    let preview = match model.method {
        Method::Vdtm => Some(write_preview(w, model)?),
        _ if model.materials.is_empty() => None,
        _ => Some(write_preview(w, model)?),
    };
    write_layer(w, &mut e, first);
    let map = layers.facet_of_texel.map(|f| [f.to_le_bytes()[0], f.to_le_bytes()[1], 0]);
    e.facet_map = Some(w.part_image(&coding::encode_png(&map)?, "facet map".to_owned()));
    e.ring_axis = layers.facets.iter().find_map(|f| f.complex.ring()).map(Into::into);
    write_facets(w, &mut e, &layers.facets, layers.layers.len())?;
    rest.iter().for_each(|layer| write_layer(w, &mut e, layer));
    let preview = preview.or(e.layers.first().map(|layer| layer.image))?;
    Some((e, preview))
}

fn write_layer(w: &mut Writer, e: &mut Extension, layer: &Layer) {
    let image = w.part_image(&layer.coded, format!("layer {}", e.layers.len()));
    e.layers.push(LayerEntry { image, scale: layer.scale, offset: layer.offset });
}

/// What plain viewers show.
fn write_preview(w: &mut Writer, model: &Model) -> Option<usize> {
    Some(w.image(&base_layer(&model.still(), &FitOptions::default())?.coded, "preview".to_owned()))
}

/// The mesh as it will be read: so that a model that was read is written as it was.
pub(crate) fn as_stored(mesh: &TexturedMesh) -> TexturedMesh {
    let mut stored = mesh.clone();
    let round = |v: &mut f64| *v = f64::from(*v as f32);
    stored.mesh.positions.iter_mut().for_each(|p| p.iter_mut().for_each(round));
    stored.uvs.iter_mut().for_each(|p| p.iter_mut().for_each(round));
    stored
}

/// Materials lie on the charts as the reader will number them.
fn write_materials(w: &mut Writer, model: &Model) -> Result<Vec<MaterialEntry>, TextureError> {
    material_layer::check(&model.materials, &model.mesh.face_charts).map_err(material_layer::refused)?;
    if model.materials.is_empty() {
        return Ok(Vec::new());
    }
    let stored = charts_of_file(&model.mesh.mesh.faces, model.mesh.mesh.positions.len());
    let write = |layer: &MaterialLayer| {
        let faces = stored.iter().zip(&model.mesh.face_charts);
        let mut charts: Vec<u32> =
            faces.filter(|(_, chart)| layer.charts.binary_search(chart).is_ok()).map(|(&stored, _)| stored).collect();
        charts.sort_unstable();
        charts.dedup();
        MaterialEntry { charts, tile_size: layer.tile_size, buffer_view: w.view(&layer.coded) }
    };
    Ok(model.materials.iter().map(write).collect())
}

fn write_facets(w: &mut Writer, e: &mut Extension, facets: &[FacetWeights], layers: usize) -> Option<()> {
    let is_sound = |f: &FacetWeights| f.rank <= layers && f.table.len() == f.rank * f.complex.sites().len();
    if !facets.iter().all(is_sound) {
        return None;
    }
    let scales = coefficient_scales(facets, layers);
    let (mut counts, mut centers, mut directions) = (Vec::new(), Vec::new(), Vec::new());
    let (mut triangles, mut edges, mut coefficients) = (Vec::new(), Vec::new(), Vec::new());
    for f in facets {
        let row = [f.complex.sites().len(), f.complex.triangles().len(), f.complex.edges().len(), f.rank];
        for n in row {
            counts.extend(u16::try_from(n).ok()?.to_le_bytes());
        }
        centers.extend([f.center.x, f.center.y, f.center.z].into_iter().flat_map(|v| (v as f32).to_le_bytes()));
        directions.extend(f.complex.sites().iter().flat_map(snorm_direction).flat_map(i16::to_le_bytes));
        triangles.extend(f.complex.triangles().iter().flatten().flat_map(|&i| (i as u16).to_le_bytes()));
        edges.extend(f.complex.edges().iter().flatten().flat_map(|&i| (i as u16).to_le_bytes()));
        let scaled = f.table.iter().enumerate().map(|(i, y)| f64::from(*y) / f64::from(scales[i % f.rank]));
        coefficients.extend(scaled.flat_map(|v| snorm(v).to_le_bytes()));
    }
    e.facets = w.part(&counts, UNSIGNED_SHORT, "VEC4", facets.len());
    e.facet_centers = w.part(&centers, FLOAT, "VEC3", facets.len());
    e.directions = w.part(&directions, SHORT, "VEC3", directions.len() / 6);
    e.triangles = w.part(&triangles, UNSIGNED_SHORT, "SCALAR", triangles.len() / 2);
    e.edges = w.part(&edges, UNSIGNED_SHORT, "SCALAR", edges.len() / 2);
    e.coefficients = w.part(&coefficients, SHORT, "SCALAR", coefficients.len() / 2);
    e.coefficient_scales = scales;
    Some(())
}

/// The largest coefficient of each layer over all facets; 1 where there is none.
fn coefficient_scales(facets: &[FacetWeights], layers: usize) -> Vec<f32> {
    let mut scales = vec![0.0f32; layers];
    for f in facets {
        f.table.iter().enumerate().for_each(|(i, y)| scales[i % f.rank] = scales[i % f.rank].max(y.abs()));
    }
    scales.into_iter().map(|s| if s > 0.0 && s.is_finite() { s } else { 1.0 }).collect()
}

/// A number in −1..=1 as glTF's normalised 16-bit integer.
fn snorm(v: f64) -> i16 {
    (v.clamp(-1.0, 1.0) * 32767.0).round() as i16
}

/// A unit vector as [`snorm`], such that reading, normalising and writing it again gives the same: what
/// rounding does to the length can carry a component over half a step. Every round strictly shrinks
/// the error of the length, so a few do.
fn snorm_direction(direction: &Vector3<f64>) -> [i16; 3] {
    let mut stored = direction.map(snorm);
    for _ in 0..8 {
        let again = read_direction(stored.map(from_snorm).into()).map(snorm);
        if again == stored {
            break;
        }
        stored = again;
    }
    stored.into()
}

/// What [`snorm`] stored.
fn from_snorm(v: i16) -> f64 {
    (f64::from(v) / 32767.0).max(-1.0)
}

/// A stored direction at unit length; zero, which no complex accepts, where it is far from it.
fn read_direction(stored: [f64; 3]) -> Vector3<f64> {
    Vector3::from(stored).try_normalize(0.5).unwrap_or_default()
}

fn write_lumigraph(w: &mut Writer, model: &Model, rays: &Lumigraph) -> Option<(Extension, usize)> {
    let mut e = blank(model);
    let preview = write_preview(w, model)?;
    let centers: Vec<u8> =
        rays.centers.iter().flat_map(|c| [c.x, c.y, c.z]).flat_map(|v| (v as f32).to_le_bytes()).collect();
    e.camera_centers = w.part(&centers, FLOAT, "VEC3", rays.centers.len());
    for (k, pair) in rays.coded.chunks_exact(2).enumerate() {
        let color = w.part_image(&pair[0], format!("ray colours {k}"));
        let view = w.part_image(&pair[1], format!("ray views {k}"));
        e.rays.push(RayEntry { color, view });
    }
    Some((e, preview))
}

/// A glTF being read.
struct Reader<'a> {
    root: Value,
    bin: &'a [u8],
}

impl<'a> Reader<'a> {
    fn view(&self, index: usize) -> Result<&'a [u8], String> {
        let view = self.root["bufferViews"].get(index).ok_or_else(|| format!("buffer view {index} is missing"))?;
        let number = |key: &str| view.get(key).map_or(Some(0), Value::as_u64).and_then(|v| usize::try_from(v).ok());
        let (start, length) = number("byteOffset")
            .zip(number("byteLength"))
            .ok_or_else(|| format!("buffer view {index} has no range"))?;
        if view.get("buffer").and_then(Value::as_u64) != Some(0) {
            return Err(format!("buffer view {index} lies in another buffer"));
        }
        let end = start.checked_add(length).filter(|&end| end <= self.bin.len());
        end.map(|end| &self.bin[start..end])
            .ok_or_else(|| format!("buffer view {index} reaches past the end of the file"))
    }

    /// The elements of an accessor as bytes, `width` bytes each, and how many there are.
    fn accessor(&self, index: usize, component: u32, kind: &str, width: usize) -> Result<(&'a [u8], usize), String> {
        let a = self.root["accessors"].get(index).ok_or_else(|| format!("accessor {index} is missing"))?;
        if a["componentType"] != json!(component) || a["type"] != json!(kind) {
            return Err(format!("accessor {index} is not {kind} of component type {component}"));
        }
        let field = |key: &str| a.get(key).and_then(Value::as_u64).and_then(|v| usize::try_from(v).ok());
        let (view, count) =
            field("bufferView").zip(field("count")).ok_or_else(|| format!("accessor {index} has no data"))?;
        let is_packed = self.root["bufferViews"][view].get("byteStride").is_none_or(|stride| *stride == json!(width));
        if !is_packed || a.get("sparse").is_some() {
            return Err(format!("accessor {index} is sparse or interleaved, which is not read"));
        }
        let offset = if a.get("byteOffset").is_some() { field("byteOffset") } else { Some(0) };
        let bytes = offset.and_then(|offset| self.view(view).map(|bytes| bytes.get(offset..)).transpose());
        let bytes = bytes.ok_or_else(|| format!("accessor {index} begins past the end of its buffer view"))??;
        let length = count.checked_mul(width).filter(|&l| l <= bytes.len());
        let length =
            length.ok_or_else(|| format!("accessor {index} counts more elements than its buffer view holds"))?;
        Ok((&bytes[..length], count))
    }

    /// Refuses a file whose data lie elsewhere: no address is followed, so none may be meant.
    fn refuse_addresses(&self) -> Result<(), String> {
        let mut parts = ["buffers", "images"].into_iter().filter_map(|kind| self.root[kind].as_array()).flatten();
        let has_address = parts.any(|part| part.get("uri").is_some());
        if has_address { Err("it names other files, which is not followed".to_owned()) } else { Ok(()) }
    }

    /// Refuses layers and materials that decode the same bytes again and again: a small file could ask for any memory.
    fn refuse_shared_bytes(&self, e: &Extension) -> Result<(), String> {
        let rays = e.rays.iter().flat_map(|ray| [ray.color, ray.view]);
        let mut bytes = 0usize;
        for image in e.layers.iter().map(|layer| layer.image).chain(rays) {
            bytes = bytes.saturating_add(self.image(image)?.len());
        }
        if bytes > self.bin.len() {
            return Err("its layers share images".to_owned());
        }
        let materials = e.materials.iter().map(|entry| Ok(self.view(entry.buffer_view)?.len()));
        let bytes = materials.sum::<Result<usize, String>>()?;
        if bytes > self.bin.len() { Err("its materials share bytes".to_owned()) } else { Ok(()) }
    }

    fn floats(&self, index: usize, kind: &str, per: usize) -> Result<Vec<f64>, String> {
        let (bytes, _) = self.accessor(index, FLOAT, kind, 4 * per)?;
        let values: Vec<f64> = bytes.as_chunks::<4>().0.iter().map(|&b| f64::from(f32::from_le_bytes(b))).collect();
        match values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(format!("accessor {index} holds {} at position {i}", values[i])),
            None => Ok(values),
        }
    }

    fn points(&self, index: usize) -> Result<Vec<Point3<f64>>, String> {
        Ok(self.floats(index, "VEC3", 3)?.as_chunks::<3>().0.iter().map(|&p| Point3::from(p)).collect())
    }

    fn shorts(&self, index: Option<usize>, component: u32, kind: &str, per: usize) -> Result<Vec<u16>, String> {
        let Some(index) = index else { return Ok(Vec::new()) };
        let (bytes, _) = self.accessor(index, component, kind, 2 * per)?;
        Ok(bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)).collect())
    }

    fn snorms(&self, index: Option<usize>, kind: &str, per: usize) -> Result<Vec<f64>, String> {
        let raw = self.shorts(index, SHORT, kind, per)?;
        Ok(raw.into_iter().map(|v| from_snorm(v.cast_signed())).collect())
    }

    fn image(&self, index: usize) -> Result<&'a [u8], String> {
        let image = self.root["images"].get(index).ok_or_else(|| format!("image {index} is missing"))?;
        let view = image["bufferView"].as_u64().and_then(|v| usize::try_from(v).ok());
        self.view(view.ok_or_else(|| format!("image {index} is not inside the file"))?)
    }
}

/// The model in `bytes`; `Err` says what is wrong with them.
pub(crate) fn read(bytes: &[u8]) -> Result<Model, String> {
    // The reader of the `gltf` crate subtracts its header from this length unchecked.
    let length = bytes.get(8..12).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    if length < HEADER_BYTES {
        return Err("no binary glTF (its header is cut off or says so)".to_owned());
    }
    let glb = Glb::from_slice(bytes).map_err(|e| format!("no binary glTF ({e})"))?;
    let root: Value = serde_json::from_slice(&glb.json).map_err(|e| format!("its JSON does not parse ({e})"))?;
    let bin = glb.bin.as_deref().ok_or("it has no binary chunk")?;
    let reader = Reader { root, bin };
    let extension = reader.root["materials"][0]["extensions"].get(EXTENSION).cloned();
    let extension = extension.ok_or_else(|| format!("its material has no extension {EXTENSION}"))?;
    let e: Extension = serde_json::from_value(extension).map_err(|e| format!("its extension does not parse ({e})"))?;
    if e.version != VERSION {
        return Err(format!("version {} of the extension; this program reads version {VERSION}", e.version));
    }
    if !surface::is_atlas_size(e.atlas_size) {
        return Err(format!("an atlas of {:?} texels", e.atlas_size));
    }
    reader.refuse_addresses()?;
    reader.refuse_shared_bytes(&e)?;
    let method: Method = e.method.parse()?;
    let mesh = read_mesh(&reader, e.atlas_size)?;
    let appearance =
        if method == Method::Lumigraph { read_lumigraph(&reader, &e, &mesh)? } else { read_layers(&reader, &e)? };
    let materials = read_materials(&reader, &e, &mesh)?;
    Ok(Model { mesh, method, appearance, materials })
}

fn read_materials(r: &Reader<'_>, e: &Extension, mesh: &TexturedMesh) -> Result<Vec<MaterialLayer>, String> {
    let read = |(k, entry): (usize, &MaterialEntry)| {
        let layer = MaterialLayer::new(entry.charts.clone(), entry.tile_size, r.view(entry.buffer_view)?.to_vec());
        layer.map_err(|fault| format!("material {k}: {fault}"))
    };
    let layers = e.materials.iter().enumerate().map(read).collect::<Result<Vec<_>, _>>()?;
    material_layer::check(&layers, &mesh.face_charts)?;
    Ok(layers)
}

fn read_mesh(r: &Reader<'_>, atlas_size: [usize; 2]) -> Result<TexturedMesh, String> {
    let primitive = &r.root["meshes"][0]["primitives"][0];
    let index = |v: &Value, what: &str| {
        v.as_u64().and_then(|v| usize::try_from(v).ok()).ok_or_else(|| format!("the mesh has no {what}"))
    };
    let positions = r.points(index(&primitive["attributes"]["POSITION"], "positions")?)?;
    let uvs = r.floats(index(&primitive["attributes"]["TEXCOORD_0"], "texture coordinates")?, "VEC2", 2)?;
    let uvs: Vec<Point2<f64>> = uvs.as_chunks::<2>().0.iter().map(|&p| Point2::from(p)).collect();
    let (indices, _) = r.accessor(index(&primitive["indices"], "indices")?, UNSIGNED_INT, "SCALAR", 4)?;
    let indices: Vec<u32> = indices.as_chunks::<4>().0.iter().map(|&b| u32::from_le_bytes(b)).collect();
    if uvs.len() != positions.len() {
        return Err(format!("{} texture coordinates for {} positions", uvs.len(), positions.len()));
    }
    if let Some(i) = indices.iter().find(|&&i| i as usize >= positions.len()) {
        return Err(format!("a face names vertex {i} of {}", positions.len()));
    }
    if uvs.iter().any(|p| !(-1e-6..=1.0 + 1e-6).contains(&p.x) || !(-1e-6..=1.0 + 1e-6).contains(&p.y)) {
        return Err("a texture coordinate lies outside the atlas".to_owned());
    }
    let faces = indices.as_chunks::<3>().0.to_vec();
    let mesh = Mesh { positions, faces };
    let face_charts = charts_of_file(&mesh.faces, mesh.positions.len());
    Ok(TexturedMesh { mesh, uvs, face_charts, atlas_size })
}

fn read_layers(r: &Reader<'_>, e: &Extension) -> Result<Appearance, String> {
    if e.layers.is_empty() {
        return Err("it has no layers".to_owned());
    }
    let layers =
        e.layers.iter().enumerate().map(|(k, entry)| read_layer(r, e, k, entry)).collect::<Result<Vec<_>, _>>()?;
    let map = coding::decode(r.image(e.facet_map.ok_or("it has no facet map")?)?, e.atlas_size)?;
    let facet_of_texel = map.map(|[low, high, _]| u16::from_le_bytes([low, high]));
    let facets = read_facets(r, e)?;
    if let Some(f) = facet_of_texel.pixels().iter().find(|&&f| usize::from(f) >= facets.len()) {
        return Err(format!("a texel names facet {f} of {}", facets.len()));
    }
    Ok(Appearance::Layers(Layers { layers, facet_of_texel, facets }))
}

fn read_layer(r: &Reader<'_>, e: &Extension, k: usize, entry: &LayerEntry) -> Result<Layer, String> {
    if !entry.scale.is_finite() || !entry.offset.is_finite() {
        return Err(format!("layer {k} has a scale or offset that is no number"));
    }
    let coded = r.image(entry.image)?.to_vec();
    let texels = coding::decode(&coded, e.atlas_size).map_err(|fault| format!("layer {k}: {fault}"))?;
    Ok(Layer { texels, scale: entry.scale, offset: entry.offset, coded })
}

fn read_facets(r: &Reader<'_>, e: &Extension) -> Result<Vec<FacetWeights>, String> {
    let counts = r.shorts(e.facets, UNSIGNED_SHORT, "VEC4", 4)?;
    let counts = counts.as_chunks::<4>().0;
    let centers = r.points(e.facet_centers.ok_or("it has no facet centres")?)?;
    if centers.len() != counts.len() {
        return Err(format!("{} centres for {} facets", centers.len(), counts.len()));
    }
    if e.coefficient_scales.len() != e.layers.len() || e.coefficient_scales.iter().any(|s| !s.is_finite()) {
        return Err("its coefficient scales do not fit its layers".to_owned());
    }
    let directions = r.snorms(e.directions, "VEC3", 3)?;
    let mut directions = Taker(directions.as_chunks::<3>().0, "directions");
    let (triangles, edges) =
        (r.shorts(e.triangles, UNSIGNED_SHORT, "SCALAR", 1)?, r.shorts(e.edges, UNSIGNED_SHORT, "SCALAR", 1)?);
    let mut triangles = Taker(triangles.as_chunks::<3>().0, "triangles");
    let mut edges = Taker(edges.as_chunks::<2>().0, "edges");
    let coefficients = r.snorms(e.coefficients, "SCALAR", 1)?;
    let mut coefficients = Taker(&coefficients, "coefficients");
    let layout = e.ring_axis.map_or(Layout::General, |axis| Layout::Ring(axis.into()));
    let mut facets = Vec::with_capacity(counts.len());
    for (n, (&[s, t, d, rank], &center)) in counts.iter().zip(&centers).enumerate() {
        let [s, t, d, rank] = [s, t, d, rank].map(usize::from);
        if rank == 0 || rank > e.layers.len() {
            return Err(format!("facet {n} uses {rank} of {} layers", e.layers.len()));
        }
        let sites = directions.take(s)?.iter().map(|&d| read_direction(d)).collect();
        let triangles = triangles.take(t)?.iter().map(|t| t.map(u32::from)).collect();
        let edges = edges.take(d)?.iter().map(|t| t.map(u32::from)).collect();
        let complex = DirectionComplex::from_parts(sites, triangles, edges, layout)
            .ok_or_else(|| format!("facet {n} has an unsound triangulation"))?;
        let table = coefficients.take(s * rank)?;
        let table = table.iter().enumerate().map(|(i, y)| *y as f32 * e.coefficient_scales[i % rank]).collect();
        facets.push(FacetWeights { center, complex, rank, table });
    }
    Ok(facets)
}

/// Elements handed out in order.
struct Taker<'a, T>(&'a [T], &'static str);

impl<'a, T> Taker<'a, T> {
    fn take(&mut self, count: usize) -> Result<&'a [T], String> {
        let (head, tail) =
            self.0.split_at_checked(count).ok_or_else(|| format!("its facets want more {} than there are", self.1))?;
        self.0 = tail;
        Ok(head)
    }
}

fn read_lumigraph(r: &Reader<'_>, e: &Extension, mesh: &TexturedMesh) -> Result<Appearance, String> {
    let centers = r.points(e.camera_centers.ok_or("it has no camera centres")?)?;
    if e.rays.is_empty() {
        return Err("it has no rays".to_owned());
    }
    let mut coded = Vec::new();
    for ray in &e.rays {
        coded.push(r.image(ray.color)?.to_vec());
        coded.push(r.image(ray.view)?.to_vec());
    }
    // Before the surface is baked, one image proves that the atlas is as large as it is said to be.
    coded.first().map(|image| coding::decode(image, e.atlas_size)).transpose()?;
    let surface = SurfaceTexels::bake(mesh);
    let rays = Lumigraph::decode(centers, coded, &surface)?;
    Ok(Appearance::Lumigraph(rays, surface))
}
