//! A film of an object on a turntable, as someone takes it to make a model of: a printed board under the object, a
//! coloured cloth behind it, a lens that bends, a platter that turns not quite steadily. With the truth beside it.
//!
//! The camera stands still and the platter turns; in the object's world, which is at rest, camera, lights and room go
//! around it. Light goes everywhere: the cloth spills its colour on the object, the object shades the cloth.

mod camera;
mod drive;
mod set;
mod shot;
mod truth;

pub use truth::TruthFolder;

pub(crate) use set::{SET, Set};

use crate::error::SynthError;
use crate::faults::{Faults, SensorNoise, develop};
use crate::film::{Effort, Exposure};
use crate::light::LightRig;
use crate::sampler::splitmix;
use crate::scene::Scene;
use crate::trace::{PathLimits, World};
use crate::turntable::{Station, room_yaw};
use capture::board::Dictionary;
use capture::{Aabb, Board, Camera, Distortion, View};
use geometry::Mesh;
use nalgebra::{Isometry3, Vector3};
use std::f64::consts::{SQRT_2, TAU};
use std::fmt;
use std::str::FromStr;

/// Colour of the cloth behind the turntable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backdrop {
    /// As for keying objects without green.
    Green,
    /// As for keying objects without blue.
    Blue,
    /// Neutral: nothing spills, little can be keyed.
    Grey,
    /// Nearly without light.
    Black,
}

/// How a film is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct FootageOptions {
    /// Number of frames, 1 to 10000.
    pub frames: usize,
    /// Frame width in pixels, 16 to 16384.
    pub width: usize,
    /// Frame height in pixels, 16 to 16384.
    pub height: usize,
    /// Frames per second, 1 to 1000.
    pub fps: f64,
    /// Of everything random; the same seed gives the same bytes.
    pub seed: u64,
    /// Paths per pixel of the object, 1 to 4096; the set gets a quarter.
    pub samples: u32,
    /// Surfaces a path of light may touch, 1 to 1000.
    pub surfaces: usize,
    /// Full turns of the platter from the first frame to the last, 0 to 100.
    pub turns: f64,
    /// Standard deviation of the platter's speed over its mean, 0 to 0.3.
    pub unsteadiness: f64,
    /// Of the camera above the platter, 5 to 80 degrees.
    pub elevation_deg: f64,
    /// Colour of the cloth.
    pub backdrop: Backdrop,
    /// The board on the platter; `None` for one of 7 × 7 squares that suits the object.
    pub board: Option<Board>,
    /// What the lens bends.
    pub distortion: Distortion,
    /// Principal point off the middle, in shares of width and height, each −0.2 to 0.2.
    pub principal_offset: [f64; 2],
    /// Noise of the sensor.
    pub sensor_noise: Option<SensorNoise>,
    /// Standard deviation of the exposure over the film, in stops; it drifts slowly.
    pub exposure_drift_stops: f64,
    /// Turn of the platter while the shutter is open, in degrees.
    pub motion_blur_deg: f64,
}

/// A film about to be taken: everything that is true of it, and its frames one by one.
#[derive(Debug)]
pub struct Footage {
    scene: Scene,
    options: FootageOptions,
    mesh: Mesh,
    aabb: Aabb,
    world: World,
    rig: LightRig,
    board: Board,
    world_from_board: Isometry3<f64>,
    angles: Vec<f64>,
    stations: Vec<Station>,
    cameras: Vec<Camera>,
}

/// How far the board's edges lie from the axis, in radii of the object's footprint: a ring of squares stays in view.
const BOARD_SHARE: f64 = 1.55;
/// Squares along a side of the board that suits an object.
const SQUARES: usize = 7;
/// Off the axis the board's middle lies in shares of its side, as one who puts it there by eye leaves it.
const OFF_AXIS: f64 = 0.012;
/// Azimuth of the camera in the first frame, as seen from the object.
const FIRST_AZIMUTH: f64 = 0.0;

