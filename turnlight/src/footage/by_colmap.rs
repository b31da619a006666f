//! Cameras from an installed COLMAP: of photographs, or of frames of a film chosen evenly in motion.

use super::look::look;
use super::pictures::{Pictures, Taken};
use super::{FootageOptions, Shots, Standpoint, select, silhouettes};
use crate::Error;
use crate::colmap::{self, ColmapOptions, Photograph};
use crate::stages::Stages;
use capture::choose::ChooseOptions;
use capture::footage::{Footage, FrameSource, read_upright, read_upright_alpha};
use capture::silhouette::find_moving;
use capture::write_matte;
use std::path::{Path, PathBuf};

/// Finds the cameras. COLMAP may see of what stands still only where the camera was carried: else the room would tell that
/// nothing turns.
pub(super) fn find_cameras(
    footage: &Footage,
    program: &Path,
    options: &FootageOptions,
    output: &Path,
    stages: &mut Stages<'_>,
) -> Result<(Shots, Option<Taken>), Error> {
    let mut shots = look(footage, None, stages)?;
    let (positions, taken) = chosen(footage, &mut shots, options, output, stages)?;
    let files: Vec<PathBuf> = match &taken {
        Some(taken) => (0..positions.len()).map(|i| taken.pictures.file(i).to_owned()).collect(),
        None => shots.shots.iter().map(|shot| shot.source.file.clone().unwrap_or_default()).collect(),
    };
    let place = tempfile::Builder::new().prefix("turnlight-masks-").tempdir();
    let place = place.map_err(|fault| Error::Failed(format!("no temporary folder: {fault}; set TMPDIR to another")))?;
    let masks = masks(&mut shots, &positions, &files, options, place.path(), stages)?;
    let photograph = |(image, mask): (PathBuf, Option<PathBuf>)| Photograph { image, mask };
    let photographs: Vec<Photograph> = files.into_iter().zip(masks).map(photograph).collect();
    let colmap = ColmapOptions { program: program.to_owned(), ..ColmapOptions::default() };
    let found = colmap::find_cameras(&photographs, &colmap, stages)?;
    positions.iter().zip(found.cameras).for_each(|(&at, camera)| shots.shots[at].set_camera(camera));
    if found.models > 1 {
        let fault = format!("the frames fell apart into {} groups, of which the largest is used", found.models);
        shots.findings.push(format!("{fault}: take more between them"));
    }
    Ok((Shots { told_by: "COLMAP".to_owned(), ..shots }, taken))
}

/// The positions that COLMAP gets: of photographs all, of a film those chosen evenly in motion, which are written.
fn chosen(
    footage: &Footage,
    shots: &mut Shots,
    options: &FootageOptions,
    output: &Path,
    stages: &mut Stages<'_>,
) -> Result<(Vec<usize>, Option<Taken>), Error> {
    if !footage.has_film() {
        return Ok(((0..shots.shots.len()).collect(), None));
    }
    // Neighbours have to overlap, however few are asked for in the end.
    let most = options.most.map(|most| most.max(ChooseOptions::default().most));
    let selected = select::select(shots, &FootageOptions { most, ..options.clone() });
    selected.dropped.iter().for_each(|left| shots.shots[left.position].fault = Some(left.reason.to_string()));
    let sources: Vec<_> = selected.kept.iter().map(|&at| shots.shots[at].source.clone()).collect();
    let beside = crate::output::parent(output);
    let pictures = stages.run("take frames", |observer| Pictures::extract(footage, &sources, beside, observer))?;
    Ok((selected.kept.clone(), Some(Taken { positions: selected.kept, pictures })))
}

/// The mask of each picture: given, its alpha, or what moves before a camera that stands still; none where it was carried.
fn masks(
    shots: &mut Shots,
    positions: &[usize],
    files: &[PathBuf],
    options: &FootageOptions,
    place: &Path,
    stages: &mut Stages<'_>,
) -> Result<Vec<Option<PathBuf>>, Error> {
    let takes = shots.takes();
    let sources: Vec<FrameSource> = positions.iter().map(|&at| shots.shots[at].source.clone()).collect();
    let file = |i: usize| place.join(format!("{i:06}.png"));
    if let Some(folder) = &options.masks {
        return sources.iter().map(|source| silhouettes::mask_of(folder, source, takes).map(Some)).collect();
    }
    if let Some(photographs) = silhouettes::with_alpha(&sources.iter().collect::<Vec<_>>()) {
        for (i, photograph) in photographs.iter().enumerate() {
            write_matte(&file(i), &read_upright_alpha(photograph)?)?;
        }
        return Ok((0..files.len()).map(|i| Some(file(i))).collect());
    }
    let mut masks = vec![None; files.len()];
    let mut still = 0;
    for take in 0..takes {
        let members: Vec<usize> = (0..files.len()).filter(|&i| sources[i].take == take).collect();
        let fetch = |i: usize| read_upright(&files[members[i]]);
        let Some(found) = stages.run("what moves", |_| find_moving(&fetch, members.len()))? else { continue };
        for (&i, matte) in members.iter().zip(&found) {
            write_matte(&file(i), &matte.matte())?;
            masks[i] = Some(file(i));
        }
        still += 1;
        // Photographs before a dark or an even backdrop look so wherever they were taken from.
        let is_film = members.first().is_some_and(|&i| sources[i].file.is_none());
        if is_film {
            members.iter().for_each(|&i| shots.shots[positions[i]].standpoint = Some(shots.standpoints.len()));
            shots.standpoints.push(Standpoint { take, azimuth: None });
        }
    }
    let note = if still == takes {
        "the border of the pictures stays the same: COLMAP sees what moves inside (give --masks where that is more than the \
         object and what turns with it)"
    } else {
        "nothing tells that the camera stood still (it was carried, nothing moves, or the pictures are too few): COLMAP sees \
         the room as well, which is right only if the object stood still (otherwise --masks)"
    };
    shots.notes.push(note.to_owned());
    stages.observer().noted(note);
    Ok(masks)
}
