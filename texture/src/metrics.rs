//! How far a rendered view is from its photograph.
//!
//! All figures are over 8-bit sRGB values. `r` is the render composited on black, rounded to whole
//! levels; `g` the photograph with everything outside the mask `M` set to black; `S` the rendered
//! silhouette (alpha ≥ ½).
//!
//! | figure | definition |
//! |---|---|
//! | `error_mean_pct` | `100/255 · mean \|r − g\|` over `M` and the three channels |
//! | `error_inner_pct` | the same over `M` eroded by a 7 × 7 box, where `S` covers: the texture's error alone |
//! | `error_union_pct` | the same over `M ∪ S`: a silhouette that is too fat pays here |
//! | `psnr_db` | `10 log10(255² / MSE)` over `M` and the channels, at most 99 |
//! | `psnr_full_db` | the same over the whole frame |
//! | `ssim` | mean over `M` of the structural similarity of luma `0.299 R + 0.587 G + 0.114 B` |
//! | `mask_iou` | `\|S ∩ M\| / \|S ∪ M\|` |
//! | `hole_pct`, `spill_pct` | `100 \|M ∖ S\| / \|M\|`, `100 \|S ∖ M\| / \|M\|` |
//!
//! SSIM is that of Wang, Bovik, Sheikh and Simoncelli, "Image Quality Assessment: From Error Visibility
//! to Structural Similarity", 2004 (eq. 13): Gaussian window of σ = 1.5 cut at 3.5 σ (11 taps),
//! `K₁ = 0.01`, `K₂ = 0.03`, range 255, population covariance. Borders are mirrored about the edge of the
//! outermost pixel, as SciPy and scikit-image do, where the authors take windows inside the picture alone: masks
//! touch borders, tiles of materials are as small as the window, and each pixel then counts once. What is no
//! number makes no number of the windows that hold it, and of no other.

use crate::TextureError;
use capture::Image;

/// Half-width of the box by which the mask is eroded for `error_inner_pct`.
const INNER_EROSION_PX: usize = 3;
/// Below this many pixels `error_inner_pct` says nothing.
const INNER_MIN_PIXELS: usize = 100;
/// Where PSNR is capped, so that exact agreement stays a number.
const PSNR_CAP_DB: f64 = 99.0;
const SSIM_SIGMA: f64 = 1.5;
/// `int(3.5 σ + ½)`.
const SSIM_RADIUS: usize = 5;
pub(crate) const LUMA: [f64; 3] = [0.299, 0.587, 0.114];

/// The figures of one view; see the module's table.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ViewScore {
    /// Mean absolute difference over the mask, % of 255.
    pub error_mean_pct: f64,
    /// The same over mask and rendered silhouette together.
    pub error_union_pct: f64,
    /// The same inside both, away from the rim; `None` with fewer than 100 pixels.
    pub error_inner_pct: Option<f64>,
    /// Peak signal-to-noise ratio over the mask.
    pub psnr_db: f64,
    /// The same over the whole frame, both composited on black.
    pub psnr_full_db: f64,
    /// Mean structural similarity over the mask.
    pub ssim: f64,
    /// Intersection over union of rendered and reference silhouettes.
    pub mask_iou: f64,
    /// Share of the mask that was not rendered, % of the mask.
    pub hole_pct: f64,
    /// Rendered pixels outside the mask, % of the mask.
    pub spill_pct: f64,
}

