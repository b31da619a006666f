//! The fast renderer: tiles, edge functions, deferred shading; the picture [`crate::reference`] defines.
//!
//! Four stages, each parallel and each with the same result whatever the thread count:
//!
//! 1. *setup*: every face becomes three edge functions over the pixels of an ideal pinhole, by
//!    homogeneous rasterisation (Olano and Greer, Triangle Scan Conversion using 2D Homogeneous
//!    Coordinates, 1997). They hold for faces that cross the camera plane too, so nothing is clipped;
//! 2. *visibility*: tile by tile, the nearest face of each sub-sample of whatever object, and what the faces that show
//!    need of their textures: which blocks, up to which mip level;
//! 3. *blend*: just that is made: [`crate::blend`] for models, reductions of an atlas handed in;
//! 4. *shading*: one trilinear lookup per visible sub-sample, or its material.
//!
//! [`Player`] draws one mesh with textures handed to it in `f32`, [`ScenePlayer`] models by what their files hold.
//!
//! Edge functions are evaluated in `f64` and are exactly opposite on both sides of a shared edge, so
//! a sub-sample on the edge belongs to one of the two faces, never to both or none.
//!
//! A lens is exact: sub-samples are carried to the ideal plane once per camera model (microseconds
//! each, so a second for the first frame; players keep them) and faces are tested there.
//!
//! Loops over sub-samples are compiled for AVX2 too and take it where it is: nothing is fused or reordered, so pictures
//! do not depend on the machine.

mod samples;
mod scene;
mod seen;
mod setup;
mod shade;
mod visibility;

#[cfg(feature = "gpu")]
pub(crate) use scene::distinct;
pub use scene::{Object, ScenePlayer};

use crate::blend::Wanted;
use crate::filter::{Channel, MipChain};
use crate::material::{Coats, Lit};
use crate::pose::Pose;
use crate::simd::Level;
use crate::{RenderOptions, frame_size, is_usable, resolve};
use capture::{Camera, Image};
use geometry::TexturedMesh;
use rayon::prelude::*;
use samples::Samples;
use seen::{Find, Geometry, Seen};
use setup::Faces;
use shade::{Look, Shading};
use std::time::{Duration, Instant};
use visibility::Nearest;

/// How long the stages of the last frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Edge functions and bins, and the lens where it changed.
    pub setup: Duration,
    /// Nearest faces, and what they need of their textures.
    pub visibility: Duration,
    /// Layers blended, atlases reduced.
    pub blend: Duration,
    /// Texture lookups, averages, the picture.
    pub shading: Duration,
}

/// Plays one mesh: keeps between frames what does not depend on the pose.
#[derive(Debug)]
pub struct Player<'a> {
    mesh: &'a TexturedMesh,
    canvas: Canvas,
}

/// What frames are drawn on, kept between them.
#[derive(Debug)]
struct Canvas {
    options: RenderOptions,
    level: Level,
    samples: Option<Samples>,
    /// Kept for their memory alone, as what tiles see.
    faces: Faces,
    tiles: Vec<Seen>,
    times: StageTimes,
}

/// One of the meshes in a frame.
#[derive(Debug)]
struct Part<'a> {
    mesh: &'a TexturedMesh,
    pose: Pose,
    /// Texels across and down.
    atlas_size: [usize; 2],
    /// What lies on the mesh.
    coats: Option<&'a Coats<'a>>,
    /// Where what is needed of the texture is written down.
    wanted: &'a Wanted,
}

/// Draws one frame; the same contract as [`crate::reference::render`].
pub fn render(
    mesh: &TexturedMesh,
    atlas: &Image<[f32; 3]>,
    camera: &Camera,
    options: &RenderOptions,
) -> Image<[u8; 4]> {
    Player::new(mesh, *options).render(atlas, camera)
}

/// The same with materials, which must have been laid over `mesh`; as [`crate::reference::render_lit`].
pub fn render_lit(
    mesh: &TexturedMesh,
    atlas: &Image<[f32; 3]>,
    lit: &Lit<'_>,
    camera: &Camera,
    options: &RenderOptions,
) -> Image<[u8; 4]> {
    Player::new(mesh, *options).render_lit(atlas, lit, camera)
}

