//! The mesh as the hardware draws it, and the pass that fills sub-samples.
//!
//! The hardware decides which face a sub-sample sees, by a depth buffer of 1 / depth in 32-bit floats (relative
//! precision at all depths, no far plane); texture coordinates and footprint follow in the shader from the face's plane
//! and the sub-sample's ray, as in [`crate::reference`]. Faces are prepared in `f64`, about the middle of the mesh.

use super::GpuError;
use super::atlas::{Atlas, FORMAT};
use super::device::Device;
use super::tiles::Tile;
use crate::RenderOptions;
use crate::face::{Corners, corners};
use bytemuck::{Pod, Zeroable};
use capture::Camera;
use geometry::TexturedMesh;
use nalgebra::{Matrix4, Point3, Vector3};

pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The source every pipeline that draws faces starts with.
pub(super) const SOURCE: &str = include_str!("surface.wgsl");

/// Depths below this share of the mesh's extent are not drawn.
const NEAREST: f64 = 1e-6;

/// A face as the shader reads it: `Face` in `surface.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct GpuFace {
    corner: [f32; 4],
    normal: [f32; 4],
    second: [f32; 4],
    third: [f32; 4],
    uv: [f32; 4],
    edges: [f32; 4],
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Vertex {
    position: [f32; 3],
    face: u32,
}

/// `Frame` in `surface.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Frame {
    clip_from_object: [[f32; 4]; 4],
    right: [f32; 4],
    down: [f32; 4],
    forward: [f32; 4],
    eye: [f32; 4],
    pinhole: [f32; 4],
    center: [f32; 4],
    atlas: [u32; 4],
}

/// Corners of some of the faces.
#[derive(Clone, Debug)]
pub(super) struct Vertices {
    buffer: wgpu::Buffer,
    count: u32,
}

/// The mesh and how it is drawn.
#[derive(Debug)]
pub(super) struct Surface {
    middle: Point3<f64>,
    nearest: f64,
    all: Vertices,
    faces: wgpu::Buffer,
    frame: wgpu::Buffer,
    pipeline: wgpu::RenderPipeline,
}

impl Surface {
    pub(super) fn new(device: &Device, mesh: &TexturedMesh) -> Result<Self, GpuError> {
        let drawable: Vec<(usize, Corners)> =
            (0..mesh.mesh.faces.len()).filter_map(|face| Some((face, corners(mesh, face)?))).collect();
        let (middle, extent) = bounds(&drawable);
        let mut faces = vec![GpuFace::default(); mesh.mesh.faces.len()];
        for (index, corners) in &drawable {
            faces[*index] = gpu_face(corners, &middle).unwrap_or_default();
        }
        Ok(Self {
            middle,
            nearest: NEAREST * extent.max(f64::MIN_POSITIVE),
            all: vertices(device, mesh, &middle, |_| true)?,
            faces: device.buffer(bytemuck::cast_slice(&faces), wgpu::BufferUsages::STORAGE)?,
            frame: device.buffer(&[0; size_of::<Frame>()], wgpu::BufferUsages::UNIFORM)?,
            pipeline: pipeline(device, SOURCE, "show"),
        })
    }

    /// The same faces for another pose.
    pub(super) fn another(&self, device: &Device) -> Result<Self, GpuError> {
        let frame = device.buffer(&[0; size_of::<Frame>()], wgpu::BufferUsages::UNIFORM)?;
        Ok(Self { frame, all: self.all.clone(), faces: self.faces.clone(), pipeline: self.pipeline.clone(), ..*self })
    }

    /// Depths below this are not drawn.
    pub(super) fn nearest(&self) -> f64 {
        self.nearest
    }

    /// Corners of the faces of the mesh that `keep` picks.
    pub(super) fn vertices(
        &self,
        device: &Device,
        mesh: &TexturedMesh,
        keep: impl Fn(usize) -> bool,
    ) -> Result<Vertices, GpuError> {
        vertices(device, mesh, &self.middle, keep)
    }

    /// What a pipeline reads that draws faces without the atlas.
    pub(super) fn bind_faces(&self, device: &Device, pipeline: &wgpu::RenderPipeline) -> wgpu::BindGroup {
        device.bind(pipeline, 0, &[self.frame.as_entire_binding(), self.faces.as_entire_binding()])
    }

    /// What the shader reads of an atlas.
    pub(super) fn bind(&self, device: &Device, atlas: &Atlas) -> wgpu::BindGroup {
        let texture = wgpu::BindingResource::TextureView(&atlas.all());
        device.bind(&self.pipeline, 0, &[self.frame.as_entire_binding(), self.faces.as_entire_binding(), texture])
    }

    /// The point about which the shaders' coordinates are.
    pub(super) fn middle(&self) -> Point3<f64> {
        self.middle
    }

    /// Looks through a camera without a lens at a tile of its frame; the depth buffer is 1 at the depth of `nearest`.
    pub(super) fn look(
        &self,
        device: &Device,
        (camera, nearest): (&Camera, f64),
        options: &RenderOptions,
        tile: &Tile,
        atlas: &Atlas,
    ) {
        let i = &camera.intrinsics;
        let axis = |k: usize| -> [f32; 4] {
            let row: Vector3<f64> = camera.rotation.row(k).transpose();
            row.push(0.0).cast().into()
        };
        let eye = camera.center() - self.middle;
        let (step, [width, height]) = (1.0 / options.per_side() as f64, atlas.size());
        let center = [i.cx - tile.origin[0] as f64, i.cy - tile.origin[1] as f64];
        let frame = Frame {
            clip_from_object: self.clip_from_object(camera, nearest, tile).cast().into(),
            right: axis(0),
            down: axis(1),
            forward: axis(2),
            eye: eye.push(0.0).cast().into(),
            pinhole: [1.0 / i.fx, 1.0 / i.fy, i.skew, step].map(|v| v as f32),
            center: [center[0] as f32, center[1] as f32, 0.0, 0.0],
            atlas: [width, height, atlas.top_level(), 0],
        };
        device.queue().write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
    }

