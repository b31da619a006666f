//! Every frame of footage whose cameras come from elsewhere: how sharp it is, and how far it moved.

use super::silhouettes::check_size;
use super::{Shot, Shots};
use crate::Error;
use crate::stages::Stages;
use capture::choose;
use capture::footage::{Footage, FrameSource, read_upright};
use rayon::prelude::*;

/// Looks at every frame once; `size` is what its cameras are for, where they are known. Nothing but the frames is in the
/// result yet.
///
/// # Errors
/// Names the frame that cannot be read, or is of another size, and the film where this build reads none.
pub(super) fn look(footage: &Footage, size: Option<[usize; 2]>, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    if footage.has_film() { look_at_film(footage, size, stages) } else { look_at_photographs(footage, size, stages) }
}

fn look_at_photographs(footage: &Footage, size: Option<[usize; 2]>, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    let look = |source: FrameSource| {
        let Some(file) = source.file.clone() else { return Ok(([0, 0], Shot::bare(source, 0.0))) };
        let image = read_upright(&file)?;
        let found = [image.width(), image.height()];
        check_size(&file, found, size.unwrap_or(found))?;
        Ok((found, Shot::bare(source, choose::sharpness(&image))))
    };
    let looked: Vec<Result<_, Error>> =
        stages.run("look", |_| footage.photographs().into_par_iter().map(look).collect());
    let mut shots = Shots::default();
    for looked in looked {
        let (found, shot) = looked?;
        shots.size = if shots.shots.is_empty() { found } else { shots.size };
        check_size(shot.source.name.as_ref(), found, shots.size)?;
        shots.shots.push(shot);
    }
    Ok(shots)
}

#[cfg(feature = "video")]
fn look_at_film(footage: &Footage, size: Option<[usize; 2]>, stages: &mut Stages<'_>) -> Result<Shots, Error> {
    use capture::video::{Observed, observe};
    // How many frames a film has is known when it has been read.
    let seen = stages.run("look", |observer| observe(footage, None, &mut |seen| observer.advanced(seen, 0)))?;
    check_size(footage.path(), seen.size, size.unwrap_or(seen.size))?;
    let shot = |frame: Observed| Shot { motion: frame.motion, ..Shot::bare(frame.source, frame.sharpness) };
    let findings = seen.fault.iter().map(|fault| format!("the footage is used as far as it goes: {fault}")).collect();
    Ok(Shots { shots: seen.frames.into_iter().map(shot).collect(), size: seen.size, findings, ..Shots::default() })
}

#[cfg(not(feature = "video"))]
fn look_at_film(footage: &Footage, _: Option<[usize; 2]>, _: &mut Stages<'_>) -> Result<Shots, Error> {
    Err(super::cameras::needs_video(footage))
}
