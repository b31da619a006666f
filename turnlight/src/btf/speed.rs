//! How fast a codec answers.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::Serialize;
use std::hint::black_box;
use std::time::{Duration, Instant};
use texture::btf::Sampler;
use texture::btf::multilevel_vq::MultilevelVq;

/// Questions drawn once and asked over and over: more than the first caches hold.
const QUESTIONS: usize = 1 << 16;
/// How long a run of each figure takes, and how often it is run.
const AT_LEAST: Duration = Duration::from_millis(50);
const RUNS: usize = 10;
/// Polar angle up to which materials are measured.
const THETA_MAX: f32 = 75.0;

/// Answers per second.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Speed {
    /// Random texels and directions on one core.
    pub evals_per_s_core: f64,
    /// The same on all of the pool's.
    pub evals_per_s_all: f64,
    /// Whole tiles under one light and view, texels on one core.
    pub texels_per_s_core: f64,
}

struct Question {
    texel: usize,
    light: Vector3<f32>,
    view: Vector3<f32>,
}

/// Times a codec.
pub fn speed(sampler: &dyn Sampler, seed: u64) -> Speed {
    let questions = questions(sampler.frame().texels(), seed);
    let answer = |q: &Question| black_box(sampler.value(q.texel, &q.light, &q.view));
    let texels = sampler.frame().texels();
    Speed {
        evals_per_s_core: rate(|n| {
            let q = &questions[n % QUESTIONS..][..256];
            q.iter().for_each(|q| {
                answer(q);
            });
            256
        }),
        evals_per_s_all: rate(|_| {
            questions.par_chunks(256).for_each(|chunk| {
                chunk.iter().for_each(|q| {
                    answer(q);
                });
            });
            QUESTIONS
        }),
        texels_per_s_core: rate(|n| {
            let q = &questions[n / texels.max(1) % QUESTIONS];
            black_box(sampler.picture(&q.light, &q.view));
            texels
        }),
    }
}

/// Directions of light drawn per second on one core.
pub(super) fn draws(codec: &MultilevelVq, seed: u64) -> f64 {
    let questions = questions(codec.frame().texels(), seed);
    rate(|n| {
        for (i, q) in questions[n % QUESTIONS..][..256].iter().enumerate() {
            // Any numbers will do: those of the directions at hand.
            let u = [q.light.x.abs(), q.light.y.abs(), i as f32 / 256.0];
            black_box(codec.sample(q.texel, &q.view, u));
        }
        256
    })
}

fn questions(texels: usize, seed: u64) -> Vec<Question> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut direction = move || {
        let cos = 1.0 - random.random::<f32>() * (1.0 - THETA_MAX.to_radians().cos());
        let (sin, phi) = ((1.0 - cos * cos).sqrt(), random.random::<f32>() * std::f32::consts::TAU);
        Vector3::new(sin * phi.cos(), sin * phi.sin(), cos)
    };
    let mut texel = Pcg64Mcg::seed_from_u64(seed ^ 1);
    (0..QUESTIONS)
        .map(|_| Question { texel: texel.random_range(0..texels), light: direction(), view: direction() })
        .collect()
}

/// Answers per second of `work`, which is told how many came before and tells how many it gave: the best of several
/// runs, for whatever else the machine does takes from all.
fn rate(mut work: impl FnMut(usize) -> usize) -> f64 {
    let mut run = || {
        let (start, mut done) = (Instant::now(), 0);
        while start.elapsed() < AT_LEAST {
            done += work(done);
        }
        done as f64 / start.elapsed().as_secs_f64()
    };
    (0..RUNS).map(|_| run()).fold(0.0, f64::max)
}
