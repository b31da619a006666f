//! Films drawn in a moment: two balls on a board that turns before a cloth, flat shaded. Not to be mistaken for
//! photographs (`data_synth::footage` takes those), but every truth is known in closed form, and every fault of real
//! footage can be had.

use capture::{Board, Camera, Distortion, Image, Intrinsics, Ray};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Rotation3, Unit, Vector2, Vector3};
use rayon::prelude::*;

/// A film to be drawn.
#[derive(Clone, Debug)]
pub struct Cartoon {
    /// On the platter; lies in the plane z = 0 of the world, its middle 4 mm off the axis.
    pub board: Board,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Height of the camera above the platter in degrees.
    pub elevation_deg: f64,
    /// Colour of the cloth.
    pub cloth: [u8; 3],
    /// Colour of the lower and the upper ball.
    pub balls: [[u8; 3]; 2],
    /// Whether there is a platter with the board; else the balls hang before the cloth.
    pub has_platter: bool,
    /// Column, row and radius in pixels of a black mirror ball that stands in the room.
    pub mirror: Option<[f64; 3]>,
}

/// Two balls one upon the other: centres and radii in metres.
const BALLS: [([f64; 3], f64); 2] = [([0.004, -0.003, 0.034], 0.034), ([-0.006, 0.008, 0.082], 0.021)];
/// Of the platter in metres.
const PLATTER: f64 = 0.16;
/// Rays a pixel along each side.
const RAYS: usize = 3;
/// Towards the only lamp of the room, seen by the camera.
const LAMP: [f64; 3] = [-0.5, -0.7, -0.5];
/// Cosine of half the angle under which the mirror ball sees it.
const LAMP_COSINE: f64 = 0.995;
/// Of the mirror ball from the camera, metres: nearer than anything else.
const MIRROR_DISTANCE: f64 = 0.25;

impl Default for Cartoon {
    fn default() -> Self {
        Self {
            board: Board::Charuco {
                columns: 7,
                rows: 7,
                square: 0.03,
                marker: 0.0225,
                dictionary: capture::board::Dictionary::DICT_4X4_50,
                light_first: false,
            },
            size: [640, 480],
            elevation_deg: 30.0,
            cloth: [40, 160, 60],
            balls: [[200, 90, 60], [210, 190, 80]],
            has_platter: true,
            mirror: None,
        }
    }
}

/// One frame and its truth.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// 8-bit sRGB.
    pub image: Image<[u8; 3]>,
    /// Coverage by the balls.
    pub matte: Image<u8>,
    /// World to pixels; the world is that of the object, z along the axis.
    pub camera: Camera,
}

impl Cartoon {
    /// What takes the film: a lens with a focal length of 1.05 widths that bends a little, off the middle.
    pub fn lens(&self) -> Intrinsics {
        let [width, height] = self.size;
        let focal = 1.05 * width as f64;
        Intrinsics {
            fx: focal,
            fy: focal,
            skew: 0.0,
            cx: 0.508 * width as f64,
            cy: 0.493 * height as f64,
            distortion: Distortion { k1: -0.05, k2: 0.01, ..Distortion::default() },
            width,
            height,
        }
    }

    /// From board coordinates to the world: the middle of the board 4 mm off the axis, turned by a tenth.
    pub fn world_from_board(&self) -> Isometry3<f64> {
        let [width, height] = self.board.size();
        let turn = Isometry3::rotation(Vector3::z() * 0.1);
        Isometry3::translation(0.004, -0.001, 0.0) * turn * Isometry3::translation(-0.5 * width, -0.5 * height, 0.0)
    }

    /// The camera in the room, which sees the world turned by `angle` radians.
    pub fn camera(&self, angle: f64) -> Camera {
        let elevation = self.elevation_deg.to_radians();
        let forward = -Vector3::new(elevation.cos(), 0.0, elevation.sin());
        let right = forward.cross(&Vector3::z()).normalize();
        let rotation = Matrix3::from_rows(&[right.transpose(), forward.cross(&right).transpose(), forward.transpose()]);
        let centre = Vector3::new(0.0, 0.0, 0.03) - 0.5 * forward;
        let turned = rotation * Rotation3::from_axis_angle(&Vector3::z_axis(), angle).into_inner();
        Camera { intrinsics: self.lens(), rotation: turned, translation: -(rotation * centre) }
    }

    /// Unit direction in the camera's coordinates towards the lamp.
    pub fn lamp(&self) -> Unit<Vector3<f64>> {
        Unit::new_normalize(LAMP.into())
    }

    /// The set without object and platter.
    pub fn set(&self) -> Image<[u8; 3]> {
        let [width, height] = self.size;
        let cloth = |at: usize| self.backdrop((at / width) as f64 + 0.5).map(|level| level.round() as u8);
        Image::from_pixels(width, height, (0..width * height).map(cloth).collect()).unwrap_or_default()
    }

    /// A cloth that is lighter above.
    fn backdrop(&self, row: f64) -> [f64; 3] {
        let light = 1.1 - 0.3 * row / self.size[1] as f64;
        self.cloth.map(|c| f64::from(c) * light)
    }

