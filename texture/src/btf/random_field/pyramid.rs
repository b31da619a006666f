//! Gaussian–Laplacian pyramid (Burt and Adelson 1983) of fields that continue themselves on all sides, of
//! any size: levels halve, odd sizes are rounded up and resampled. The last band is the coarsest Gaussian;
//! [`collapse`] gives back what [`split`] took to rounding.

/// Coarsest level worth a model, texels a side.
const SMALLEST: usize = 8;
const MOST_BANDS: usize = 4;

/// How many bands a tile has: halving stops at 8 texels.
pub(super) fn band_count(size: [usize; 2]) -> usize {
    let mut side = size[0].min(size[1]);
    let mut bands = 1;
    while bands < MOST_BANDS && side.div_ceil(2) >= SMALLEST {
        side = side.div_ceil(2);
        bands += 1;
    }
    bands
}

/// Sizes of the bands, finest first.
pub(super) fn band_sizes(size: [usize; 2], bands: usize) -> Vec<[usize; 2]> {
    std::iter::successors(Some(size), |s| Some(s.map(|n| n.div_ceil(2)))).take(bands).collect()
}

/// The bands of a field, finest first.
pub(super) fn split(field: &[f64], size: [usize; 2], bands: usize) -> Vec<Vec<f64>> {
    let sizes = band_sizes(size, bands);
    let mut rest = field.to_vec();
    let mut split = Vec::with_capacity(bands);
    for pair in sizes.windows(2) {
        let coarse = resample(&rest, pair[0], pair[1], reduced);
        let smooth = resample(&coarse, pair[1], pair[0], expanded);
        split.push(rest.iter().zip(smooth).map(|(r, s)| r - s).collect());
        rest = coarse;
    }
    split.push(rest);
    split
}

/// The field of these bands.
pub(super) fn collapse(bands: &[Vec<f64>], size: [usize; 2]) -> Vec<f64> {
    let sizes = band_sizes(size, bands.len());
    let Some((coarsest, finer)) = bands.split_last() else { return Vec::new() };
    let mut field = coarsest.clone();
    for (level, band) in finer.iter().enumerate().rev() {
        let smooth = resample(&field, sizes[level + 1], sizes[level], expanded);
        field = band.iter().zip(smooth).map(|(b, s)| b + s).collect();
    }
    field
}

/// A new value from the old ones about a place, wrapped.
type Kernel = fn(&dyn Fn(isize) -> f64, f64) -> f64;

/// Binomial `[1 4 6 4 1]/16` about a place, between texels linear.
fn reduced(at: &dyn Fn(isize) -> f64, place: f64) -> f64 {
    let blurred = |i: isize| (at(i - 2) + at(i + 2) + 4.0 * (at(i - 1) + at(i + 1)) + 6.0 * at(i)) / 16.0;
    let floor = place.floor();
    let (i, share) = (floor as isize, place - floor);
    if share > 0.0 { (1.0 - share) * blurred(i) + share * blurred(i + 1) } else { blurred(i) }
}

/// Cubic B-spline about a place.
fn expanded(at: &dyn Fn(isize) -> f64, place: f64) -> f64 {
    let floor = place.floor();
    let (i, t) = (floor as isize, place - floor);
    let u = 1.0 - t;
    let weights = [u * u * u, 4.0 - 3.0 * t * t * (2.0 - t), 4.0 - 3.0 * u * u * (2.0 - u), t * t * t];
    (-1..3).zip(weights).map(|(k, w)| w / 6.0 * at(i + k)).sum()
}

/// Along x, then along y.
fn resample(field: &[f64], from: [usize; 2], to: [usize; 2], kernel: Kernel) -> Vec<f64> {
    let along_x: Vec<f64> =
        field.chunks_exact(from[0]).flat_map(|row| line(&|i| row[i], from[0], to[0], kernel)).collect();
    let mut result = vec![0.0; to[0] * to[1]];
    for x in 0..to[0] {
        let column = line(&|y| along_x[y * to[0] + x], from[1], to[1], kernel);
        column.into_iter().enumerate().for_each(|(y, v)| result[y * to[0] + x] = v);
    }
    result
}

fn line(values: &dyn Fn(usize) -> f64, from: usize, to: usize, kernel: Kernel) -> Vec<f64> {
    let at = |i: isize| values(i.rem_euclid(from as isize) as usize);
    (0..to).map(|i| kernel(&at, i as f64 * from as f64 / to as f64)).collect()
}
