//! What an object is filmed on and before: a printed board on a turntable, on a table that runs up into a wall.
//!
//! Table and wall are a surface of revolution around the turntable's axis, so that the room can turn against the
//! object by its paint alone: a cloth behind the turntable and under it, the bare table before it, grey wall
//! elsewhere. In room coordinates +x points at the camera.

use super::Backdrop;
use crate::material::Vec3;
use crate::shape::MeshBuilder;
use crate::texture_field::{blend, color, fractal, noise, step, stripe, wrap};
use capture::Board;
use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Parts from here on belong to the set.
pub(crate) const SET: u8 = 200;
const CARD: u8 = SET;
const CARD_SIDE: u8 = SET + 1;
const PLATTER: u8 = SET + 2;
const PLATTER_SIDE: u8 = SET + 3;
const ROOM: u8 = SET + 4;

/// Points around surfaces of revolution.
const AROUND: usize = 160;
/// The card lies so far below the object, in metres, lest the two share a plane.
const GAP: f64 = 1e-4;
/// Of the card the board is printed on, in metres.
const CARD_THICKNESS: f64 = 0.003;
/// The platter's radius, in half widths of the board: its rim shows beyond the card's sides, not its corners.
const PLATTER_SHARE: f64 = 1.2;
/// Radius of the wall in lengths of the set.
pub(super) const WALL: f64 = 7.0;
/// Radius of the rounding between table and wall.
const COVE: f64 = 2.5;
/// Height of the wall.
const HEIGHT: f64 = 6.0;

/// A set for one object.
#[derive(Clone, Debug)]
pub(crate) struct Set {
    board: Board,
    world_from_board: Isometry3<f64>,
    backdrop: Vec3,
    /// Platter radius, in metres.
    platter: f64,
    /// What room and lights are sized by, in metres: the platter's radius, or more for a tall object.
    length: f64,
}

impl Set {
    /// A set for an object so high, with the middle of the `board` at `middle` and turned by `turn` radians.
    pub(super) fn new(board: Board, middle: [f64; 2], turn: f64, height: f64, backdrop: Backdrop) -> Self {
        let [width, depth] = board.size();
        let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let to_middle = Isometry3::translation(-0.5 * width, -0.5 * depth, 0.0);
        let place = Translation3::new(middle[0], middle[1], -GAP);
        let platter = PLATTER_SHARE * 0.5 * width.max(depth);
        let world_from_board = Isometry3::from_parts(place, turned) * to_middle;
        Self { board, world_from_board, backdrop: cloth_color(backdrop), platter, length: platter.max(0.8 * height) }
    }

    pub(super) fn board(&self) -> &Board {
        &self.board
    }

    pub(super) fn world_from_board(&self) -> &Isometry3<f64> {
        &self.world_from_board
    }

    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// Everything, facing inward where it surrounds.
    pub(crate) fn build(&self) -> MeshBuilder {
        let mut b = MeshBuilder::default();
        self.card(&mut b);
        let table = self.platter(&mut b);
        self.room(&mut b, table);
        b
    }

    /// A card with a light margin around the pattern.
    fn card(&self, b: &mut MeshBuilder) {
        let ([width, depth], margin) = (self.board.size(), 2.0 * self.board.quiet_zone());
        let ([left, right], [near, far]) = ([-margin, width + margin], [-margin, depth + margin]);
        let corners = [[left, near], [right, near], [right, far], [left, far]];
        let at = |z: f64| corners.map(|[x, y]| (self.world_from_board * Point3::new(x, y, z)).coords.into());
        let (low, high) = (b.ring(at(-CARD_THICKNESS)), b.ring(at(0.0)));
        b.part = CARD_SIDE;
        b.cap_reversed(&low);
        b.walls(&low, &high);
        b.part = CARD;
        b.cap(&high);
    }

    /// A disc on a smaller foot; returns the height of the table it stands on.
    fn platter(&self, b: &mut MeshBuilder) -> f64 {
        let (r, top) = (self.platter, -GAP - CARD_THICKNESS);
        let (rim, table) = (top - 0.055 * r, top - 0.13 * r);
        let bevel = 0.006 * r;
        let profile =
            [(0.6 * r, table), (0.6 * r, rim), (r - bevel, rim), (r, rim + bevel), (r, top - bevel), (r - bevel, top)];
        let rings: Vec<_> = profile.iter().map(|&(r, z)| b.ring(circle(r, z))).collect();
        b.part = PLATTER_SIDE;
        b.loft(&rings);
        b.part = PLATTER;
        b.cap(&rings[rings.len() - 1]);
        table
    }

