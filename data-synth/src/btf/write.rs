//! A material as a folder in the layout of the measurements of 2003: one folder per view, one picture per
//! light, and `btf.json`, which says how to read them. The folder appears whole or not at all.
//!
//! ```text
//! tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.png    angles in degrees, NNNNN = 81 · light + view
//! ```
//!
//! Pictures are 8-bit sRGB PNG, or 32-bit float OpenEXR: lossless both, the second without exposure.

use super::material::BtfMaterial;
use super::{BtfOptions, BtfStudio};
use crate::error::{SynthError, io_error};
use crate::film::encode;
use capture::btf::{BtfDirection, DIRECTIONS};
use image::{ExtendedColorType, ImageFormat};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BtfWritten {
    /// What a radiance was multiplied by before it was encoded: 1 for HDR.
    pub exposure: f64,
    /// Between texels.
    pub texel_pitch_mm: f64,
    /// Of all pictures.
    pub bytes: u64,
}

/// Measures a material and writes it to the folder `dir`, which must not exist yet or be empty; 8 bit, or
/// with `hdr` float. Holds one view at a time. Tells `progress` the number of views done, and of all.
///
/// # Errors
/// Names the option that is out of range, [`SynthError::Exists`] where the folder holds something, or names
/// the file that could not be written.
pub fn write_btf(
    material: BtfMaterial,
    options: &BtfOptions,
    hdr: bool,
    dir: impl AsRef<Path>,
    mut progress: impl FnMut(usize, usize),
) -> Result<BtfWritten, SynthError> {
    let dir = dir.as_ref();
    let occupied = if dir.is_dir() {
        fs::read_dir(dir).map_err(io_error(dir))?.next().is_some()
    } else {
        dir.symlink_metadata().is_ok()
    };
    if occupied {
        return Err(SynthError::Exists { path: dir.to_owned() });
    }
    let studio = BtfStudio::new(material, options)?;
    let exposure = if hdr { 1.0 } else { 1.0 / studio.metered()? };
    let parent = dir.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(io_error(parent))?;
    // Beside the target, so that the rename stays on one file system; gone if we fail.
    let staging = tempfile::Builder::new().prefix(".turnlight-synth-").tempdir_in(parent).map_err(io_error(parent))?;
    let folder = Folder { root: staging.path().join("btf"), size: options.size, exposure, hdr };
    let mut bytes = 0;
    for view in 0..DIRECTIONS {
        bytes += folder.write_view(view, &studio.view(view)?)?;
        progress(view + 1, DIRECTIONS);
    }
    let texel_pitch_mm = material.side_mm() / options.size as f64;
    let written = BtfWritten { exposure: f64::from(exposure), texel_pitch_mm, bytes };
    let text = format!("{:#}\n", description(material, options, hdr, &written));
    let path = folder.root.join("btf.json");
    fs::write(&path, text).map_err(io_error(&path))?;
    if dir.is_dir() {
        // Empty, as checked above; some systems do not rename over a folder.
        fs::remove_dir(dir).map_err(io_error(dir))?;
    }
    fs::rename(&folder.root, dir).map_err(io_error(dir))?;
    Ok(written)
}

fn description(material: BtfMaterial, options: &BtfOptions, hdr: bool, written: &BtfWritten) -> Value {
    json!({
        "name": material.name(),
        "size": options.size,
        "seed": options.seed,
        "samples": options.samples,
        "surfaces": options.surfaces,
        "views": DIRECTIONS,
        "lights": DIRECTIONS,
        "texel_pitch_mm": written.texel_pitch_mm,
        "encoding": if hdr { "linear" } else { "srgb" },
        "includes_cosine": true,
        "exposure": written.exposure,
    })
}

/// The folder while it is being written.
struct Folder {
    root: PathBuf,
    size: usize,
    exposure: f32,
    hdr: bool,
}

impl Folder {
    /// Writes the pictures of one view, laid out (light, y, x, channel); returns their bytes.
    fn write_view(&self, view: usize, samples: &[f32]) -> Result<u64, SynthError> {
        let directions = BtfDirection::all();
        let v = directions[view];
        let folder = self.root.join(format!("tv{:03}_pv{:03}", v.theta_deg, v.phi_deg));
        fs::create_dir_all(&folder).map_err(io_error(&folder))?;
        let extension = if self.hdr { "exr" } else { "png" };
        let picture = |(light, pixels): (usize, &[f32])| {
            let l = directions[light];
            let (number, [lt, lp, vt, vp]) =
                (DIRECTIONS * light + view, [l.theta_deg, l.phi_deg, v.theta_deg, v.phi_deg]);
            let path = folder.join(format!("{number:05} tl{lt:03} pl{lp:03} tv{vt:03} pv{vp:03}.{extension}"));
            self.write_picture(&path, pixels)
        };
        samples.par_chunks(3 * self.size * self.size).enumerate().map(picture).sum()
    }

    fn write_picture(&self, path: &Path, pixels: &[f32]) -> Result<u64, SynthError> {
        let (kind, format, bytes): (_, _, Vec<u8>) = if self.hdr {
            (ExtendedColorType::Rgb32F, ImageFormat::OpenExr, pixels.iter().flat_map(|c| c.to_ne_bytes()).collect())
        } else {
            let level = |c: &f32| encode(c * self.exposure).round() as u8;
            (ExtendedColorType::Rgb8, ImageFormat::Png, pixels.iter().map(level).collect())
        };
        let mut out = std::io::Cursor::new(Vec::new());
        image::write_buffer_with_format(&mut out, &bytes, self.size as u32, self.size as u32, kind, format)
            .map_err(|source| SynthError::Encode { path: path.to_owned(), source })?;
        fs::write(path, out.get_ref()).map_err(io_error(path))?;
        Ok(out.get_ref().len() as u64)
    }
}