    /// What the mirror ball shows along a ray, if it is met.
    fn mirrored(&self, camera: &Camera, ray: &Ray, lamp: &Unit<Vector3<f64>>) -> Option<[f64; 3]> {
        let [column, row, radius] = self.mirror?;
        let towards = camera.ray(Point2::new(column, row))?;
        let centre = towards.origin + towards.direction * MIRROR_DISTANCE;
        let radius = MIRROR_DISTANCE * (radius / camera.intrinsics.fx).atan().sin();
        let normal = (ray.origin + ray.direction * hit(ray, centre, radius)? - centre) / radius;
        let reflected = ray.direction - 2.0 * ray.direction.dot(&normal) * normal;
        Some(if reflected.dot(lamp) > LAMP_COSINE { [255.0; 3] } else { [22.0, 20.0, 24.0] })
    }

    /// The frame at which the platter has turned by `angle` radians.
    pub fn frame(&self, angle: f64) -> Drawn {
        let camera = self.camera(angle);
        let [width, height] = self.size;
        let board_from_world = self.world_from_board().inverse();
        // The lamp stands in the room: seen from the object it goes round.
        let lamp = Unit::new_normalize(camera.rotation.transpose() * Vector3::from(LAMP));
        let rows: Vec<Vec<([u8; 3], u8)>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| self.pixel(&camera, &board_from_world, &lamp, [x, y])).collect())
            .collect();
        let pixels = rows.concat();
        let image = Image::from_pixels(width, height, pixels.iter().map(|p| p.0).collect()).unwrap_or_default();
        let matte = Image::from_pixels(width, height, pixels.iter().map(|p| p.1).collect()).unwrap_or_default();
        Drawn { image, matte, camera }
    }

    fn pixel(
        &self,
        camera: &Camera,
        board_from_world: &Isometry3<f64>,
        lamp: &Unit<Vector3<f64>>,
        [x, y]: [usize; 2],
    ) -> ([u8; 3], u8) {
        let (mut sum, mut covered) = ([0.0; 3], 0);
        for ray in 0..RAYS * RAYS {
            let offset = Vector2::new((ray % RAYS) as f64 + 0.5, (ray / RAYS) as f64 + 0.5) / RAYS as f64;
            let pixel = Point2::new(x as f64, y as f64) + offset;
            let (colour, is_ball) = self.seen(camera, board_from_world, lamp, pixel);
            (0..3).for_each(|c| sum[c] += linear(colour[c]));
            covered += usize::from(is_ball);
        }
        let count = (RAYS * RAYS) as f64;
        let grain = grain(x, y, camera);
        (
            sum.map(|s| (encoded(s / count) + grain).round().clamp(0.0, 255.0) as u8),
            (255 * covered / (RAYS * RAYS)) as u8,
        )
    }

    fn seen(
        &self,
        camera: &Camera,
        board_from_world: &Isometry3<f64>,
        lamp: &Unit<Vector3<f64>>,
        pixel: Point2<f64>,
    ) -> ([f64; 3], bool) {
        let Some(ray) = camera.ray(pixel) else { return ([0.0; 3], false) };
        if let Some(colour) = self.mirrored(camera, &ray, lamp) {
            return (colour, false);
        }
        let balls = BALLS.iter().enumerate();
        let hits = balls.filter_map(|(i, &(centre, radius))| Some((hit(&ray, centre.into(), radius)?, i)));
        if let Some((distance, ball)) = hits.min_by(|a, b| a.0.total_cmp(&b.0)) {
            let point = ray.origin + ray.direction * distance;
            let normal = (point - Point3::from(BALLS[ball].0)) / BALLS[ball].1;
            let light = 0.45 + 0.55 * normal.dot(lamp).max(0.0);
            // Something to see on it.
            let stripes = if (12.0 * normal.y.atan2(normal.x)).sin() > 0.0 { 1.0 } else { 0.8 };
            return (self.balls[ball].map(|c| f64::from(c) * light * stripes), true);
        }
        let on_plane = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
        if self.has_platter && ray.direction.z < 0.0 && on_plane.coords.norm() < PLATTER {
            let [width, height] = self.board.size();
            let place = board_from_world * on_plane;
            let is_card = (-0.006..width + 0.006).contains(&place.x) && (-0.006..height + 0.006).contains(&place.y);
            let level = match (is_card, self.board.is_dark(place.xy())) {
                (false, _) => 95.0,
                (true, true) => 35.0,
                (true, false) => 205.0,
            };
            return ([level; 3], false);
        }
        (self.backdrop(pixel.y), false)
    }
}

/// How far along a ray a ball is met.
fn hit(ray: &Ray, centre: Point3<f64>, radius: f64) -> Option<f64> {
    let offset = ray.origin - centre;
    let along = offset.dot(&ray.direction);
    let root = along * along - offset.norm_squared() + radius * radius;
    (root > 0.0).then(|| -along - root.sqrt())
}

/// Levels of 8 bits to light and back; pixels average light. A power of 2.2 is near enough.
fn linear(level: f64) -> f64 {
    (level / 255.0).max(0.0).powf(2.2)
}

fn encoded(light: f64) -> f64 {
    255.0 * light.powf(1.0 / 2.2)
}

/// Uniform noise of ± 2 levels, another in every frame.
fn grain(x: usize, y: usize, camera: &Camera) -> f64 {
    let frame = (camera.rotation[(0, 0)] * 1e9) as i64 as u64;
    let mut state =
        (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f) ^ frame;
    state = (state ^ (state >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state ^= state >> 29;
    4.0 * (state >> 11) as f64 / (1_u64 << 53) as f64 - 2.0
}