/// Scores a rendered view (straight alpha) against its photograph; `mask` is the object where ≥ 128.
///
/// # Errors
/// Where sizes differ or the mask is empty.
pub fn score(render: &Image<[u8; 4]>, reference: &Image<[u8; 3]>, mask: &Image<u8>) -> Result<ViewScore, TextureError> {
    check_sizes(render, reference, mask)?;
    let pair = Pair::new(render, reference, mask);
    let mask_count = count(&pair.mask);
    if mask_count == 0 {
        return Err(degenerate("the reference mask is empty", "score a view that shows the object"));
    }
    let union: Vec<bool> = pair.mask.iter().zip(&pair.rendered).map(|(m, s)| m | s).collect();
    let eroded = erode_box(&pair.mask, render.width(), render.height(), INNER_EROSION_PX);
    let inner: Vec<bool> = eroded.iter().zip(&pair.rendered).map(|(m, s)| m & s).collect();
    let overlap = pair.mask.iter().zip(&pair.rendered).filter(|(m, s)| **m && **s).count();
    let in_pct_of_mask = |n: usize| 100.0 * n as f64 / mask_count as f64;
    Ok(ViewScore {
        error_mean_pct: pair.mean_abs_pct(&pair.mask),
        error_union_pct: pair.mean_abs_pct(&union),
        error_inner_pct: (count(&inner) >= INNER_MIN_PIXELS).then(|| pair.mean_abs_pct(&inner)),
        psnr_db: pair.psnr_db(Some(&pair.mask)),
        psnr_full_db: pair.psnr_db(None),
        ssim: pair.mean_ssim(),
        mask_iou: overlap as f64 / count(&union) as f64,
        hole_pct: in_pct_of_mask(mask_count - overlap),
        spill_pct: in_pct_of_mask(count(&pair.rendered) - overlap),
    })
}

/// Render and photograph on black, with their silhouettes.
struct Pair {
    width: usize,
    height: usize,
    render: Vec<[f64; 3]>,
    reference: Vec<[f64; 3]>,
    mask: Vec<bool>,
    rendered: Vec<bool>,
}

impl Pair {
    fn new(render: &Image<[u8; 4]>, reference: &Image<[u8; 3]>, mask: &Image<u8>) -> Self {
        let mask: Vec<bool> = mask.pixels().iter().map(|&m| m >= 128).collect();
        Self {
            width: render.width(),
            height: render.height(),
            render: render.pixels().iter().map(|&p| on_black(p)).collect(),
            reference: (reference.pixels().iter().zip(&mask))
                .map(|(p, &m)| if m { p.map(f64::from) } else { [0.0; 3] })
                .collect(),
            rendered: render.pixels().iter().map(|p| p[3] >= 128).collect(),
            mask,
        }
    }

    fn mean_abs_pct(&self, region: &[bool]) -> f64 {
        let differences = self.differences().zip(region).filter(|(_, inside)| **inside);
        let sum: f64 = differences.map(|(d, _)| d.iter().map(|v| v.abs()).sum::<f64>()).sum();
        sum / (3 * count(region)) as f64 / 2.55
    }

    fn psnr_db(&self, region: Option<&[bool]>) -> f64 {
        let squares = self.differences().map(|d| d.iter().map(|v| v * v).sum::<f64>());
        let (sum, n) = match region {
            Some(region) => (squares.zip(region).filter(|(_, i)| **i).map(|(s, _)| s).sum::<f64>(), count(region)),
            None => (squares.sum(), self.render.len()),
        };
        let mean = sum / (3 * n) as f64;
        (10.0 * (255.0 * 255.0 / mean.max(1e-12)).log10()).min(PSNR_CAP_DB)
    }

    fn differences(&self) -> impl Iterator<Item = [f64; 3]> {
        self.render.iter().zip(&self.reference).map(|(r, g)| [r[0] - g[0], r[1] - g[1], r[2] - g[2]])
    }

    fn mean_ssim(&self) -> f64 {
        let map = ssim_map(&luma(&self.render), &luma(&self.reference), self.width, self.height);
        let sum: f64 = map.iter().zip(&self.mask).filter(|(_, m)| **m).map(|(s, _)| s).sum();
        sum / count(&self.mask) as f64
    }
}

