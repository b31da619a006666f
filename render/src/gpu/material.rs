//! Charts that carry a material: each coat's faces drawn with its codec in the shader.
//!
//! Gaussian mixtures and multi-level vector quantisation are evaluated as they are, out of the tables of
//! [`texture::btf::Tables`]; other codecs are refused. A sub-sample costs up to 16 texels × lights evaluations: of
//! M components the one, of 16 chains of look-ups the other. Footprints of many texels are those 16 spread over it, not
//! averages as on the CPU.

use super::GpuError;
use super::device::Device;
use super::surface::{self, Surface, Vertices};
use crate::material::numbers::CoatNumbers;
use crate::material::{Coats, Light, Lighting};
use bytemuck::{Pod, Zeroable, bytes_of, cast_slice};
use capture::btf::Encoding;
use nalgebra::{Point3, Vector3};
use texture::btf::{DirectionSet, MixtureTables, Tables, VqTables};

/// Lights of a scene at most.
const MOST_LIGHTS: usize = 4096;

/// The sources of the codecs.
pub(super) const CODECS: [&str; 2] = [include_str!("gaussian_mixture.wgsl"), include_str!("multilevel_vq.wgsl")];

/// A program that draws faces with the codec of `source`.
pub(super) fn program(source: &str) -> String {
    [surface::SOURCE, include_str!("material.wgsl"), source].concat()
}

/// `Coat` in `material.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct CoatUniform {
    size: [u32; 2],
    lights: u32,
    includes_cosine: u32,
    lowest: [f32; 2],
    inverse_exposure: f32,
    gain: f32,
    mesh_atlas: [f32; 2],
    encoding: u32,
    floor: f32,
    range: f32,
    padding: [u32; 3],
    layout: [[u32; 4]; 4],
}

/// `Light` in `material.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct LightUniform {
    place: [f32; 4],
    irradiance: [f32; 4],
}

/// `CoatedFace` in `material.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct FaceUniform {
    frames: [[[f32; 4]; 3]; 2],
    tile: [f32; 4],
}

/// Coats on the adapter.
#[derive(Debug)]
pub(super) struct Dress {
    coats: Vec<DressedCoat>,
    /// Faces that carry none.
    pub(super) bare: Vertices,
    lights: wgpu::Buffer,
}

#[derive(Debug)]
struct DressedCoat {
    numbers: CoatUniform,
    uniform: wgpu::Buffer,
    vertices: Vertices,
    pipeline: wgpu::RenderPipeline,
    surface: wgpu::BindGroup,
    bindings: wgpu::BindGroup,
}

impl Dress {
    pub(super) fn new(device: &Device, surface: &Surface, coats: &Coats<'_>) -> Result<Self, GpuError> {
        let mesh = coats.mesh();
        let count = mesh.mesh.faces.len();
        let face = |face: usize| coats.face_numbers(face).map_or_else(FaceUniform::default, FaceUniform::of);
        let faces: Vec<FaceUniform> = (0..count).map(face).collect();
        let faces = device.buffer(cast_slice(&faces), wgpu::BufferUsages::STORAGE)?;
        let lights = vec![0; MOST_LIGHTS * size_of::<LightUniform>()];
        let lights = device.buffer(&lights, wgpu::BufferUsages::STORAGE)?;
        let coat_of: Vec<Option<usize>> = (0..count).map(|f| coats.face_numbers(f).map(|n| n.coat)).collect();
        let dressed = |(k, coat): (usize, CoatNumbers<'_>)| {
            let vertices = surface.vertices(device, mesh, |face| coat_of[face] == Some(k))?;
            let mesh_atlas = mesh.atlas_size.map(|side| side as f32);
            DressedCoat::new(device, (surface, vertices), &coat, mesh_atlas, [&lights, &faces])
        };
        Ok(Self {
            bare: surface.vertices(device, mesh, |face| coat_of[face].is_none())?,
            coats: coats.numbers().enumerate().map(dressed).collect::<Result<_, GpuError>>()?,
            lights,
        })
    }