    /// Depth 1 / z, scaled to be 1 at the nearest; pixels of the tile to −1..=1, y up.
    fn clip_from_object(&self, camera: &Camera, nearest: f64, tile: &Tile) -> Matrix4<f64> {
        let i = &camera.intrinsics;
        let [width, height] = tile.size.map(|side| side as f64);
        let [left, top] = tile.origin.map(|side| side as f64);
        let clip_from_camera = Matrix4::new(
            2.0 * i.fx / width,
            2.0 * i.skew / width,
            2.0 * (i.cx - left) / width - 1.0,
            0.0,
            0.0,
            -2.0 * i.fy / height,
            1.0 - 2.0 * (i.cy - top) / height,
            0.0,
            0.0,
            0.0,
            0.0,
            nearest,
            0.0,
            0.0,
            1.0,
            0.0,
        );
        let middle = camera.to_camera(&self.middle);
        clip_from_camera * (Matrix4::new_translation(&middle) * camera.rotation.to_homogeneous())
    }

    /// Draws faces with the atlas; all, where none are picked.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, bindings: &wgpu::BindGroup, picked: Option<&Vertices>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bindings, &[]);
        picked.unwrap_or(&self.all).draw(pass);
    }
}

impl Vertices {
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, self.buffer.slice(..));
        pass.draw(0..self.count, 0..1);
    }
}

/// Corners of the faces that `keep` picks and that have an area.
fn vertices(
    device: &Device,
    mesh: &TexturedMesh,
    middle: &Point3<f64>,
    keep: impl Fn(usize) -> bool,
) -> Result<Vertices, GpuError> {
    let mut vertices = Vec::new();
    for index in (0..mesh.mesh.faces.len()).filter(|&face| keep(face)) {
        let Some(corners) = corners(mesh, index).filter(|c| gpu_face(c, middle).is_some()) else { continue };
        let vertex = |p: Point3<f64>| Vertex { position: (p - middle).cast().into(), face: index as u32 };
        vertices.extend(corners.positions.map(vertex));
    }
    device.check("corners of faces", vertices.len() as u64, u64::from(u32::MAX))?;
    let buffer = device.buffer(bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX)?;
    Ok(Vertices { buffer, count: vertices.len() as u32 })
}

/// Middle and longest side of the box of the corners; a unit box at the origin where there are none.
fn bounds(faces: &[(usize, Corners)]) -> (Point3<f64>, f64) {
    let mut points = faces.iter().flat_map(|(_, corners)| corners.positions);
    let Some(first) = points.next() else { return (Point3::origin(), 1.0) };
    let (low, high) = points.fold((first, first), |(low, high), p| (low.inf(&p), high.sup(&p)));
    (nalgebra::center(&low, &high), (high - low).amax())
}

/// `None` of a face without area.
fn gpu_face(corners: &Corners, middle: &Point3<f64>) -> Option<GpuFace> {
    let [a, b, c] = corners.positions;
    let [ta, tb, tc] = corners.uvs;
    let (ab, ac) = (b - a, c - a);
    let across = ab.cross(&ac);
    let normal = across.try_normalize(0.0)?;
    // Barycentric coordinates in the plane (Ericson, Real-Time Collision Detection, 3.4).
    let area = across.norm_squared();
    let (second, third) = (ac.cross(&across) / area, across.cross(&ab) / area);
    let [e, f] = [tb - ta, tc - ta];
    let four = |v: &Vector3<f64>| -> [f32; 4] { v.push(0.0).cast().into() };
    let face = GpuFace {
        corner: four(&(a - middle)),
        normal: four(&normal),
        second: four(&second),
        third: four(&third),
        uv: [ta.x as f32, ta.y as f32, 0.0, 0.0],
        edges: [e.x, e.y, f.x, f.y].map(|v| v as f32),
    };
    let numbers: &[f32] = bytemuck::cast_slice(std::slice::from_ref(&face));
    numbers.iter().all(|v| v.is_finite()).then_some(face)
}

/// A pipeline that draws faces: sub-samples, nearest first.
pub(super) fn pipeline(device: &Device, source: &str, entry: &str) -> wgpu::RenderPipeline {
    let module = &device.shader(source);
    let compilation_options = wgpu::PipelineCompilationOptions::default();
    let attributes = &wgpu::vertex_attr_array![0 => Float32x3, 1 => Uint32];
    let array_stride = size_of::<Vertex>() as u64;
    let buffer = wgpu::VertexBufferLayout { array_stride, step_mode: wgpu::VertexStepMode::Vertex, attributes };
    let nearer = wgpu::DepthStencilState {
        format: DEPTH,
        depth_write_enabled: Some(true),
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    };
    device.wgpu().create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("project"),
            compilation_options: compilation_options.clone(),
            buffers: &[Some(buffer)],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(nearer),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry),
            compilation_options,
            targets: &[Some(FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
