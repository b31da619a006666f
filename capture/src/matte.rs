//! Shapes of mattes: distance, erosion and growth, smoothing, connected parts.

use crate::{Image, View};

impl View {
    /// The matte shrunk by `px` pixels (grown where negative), to keep mixed edge pixels out of textures.
    /// What lies outside the frame does not erode.
    pub fn eroded_matte(&self, px: f64) -> Image<u8> {
        erode(&self.matte, px)
    }
}

/// Shrinks the object (≥ 128) of a matte by `px` pixels, any fraction; grows it by `−px` where negative.
/// The new edge is a ramp one pixel wide. 0 returns the matte unchanged; NaN counts as 0.
pub fn erode(matte: &Image<u8>, px: f64) -> Image<u8> {
    if px == 0.0 || px.is_nan() {
        return matte.clone();
    }
    let distance = signed_distance(matte);
    let pixels = matte.pixels().iter().zip(distance.pixels()).map(|(&old, &d)| {
        let new = ((f64::from(d) - px + 0.5).clamp(0.0, 1.0) * 255.0).round() as u8;
        if px > 0.0 { old.min(new) } else { old.max(new) }
    });
    Image::from_pixels(matte.width(), matte.height(), pixels.collect()).unwrap_or_default()
}

/// Grows the object of a matte by `px` pixels.
pub fn grow(matte: &Image<u8>, px: f64) -> Image<u8> {
    erode(matte, -px)
}

/// Whether the matte has hard edges: no level but 0 and 255.
pub fn is_binary(matte: &Image<u8>) -> bool {
    matte.pixels().iter().all(|&v| v == 0 || v == 255)
}

/// Gives a hard-edged matte a ramp, by a Gaussian of `sigma` pixels, so that its contour at half level
/// runs between the steps of the pixel grid. Curves shrink by σ²κ/2: keep `sigma` near 0.7 to 1
///. Outside the frame the border pixel is repeated.
pub fn smooth(matte: &Image<u8>, sigma: f64) -> Image<u8> {
    if sigma.is_nan() || sigma <= 0.0 {
        return matte.clone();
    }
    let blurred = blur(&matte.map(f32::from), sigma.min(100.0));
    blurred.map(|v| v.round().clamp(0.0, 255.0) as u8)
}

/// Signed Euclidean distance in pixels of every pixel centre to the edge of the object (≥ 128), positive
/// inside; the edge runs half way between centres. Without an edge: ± infinity.
pub fn signed_distance(matte: &Image<u8>) -> Image<f32> {
    let inside = squared_distance(&matte.map(|v| v < 128));
    let outside = squared_distance(&matte.map(|v| v >= 128));
    let pixels = inside.pixels().iter().zip(outside.pixels());
    let signed = pixels.map(|(&i, &o)| if i > 0.0 { i.sqrt() - 0.5 } else { 0.5 - o.sqrt() });
    Image::from_pixels(matte.width(), matte.height(), signed.collect())
        .unwrap_or_else(|| Image::filled(matte.width(), matte.height(), 0.0))
}

/// Squared distance of each pixel to the nearest `true`, exact, separable: the lower envelope of
/// parabolas (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012).
fn squared_distance(target: &Image<bool>) -> Image<f32> {
    let (width, height) = (target.width(), target.height());
    let mut image = target.map(|t| if t { 0.0 } else { f32::INFINITY });
    for x in 0..width {
        let column: Vec<f32> = (0..height).map(|y| image.at(x, y)).collect();
        for (y, d) in envelope(&column).into_iter().enumerate() {
            image.set(x, y, d);
        }
    }
    for y in 0..height {
        let row = envelope(image.row(y));
        image.pixels_mut()[y * width..(y + 1) * width].copy_from_slice(&row);
    }
    image
}

/// `min_j (i − j)² + f(j)` for every i.
fn envelope(f: &[f32]) -> Vec<f32> {
    // Each parabola with the place from which on it is the lowest.
    let mut lowest: Vec<(usize, f64)> = Vec::new();
    for (j, &value) in f.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let height = |j: usize, v: f32| f64::from(v) + (j * j) as f64;
        let mut from = f64::NEG_INFINITY;
        while let Some(&(k, start)) = lowest.last() {
            from = (height(j, value) - height(k, f[k])) / (2.0 * (j as f64 - k as f64));
            if from > start {
                break;
            }
            lowest.pop();
            from = f64::NEG_INFINITY;
        }
        lowest.push((j, from));
    }
    if lowest.is_empty() {
        return f.to_vec();
    }
    let mut at = 0;
    let value = |i: usize| {
        while at + 1 < lowest.len() && lowest[at + 1].1 <= i as f64 {
            at += 1;
        }
        let j = lowest[at].0;
        let step = i.abs_diff(j) as f32;
        step * step + f[j]
    };
    (0..f.len()).map(value).collect()
}

