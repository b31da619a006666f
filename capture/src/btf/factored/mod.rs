//! `.btf` files of the University of Bonn (BTFDBB, 2014): a matrix of pairs by texels, factored.
//!
//! Little-endian; angles in radians; (θ, φ) is `(sin θ cos φ, sin θ sin φ, cos θ)`.
//!
//! ```text
//! "!DFMF08FC" or "!FMF12FCE"    one factorisation per channel, or one for all
//! "R"            rotations follow the size (optional)
//! u32            bytes from here to the views
//! u32            version
//! 3 × 80 bytes   set-up, sensor, light source
//! f32, 3 × f32   pixels per mm; scale of R, G, B
//! u32            from version 2: whether the cosine of the light is in the data
//! u32 n, n       from version 3: XML
//! u32 n, n × (u32 m, m)    from version 4: names of channels; R, G, B before
//! u32 n, n × (f32 θ, f32 φ, u32 m, m × (f32 θ, f32 φ))    views, each with its lights, the same for all
//! u32, u32       width, height; with rotations then u32 n, n × 9 × f32
//! DFMF:  u32 components; u32 colour model; 3 × f32 mean; 9 × f32 transform; per channel a factorisation
//! FMF1:  u8 version; from 1 u32 range reduction; from 2 u32 w, u32 h, w · h × u16 heights; u32 components; a factorisation
//!
//! factorisation: u8 bytes per number; u32 K; u32 rows; u32 columns; K numbers S; rows × K numbers U; columns × K numbers S·V
//! ```
//!
//! A sample is `Σ_k U[pair, k] · SV[texel, k]`, pair = view · lights + light (FMF1: times 3, plus channel),
//! texel = y · width + x with rows from the bottom. In colour model 11 channels are `ln Y`, `U/Y`,
//! `V/Y` with an offset of 1e-5; with range reduction FMF1 holds logarithms with that offset.

use super::pictures::MAX_BYTES;
use super::{Btf, Encoding};
use crate::CaptureError;
use half::f16;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::path::Path;

/// Keeps logarithms of black finite.
const OFFSET: f32 = 1e-5;
/// Most views, and lights of a view: Bonn measured 151.
const MAX_DIRECTIONS: usize = 4096;
/// Logarithm of luminance, and chrominance over it.
const LOG_YUV: usize = 11;

/// Reads a file, cut to its middle `crop` × `crop` texels where that is less than all.
///
/// # Errors
/// Where it is not of these kinds, ends early, or is too large for memory uncut.
pub fn read_factored(path: &Path, crop: Option<usize>) -> Result<Btf, CaptureError> {
    let bytes = std::fs::read(path).map_err(|e| CaptureError::io(path, e))?;
    let name = path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut btf =
        parse(&bytes, name, crop).map_err(|Fault { fault, remedy }| CaptureError::invalid(path, fault, remedy))?;
    btf.check()?;
    Ok(btf)
}

struct Fault {
    fault: String,
    remedy: &'static str,
}

/// Bytes and where reading has come to.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// How the colours of a file become RGB.
enum Colour {
    Plain,
    LogYuv,
    Log,
}

/// `rows × k` times `k × columns`, the second transposed; both row-major.
struct Factors {
    k: usize,
    rows: Vec<f32>,
    columns: Vec<f32>,
}

/// The texels that are kept.
struct Window {
    width: usize,
    height: usize,
    left: usize,
    top: usize,
    file_width: usize,
    file_height: usize,
}

fn fault<T>(fault: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { fault: fault.into(), remedy: "fetch it again; only DFMF08FC and FMF12FCE files are known" })
}

fn parse(bytes: &[u8], name: String, crop: Option<usize>) -> Result<Btf, Fault> {
    let mut from = Cursor { bytes, at: 0 };
    let per_channel = match from.take(9)? {
        b"!DFMF08FC" => true,
        b"!FMF12FCE" => false,
        other => return fault(format!("it begins with {:?}", String::from_utf8_lossy(other))),
    };
    let turned = from.bytes.get(from.at) == Some(&b'R');
    from.at += usize::from(turned);
    let (includes_cosine, pitch) = header(&mut from)?;
    let [views, lights] = directions(&mut from)?;
    let window = Window::new(from.u32()?, from.u32()?, crop)?;
    if turned {
        let rotations = from.u32()?;
        from.skip(rotations, 36)?;
    }
    let pairs = views.len() * lights.len();
    let due = 12 * pairs as u128 * window.texels() as u128;
    if due > MAX_BYTES as u128 {
        let fault = format!("{pairs} pairs of {} × {} texels take {} GiB", window.width, window.height, due >> 30);
        return Err(Fault { fault, remedy: "read its middle alone with --crop 64" });
    }
    let samples = if per_channel { channels(&mut from, pairs, &window)? } else { full(&mut from, pairs, &window)? };
    if from.at < bytes.len() {
        return fault(format!("{} bytes follow its end", bytes.len() - from.at));
    }
    Ok(Btf {
        name,
        views,
        lights,
        width: window.width,
        height: window.height,
        encoding: Encoding::Linear,
        exposure: 1.0,
        includes_cosine,
        texel_pitch_mm: pitch,
        samples,
        measured: Vec::new(),
    })
}

