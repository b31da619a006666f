//! Cameras from a board in the footage.

use super::shots::lens_note;
use super::{FootageOptions, Shot, Shots, Standpoint};
use crate::Error;
use crate::stages::Stages;
use capture::Board;
use capture::calibrate::{
    CalibrateOptions, Calibration, FramePose, LensKnowledge, Motion, MotionKind, Segment, Sighting, Standing, Target,
    Turntable, calibrate,
};
use capture::choose::PoseSource;
use capture::footage::Footage;
use capture::silhouette::Print;
use capture::video::{Observations, Observed, Pattern, observe, recognise_in_footage};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

/// Corners that tell a camera: a homography needs four, and two more show that it is right.
const FEWEST_CORNERS: usize = 6;

pub(super) fn find_cameras(
    footage: &Footage,
    options: &FootageOptions,
    stages: &mut Stages<'_>,
) -> Result<Shots, Error> {
    let (pattern, is_measured) = find_pattern(footage, options, stages)?;
    let seen = look(footage, &pattern, "look", stages)?;
    let sightings = sightings(&seen);
    if sightings.len() < 2 {
        return Err(too_few(footage, &described(&pattern, is_measured), &sightings, &seen));
    }
    let lens = lens(footage, options, &pattern, seen.size, stages)?;
    let calibrate_options = CalibrateOptions {
        lens,
        motion: options.motion,
        upside_down: looks_the_same_upside_down(&pattern),
        ..CalibrateOptions::new(seen.size)
    };
    let found = stages.run("calibrate", |_| calibrate(&target(&pattern, options), &sightings, &calibrate_options));
    let calibration = found.map_err(|fault| Error::Failed(format!("{}: {fault}", footage.path().display())))?;
    let notes = calibration.notes.clone();
    let mut findings = calibration.findings.clone();
    findings.extend(seen.fault.as_ref().map(|fault| format!("the footage is used as far as it goes: {fault}")));
    let shots = shots(&seen, &calibration);
    let told_by = format!("{} in {} of {} frames", described(&pattern, is_measured), sightings.len(), shots.len());
    Ok(Shots {
        shots,
        size: seen.size,
        print: match pattern {
            Pattern::Board(board @ Board::Charuco { .. }) => print(board, &calibration),
            // Of a grid of markers there may be the rim alone, and of a chessboard nothing below the object.
            Pattern::Board(_) | Pattern::Markers(_) => None,
        },
        standpoints: standpoints(&calibration),
        calibration: Some(calibration),
        told_by,
        unit: is_measured.then_some(1.0),
        has_plane: true,
        findings,
        notes,
    })
}

/// What is printed, and whether its lengths are metres.
fn find_pattern(
    footage: &Footage,
    options: &FootageOptions,
    stages: &mut Stages<'_>,
) -> Result<(Pattern, bool), Error> {
    if let Some(board) = options.board {
        return Ok((Pattern::Board(board), true));
    }
    let found = stages.run("recognise board", |_| recognise_in_footage(footage))?;
    let pattern = found.ok_or_else(|| no_board(footage))?;
    let pattern = sized(pattern, options.length.unwrap_or(1.0));
    stages.observer().noted(&described(&pattern, options.length.is_some()));
    Ok((pattern, options.length.is_some()))
}

fn no_board(footage: &Footage) -> Error {
    Error::Failed(format!(
        "{}: shows no calibration board; print one (`turnlight board -o board.pdf`), put it under the object and film \
         again, or give cameras (--cameras, --colmap)",
        footage.path().display()
    ))
}

/// A board of unit squares (of unit markers), with squares of this many metres.
fn sized(pattern: Pattern, length: f64) -> Pattern {
    let Pattern::Board(mut board) = pattern else { return pattern };
    match &mut board {
        Board::Chessboard { square, .. } => *square *= length,
        Board::Charuco { square, marker, .. } => (*square, *marker) = (*square * length, *marker * length),
        Board::ArucoGrid { marker, gap, .. } => (*marker, *gap) = (*marker * length, *gap * length),
    }
    Pattern::Board(board)
}

fn described(pattern: &Pattern, is_measured: bool) -> String {
    match pattern {
        Pattern::Board(board) if is_measured => board.to_string(),
        Pattern::Board(board) => {
            let [columns, rows] = board.counts();
            let dictionary = board.dictionary().map(|d| format!(", {d}")).unwrap_or_default();
            let kind = match board {
                Board::Chessboard { .. } => "chessboard",
                Board::Charuco { .. } => "ChArUco board",
                Board::ArucoGrid { .. } => "grid of markers",
            };
            format!("{kind} of {columns} × {rows}{dictionary}, of unknown size")
        }
        Pattern::Markers(dictionary) => format!("markers in no order, {dictionary}"),
    }
}