/// Gaussian blur, separable, cut at 3 σ; the border pixel is repeated outside.
pub(crate) fn blur(image: &Image<f32>, sigma: f64) -> Image<f32> {
    let radius = (3.0 * sigma).ceil() as isize;
    let weight = |i: isize| (-0.5 * (i as f64 / sigma).powi(2)).exp();
    let total: f64 = (-radius..=radius).map(weight).sum();
    let kernel: Vec<f32> = (-radius..=radius).map(|i| (weight(i) / total) as f32).collect();
    let pass = |source: &Image<f32>, dx: isize, dy: isize| {
        let mut out = source.clone();
        for y in 0..source.height() {
            for x in 0..source.width() {
                let at = |i: isize| source.at_clamped(x as isize + i * dx, y as isize + i * dy);
                out.set(x, y, kernel.iter().zip(-radius..).map(|(w, i)| w * at(i)).sum());
            }
        }
        out
    };
    if image.pixels().is_empty() {
        return image.clone();
    }
    pass(&pass(image, 1, 0), 0, 1)
}

/// Sizes and labels of 4-connected parts of `true` pixels; label 0 is `false`, part `i` has size `[i - 1]`.
pub(crate) fn components(mask: &Image<bool>) -> (Vec<usize>, Image<u32>) {
    let (width, height) = (mask.width(), mask.height());
    let mut labels = Image::filled(width, height, 0_u32);
    let mut sizes = Vec::new();
    let mut open = Vec::new();
    for start in 0..width * height {
        if !mask.pixels()[start] || labels.pixels()[start] != 0 {
            continue;
        }
        let label = sizes.len() as u32 + 1;
        let mut size = 0;
        labels.pixels_mut()[start] = label;
        open.push(start);
        while let Some(at) = open.pop() {
            size += 1;
            let (x, y) = (at % width, at / width);
            let left = (x > 0).then(|| at - 1);
            let right = (x + 1 < width).then(|| at + 1);
            let up = (y > 0).then(|| at - width);
            let down = (y + 1 < height).then(|| at + width);
            for next in [left, right, up, down].into_iter().flatten() {
                if mask.pixels()[next] && labels.pixels()[next] == 0 {
                    labels.pixels_mut()[next] = label;
                    open.push(next);
                }
            }
        }
        sizes.push(size);
    }
    (sizes, labels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(size: usize, radius: f64) -> Image<u8> {
        let mut matte = Image::filled(size, size, 0);
        let c = size as f64 / 2.0;
        for y in 0..size {
            for x in 0..size {
                let r = (x as f64 + 0.5 - c).hypot(y as f64 + 0.5 - c);
                matte.set(x, y, ((radius - r + 0.5).clamp(0.0, 1.0) * 255.0) as u8);
            }
        }
        matte
    }

    fn area(matte: &Image<u8>) -> f64 {
        matte.pixels().iter().map(|&v| f64::from(v) / 255.0).sum()
    }

    #[test]
    fn a_disc_shrinks_and_grows_by_the_radius() {
        for px in [-3.5, -1.0, 1.0, 2.5, 8.0] {
            // Distances are between pixel centres: the radius is known to a fraction of a pixel.
            let radius = (area(&erode(&disc(100, 30.0), px)) / std::f64::consts::PI).sqrt();
            assert!((radius - (30.0 - px)).abs() < 0.3, "{px}: {radius}");
        }
    }

    #[test]
    fn distances_agree_with_brute_force() {
        let mut matte = Image::filled(13, 9, 0_u8);
        for (x, y) in [(0, 0), (3, 4), (4, 4), (5, 4), (12, 8), (7, 1)] {
            matte.set(x, y, 255);
        }
        let fast = signed_distance(&matte);
        for y in 0..9 {
            for x in 0..13 {
                let here = matte.at(x, y);
                let all = (0..9).flat_map(|v| (0..13).map(move |u| (u, v)));
                let others = all.filter(|&(u, v)| matte.at(u, v) != here);
                let nearest = others.map(|(u, v)| (u as f32 - x as f32).hypot(v as f32 - y as f32));
                let d = nearest.fold(f32::INFINITY, f32::min) - 0.5;
                let expected = if here == 255 { d } else { -d };
                assert!((fast.at(x, y) - expected).abs() < 1e-5, "({x}, {y})");
            }
        }
    }

    #[test]
    fn mattes_without_an_edge_stay() {
        for level in [0, 255] {
            let matte = Image::filled(5, 4, level);
            assert_eq!(erode(&matte, 2.0), matte);
            assert_eq!(smooth(&matte, 1.0), matte);
        }
        assert_eq!(erode(&Image::filled(0, 0, 0), 1.0), Image::filled(0, 0, 0));
    }
}
