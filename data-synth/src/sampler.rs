//! Counter-based random numbers, stratified over the samples of a pixel.
//!
//! Every number is a function of (seed, view, pixel, sample, dimension) alone, so pictures do not
//! depend on how pixels are shared among threads. Pairs of dimensions are the first two of Sobol',
//! Owen-scrambled by a hash and padded with independent shuffles (Burley, "Practical Hash-based Owen
//! Scrambling", JCGT 2020; the hash constants are Vegdahl's, 2021).

/// The random numbers of one sample of one pixel.
#[derive(Clone, Debug)]
pub(crate) struct Sampler {
    pixel_seed: u32,
    index: u32,
    mask: u32,
    dimension: u32,
}

impl Sampler {
    /// The stream of sample `index` of `count` of a pixel whose seed is `pixel_seed`.
    pub(crate) fn new(pixel_seed: u32, index: u32, count: u32) -> Self {
        let mask = count.max(1).checked_next_power_of_two().map_or(u32::MAX, |n| n - 1);
        Self { pixel_seed, index, mask, dimension: 0 }
    }

    /// Two numbers in [0, 1), stratified over the samples of the pixel.
    pub(crate) fn pair(&mut self) -> [f32; 2] {
        let seed = mix(self.pixel_seed ^ mix(self.dimension.wrapping_add(0x9e37_79b9)));
        self.dimension += 1;
        // Bits are flipped depending on those above them: aligned blocks of samples stay blocks, and below the
        // highest bit in use this is a permutation. Each dimension gets its own, so that they are independent.
        let index = owen_scramble(self.index, seed) & self.mask;
        let x = owen_scramble(index.reverse_bits(), mix(seed ^ 0xa511_e9b3));
        let y = owen_scramble(sobol_second(index), mix(seed ^ 0x63d8_3595));
        [unit(x), unit(y)]
    }
}

/// A seed for one pixel of one view.
pub(crate) fn pixel_seed(seed: u64, view: usize, x: usize, y: usize) -> u32 {
    let mut state = splitmix(seed ^ 0x5851_f42d_4c95_7f2d);
    for part in [view, x, y] {
        state = splitmix(state ^ part as u64);
    }
    (state >> 32) as u32
}

/// SplitMix64's finalizer (Steele, Lea, Flood 2014) after one step of its counter.
pub(crate) fn splitmix(state: u64) -> u64 {
    let z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A 32-bit finalizer with low bias (Wellons, "Hash Prospector", 2018).
pub(crate) fn mix(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    let x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Uniform in [0, 1) from the 24 leading bits, all that an `f32` holds.
pub(crate) fn unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Nested uniform scramble: each bit is flipped depending on the bits above it.
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// Second dimension of Sobol', whose direction numbers are the rows of Pascal's triangle mod 2.
fn sobol_second(mut index: u32) -> u32 {
    let (mut v, mut result) = (1_u32 << 31, 0);
    while index != 0 {
        if index & 1 == 1 {
            result ^= v;
        }
        index >>= 1;
        v ^= v >> 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_samples_fill_every_elementary_interval() {
        // A (0, 4, 2)-net has exactly one point in each dyadic box of area 1/16.
        for dimension in 0..4 {
            for (nx, ny) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
                let mut seen = [false; 16];
                for i in 0..16 {
                    let mut s = Sampler::new(77, i, 16);
                    s.dimension = dimension;
                    let [x, y] = s.pair();
                    seen[(x * nx as f32) as usize * ny + (y * ny as f32) as usize] = true;
                }
                assert!(seen.iter().all(|&s| s), "{nx}x{ny} in dimension {dimension}");
            }
        }
    }

    #[test]
    fn quarters_of_the_samples_are_nets_too() {
        for quarter in 0..4 {
            let mut seen = [false; 4];
            for i in 4 * quarter..4 * quarter + 4 {
                let [x, y] = Sampler::new(5, i, 16).pair();
                seen[(x * 2.0) as usize * 2 + (y * 2.0) as usize] = true;
            }
            assert!(seen.iter().all(|&s| s), "{quarter}");
        }
    }

    #[test]
    fn dimensions_are_independent() {
        // ∫∫ of the product of two dimensions' numbers, one from each pair, is a quarter; its mean over pixels of
        // sixteen samples would be off by 1/12 were they the same numbers, and would vary more from pixel to
        // pixel than by chance were they tied in another way for each.
        let pixels = 4000;
        let estimate = |pixel: u32| {
            let product = |i| {
                let mut s = Sampler::new(mix(pixel), i, 16);
                let ([a, _], [_, b]) = (s.pair(), s.pair());
                (f64::from(a) - 0.5) * (f64::from(b) - 0.5)
            };
            (0..16).map(product).sum::<f64>() / 16.0
        };
        let values: Vec<f64> = (0..pixels).map(estimate).collect();
        let mean = values.iter().sum::<f64>() / f64::from(pixels);
        let square = values.iter().map(|v| v * v).sum::<f64>() / f64::from(pixels);
        // Independent: mean zero, variance (1/12)²/16. Neighbours in a net lie on opposite sides in every
        // dimension, so that the sign of their products is the same, which may double it.
        assert!(mean.abs() < 4.0 / 12.0 / 4.0 / f64::from(pixels).sqrt(), "{mean}");
        assert!(square < 2.0 / 144.0 / 16.0, "{square} against {}", 1.0 / 144.0 / 16.0);
    }

    #[test]
    fn pixels_differ() {
        assert_ne!(pixel_seed(1, 0, 0, 1), pixel_seed(1, 0, 1, 0));
        assert_ne!(pixel_seed(1, 0, 0, 0), pixel_seed(2, 0, 0, 0));
    }
}