    /// From the top of the wall down its rounding to the middle of the table.
    fn room(&self, b: &mut MeshBuilder, table: f64) {
        let at = |r: f64, z: f64| circle(r * self.length, table + z * self.length);
        let mut rings = vec![b.ring(at(WALL, HEIGHT))];
        for k in 0..=24 {
            let (s, c) = (FRAC_PI_2 * f64::from(k) / 24.0).sin_cos();
            rings.push(b.ring(at(WALL - COVE * (1.0 - c), COVE * (1.0 - s))));
        }
        b.part = ROOM;
        b.loft(&rings);
        b.cap(&rings[rings.len() - 1]);
    }

    /// Reflectance at a point in the world, the room turned by `yaw` radians.
    pub(crate) fn albedo(&self, p: Vec3, part: u8, yaw: f32) -> Vec3 {
        match part {
            CARD | CARD_SIDE => self.card_albedo(p, part),
            PLATTER | PLATTER_SIDE => color([112, 112, 114]) * (0.9 + 0.2 * noise(p * 900.0, 3)),
            _ => {
                let (s, c) = yaw.sin_cos();
                let q = Vec3::new(c * p.x + s * p.y, c * p.y - s * p.x, p.z) / self.length as f32;
                self.room_albedo(q)
            }
        }
    }

    /// Paper a little uneven in tone, and toner, which is never quite black.
    fn card_albedo(&self, p: Vec3, part: u8) -> Vec3 {
        match self.is_dark(p, part) {
            true => Vec3::repeat(0.03),
            false => color([238, 238, 234]) * (0.97 + 0.03 * noise(p * 60.0, 5)),
        }
    }

    /// Whether a point of the set is printed dark.
    pub(crate) fn is_dark(&self, p: Vec3, part: u8) -> bool {
        let on_board = self.world_from_board.inverse_transform_point(&Point3::from(p.cast::<f64>()));
        part == CARD && self.board.is_dark(Point2::new(on_board.x, on_board.y))
    }

    /// Cloth, table or wall at a point of the room, in lengths of the set.
    fn room_albedo(&self, q: Vec3) -> Vec3 {
        let wavy = 0.10 * (noise(q * 1.7, 11) - 0.5);
        let (front, side) = (q.x - 1.75 + wavy, q.y.abs() - 6.3 + wavy);
        let beyond = front.max(side);
        let is_wall = q.x.hypot(q.y) > (WALL - COVE) as f32;
        let bare = if is_wall { color([128, 126, 122]) } else { wood(q) };
        // Where the cloth's edge lies, it throws a thin shadow.
        let bare = bare * (1.0 - 0.5 * (-beyond.max(0.0) / 0.02).exp());
        blend(self.cloth(q), bare, step(0.0, 0.006, beyond))
    }

    /// Dyed unevenly, worn, and folded for the drawer: creases in a lattice, one side in light, one in shade.
    fn cloth(&self, q: Vec3) -> Vec3 {
        // Over the table and up the wall, the length of the cloth.
        let along = q.z - q.x;
        let soft = fractal(Vec3::new(0.35 * along, 0.9 * q.y, 0.0), 2, 21) - 0.5;
        let rumpled = fractal(Vec3::new(2.3 * along + 1.5 * soft, 1.6 * q.y, 4.0), 3, 22) - 0.5;
        let bent = 0.12 * (noise(q * 1.1, 23) - 0.5);
        let crease = |x: f32| stripe(x - 0.02, 0.012, 0.03) - stripe(x + 0.02, 0.012, 0.03);
        let creases = crease(wrap(q.y + bent + 0.9, 2.6)) + crease(wrap(along + bent + 0.4, 2.6));
        let worn = 0.5 + 0.5 * noise(q * 0.8, 24);
        let weave = noise(q * 160.0, 25) - 0.5;
        let shade = 1.0 + 0.45 * soft + 0.35 * rumpled + 0.16 * worn * creases + 0.10 * weave;
        // What light bleaches turns a little paler.
        blend(self.backdrop, Vec3::repeat(0.35), 0.04 * worn) * shade.max(0.2)
    }
}