    /// Takes the light to the adapter; `middle` is where the shaders' coordinates begin.
    pub(super) fn light(&self, device: &Device, lighting: &Lighting, middle: &Point3<f64>) -> Result<(), GpuError> {
        let lights: Vec<LightUniform> =
            lighting.lights.iter().filter_map(|light| LightUniform::of(light, middle)).collect();
        device.check("lights", lights.len() as u64, MOST_LIGHTS as u64)?;
        device.queue().write_buffer(&self.lights, 0, cast_slice(&lights));
        for coat in &self.coats {
            let numbers = CoatUniform { lights: lights.len() as u32, gain: lighting.stops.exp2(), ..coat.numbers };
            device.queue().write_buffer(&coat.uniform, 0, bytes_of(&numbers));
        }
        Ok(())
    }

    /// Draws the faces that carry materials.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        for coat in &self.coats {
            pass.set_pipeline(&coat.pipeline);
            pass.set_bind_group(0, &coat.surface, &[]);
            pass.set_bind_group(1, &coat.bindings, &[]);
            coat.vertices.draw(pass);
        }
    }
}

impl DressedCoat {
    fn new(
        device: &Device,
        (surface, vertices): (&Surface, Vertices),
        coat: &CoatNumbers<'_>,
        mesh_atlas: [f32; 2],
        [lights, faces]: [&wgpu::Buffer; 2],
    ) -> Result<Self, GpuError> {
        let refused = || GpuError::Unsupported { what: "a material whose codec has no shader".to_owned() };
        let (source, numbers, layout) = match coat.tables.as_ref().ok_or_else(refused)? {
            Tables::GaussianMixture(tables) => {
                let (numbers, layout) = of_mixture(tables, &coat.frame.lights, &coat.frame.views);
                (CODECS[0], numbers, layout)
            }
            Tables::MultilevelVq(tables) => {
                let (numbers, layout) = of_vq(tables);
                (CODECS[1], numbers, layout)
            }
        };
        let pipeline = surface::pipeline(device, &program(source), "lit");
        let tables = device.buffer(cast_slice(&numbers), wgpu::BufferUsages::STORAGE)?;
        let uniform = device.buffer(&[0; size_of::<CoatUniform>()], wgpu::BufferUsages::UNIFORM)?;
        let buffers = [&uniform, lights, faces, &tables].map(wgpu::Buffer::as_entire_binding);
        let bindings = device.bind(&pipeline, 1, &buffers);
        let surface = surface.bind_faces(device, &pipeline);
        let numbers = CoatUniform { mesh_atlas, layout, ..CoatUniform::of(coat) };
        Ok(Self { numbers, uniform, vertices, pipeline, surface, bindings })
    }
}

impl CoatUniform {
    fn of(coat: &CoatNumbers<'_>) -> Self {
        let (encoding, floor, range) = match coat.encoding {
            Encoding::Srgb => (0, 0.0, 0.0),
            Encoding::Linear => (1, 0.0, 0.0),
            Encoding::Log { floor, peak } => (2, floor, (peak / floor).ln_1p()),
        };
        Self {
            size: [coat.frame.width, coat.frame.height].map(|side| side as u32),
            includes_cosine: u32::from(coat.includes_cosine),
            lowest: coat.lowest.map(|z| z as f32),
            // A coat whose exposure is not positive is black.
            inverse_exposure: if coat.exposure > 0.0 { 1.0 / coat.exposure } else { 0.0 },
            encoding,
            floor,
            range,
            ..Self::default()
        }
    }
}

impl LightUniform {
    /// `None` where it does not shine.
    fn of(light: &Light, middle: &Point3<f64>) -> Option<Self> {
        let (place, irradiance) = match light {
            Light::Directional { toward, irradiance } => (toward.try_normalize(0.0)?.push(0.0), irradiance),
            Light::Point { position, intensity } => ((position - middle).push(1.0), intensity),
        };
        let [r, g, b] = *irradiance;
        let light = Self { place: place.cast().into(), irradiance: [r, g, b, 0.0] };
        light.place.iter().chain(&light.irradiance).all(|v| v.is_finite()).then_some(light)
    }
}