fn look(footage: &Footage, pattern: &Pattern, stage: &str, stages: &mut Stages<'_>) -> Result<Observations, Error> {
    // How many frames a film has is known when it has been read.
    Ok(stages.run(stage, |observer| observe(footage, Some(pattern), &mut |seen| observer.advanced(seen, 0)))?)
}

fn sightings(seen: &Observations) -> Vec<Sighting> {
    let told = seen.frames.iter().enumerate().filter(|(_, frame)| frame.view.corners.len() >= FEWEST_CORNERS);
    told.map(|(at, frame)| Sighting {
        frame: at,
        time_s: frame.source.time_s,
        corners: frame.view.corners.clone(),
        film: frame.source.take,
    })
    .collect()
}

fn too_few(footage: &Footage, board: &str, sightings: &[Sighting], seen: &Observations) -> Error {
    let (found, of) = (sightings.len(), seen.frames.len());
    let fault = seen.fault.as_ref().map(|fault| format!(" ({fault})")).unwrap_or_default();
    Error::Failed(format!(
        "{}: {board} is seen in {found} of {of} frames{fault}; check that this is the board in the footage (leave --board \
         away to have it found out), light it evenly, and film so that it stays in view",
        footage.path().display()
    ))
}

/// What is known of the lens: from calibration shots, if there are any, or from what the camera noted.
fn lens(
    footage: &Footage,
    options: &FootageOptions,
    pattern: &Pattern,
    size: [usize; 2],
    stages: &mut Stages<'_>,
) -> Result<LensKnowledge, Error> {
    let Some(shots) = &options.calibration else { return Ok(noted_lens(footage, size, stages)) };
    let found = stages.run("recognise calibration board", |_| recognise_in_footage(shots))?;
    let pattern = match found {
        Some(found) => sized(found, options.length.unwrap_or(1.0)),
        None => *pattern,
    };
    let seen = look(shots, &pattern, "look at calibration shots", stages)?;
    if seen.size != size {
        let [[a, b], [c, d]] = [seen.size, size];
        let fault = format!("{}: is {a}x{b}, the footage is {c}x{d}", shots.path().display());
        return Err(Error::Failed(format!("{fault}; calibrate with the same camera, size and zoom")));
    }
    let calibrate_options = CalibrateOptions {
        motion: Some(MotionKind::FreeHand),
        upside_down: looks_the_same_upside_down(&pattern),
        ..CalibrateOptions::new(size)
    };
    let sightings = sightings(&seen);
    let found = stages.run("calibrate lens", |_| calibrate(&target(&pattern, options), &sightings, &calibrate_options));
    let calibration = found.map_err(|fault| Error::Failed(format!("{}: {fault}", shots.path().display())))?;
    stages.observer().noted(&lens_note(&calibration));
    calibration.findings.iter().for_each(|finding| stages.observer().noted(finding));
    if let Some(fault) = &seen.fault {
        stages.observer().noted(&format!("the calibration shots are used as far as they go: {fault}"));
    }
    Ok(LensKnowledge::Known(calibration.intrinsics))
}

/// What the photographs' own notes say.
fn noted_lens(footage: &Footage, size: [usize; 2], stages: &Stages<'_>) -> LensKnowledge {
    let Some(focal) = footage.noted_focal_px(size) else { return LensKnowledge::Unknown };
    stages.observer().noted(&format!("the camera noted a focal length of about {focal:.0} px"));
    LensKnowledge::Guess(focal)
}

fn target(pattern: &Pattern, options: &FootageOptions) -> Target {
    match pattern {
        // Printed at home, on paper that curls: where its markers lie is better learnt than believed.
        Pattern::Board(Board::ArucoGrid { marker, .. }) => Target::Markers { side: *marker },
        Pattern::Board(board) => Target::Points(board.corners()),
        Pattern::Markers(_) => Target::Markers { side: options.length.unwrap_or(1.0) },
    }
}