impl Default for FootageOptions {
    /// Five seconds of a phone.
    fn default() -> Self {
        Self {
            frames: 150,
            width: 1280,
            height: 720,
            fps: 30.0,
            seed: 0,
            samples: 8,
            surfaces: 4,
            turns: 1.05,
            unsteadiness: 0.05,
            elevation_deg: 25.0,
            backdrop: Backdrop::Green,
            board: None,
            distortion: Distortion { k1: -0.06, k2: 0.02, ..Distortion::default() },
            principal_offset: [0.012, -0.009],
            sensor_noise: Some(SensorNoise { full_well: 5000.0, read_electrons: 8.0 }),
            exposure_drift_stops: 0.02,
            motion_blur_deg: 0.0,
        }
    }
}

impl FootageOptions {
    fn check(&self) -> Result<(), SynthError> {
        let within = |option: &'static str, value: f64, [low, high]: [f64; 2]| {
            let ok = (low..=high).contains(&value);
            let allowed = || format!("between {low} and {high}");
            if ok { Ok(()) } else { Err(SynthError::Option { option, value: value.to_string(), allowed: allowed() }) }
        };
        within("frames", self.frames as f64, [1.0, 10_000.0])?;
        within("width", self.width as f64, [16.0, 16_384.0])?;
        within("height", self.height as f64, [16.0, 16_384.0])?;
        within("fps", self.fps, [1.0, 1000.0])?;
        within("samples", f64::from(self.samples), [1.0, 4096.0])?;
        within("surfaces", self.surfaces as f64, [1.0, 1000.0])?;
        within("turns", self.turns, [0.0, 100.0])?;
        within("unsteadiness", self.unsteadiness, [0.0, 0.3])?;
        within("elevation_deg", self.elevation_deg, [5.0, 80.0])?;
        within("principal_offset", self.principal_offset[0], [-0.2, 0.2])?;
        within("principal_offset", self.principal_offset[1], [-0.2, 0.2])?;
        if let Some(board) = self.board {
            let allowed = |fault: capture::BoardError| format!("a board that can be: {fault}");
            board.check().map_err(|fault| SynthError::Option {
                option: "board",
                value: board.to_string(),
                allowed: allowed(fault),
            })?;
        }
        self.faults().check()
    }

    /// Those faults that are checked as a capture's are.
    fn faults(&self) -> Faults {
        let (sensor_noise, exposure_drift_stops) = (self.sensor_noise, self.exposure_drift_stops);
        Faults { sensor_noise, exposure_drift_stops, motion_blur_deg: self.motion_blur_deg, ..Faults::default() }
    }
}

/// Builds the set around a scene and puts camera, board and platter where they will be.
///
/// # Errors
/// Names the option that is out of range.
pub fn set_up(scene: Scene, options: &FootageOptions) -> Result<Footage, SynthError> {
    options.check()?;
    let built = scene.build();
    let aabb = built.mesh.aabb().ok_or(SynthError::Scene { fault: "it has no vertices" })?;
    let footprint = built.mesh.positions.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max);
    let height = aabb.max.z;
    let board = options.board.unwrap_or_else(|| suitable_board(footprint));
    let set = laid_out(board, height, options);
    let angles = drive::angles(options.frames, options.turns, options.unsteadiness, options.seed);
    // The platter turns counter-clockwise seen from above; what stands still goes the other way around it.
    let elevation = options.elevation_deg.to_radians();
    let station = |angle: &f64| Station { azimuth: FIRST_AZIMUTH - angle, elevation };
    let stations: Vec<Station> = angles.iter().map(station).collect();
    let cameras = camera::cameras(&stations, [footprint, height], set.length(), options)?;
    Ok(Footage {
        scene,
        options: options.clone(),
        aabb,
        rig: LightRig::film_set(set.length() as f32),
        board: *set.board(),
        world_from_board: *set.world_from_board(),
        world: built.world.on_set(&built.mesh, set),
        mesh: built.mesh,
        angles,
        stations,
        cameras,
    })
}

