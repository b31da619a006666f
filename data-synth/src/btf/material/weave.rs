//! A tartan: 2/2 twill, the same colours in the same order in warp (along y) and weft (along x). Each
//! thread passes over two and under two, one step further in each row.

use super::cells::random;
use super::yarn::Yarn;
use crate::btf::patch::Patch;
use crate::material::{Finish, Vec3};
use crate::texture_field::color;
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Length of the period.
pub(super) const SIDE_MM: f64 = 8.0;
/// Threads each way; a multiple of four, the repeat of the twill.
const THREADS: usize = 12;
/// Points between two crossings.
const POINTS: usize = 6;
/// The sett: one colour per thread.
const SETT: [Dye; THREADS] = [
    Dye::Navy,
    Dye::Navy,
    Dye::Navy,
    Dye::Navy,
    Dye::Green,
    Dye::Green,
    Dye::Green,
    Dye::Green,
    Dye::Red,
    Dye::Red,
    Dye::Cream,
    Dye::Red,
];

#[derive(Clone, Copy, Debug)]
enum Dye {
    Navy,
    Green,
    Red,
    Cream,
}

impl Dye {
    fn color(self) -> Vec3 {
        match self {
            Self::Navy => color([38, 52, 104]),
            Self::Green => color([44, 104, 68]),
            Self::Red => color([184, 40, 40]),
            Self::Cream => color([228, 212, 170]),
        }
    }
}

/// The cloth.
pub(super) fn patch(seed: u64) -> Patch {
    let mut patch = Patch::new(SIDE_MM, Finish::glazed(0.4, 1.5));
    let pitch = SIDE_MM / THREADS as f64;
    for (thread, dye) in SETT.iter().enumerate() {
        for is_warp in [true, false] {
            let yarn = Yarn {
                radius: [0.47 * pitch, 0.26 * pitch],
                plies: 1,
                turns: THREADS as f64 / 2.0,
                fibres: 14,
                loose: 36,
                color: dye.color(),
                seed: seed.wrapping_add(2 * thread as u64 + u64::from(is_warp)),
            };
            yarn.spin(&mut patch, &thread_path(seed, thread, is_warp, pitch));
        }
    }
    patch.relief(1, |_, _| -0.75 * pitch, |_| Vec3::repeat(0.03));
    patch
}

fn thread_path(seed: u64, thread: usize, is_warp: bool, pitch: f64) -> Vec<Vector3<f64>> {
    let height = |crossing: usize| {
        let other = crossing % THREADS;
        let over = if is_warp { (thread + other) % 4 < 2 } else { (thread + other) % 4 >= 2 };
        if over { 1.0 } else { -1.0 }
    };
    let drift =
        |crossing: usize| 0.08 * (random(seed, [thread as i64, (crossing % THREADS) as i64, i64::from(is_warp)]) - 0.5);
    let point = |k: usize| {
        let (crossing, t) = (k / POINTS, (k % POINTS) as f64 / POINTS as f64);
        // Half a cosine from one crossing to the next.
        let s = 0.5 - 0.5 * (PI * t).cos();
        let mixed = |f: &dyn Fn(usize) -> f64| f(crossing) * (1.0 - s) + f(crossing + 1) * s;
        let along = (k as f64 / POINTS as f64 + 0.5) * pitch;
        let across = (thread as f64 + 0.5 + mixed(&drift)) * pitch;
        let z = pitch * (0.27 * mixed(&height) - 0.1);
        if is_warp { Vector3::new(across, along, z) } else { Vector3::new(along, across, z) }
    };
    (0..=POINTS * THREADS).map(point).collect()
}