/// Up to the views: whether the cosine is in the data, and the pitch of texels in mm.
fn header(from: &mut Cursor<'_>) -> Result<(bool, Option<f64>), Fault> {
    let start = from.at;
    let size = from.u32()?;
    let version = from.u32()?;
    from.take(240)?;
    let per_mm = from.f32()?;
    from.take(12)?;
    let cosine = version > 1 && from.u32()? != 0;
    if version > 2 {
        let length = from.u32()?;
        from.take(length)?;
    }
    let channels = if version > 3 { from.u32()? } else { 3 };
    if channels != 3 {
        return fault(format!("it has {channels} channels, not R, G, B"));
    }
    if version > 3 {
        for _ in 0..3 {
            let length = from.u32()?;
            from.take(length)?;
        }
    }
    if from.at - start != size {
        return fault(format!("its header has {} bytes and claims {size}", from.at - start));
    }
    let pitch = (per_mm.is_finite() && per_mm > 0.0).then(|| 1.0 / f64::from(per_mm));
    Ok((cosine, pitch))
}

/// Views and lights.
fn directions(from: &mut Cursor<'_>) -> Result<[Vec<Vector3<f64>>; 2], Fault> {
    let count = from.u32()?;
    if count > MAX_DIRECTIONS {
        return fault(format!("it has {count} views"));
    }
    let (mut views, mut lights) = (Vec::new(), Vec::new());
    for view in 0..count {
        views.push(from.direction()?);
        let count = from.u32()?;
        if count > MAX_DIRECTIONS {
            return fault(format!("view {view} has {count} lights"));
        }
        from.expect(count, 8)?;
        let of_view: Vec<Vector3<f64>> = (0..count).map(|_| from.direction()).collect::<Result<_, _>>()?;
        if view > 0 && of_view != lights {
            return fault(format!("view {view} has other lights than view 0"));
        }
        lights = of_view;
    }
    if lights.is_empty() { fault("it has no views or no lights") } else { Ok([views, lights]) }
}

/// One factorisation per channel; (pair, texel, channel).
fn channels(from: &mut Cursor<'_>, pairs: usize, window: &Window) -> Result<Vec<f32>, Fault> {
    from.u32()?;
    let colour = match from.u32()? {
        0 => Colour::Plain,
        LOG_YUV => Colour::LogYuv,
        other => return fault(format!("colour model {other} is unknown")),
    };
    from.take(48)?;
    let planes = [from.factors(pairs, window)?, from.factors(pairs, window)?, from.factors(pairs, window)?];
    Ok(multiply(pairs, window.texels(), &colour, |pair, texel| {
        [0, 1, 2].map(|c: usize| planes[c].product(pair, texel))
    }))
}

/// One factorisation for all channels.
fn full(from: &mut Cursor<'_>, pairs: usize, window: &Window) -> Result<Vec<f32>, Fault> {
    let version = from.u8()?;
    let reduced = version >= 1 && from.u32()? != 0;
    if version >= 2 {
        let (width, height) = (from.u32()?, from.u32()?);
        from.skip(width.saturating_mul(height), 2)?;
    }
    from.u32()?;
    let factors = from.factors(3 * pairs, window)?;
    let colour = if reduced { Colour::Log } else { Colour::Plain };
    Ok(multiply(pairs, window.texels(), &colour, |pair, texel| [0, 1, 2].map(|c| factors.product(3 * pair + c, texel))))
}

fn multiply(
    pairs: usize,
    texels: usize,
    colour: &Colour,
    stored: impl Fn(usize, usize) -> [f32; 3] + Sync,
) -> Vec<f32> {
    let mut samples = vec![0.0; 3 * pairs * texels];
    samples.par_chunks_mut(3 * texels).enumerate().for_each(|(pair, picture)| {
        for (texel, rgb) in picture.chunks_exact_mut(3).enumerate() {
            rgb.copy_from_slice(&colour.rgb(stored(pair, texel)));
        }
    });
    samples
}