fn check_sizes(render: &Image<[u8; 4]>, reference: &Image<[u8; 3]>, mask: &Image<u8>) -> Result<(), TextureError> {
    let size = [render.width(), render.height()];
    for (what, other) in
        [("reference", [reference.width(), reference.height()]), ("mask", [mask.width(), mask.height()])]
    {
        if size != other {
            let fault =
                format!("the render is {} × {} pixels, the {what} {} × {}", size[0], size[1], other[0], other[1]);
            return Err(degenerate(&fault, "render with the camera of the reference"));
        }
    }
    Ok(())
}

fn degenerate(fault: &str, remedy: &str) -> TextureError {
    TextureError::Degenerate { fault: fault.to_owned(), remedy: remedy.to_owned() }
}

fn count(region: &[bool]) -> usize {
    region.iter().filter(|inside| **inside).count()
}

fn on_black([r, g, b, a]: [u8; 4]) -> [f64; 3] {
    let alpha = f64::from(a) / 255.0;
    [r, g, b].map(|v| (f64::from(v) * alpha + 0.5).floor())
}

fn luma(pixels: &[[f64; 3]]) -> Vec<f64> {
    pixels.iter().map(|p| p[0] * LUMA[0] + p[1] * LUMA[1] + p[2] * LUMA[2]).collect()
}

/// True where the whole box of half-width `radius` around a pixel is inside the frame and the mask.
fn erode_box(mask: &[bool], width: usize, height: usize, radius: usize) -> Vec<bool> {
    let along = |line: &dyn Fn(usize) -> bool, n: usize, i: usize| {
        i >= radius && i + radius < n && (i - radius..=i + radius).all(line)
    };
    let rows: Vec<bool> = (0..mask.len()).map(|p| along(&|x| mask[p / width * width + x], width, p % width)).collect();
    (0..mask.len()).map(|p| along(&|y| rows[y * width + p % width], height, p / width)).collect()
}

/// Structural similarity at every pixel.
pub(crate) fn ssim_map(x: &[f64], y: &[f64], width: usize, height: usize) -> Vec<f64> {
    let blurred = |f: &dyn Fn(usize) -> f64| gaussian(&(0..x.len()).map(f).collect::<Vec<_>>(), width, height);
    let [mean_x, mean_y] = [blurred(&|i| x[i]), blurred(&|i| y[i])];
    let [xx, yy, xy] = [blurred(&|i| x[i] * x[i]), blurred(&|i| y[i] * y[i]), blurred(&|i| x[i] * y[i])];
    let [c1, c2] = [(0.01_f64 * 255.0).powi(2), (0.03_f64 * 255.0).powi(2)];
    (0..x.len())
        .map(|i| {
            let (ux, uy) = (mean_x[i], mean_y[i]);
            let (vx, vy, vxy) = (xx[i] - ux * ux, yy[i] - uy * uy, xy[i] - ux * uy);
            let numerator = (2.0 * ux * uy + c1) * (2.0 * vxy + c2);
            numerator / ((ux * ux + uy * uy + c1) * (vx + vy + c2))
        })
        .collect()
}