/// Where the board lies in the world: the rigid motion that takes the corners of the board to where they were found, by
/// least squares (Arun, Huang and Blostein: Least-Squares Fitting of Two 3-D Point Sets, PAMI 9(5), 1987).
fn print(board: Board, calibration: &Calibration) -> Option<Print> {
    let corners = board.corners();
    let pair =
        |(index, place): &(usize, Point3<f64>)| Some((*corners.get(*index)?, calibration.world_from_target * place));
    let pairs: Vec<(Point3<f64>, Point3<f64>)> = calibration.points.iter().filter_map(pair).collect();
    let count = pairs.len().max(1) as f64;
    let on_board = pairs.iter().map(|pair| pair.0.coords).sum::<Vector3<f64>>() / count;
    let in_world = pairs.iter().map(|pair| pair.1.coords).sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> =
        pairs.iter().map(|(b, w)| (b.coords - on_board) * (w.coords - in_world).transpose()).sum();
    let svd = scatter.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?.transpose());
    // Points of a plane leave a reflection open.
    let turned = v * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (v * u.transpose()).determinant())) * u.transpose();
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned));
    let world_from_board = Isometry3::from_parts((in_world - rotation * on_board).into(), rotation);
    (pairs.len() >= 3).then(|| Print { board, board_from_world: world_from_board.inverse() })
}

/// A chessboard whose counts are both even or both odd shows the same squares when turned half around.
fn looks_the_same_upside_down(pattern: &Pattern) -> bool {
    matches!(pattern, Pattern::Board(Board::Chessboard { columns, rows, .. }) if (columns + rows) % 2 == 0)
}

/// Every frame with its camera: by its own corners, or from the motion between those that have some.
fn shots(seen: &Observations, calibration: &Calibration) -> Vec<Shot> {
    let turntable = match &calibration.motion {
        Motion::Turntable(turntable) => Some(turntable),
        Motion::FreeHand => None,
    };
    let mut poses = calibration.frames.iter().enumerate().peekable();
    let shot = |(at, frame): (usize, &Observed)| match poses.next_if(|(_, pose)| pose.frame == at) {
        Some((sighting, pose)) => sighted(frame, sighting, pose, turntable),
        None => unsighted(frame, calibration),
    };
    seen.frames.iter().enumerate().map(shot).collect()
}

/// Where the camera stood, one place for each part of the motion.
fn standpoints(calibration: &Calibration) -> Vec<Standpoint> {
    let Motion::Turntable(turntable) = &calibration.motion else { return Vec::new() };
    let standpoint = |segment: &Segment| {
        let centre = segment.pose.inverse().translation.vector;
        Standpoint { take: segment.film, azimuth: Some(centre.y.atan2(centre.x)) }
    };
    turntable.segments.iter().map(standpoint).collect()
}

fn bare(frame: &Observed) -> Shot {
    let (blur_px, motion) = (frame.blur_px, frame.motion);
    Shot { blur_px, motion, ..Shot::bare(frame.source.clone(), frame.sharpness) }
}

fn sighted(frame: &Observed, sighting: usize, pose: &FramePose, turntable: Option<&Turntable>) -> Shot {
    let fault = match &pose.standing {
        Standing::Used => None,
        Standing::Rejected(why) => Some(why.clone()),
    };
    let source = match (pose.camera, &fault, pose.filled_deviation) {
        (None, ..) => PoseSource::Missing,
        (Some(_), _, Some(_)) => PoseSource::Filled,
        (Some(_), Some(_), None) => PoseSource::Rejected,
        (Some(_), None, None) => PoseSource::Measured,
    };
    let segments = turntable.map(|t| &t.segments[..]).unwrap_or_default();
    Shot {
        camera: pose.camera,
        pose: source,
        angle: turntable.and_then(|t| t.angles.get(sighting).copied().flatten()),
        angle_deviation: turntable.and_then(|t| t.angle_deviations.get(sighting).copied().flatten()),
        standpoint: segments.iter().position(|s| (s.first..=s.last).contains(&sighting)),
        corners: pose.used.len(),
        rms_px: pose.rms_px,
        fault,
        ..bare(frame)
    }
}

fn unsighted(frame: &Observed, calibration: &Calibration) -> Shot {
    let Some(filled) = calibration.camera_at(frame.source.take, frame.source.time_s) else {
        return Shot { fault: Some("the board is not seen".to_owned()), ..bare(frame) };
    };
    Shot {
        camera: Some(filled.camera),
        pose: PoseSource::Filled,
        angle: Some(filled.angle),
        angle_deviation: Some(filled.deviation),
        standpoint: Some(filled.segment),
        ..bare(frame)
    }
}
