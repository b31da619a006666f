//! Which frames of the footage become the capture.

use super::{FootageOptions, Shots};
use capture::choose::{Choice, ChooseOptions, DropReason, Dropped, FilmFrame, Viewpoint, choose_frames};

/// Standpoints whose heights above the table differ by less see the same ring, radians.
const SAME_HEIGHT: f64 = 0.06;

/// Photographs nearer to one another than this show the same, degrees.
const PHOTOGRAPH_STEP_DEG: f64 = 0.5;

/// The frames chosen.
#[derive(Clone, Debug, Default)]
pub struct Selected {
    /// Positions in the footage, ascending.
    pub kept: Vec<usize>,
    /// All others, ascending, and why.
    pub dropped: Vec<Dropped>,
    /// The choice for every height at which the camera stood; positions are in the footage.
    pub rings: Vec<Choice>,
}

/// Chooses frames for every height of the camera, and puts the choices together. Whoever took photographs has chosen:
/// of them all are kept that show another side.
pub(super) fn select(shots: &Shots, options: &FootageOptions) -> Selected {
    let groups = heights(shots);
    let is_film = shots.shots.iter().any(|shot| shot.source.file.is_none());
    let of_film = ChooseOptions::default();
    let usual = if is_film {
        of_film
    } else {
        ChooseOptions { most: (360.0 / PHOTOGRAPH_STEP_DEG) as usize, min_step_deg: PHOTOGRAPH_STEP_DEG, ..of_film }
    };
    let most = (options.most.unwrap_or(usual.most * groups.len()) / groups.len()).max(1);
    // Whoever asks for more than usual means it.
    let usual = ChooseOptions { min_step_deg: usual.min_step_deg.min(360.0 / most as f64), ..usual };
    let mut selected = Selected::default();
    for members in &groups {
        let frames: Vec<FilmFrame> = members.iter().map(|&at| film_frame(shots, at)).collect();
        let mut choice = choose_frames(&frames, &ChooseOptions { most, ..usual });
        choice.kept.iter_mut().for_each(|at| *at = members[*at]);
        choice.dropped.iter_mut().for_each(|dropped| dropped.position = members[dropped.position]);
        selected.kept.extend(&choice.kept);
        selected.dropped.extend(&choice.dropped);
        selected.rings.push(choice);
    }
    selected.kept.sort_unstable();
    selected.dropped.sort_by_key(|dropped| dropped.position);
    selected
}

impl Selected {
    /// What most often kept frames out.
    pub(super) fn why_none(&self) -> String {
        let count = |reason: DropReason| self.dropped.iter().filter(|d| d.reason == reason).count();
        let reasons = [DropReason::NoPose, DropReason::RejectedPose, DropReason::Blurred, DropReason::TooClose];
        let worst = reasons.into_iter().max_by_key(|&reason| count(reason));
        worst.map_or_else(String::new, |reason| format!("{} of {} frames: {reason}", count(reason), self.dropped.len()))
    }
}

fn film_frame(shots: &Shots, at: usize) -> FilmFrame {
    let shot = &shots.shots[at];
    FilmFrame {
        time_s: shot.source.time_s,
        sharpness: shot.sharpness,
        blur_px: shot.blur_px,
        viewpoint: viewpoint(shots, at),
        pose: shot.pose,
        motion: shot.motion,
    }
}

/// On a turntable the azimuth of the camera about the axis, unwrapped; otherwise its direction from the origin.
fn viewpoint(shots: &Shots, at: usize) -> Option<Viewpoint> {
    let shot = &shots.shots[at];
    let camera = shot.camera?;
    let start = shot.standpoint.and_then(|at| shots.standpoints.get(at)?.azimuth);
    match (shot.angle, start) {
        // The camera goes round the object the other way.
        (Some(angle), Some(start)) => Some(Viewpoint::Angle(start - angle)),
        _ => Some(Viewpoint::Direction(camera.center().coords)),
    }
}

/// Positions of frames by the camera's height above the table; one group where nothing turns.
fn heights(shots: &Shots) -> Vec<Vec<usize>> {
    let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
    let mut without = Vec::new();
    for (at, shot) in shots.shots.iter().enumerate() {
        let centre = shot.camera.filter(|_| shot.angle.is_some()).map(|camera| camera.center());
        let Some(centre) = centre else {
            without.push(at);
            continue;
        };
        let height = centre.z.atan2(centre.x.hypot(centre.y));
        match groups.iter_mut().find(|(known, _)| (known - height).abs() < SAME_HEIGHT) {
            Some((_, members)) => members.push(at),
            None => groups.push((height, vec![at])),
        }
    }
    let mut groups: Vec<Vec<usize>> = groups.into_iter().map(|(_, members)| members).collect();
    // Frames without a camera are dropped by whatever group they are in.
    match groups.first_mut() {
        Some(first) => {
            first.extend(without);
            first.sort_unstable();
        }
        None => groups.push(without),
    }
    groups
}
