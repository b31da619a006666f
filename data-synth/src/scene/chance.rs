//! Random numbers for model makers: a stream per model, the same every time.

use crate::sampler::splitmix;
use crate::shape::P;
use std::f64::consts::TAU;

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(super) struct Chance(u64);

impl Chance {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = splitmix(self.0);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [low, high).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in [−size, size).
    pub(super) fn around(&mut self, size: f64) -> f64 {
        self.between(-size, size)
    }

    /// One of `0..n`.
    pub(super) fn below(&mut self, n: u8) -> u8 {
        (self.unit() * f64::from(n)) as u8
    }

    /// A unit vector, uniform over the sphere.
    pub(super) fn direction(&mut self) -> P {
        let (z, turn) = (self.around(1.0), self.between(0.0, TAU));
        let r = (1.0 - z * z).max(0.0).sqrt();
        P::new(r * turn.cos(), r * turn.sin(), z)
    }

    /// Like [`Chance::direction`], within a cube's half size `size` of zero along each axis.
    pub(super) fn jitter(&mut self, size: f64) -> P {
        P::new(self.around(size), self.around(size), self.around(size))
    }
}
