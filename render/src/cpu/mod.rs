//! The fast renderer: tiles, edge functions, deferred shading; the picture [`crate::reference`] defines.
//!
//! Four stages, each parallel and each with the same result whatever the thread count:
//!
//! 1. *setup*: every face becomes three edge functions over the pixels of an ideal pinhole, by
//!    homogeneous rasterisation (Olano and Greer, Triangle Scan Conversion using 2D Homogeneous
//!    Coordinates, 1997). They hold for faces that cross the camera plane too, so nothing is clipped;
//! 2. *visibility*: tile by tile, the nearest face of each sub-sample, then its texture coordinates
//!    and mip level;
//! 3. *mips*: only as many levels as some visible sub-sample asks for;
//! 4. *shading*: one trilinear lookup per visible sub-sample, or its material.
//!
//! Edge functions are evaluated in `f64` and are exactly opposite on both sides of a shared edge, so
//! a sub-sample on the edge belongs to one of the two faces, never to both or none.
//!
//! A lens is exact: sub-samples are carried to the ideal plane once per camera model (microseconds
//! each, so a second for the first frame; a [`Player`] keeps them) and faces are tested there.

mod fragments;
mod samples;
mod setup;
mod shade;
mod visibility;

use crate::filter::MipChain;
use crate::material::Lit;
use crate::{RenderOptions, frame_size, is_usable, resolve};
use capture::{Camera, Image};
use fragments::{Fragments, Scene};
use geometry::TexturedMesh;
use rayon::prelude::*;
use samples::Samples;
use shade::Look;
use std::time::{Duration, Instant};
use visibility::Nearest;

/// How long the stages of the last frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Edge functions and bins, and the lens where it changed.
    pub setup: Duration,
    /// Nearest faces, texture coordinates, mip levels.
    pub visibility: Duration,
    /// Reductions of the atlas.
    pub mips: Duration,
    /// Texture lookups, averages, the picture.
    pub shading: Duration,
}

/// Plays one mesh: keeps between frames what does not depend on the pose.
#[derive(Debug)]
pub struct Player<'a> {
    mesh: &'a TexturedMesh,
    options: RenderOptions,
    samples: Option<Samples>,
    /// Kept for their memory alone.
    tiles: Vec<Fragments>,
    times: StageTimes,
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
        Self { mesh, options, samples: None, tiles: Vec::new(), times: StageTimes::default() }
    }

    /// How long the stages of the last frame took.
    pub fn times(&self) -> StageTimes {
        self.times
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
        self.times = StageTimes::default();
        let (width, height) = frame_size(camera);
        let nothing = resolve::Accumulator::default().finish(1, self.options.background);
        let mut frame = Image::filled(width, height, nothing);
        if width == 0 || height == 0 || !is_usable(camera) {
            return frame;
        }
        let start = Instant::now();
        let n = self.options.per_side();
        let samples = match self.samples.take() {
            Some(kept) if kept.fit(&camera.intrinsics, n) => kept,
            _ => Samples::new(camera, n),
        };
        let samples = self.samples.insert(samples);
        let faces = setup::faces(self.mesh, camera);
        let bins = samples.bin(&faces);
        let binned = Instant::now();
        let (atlas_size, coats) = ([atlas.width(), atlas.height()], lit.map(|lit| lit.coats));
        let scene = Scene { samples, mesh: self.mesh, faces: &faces, atlas_size, coats };
        self.tiles.resize_with(samples.tiles(), Fragments::default);
        let find = |nearest: &mut Nearest, (tile, fragments): (usize, &mut Fragments)| {
            fragments.find(&scene, tile, bins.of(tile), nearest);
        };
        self.tiles.par_iter_mut().enumerate().for_each_init(Nearest::default, find);
        let seen = Instant::now();
        let top = self.tiles.iter().map(Fragments::top_level).max().unwrap_or(0);
        let chain = MipChain::build(atlas, top);
        let reduced = Instant::now();
        let look = Look { chain: &chain, lit, eye: camera.center(), background: self.options.background };
        shade::frame(&mut frame, samples, &self.tiles, &look);
        self.times = StageTimes {
            setup: binned - start,
            visibility: seen - binned,
            mips: reduced - seen,
            shading: reduced.elapsed(),
        };
        frame
    }
}