impl FaceUniform {
    fn of(face: crate::material::numbers::FaceNumbers) -> Self {
        let four = |v: Vector3<f64>| -> [f32; 4] { v.push(0.0).cast().into() };
        let mirrored = if face.is_mirrored { 1.0 } else { 0.0 };
        Self { frames: face.frames.map(|corners| corners.map(four)), tile: [face.scale as f32, mirrored, 0.0, 0.0] }
    }
}

/// Numbers in a row, floats by their bits.
#[derive(Debug, Default)]
struct Row(Vec<u32>);

impl Row {
    fn here(&self) -> u32 {
        self.0.len() as u32
    }

    fn floats(&mut self, values: &[f32]) {
        self.0.extend(values.iter().map(|v| v.to_bits()));
    }

    /// Appends links; where they begin.
    fn links(&mut self, links: &[(u32, f32)]) -> u32 {
        let start = self.here();
        self.0.extend(links.iter().flat_map(|(child, scale)| [*child, scale.to_bits()]));
        start
    }

    /// Appends a set of directions as `blend` in `gaussian_mixture.wgsl` reads it.
    fn directions(&mut self, set: &DirectionSet) -> [u32; 4] {
        let (start, complex) = (self.here(), set.complex());
        let floats = |v: &Vector3<f64>| -> [f32; 3] { v.cast().into() };
        complex.sites().iter().for_each(|site| self.floats(&floats(site)));
        for triangle in complex.triangles() {
            let [a, b, c] = triangle.map(|site| complex.sites()[site as usize]);
            // Rows of the inverse of [a b c]; of a flat one none that anything is inside of.
            let (rows, det) = ([b.cross(&c), c.cross(&a), a.cross(&b)], a.dot(&b.cross(&c)));
            rows.iter().for_each(|row| self.floats(&if det == 0.0 { [0.0; 3] } else { floats(&(row / det)) }));
            self.0.extend(triangle);
        }
        self.0.extend(complex.edges().as_flattened());
        [start, complex.sites().len() as u32, complex.triangles().len() as u32, complex.edges().len() as u32]
    }
}

/// Tables and layout of `gaussian_mixture.wgsl`.
fn of_mixture(tables: &MixtureTables, lights: &DirectionSet, views: &DirectionSet) -> (Vec<u32>, [[u32; 4]; 4]) {
    let mut row = Row::default();
    for component in &tables.components {
        row.floats(&component.mean);
        row.floats(&component.scale);
        row.floats(&component.color);
        row.floats(&[component.bias]);
    }
    let mean = row.here();
    row.floats(tables.mean.as_flattened());
    let sets = [lights, views].map(|set| row.directions(set));
    let [x, y] = tables.periods.map(f32::to_bits);
    (row.0, [[0, tables.components.len() as u32, mean, lights.len() as u32], sets[0], sets[1], [x, y, 0, 0]])
}

/// Tables and layout of `multilevel_vq.wgsl`.
fn of_vq(tables: &VqTables) -> (Vec<u32>, [[u32; 4]; 4]) {
    let mut row = Row::default();
    row.floats(tables.turns.as_flattened());
    let [plane, texels, slices] = [&tables.plane, &tables.texels, &tables.slices].map(|links| row.links(links));
    let views = row.here();
    row.0.extend(tables.views.iter().flat_map(|(slices, colors, scale)| [*slices, *colors, scale.to_bits()]));
    let rows = row.here();
    row.floats(&tables.rows);
    let color_slices = row.here();
    row.0.extend(&tables.color_slices);
    let color_rows = row.here();
    row.floats(tables.color_rows.as_flattened());
    let grid = [tables.grid.alpha, tables.grid.beta, tables.grid.theta, tables.grid.phi].map(|nodes| nodes as u32);
    let rim = f32::from(tables.grid.rim_deg).to_radians();
    let along = u32::from(tables.grid.axis == texture::btf::multilevel_vq::Axis::Along);
    let lists = [[along, tables.plane.len() as u32, 0, plane], [texels, views, slices, rows]];
    (row.0, [grid, lists[0], lists[1], [color_slices, color_rows, rim.to_bits(), 0]])
}