/// Separable Gaussian blur, down the columns and then along the rows.
fn gaussian(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let kernel = gaussian_kernel();
    let mut blurred = Vec::with_capacity(values.len());
    let mut column_sums = vec![0.0; width];
    let mut padded = Vec::with_capacity(width + 2 * SSIM_RADIUS);
    for y in 0..height {
        column_sums.fill(0.0);
        for (k, w) in kernel.iter().enumerate() {
            let row = mirrored(y as isize + k as isize - SSIM_RADIUS as isize, height) * width;
            column_sums.iter_mut().zip(&values[row..row + width]).for_each(|(sum, v)| *sum += w * v);
        }
        padded.clear();
        let reach = SSIM_RADIUS as isize;
        padded.extend((-reach..width as isize + reach).map(|x| column_sums[mirrored(x, width)]));
        blurred.extend(padded.windows(kernel.len()).map(|taps| dot(taps, &kernel)));
    }
    blurred
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn gaussian_kernel() -> [f64; 2 * SSIM_RADIUS + 1] {
    let mut kernel = [0.0; 2 * SSIM_RADIUS + 1];
    for (k, w) in kernel.iter_mut().enumerate() {
        let d = k as f64 - SSIM_RADIUS as f64;
        *w = (-0.5 * d * d / (SSIM_SIGMA * SSIM_SIGMA)).exp();
    }
    let sum: f64 = kernel.iter().sum();
    kernel.map(|w| w / sum)
}

/// Index into `n` samples mirrored about the outer edges: … 1 0 | 0 1 … n−1 | n−1 n−2 …
fn mirrored(i: isize, n: usize) -> usize {
    let n = n as isize;
    let i = i.rem_euclid(2 * n);
    (if i < n { i } else { 2 * n - 1 - i }) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 80;
    const H: usize = 64;

    fn mask() -> Image<u8> {
        let inside = |p: usize| (20..60).contains(&(p % W)) && (16..48).contains(&(p / W));
        Image::from_pixels(W, H, (0..W * H).map(|p| if inside(p) { 255 } else { 0 }).collect()).unwrap()
    }

    /// Dirty background on purpose: nothing outside the mask may count.
    fn photograph() -> Image<[u8; 3]> {
        let level = |p: usize, c: usize| 60 + ((p * 7919 + c * 104_729) % 120) as u8;
        Image::from_pixels(W, H, (0..W * H).map(|p| [level(p, 0), level(p, 1), level(p, 2)]).collect()).unwrap()
    }

    fn rendered(offset: u8) -> Image<[u8; 4]> {
        let (mask, photo) = (mask(), photograph());
        let pixel = |(p, m): (&[u8; 3], &u8)| {
            if *m == 0 { [0; 4] } else { [p[0] + offset, p[1] + offset, p[2] + offset, 255] }
        };
        Image::from_pixels(W, H, photo.pixels().iter().zip(mask.pixels()).map(pixel).collect()).unwrap()
    }

    #[test]
    fn an_exact_render_has_no_error() {
        let s = score(&rendered(0), &photograph(), &mask()).unwrap();
        assert_eq!((s.error_mean_pct, s.error_union_pct, s.error_inner_pct), (0.0, 0.0, Some(0.0)));
        assert_eq!((s.psnr_db, s.psnr_full_db, s.mask_iou), (99.0, 99.0, 1.0));
        assert!((s.ssim - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_constant_offset_of_a_fifth_is_twenty_percent() {
        let s = score(&rendered(51), &photograph(), &mask()).unwrap();
        assert!((s.error_mean_pct - 20.0).abs() < 1e-12);
        // MSE = 51² inside, so 20 log10(255 / 51); outside nothing.
        assert!((s.psnr_db - 20.0 * 5_f64.log10()).abs() < 1e-9);
        let full = 10.0 * (255.0_f64.powi(2) / (51.0 * 51.0 * 1280.0 / (W * H) as f64)).log10();
        assert!((s.psnr_full_db - full).abs() < 1e-9);
    }

    #[test]
    fn a_missing_half_is_a_hole_and_black_spill_is_spill() {
        let mut half = rendered(0);
        half.pixels_mut().iter_mut().enumerate().filter(|(p, _)| p % W < 40).for_each(|(_, v)| *v = [0; 4]);
        let s = score(&half, &photograph(), &mask()).unwrap();
        assert_eq!((s.hole_pct, s.spill_pct, s.mask_iou), (50.0, 0.0, 0.5));
        assert_eq!(s.error_inner_pct, Some(0.0));
        let mut fat = rendered(0);
        fat.pixels_mut()[..640].fill([0, 0, 0, 255]);
        let s = score(&fat, &photograph(), &mask()).unwrap();
        assert_eq!((s.spill_pct, s.error_union_pct), (50.0, 0.0));
        assert!((s.mask_iou - 1280.0 / 1920.0).abs() < 1e-12);
    }

    /// Two constants a and b give (2ab + c₁) / (a² + b² + c₁): the structure terms cancel.
    #[test]
    fn ssim_of_constants_has_its_closed_form() {
        let map = ssim_map(&[100.0; 20], &[150.0; 20], 5, 4);
        let c1 = 2.55 * 2.55;
        let expected = (2.0 * 100.0 * 150.0 + c1) / (100.0 * 100.0 + 150.0 * 150.0 + c1);
        assert!(map.iter().all(|s| (s - expected).abs() < 1e-9));
    }

    const SIDE: usize = 40;

    /// 100 ± 20 in turn: under the window mean 100 and variance 400 to nine digits.
    fn checked(amplitude: f64) -> Vec<f64> {
        (0..SIDE * SIDE)
            .map(|p| 100.0 + if (p % SIDE + p / SIDE).is_multiple_of(2) { amplitude } else { -amplitude })
            .collect()
    }

    /// Away from the border, where mirrored pixels do not take turns.
    fn inner(x: &[f64], y: &[f64]) -> Vec<f64> {
        let map = ssim_map(x, y, SIDE, SIDE);
        let is_inner = |p: &usize| [p % SIDE, p / SIDE].iter().all(|at| (SSIM_RADIUS..SIDE - SSIM_RADIUS).contains(at));
        (0..map.len()).filter(is_inner).map(|p| map[p]).collect()
    }

    #[test]
    fn ssim_of_contrast_has_its_closed_form() {
        for (amplitude, known) in [(20.0, 1.0), (10.0, 0.820_956), (-20.0, -0.863_667)] {
            let found = inner(&checked(20.0), &checked(amplitude));
            assert!(found.iter().all(|s| (s - known).abs() < 1e-6), "{amplitude}: {}", found[0]);
        }
        let map = |a: f64, b: f64| ssim_map(&[a; 300], &[b; 300], 20, 15)[140];
        assert!((map(100.0, 110.0) - 0.995_476).abs() < 1e-6 && (map(0.0, 255.0) - 9.999e-5).abs() < 1e-8);
    }

    #[test]
    fn ssim_is_symmetric_and_one_of_the_same() {
        let ramp: Vec<f64> = (0..SIDE * SIDE).map(|p| ((p * 7919) % 256) as f64).collect();
        assert_eq!(ssim_map(&ramp, &checked(20.0), SIDE, SIDE), ssim_map(&checked(20.0), &ramp, SIDE, SIDE));
        assert!(ssim_map(&ramp, &ramp, SIDE, SIDE).iter().all(|s| *s == 1.0));
        // Smaller than the window.
        assert!(ssim_map(&ramp[..25], &ramp[..25], 5, 5).iter().all(|s| *s == 1.0));
    }

    #[test]
    fn what_is_no_number_spoils_the_windows_that_hold_it_alone() {
        let mut broken = checked(20.0);
        broken[20 * SIDE + 20] = f64::NAN;
        let map = ssim_map(&broken, &checked(20.0), SIDE, SIDE);
        for (p, s) in map.iter().enumerate() {
            let is_near = [p % SIDE, p / SIDE].iter().all(|at| at.abs_diff(20) <= SSIM_RADIUS);
            assert_eq!(s.is_nan(), is_near, "{p}");
        }
    }

    #[test]
    fn partial_alpha_is_composited_and_rounded_half_up() {
        assert_eq!(on_black([255, 100, 1, 128]), [128.0, 50.0, 1.0]);
    }

    #[test]
    fn faults_are_refused() {
        let empty = Image::filled(W, H, 0);
        assert!(score(&rendered(0), &photograph(), &empty).is_err());
        assert!(score(&rendered(0), &Image::filled(3, 3, [0; 3]), &mask()).is_err());
        assert!(score(&Image::filled(0, 0, [0; 4]), &Image::filled(0, 0, [0; 3]), &Image::filled(0, 0, 0)).is_err());
    }
}