impl Colour {
    fn rgb(&self, stored: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Plain => stored.map(|c| c.max(0.0)),
            Self::Log => stored.map(|c| (c.exp() - OFFSET).max(0.0)),
            Self::LogYuv => {
                let y = stored[0].exp() - OFFSET;
                let [u, v] = [stored[1], stored[2]].map(|c| c * y + OFFSET);
                [y + 1.139_83 * v, y - 0.394_65 * u - 0.580_6 * v, y + 2.032_11 * u].map(|c| c.max(0.0))
            }
        }
    }
}

impl Factors {
    fn product(&self, row: usize, column: usize) -> f32 {
        let (a, b) = (&self.rows[row * self.k..][..self.k], &self.columns[column * self.k..][..self.k]);
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }
}

impl Window {
    fn new(file_width: usize, file_height: usize, crop: Option<usize>) -> Result<Self, Fault> {
        if file_width == 0 || file_height == 0 {
            return fault(format!("its tile is {file_width} × {file_height} texels"));
        }
        let [width, height] = [file_width, file_height].map(|n| crop.map_or(n, |crop| n.min(crop.max(1))));
        let (left, top) = ((file_width - width) / 2, (file_height - height) / 2);
        Ok(Self { width, height, left, top, file_width, file_height })
    }

    fn texels(&self) -> usize {
        self.width * self.height
    }

    /// The file's column of a texel; rows of the file run from the bottom.
    fn column(&self, texel: usize) -> usize {
        let (x, y) = (texel % self.width + self.left, texel / self.width + self.top);
        (self.file_height - 1 - y) * self.file_width + x
    }
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        self.expect(count, 1)?;
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    fn expect(&self, count: usize, size: usize) -> Result<(), Fault> {
        let left = self.bytes.len() - self.at;
        match count.checked_mul(size) {
            Some(bytes) if bytes <= left => Ok(()),
            _ => fault(format!("{count} × {size} bytes are due at byte {}, {left} are left", self.at)),
        }
    }

    fn skip(&mut self, count: usize, size: usize) -> Result<(), Fault> {
        self.expect(count, size)?;
        self.at += count * size;
        Ok(())
    }

    fn u8(&mut self) -> Result<u8, Fault> {
        Ok(self.take(1)?[0])
    }

    fn u32(&mut self) -> Result<usize, Fault> {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(self.take(4)?);
        Ok(u32::from_le_bytes(bytes) as usize)
    }

    fn f32(&mut self) -> Result<f32, Fault> {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(self.take(4)?);
        Ok(f32::from_le_bytes(bytes))
    }

    fn direction(&mut self) -> Result<Vector3<f64>, Fault> {
        let (theta, phi) = (f64::from(self.f32()?), f64::from(self.f32()?));
        let direction = Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        // The horizon, after rounding.
        let risen = Vector3::new(direction.x, direction.y, if direction.z.abs() < 1e-6 { 0.0 } else { direction.z });
        if risen.z >= 0.0 { Ok(risen) } else { fault(format!("a direction at θ = {theta}, φ = {phi}")) }
    }

    /// Matrices of `rows` rows, with the columns of the window alone.
    fn factors(&mut self, rows: usize, window: &Window) -> Result<Factors, Fault> {
        let size = usize::from(self.u8()?);
        if ![2, 4, 8].contains(&size) {
            return fault(format!("numbers of {size} bytes"));
        }
        let (k, file_rows, columns) = (self.u32()?, self.u32()?, self.u32()?);
        if file_rows != rows || columns != window.file_width * window.file_height {
            return fault(format!("a factorisation of {file_rows} × {columns}"));
        }
        if k == 0 {
            return fault("a factorisation without components");
        }
        self.skip(k, size)?;
        self.expect(rows.saturating_mul(k), size)?;
        let row_bytes = self.take(rows * k * size)?;
        self.expect(columns.saturating_mul(k), size)?;
        let column_bytes = self.take(columns * k * size)?;
        let row = |texel| &column_bytes[window.column(texel) * k * size..][..k * size];
        let columns = (0..window.texels()).flat_map(|texel| numbers(row(texel), size)).collect();
        Ok(Factors { k, rows: numbers(row_bytes, size).collect(), columns })
    }
}

/// Numbers of 2, 4 or 8 bytes.
fn numbers(bytes: &[u8], size: usize) -> impl Iterator<Item = f32> + '_ {
    bytes.chunks_exact(size).map(move |b| match *b {
        [a, b] => f16::from_le_bytes([a, b]).to_f32(),
        [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]) as f32,
        _ => f32::NAN,
    })
}

#[cfg(test)]
mod tests;
