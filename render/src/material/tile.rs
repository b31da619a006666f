//! What answers for the texels of a material, sampled or synthesized.
//!
//! A synthesizer makes whole pictures; one per look-up would be hopeless. So the picture of a pair of
//! *measured* directions is made when it is first asked for and kept (6 bytes a texel), and directions between are
//! interpolated from up to 3 × 3 of them. The same seed makes the same surface under all of them. A flat
//! tile under one light and view is made for just these.

use nalgebra::Vector3;
use std::sync::OnceLock;
use texture::btf::{Answer, Frame, Material, Sampler, Synthesizer};

/// One step of a kept sample.
const STEPS: f32 = 65535.0;

/// A material as both renderers ask for it.
pub enum Tile<'a> {
    /// As measured.
    Sampled(&'a dyn Sampler),
    /// Made.
    Synthesized(SynthesizedTile<'a>),
}

/// A synthesized tile.
pub struct SynthesizedTile<'a> {
    synthesizer: &'a dyn Synthesizer,
    seed: u64,
    frame: Frame,
    /// Per (view, light): (y, x, channel), 0..=1 in 16 bits.
    pictures: Vec<OnceLock<Vec<u16>>>,
}

impl<'a> Tile<'a> {
    /// The tile of a material; a synthesized one is as large as the one measured.
    pub fn of(material: &'a Material, seed: u64) -> Self {
        match material.codec.answer() {
            Answer::Sampler(sampler) => Self::Sampled(sampler),
            Answer::Synthesizer(synthesizer) => {
                let frame = synthesizer.frame();
                Self::Synthesized(SynthesizedTile::new(synthesizer, [frame.width, frame.height], seed))
            }
        }
    }

    /// What answers texel by texel.
    pub fn sampler(&self) -> &dyn Sampler {
        match self {
            Self::Sampled(sampler) => *sampler,
            Self::Synthesized(tile) => tile,
        }
    }
}

impl<'a> SynthesizedTile<'a> {
    /// A tile of `size` (columns, rows) texels.
    pub fn new(synthesizer: &'a dyn Synthesizer, size: [usize; 2], seed: u64) -> Self {
        let frame = Frame { width: size[0], height: size[1], ..synthesizer.frame().clone() };
        let pictures = (0..frame.pairs()).map(|_| OnceLock::new()).collect();
        Self { synthesizer, seed, frame, pictures }
    }

    fn sample(&self, view: usize, light: usize, texel: usize) -> [f32; 3] {
        let make = || -> Vec<u16> {
            let (l, v) = (self.frame.lights.vectors()[light].cast(), self.frame.views.vectors()[view].cast());
            self.picture(&l, &v).into_iter().map(|s| (s.clamp(0.0, 1.0) * STEPS).round() as u16).collect()
        };
        let kept = &self.pictures[view * self.frame.lights.len() + light];
        // Made outside of the lock: while the synthesizer waits for its own threads, this one may come here again.
        let picture = match kept.get() {
            Some(picture) => picture,
            None => {
                let made = make();
                kept.get_or_init(|| made)
            }
        };
        [0, 1, 2].map(|c| picture.get(3 * texel + c).map_or(0.0, |&s| f32::from(s) / STEPS))
    }
}

impl Sampler for SynthesizedTile<'_> {
    fn frame(&self) -> &Frame {
        &self.frame
    }

    fn value(&self, texel: usize, light: &Vector3<f32>, view: &Vector3<f32>) -> [f32; 3] {
        let mut sum = [0.0; 3];
        let lights = self.frame.lights.blend(light).entries;
        for (v, view_weight) in self.frame.views.blend(view).entries.into_iter().filter(|e| e.1 > 0.0) {
            for (l, light_weight) in lights.into_iter().filter(|e| e.1 > 0.0) {
                let sample = self.sample(v as usize, l as usize, texel);
                (0..3).for_each(|c| sum[c] += view_weight * light_weight * sample[c]);
            }
        }
        sum
    }

    fn picture(&self, light: &Vector3<f32>, view: &Vector3<f32>) -> Vec<f32> {
        self.synthesizer.picture([self.frame.width, self.frame.height], self.seed, light, view)
    }
}

impl std::fmt::Debug for Tile<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tile").field("frame", self.sampler().frame()).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for SynthesizedTile<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SynthesizedTile").field("frame", &self.frame).field("seed", &self.seed).finish_non_exhaustive()
    }
}
