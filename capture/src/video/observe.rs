//! Looks through footage once: how sharp every frame is, how far it moved, and where it shows the board.

use super::{BoardView, Pattern, blur, detect_pattern, recognise_pattern};
use crate::footage::{Footage, FootageFrame, FrameSource};
use crate::{CaptureError, Image, choose};
use rayon::prelude::*;

/// What one frame shows.
#[derive(Clone, Debug)]
pub struct Observed {
    /// Where it comes from.
    pub source: FrameSource,
    /// As [`choose::sharpness`] says.
    pub sharpness: f64,
    /// Mean difference from the frame before, in levels of a small picture of both; 0 for the first of a take.
    pub motion: f64,
    /// Standard deviation, in pixels, of the blur at the edges of the board: the root mean square over its two sides, in
    /// linear light, without that of the pixels themselves. `None` where too little of the board is seen.
    pub blur_px: Option<f64>,
    /// What is seen of the board.
    pub view: BoardView,
}

/// What footage shows.
#[derive(Debug)]
pub struct Observations {
    /// Width and height of the frames.
    pub size: [usize; 2],
    /// Every frame, in order.
    pub frames: Vec<Observed>,
    /// Why the footage ended early, if it did.
    pub fault: Option<CaptureError>,
}

/// Every so many frames of a film are looked at to find out what board it shows.
const SAMPLE_STEP: usize = 10;
/// Pictures that are looked at together; more are only looked at where these show nothing.
const SAMPLE: usize = 12;
/// Frames looked at together, by all threads; they are what is held in memory.
const BATCH: usize = 8;
/// Longer side of the pictures that tell motion.
const SMALL: usize = 64;

/// Finds out what pattern the footage shows, by looking at a part of it; all of it where there is none.
///
/// # Errors
/// Where not even the first frame can be read, and [`CaptureError::OpenCv`] where OpenCV fails.
pub fn recognise_in_footage(footage: &Footage) -> Result<Option<Pattern>, CaptureError> {
    let step = if footage.has_film() { SAMPLE_STEP } else { 1 };
    let mut sample = Vec::new();
    for (i, frame) in footage.frames().enumerate() {
        let frame = match frame {
            Ok(frame) => frame,
            Err(fault) if i == 0 => return Err(fault),
            // [`observe`] says so.
            Err(_) => break,
        };
        if i % step == 0 {
            sample.push(frame.image);
        }
        if sample.len() == SAMPLE {
            let found = recognise_pattern(&std::mem::take(&mut sample))?;
            if found.is_some() {
                return Ok(found);
            }
        }
    }
    recognise_pattern(&sample)
}

/// Looks at every frame of the footage once. `seen` hears how many have been looked at. Footage that ends in a fault
/// is used as far as it goes. Deterministic.
///
/// # Errors
/// Where not even the first frame can be read, and [`CaptureError::OpenCv`] where OpenCV fails.
pub fn observe(
    footage: &Footage,
    pattern: Option<&Pattern>,
    seen: &mut dyn FnMut(usize),
) -> Result<Observations, CaptureError> {
    let mut frames = footage.frames();
    let mut found = Observations { size: [0, 0], frames: Vec::new(), fault: None };
    let mut last: Option<(usize, Image<u8>)> = None;
    let mut batch = read_batch(&mut frames, &mut found.fault);
    while !batch.is_empty() {
        // The next frames are decoded while these are looked at.
        let (looked, next) = rayon::join(
            || batch.par_iter().map(|frame| look(frame, pattern)).collect::<Vec<_>>(),
            || {
                let mut fault = None;
                (read_batch(&mut frames, &mut fault), fault)
            },
        );
        found.size = [batch[0].image.width(), batch[0].image.height()];
        for looked in looked {
            let (mut observed, small) = looked?;
            let before = last.as_ref().filter(|(take, _)| *take == observed.source.take);
            observed.motion = before.map_or(0.0, |(_, before)| difference(before, &small));
            last = Some((observed.source.take, small));
            found.frames.push(observed);
        }
        seen(found.frames.len());
        batch = next.0;
        found.fault = found.fault.or(next.1);
    }
    match found.fault {
        Some(fault) if found.frames.is_empty() => Err(fault),
        fault => Ok(Observations { fault, ..found }),
    }
}

fn read_batch(
    frames: &mut dyn Iterator<Item = Result<FootageFrame, CaptureError>>,
    fault: &mut Option<CaptureError>,
) -> Vec<FootageFrame> {
    let read = frames.take(BATCH).map_while(|frame| frame.map_err(|error| *fault = Some(error)).ok());
    read.collect()
}

fn look(frame: &FootageFrame, pattern: Option<&Pattern>) -> Result<(Observed, Image<u8>), CaptureError> {
    let view = pattern.map(|pattern| detect_pattern(&frame.image, pattern)).transpose()?.unwrap_or_default();
    let blur_px = pattern.and_then(|pattern| blur::blur_px(&frame.image, pattern, &view));
    let sharpness = choose::sharpness(&frame.image);
    Ok((Observed { source: frame.source.clone(), sharpness, motion: 0.0, blur_px, view }, small(&frame.image)))
}

/// The green channel at every so many pixels: enough to see that something moved.
fn small(image: &Image<[u8; 3]>) -> Image<u8> {
    let step = image.width().max(image.height()).div_ceil(SMALL).max(1);
    let (width, height) = (image.width().div_ceil(step), image.height().div_ceil(step));
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| image.at(x * step, y * step)[1])).collect();
    Image::from_pixels(width, height, pixels).unwrap_or_default()
}

fn difference(a: &Image<u8>, b: &Image<u8>) -> f64 {
    let sum: u32 = a.pixels().iter().zip(b.pixels()).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
    f64::from(sum) / a.pixels().len().max(1) as f64
}
