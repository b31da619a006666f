//! MATLAB 5 files (`.mat`) with a cell array of 3×4 matrices, as `dino_Ps.mat` of the Oxford VGG
//! multi-view data. Images are the folder's, in natural order of their names.
//!
//! Layout ("MAT-File Format", MathWorks): a header of 128 bytes, then elements of an 8-byte tag (type,
//! size) and padded data. Type 15 wraps one zlib-compressed element. A matrix (type 14) holds flags,
//! dimensions, a name, and its numbers or, for a cell, more matrices.

use super::{
    capture, file_name, is_image, list, natural_order,
    projections::{facing_the_object, projection_frame},
};
use crate::{Capture, CaptureError};
use nalgebra::Matrix3x4;
use std::io::Read;
use std::path::{Path, PathBuf};

const MI_DOUBLE: u32 = 9;
const MI_MATRIX: u32 = 14;
const MI_COMPRESSED: u32 = 15;
const CLASS_CELL: u8 = 1;

/// Largest element that is unpacked: far above any list of cameras, far below a memory bomb.
const MAX_UNPACKED: u64 = 64 << 20;

pub(super) fn read(file: &Path) -> Result<Capture, CaptureError> {
    let bytes = std::fs::read(file).map_err(|e| CaptureError::io(file, e))?;
    let matrices = parse(&bytes).ok_or_else(|| {
        let fault = "is no little-endian MATLAB 5 file with a cell array of 3×4 double matrices";
        CaptureError::invalid(file, fault, "save it with -v6 or -v7, or write projections.txt")
    })?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut images: Vec<PathBuf> = list(folder)?;
    images.retain(|path| is_image(path));
    images.sort_by(|a, b| natural_order(&file_name(a), &file_name(b)));
    if images.len() != matrices.len() {
        let fault = format!("holds {} matrices, its folder {} images", matrices.len(), images.len());
        return Err(CaptureError::invalid(file, fault, "move away the images that have no matrix"));
    }
    let frames =
        images.iter().zip(&matrices).enumerate().map(|(i, (image, matrix))| {
            projection_frame(file, folder, &file_name(image), &format!("cell {i}"), matrix)
        });
    Ok(capture(facing_the_object(frames.collect::<Result<_, _>>()?)))
}

/// The matrices of the first cell array. `None` where the file is something else.
fn parse(bytes: &[u8]) -> Option<Vec<Matrix3x4<f64>>> {
    // Version 0x0100 and "IM": written by a little-endian machine.
    if bytes.get(124..128)? != [0x00, 0x01, b'I', b'M'] {
        return None;
    }
    let mut rest = &bytes[128..];
    while let Some((kind, data)) = element(&mut rest) {
        let unpacked;
        let (kind, data) = if kind == MI_COMPRESSED {
            let mut buffer = Vec::new();
            flate2::read::ZlibDecoder::new(data).take(MAX_UNPACKED).read_to_end(&mut buffer).ok()?;
            unpacked = buffer;
            element(&mut unpacked.as_slice())?
        } else {
            (kind, data)
        };
        if let Some(cells) = (kind == MI_MATRIX).then(|| cell_array(data)).flatten() {
            return Some(cells);
        }
    }
    None
}

fn cell_array(mut data: &[u8]) -> Option<Vec<Matrix3x4<f64>>> {
    let (_, flags) = element(&mut data)?;
    if *flags.first()? != CLASS_CELL {
        return None;
    }
    element(&mut data)?;
    element(&mut data)?;
    let mut cells = Vec::new();
    while let Some((kind, cell)) = element(&mut data) {
        cells.push((kind == MI_MATRIX).then(|| matrix(cell)).flatten()?);
    }
    Some(cells)
}

fn matrix(mut data: &[u8]) -> Option<Matrix3x4<f64>> {
    element(&mut data)?;
    let (_, dimensions) = element(&mut data)?;
    if dimensions != [3, 0, 0, 0, 4, 0, 0, 0] {
        return None;
    }
    element(&mut data)?;
    let (kind, numbers) = element(&mut data)?;
    if kind != MI_DOUBLE || numbers.len() != 96 {
        return None;
    }
    let numbers: Vec<f64> =
        numbers.chunks_exact(8).filter_map(|b| Some(f64::from_le_bytes(b.try_into().ok()?))).collect();
    Some(Matrix3x4::from_column_slice(&numbers))
}

/// Takes one element off: its type and data. Sizes up to four bytes may share the tag ("small element").
fn element<'a>(rest: &mut &'a [u8]) -> Option<(u32, &'a [u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(rest.get(at..at + 4)?.try_into().ok()?));
    let tag = word(0)?;
    if tag >> 16 != 0 {
        let data = rest.get(4..8)?.get(..(tag >> 16) as usize)?;
        *rest = rest.get(8..)?;
        return Some((tag & 0xffff, data));
    }
    let size = word(4)? as usize;
    let data = rest.get(8..8 + size)?;
    // Compressed elements alone are not padded to eight bytes.
    let padded = if tag == MI_COMPRESSED { size } else { size.next_multiple_of(8) };
    *rest = rest.get(8 + padded..).unwrap_or(&[]);
    Some((tag, data))
}