/// Whole millimetres, as one prints it.
fn suitable_board(footprint: f64) -> Board {
    let square = (2.0 * BOARD_SHARE * footprint / SQUARES as f64 * 1e3).ceil() / 1e3;
    let dictionary = Dictionary::DICT_4X4_50;
    Board::Charuco { columns: SQUARES, rows: SQUARES, square, marker: 0.75 * square, dictionary, light_first: false }
}

/// The set with its board as someone put it there: near the middle, turned somehow.
fn laid_out(board: Board, height: f64, options: &FootageOptions) -> Set {
    let side = board.size()[0].max(board.size()[1]);
    let uniform =
        |k: u64| (splitmix(options.seed ^ splitmix(0xb0a2 + k)) >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0;
    let middle = [uniform(0), uniform(1)].map(|u| u * OFF_AXIS * side);
    Set::new(board, middle, 0.5 * uniform(2), height, options.backdrop)
}

fn frame_name(frame: usize) -> String {
    format!("{frame:04}")
}

impl Footage {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.options.frames
    }

    /// What the film is taken with.
    pub fn options(&self) -> &FootageOptions {
        &self.options
    }

    /// The board on the platter.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Where the board lies: board coordinates to the object's world, metres.
    pub fn world_from_board(&self) -> &Isometry3<f64> {
        &self.world_from_board
    }

    /// By how much the platter has turned since the first frame, about +z seen from the room, in radians, per frame.
    pub fn angles(&self) -> &[f64] {
        &self.angles
    }

    /// The camera of every frame, seen from the object.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Factor on the light of a frame: what the camera's own exposure does over the film.
    pub fn exposure(&self, frame: usize) -> f64 {
        let (seed, stops) = (self.options.seed, self.options.exposure_drift_stops);
        let phase = |k: u64| TAU * (splitmix(seed ^ splitmix(0xe4b0 + k)) >> 11) as f64 / (1_u64 << 53) as f64;
        let at = TAU * frame as f64 / self.options.frames as f64;
        (stops * ((2.0 * at + phase(0)).sin() + SQRT_2 * 0.5 * (7.0 * at + phase(1)).sin()) / 1.2247).exp2()
    }

    /// One frame as the sensor gives it, with the true matte of the object alone. Frames may be asked for in any
    /// order, each of them as often as wanted.
    ///
    /// # Panics
    /// Beyond the last frame.
    pub fn frame(&self, frame: usize) -> View {
        let (options, camera) = (&self.options, &self.cameras[frame]);
        let yaw = room_yaw(&self.stations[frame]);
        let exposure = Exposure {
            world: &self.world,
            rig: &self.rig,
            limits: PathLimits { surfaces: options.surfaces },
            effort: Effort::Samples(options.samples),
            seed: options.seed,
            view: frame,
            shutter_rad: -options.motion_blur_deg.to_radians(),
            lights_stay: true,
        };
        let shot = shot::shoot(camera, &exposure, options.samples, yaw);
        let image = develop(&shot.radiance, self.exposure(frame), options.sensor_noise, options.seed, frame);
        View {
            index: frame,
            name: frame_name(frame),
            image,
            matte: shot.coverage.map(|c| (c * 255.0).round() as u8),
            is_complete: true,
            camera: *camera,
        }
    }

    /// Unit direction from the object to the key light in a frame.
    fn light_direction(&self, frame: usize) -> Vector3<f64> {
        let rig = self.rig.turned(room_yaw(&self.stations[frame]) as f32);
        let towards = rig.lights.first().map(|light| light.center.cast() - self.aabb.center().coords);
        towards.and_then(|d: Vector3<f64>| d.try_normalize(0.0)).unwrap_or_else(Vector3::z)
    }
}

impl Backdrop {
    /// Every backdrop.
    pub const ALL: [Self; 4] = [Self::Green, Self::Blue, Self::Grey, Self::Black];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Grey => "grey",
            Self::Black => "black",
        }
    }
}

impl FromStr for Backdrop {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let allowed = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|b| b.name() == name);
        found.ok_or_else(|| SynthError::Option { option: "backdrop", value: name.to_owned(), allowed: allowed() })
    }
}

impl fmt::Display for Backdrop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests;
