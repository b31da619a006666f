//! What moves before a camera that stands still, told without knowing any camera: room for those who have to find cameras
//! on the object alone.

use super::clean_plate::is_at_border;
use super::{FetchFrame, cluster, fetched};
use crate::matte::grow;
use crate::{CaptureError, Image, load};
use rayon::prelude::*;

/// Longer side of the pictures that are compared, at least.
const SIDE: usize = 320;

/// Frames that tell what stays, spread evenly.
const WITNESSES: usize = 24;

/// Fewer frames tell nothing.
const LEAST_FRAMES: usize = 4;

/// The share of the border that looks alike in three quarters of the frames, if the camera stands still: a table may reach
/// out of the picture below.
const STILL_BORDER: f64 = 0.6;

/// Less of all frames together is noise.
const LEAST_MOVING: f64 = 0.003;

/// Pixels of the small pictures around what moves that are counted in: a feature is where two colours meet.
const MARGIN: f64 = 2.0;

/// What moves in a frame.
#[derive(Clone, Debug)]
pub struct Moving {
    /// Of a picture some times smaller.
    small: Image<u8>,
    /// Of the frame.
    size: [usize; 2],
}

impl Moving {
    /// Of the frame's size, 0 and 255.
    pub fn matte(&self) -> Image<u8> {
        enlarged(&self.small, self.size)
    }
}

/// What moves, per frame: what does not look as its place does in most frames. An
/// evenly coloured part that always covers the same place is not seen to move. `None` where the camera moved, where nothing
/// does, and of fewer than four frames. Frames are of one size. Deterministic.
///
/// # Errors
/// What `fetch` fails with.
pub fn find_moving(fetch: &FetchFrame, count: usize) -> Result<Option<Vec<Moving>>, CaptureError> {
    if count < LEAST_FRAMES {
        return Ok(None);
    }
    let small = fetched(fetch, count, |image| {
        let size = [image.width(), image.height()];
        (size, load::reduced(&image, (size[0].max(size[1]) / SIDE).max(1)))
    })?;
    let witnesses: Vec<&Image<[u8; 3]>> =
        small.iter().step_by(count.div_ceil(WITNESSES)).map(|(_, image)| image).collect();
    let Some(room) = room(&witnesses) else { return Ok(None) };
    let moving = |(size, image): &([usize; 2], Image<[u8; 3]>)| {
        let is_moving = |(&p, room): (&[u8; 3], &Option<[f32; 3]>)| match room {
            Some(room) if cluster::is_near(room, &p.map(f32::from)) => 0,
            _ => 255,
        };
        let pixels: Vec<u8> = image.pixels().iter().zip(room.pixels()).map(is_moving).collect();
        let count = pixels.iter().filter(|v| **v > 0).count();
        let matte = Image::from_pixels(image.width(), image.height(), pixels).unwrap_or_default();
        (Moving { small: grow(&matte, MARGIN), size: *size }, count as f64 / matte.pixels().len().max(1) as f64)
    };
    let (mattes, shares): (Vec<Moving>, Vec<f64>) = small.par_iter().map(moving).unzip();
    let mean = shares.iter().sum::<f64>() / count as f64;
    Ok((mean > LEAST_MOVING).then_some(mattes))
}

/// The colour of each place in most pictures, where there is one; `None` where the camera moved.
fn room(witnesses: &[&Image<[u8; 3]>]) -> Option<Image<Option<[f32; 3]>>> {
    let (width, height) = witnesses.first().map(|first| (first.width(), first.height()))?;
    let of_place = |at: usize| {
        let samples: Vec<[f32; 3]> = witnesses.iter().map(|image| image.pixels()[at].map(f32::from)).collect();
        cluster::densest(&samples)
    };
    let places: Vec<_> = (0..width * height).into_par_iter().map(of_place).collect();
    let support = |at: usize| places[at].map_or(0, |c| usize::from(c.support));
    let is_border = |at: &usize| is_at_border([width, height], at % width, at / width);
    let border: Vec<usize> = (0..width * height).filter(is_border).collect();
    let alike = border.iter().filter(|&&at| 4 * support(at) > 3 * witnesses.len()).count();
    if (alike as f64) < STILL_BORDER * border.len() as f64 {
        return None;
    }
    let usual = |at: usize| places[at].filter(|_| 2 * support(at) > witnesses.len()).map(|c| c.colour);
    Image::from_pixels(width, height, (0..width * height).map(usual).collect())
}

/// Each pixel as the nearest one of the small matte.
fn enlarged(small: &Image<u8>, [width, height]: [usize; 2]) -> Image<u8> {
    let factor = (width / small.width().max(1)).max(1);
    let at = |x: usize, y: usize| small.at((x / factor).min(small.width() - 1), (y / factor).min(small.height() - 1));
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| at(x, y))).collect();
    Image::from_pixels(width, height, pixels).unwrap_or_default()
}
