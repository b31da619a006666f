//! The pictures of a grid: read, cut, and the missing ones filled.

use super::{Btf, nearest_first};
use crate::CaptureError;
use image::GenericImageView;
use rayon::prelude::*;
use std::path::Path;

/// Largest BTF brought into memory, in bytes.
pub(super) const MAX_BYTES: usize = 8 << 30;

/// Whether a file holds floats.
pub(super) fn is_deep(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"))
}

/// Reads the pictures of all pairs, (view, light), of one size which they set; fills the pairs that have none.
pub(super) fn read_pictures(btf: &mut Btf, grid: &[Option<&Path>], crop: Option<usize>) -> Result<(), CaptureError> {
    let Some(first) = grid.iter().flatten().next() else { return Ok(()) };
    let (_, size) = read_picture(first, crop)?;
    [btf.width, btf.height] = size;
    let length = 3 * btf.texels();
    if grid.len().saturating_mul(4 * length) > MAX_BYTES {
        let gib = (grid.len() as u128 * 4 * length as u128) >> 30;
        let fault = format!("{} pictures of {} × {} take {gib} GiB", grid.len(), size[0], size[1]);
        return Err(CaptureError::invalid(first, fault, "read their middle alone with --crop 64"));
    }
    btf.samples = vec![0.0; grid.len() * length];
    let read = |(target, path): (&mut [f32], &Option<&Path>)| -> Result<(), CaptureError> {
        let Some(path) = path else { return Ok(()) };
        let (pixels, found) = read_picture(path, crop)?;
        if found != size {
            let fault = format!("it is {} × {}, others are {} × {}", found[0], found[1], size[0], size[1]);
            return Err(CaptureError::invalid(path, fault, "rectify all pictures to one size"));
        }
        target.copy_from_slice(&pixels);
        Ok(())
    };
    btf.samples.par_chunks_mut(length).zip(grid).try_for_each(read)?;
    if grid.iter().any(Option::is_none) {
        btf.measured = grid.iter().map(Option::is_some).collect();
        fill_pairs(btf);
    }
    Ok(())
}

/// Each missing picture from the nearest light of its view; where a view has none, from the nearest view.
fn fill_pairs(btf: &mut Btf) {
    let (length, lights) = (3 * btf.texels(), btf.lights.len());
    let by_light: Vec<Vec<usize>> = btf.lights.iter().map(|l| nearest_first(l, &btf.lights)).collect();
    let by_view: Vec<Vec<usize>> = btf.views.iter().map(|v| nearest_first(v, &btf.views)).collect();
    for pair in 0..btf.measured.len() {
        let (view, light) = (pair / lights, pair % lights);
        let same_view = by_light[light].iter().map(|l| view * lights + l);
        let same_light = by_view[view].iter().map(|v| v * lights + light);
        let source = same_view.chain(same_light).find(|&p| btf.measured[p]);
        if let (false, Some(source)) = (btf.measured[pair], source) {
            btf.samples.copy_within(source * length..(source + 1) * length, pair * length);
        }
    }
}

/// Pixels (y, x, channel) and size.
fn read_picture(path: &Path, crop: Option<usize>) -> Result<(Vec<f32>, [usize; 2]), CaptureError> {
    let unreadable =
        |e: image::ImageError| CaptureError::invalid(path, e.to_string(), "export it again as PNG, JPEG or EXR");
    let picture = image::ImageReader::open(path).map_err(|e| CaptureError::io(path, e))?;
    let picture = picture.with_guessed_format().map_err(|e| CaptureError::io(path, e))?.decode().map_err(unreadable)?;
    let (width, height) = picture.dimensions();
    let [cut_width, cut_height] =
        [width, height].map(|n| crop.map_or(n, |crop| n.min(u32::try_from(crop.max(1)).unwrap_or(u32::MAX))));
    let picture = picture.crop_imm((width - cut_width) / 2, (height - cut_height) / 2, cut_width, cut_height);
    Ok((picture.into_rgb32f().into_raw(), [cut_width as usize, cut_height as usize]))
}