impl<'a> Player<'a> {
    /// A player of `mesh`.
    pub fn new(mesh: &'a TexturedMesh, options: RenderOptions) -> Self {
        Self { mesh, canvas: Canvas::new(options) }
    }

    /// How long the stages of the last frame took.
    pub fn times(&self) -> StageTimes {
        self.canvas.times
    }

    /// Draws one frame with `atlas` (encoded 0..=255, unclamped): RGBA, 8 bit encoded, not
    /// premultiplied, alpha the share of covered sub-samples. See [`crate::reference::render`].
    pub fn render(&mut self, atlas: &Image<[f32; 3]>, camera: &Camera) -> Image<[u8; 4]> {
        self.draw(atlas, None, camera)
    }

    /// The same with materials, which must have been laid over the player's mesh.
    pub fn render_lit(&mut self, atlas: &Image<[f32; 3]>, lit: &Lit<'_>, camera: &Camera) -> Image<[u8; 4]> {
        self.draw(atlas, Some(lit), camera)
    }

    fn draw(&mut self, atlas: &Image<[f32; 3]>, lit: Option<&Lit<'_>>, camera: &Camera) -> Image<[u8; 4]> {
        let mut frame = Image::filled(0, 0, [0; 4]);
        let atlas_size = [atlas.width(), atlas.height()];
        let wanted = Wanted::none(atlas_size);
        let coats = lit.map(|lit| lit.coats);
        let part = Part { mesh: self.mesh, pose: Pose::default(), atlas_size, coats, wanted: &wanted };
        self.canvas.draw(&[part], camera, &mut frame, || {
            let chain = MipChain::build(atlas, wanted.top());
            vec![Look { chain, lit: lit.copied(), eye: camera.center() }]
        });
        frame
    }
}

impl Canvas {
    fn new(options: RenderOptions) -> Self {
        let (level, times) = (Level::widest(), StageTimes::default());
        Self { options, level, samples: None, faces: Faces::default(), tiles: Vec::new(), times }
    }

    /// Draws `parts`; `looks`, one per part, are asked for when it is known what they must hold. `frame` is kept for its
    /// memory alone.
    fn draw<'l, T: Channel>(
        &mut self,
        parts: &[Part<'_>],
        camera: &Camera,
        frame: &mut Image<[u8; 4]>,
        looks: impl FnOnce() -> Vec<Look<'l, T>>,
    ) {
        self.times = StageTimes::default();
        let (width, height) = frame_size(camera);
        let background = self.options.background;
        if (frame.width(), frame.height()) != (width, height) {
            *frame = Image::filled(width, height, [0; 4]);
        }
        if width == 0 || height == 0 || !is_usable(camera) {
            return frame.pixels_mut().fill(resolve::Accumulator::default().finish(1, background));
        }
        let start = Instant::now();
        let n = self.options.per_side();
        let samples = match self.samples.take() {
            Some(kept) if kept.fit(&camera.intrinsics, n) => kept,
            _ => Samples::new(camera, n),
        };
        let samples = &*self.samples.insert(samples);
        self.faces.set_up(parts, camera, samples);
        let faces = &self.faces;
        let binned = Instant::now();
        let geometry = Geometry { samples, parts, faces };
        self.tiles.resize_with(samples.tiles(), Seen::default);
        let level = self.level;
        self.tiles.par_iter_mut().enumerate().for_each_init(Default::default, |state, (tile, seen)| {
            let (nearest, candidates): &mut (Nearest, Vec<u32>) = state;
            faces.gather(tile, candidates);
            level.run(Find { geometry: &geometry, tile, candidates, nearest, seen });
        });
        let found = Instant::now();
        let looks = looks();
        let blended = Instant::now();
        Shading { samples, tiles: &self.tiles, looks: &looks, background }.draw(frame, level);
        self.times = StageTimes {
            setup: binned - start,
            visibility: found - binned,
            blend: blended - found,
            shading: blended.elapsed(),
        };
    }
}