fn cloth_color(backdrop: Backdrop) -> Vec3 {
    color(match backdrop {
        Backdrop::Green => [44, 158, 72],
        Backdrop::Blue => [30, 74, 168],
        Backdrop::Grey => [122, 122, 122],
        Backdrop::Black => [26, 26, 28],
    })
}

/// A table top of oak.
fn wood(q: Vec3) -> Vec3 {
    let grain = fractal(Vec3::new(9.0 * q.x, 0.7 * q.y, 0.0), 4, 31);
    let fine = noise(Vec3::new(60.0 * q.x, 3.0 * q.y, 0.0), 33);
    blend(color([120, 92, 64]), color([172, 136, 98]), grain) * (0.9 + 0.1 * fine)
}

fn circle(radius: f64, z: f64) -> impl Iterator<Item = [f64; 3]> {
    (0..AROUND).map(move |i| {
        let (s, c) = (TAU * i as f64 / AROUND as f64).sin_cos();
        [radius * c, radius * s, z]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set() -> Set {
        Set::new(Board::default(), [0.004, -0.003], 0.2, 0.12, Backdrop::Green)
    }

    #[test]
    fn every_surface_looks_at_the_camera_or_the_light() {
        let MeshBuilder { mesh, parts, .. } = set().build();
        for (f, &part) in parts.iter().enumerate().filter(|(_, part)| **part == ROOM) {
            let middle = mesh.corners(f).iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0;
            let towards = Vector3::new(0.0, 0.0, 0.5) - middle;
            assert!(mesh.face_area_vector(f).dot(&towards) > 0.0, "face {f} of part {part} at {middle}");
        }
        let volume = |wanted: [u8; 2]| {
            let chosen = parts.iter().zip(&mesh.faces).filter(|(part, _)| wanted.contains(part));
            let faces = chosen.map(|(_, face)| *face).collect();
            geometry::Mesh { positions: mesh.positions.clone(), faces }.signed_volume()
        };
        let [width, depth] = Board::default().size().map(|side| side + 4.0 * Board::default().quiet_zone());
        assert!((volume([CARD, CARD_SIDE]) / (width * depth * CARD_THICKNESS) - 1.0).abs() < 1e-3);
        assert!(volume([PLATTER, PLATTER_SIDE]) > 0.0);
    }

    #[test]
    fn the_board_is_printed_where_it_says() {
        let set = set();
        let at = |x: f64, y: f64| (set.world_from_board * Point3::new(x, y, 0.0)).coords.cast::<f32>();
        let [width, height] = Board::default().size();
        let mut dark = 0;
        for (i, j) in (0..40).flat_map(|i| (0..40).map(move |j| (i, j))) {
            let place = Point2::new((f64::from(i) + 0.37) / 40.0 * width, (f64::from(j) + 0.41) / 40.0 * height);
            let printed = set.albedo(at(place.x, place.y), CARD, 0.7).x < 0.1;
            assert_eq!(printed, Board::default().is_dark(place));
            dark += usize::from(printed);
        }
        assert!((400..1200).contains(&dark));
        assert!(set.albedo(at(-0.001, 0.01), CARD, 0.0).x > 0.7, "the margin is paper");
    }

    #[test]
    fn paint_is_physical_and_the_cloth_turns_with_the_room() {
        let set = set();
        let behind = Vec3::new(-3.0, 0.3, -0.02);
        for backdrop in [Backdrop::Green, Backdrop::Blue, Backdrop::Grey, Backdrop::Black] {
            let set = Set::new(Board::default(), [0.0; 2], 0.0, 0.1, backdrop);
            for i in 0..2000 {
                let (s, c) = (i as f32 * 0.7).sin_cos();
                let p = Vec3::new(c, s, 0.2 * (i as f32 * 0.01).sin()) * (0.001 * i as f32);
                assert!(set.albedo(p, ROOM, 0.3).iter().all(|a| (0.0..=1.0).contains(a)));
            }
        }
        let greenness = |c: Vec3| c.y / (c.x + c.z);
        let length = set.length as f32;
        assert!(greenness(set.albedo(behind * length, ROOM, 0.0)) > 1.5);
        // Half a turn later the same place is before the cloth.
        assert!(greenness(set.albedo(behind * length, ROOM, std::f32::consts::PI)) < 0.8);
    }
}
