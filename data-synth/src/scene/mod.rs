//! The objects. To add one: a file with `build` and `albedo`, a variant in [`Scene`] and in
//! [`Paint`]; the compiler lists the rest.

mod elephant;
mod temple;

use crate::error::SynthError;
use crate::material::{Finish, Vec3};
use crate::shape::MeshBuilder;
use crate::trace::World;
use geometry::Mesh;
use std::fmt;
use std::str::FromStr;

/// A procedural object, in metres, standing on z = 0 around the z axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// A small Greek temple of matt, weathered stone with a tiled roof.
    Temple,
    /// A glazed elephant figurine in jade green with a painted saddle cloth.
    Elephant,
}

/// How a scene is coloured.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Paint {
    /// One colour: for tests with closed forms.
    #[cfg_attr(not(test), expect(dead_code, reason = "closed-form tests need a plain surface"))]
    Plain(Vec3),
    Temple,
    Elephant,
}

/// A scene ready to be filmed.
#[derive(Debug)]
pub(crate) struct Built {
    /// The true surface.
    pub(crate) mesh: Mesh,
    /// The same, ready for rays.
    pub(crate) world: World,
}

impl Scene {
    /// Every scene, in the order of a listing.
    pub const ALL: [Self; 2] = [Self::Temple, Self::Elephant];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Temple => "temple",
            Self::Elephant => "elephant",
        }
    }

    /// One line on what it shows.
    pub fn description(self) -> &'static str {
        match self {
            Self::Temple => "a small Greek temple of matt, weathered stone",
            Self::Elephant => "a glazed elephant figurine with a painted saddle cloth",
        }
    }

    /// The true surface: closed, counter-clockwise from outside, in metres.
    pub fn mesh(self) -> Mesh {
        self.shape().mesh
    }

    fn shape(self) -> MeshBuilder {
        match self {
            Self::Temple => temple::build(),
            Self::Elephant => elephant::build(),
        }
    }

    /// Builds the object for tracing.
    pub(crate) fn build(self) -> Built {
        let MeshBuilder { mesh, parts, .. } = self.shape();
        let (crease_deg, paint, finishes) = match self {
            Self::Temple => (32.0_f64, Paint::Temple, vec![Finish::Matt]),
            Self::Elephant => (60.0, Paint::Elephant, elephant::finishes()),
        };
        let normals = crate::shape::corner_normals(&mesh, crease_deg.to_radians());
        let world = World::new(&mesh, &normals, &parts, paint, finishes);
        Built { mesh, world }
    }
}

impl FromStr for Scene {
    type Err = SynthError;

    fn from_str(name: &str) -> Result<Self, SynthError> {
        let found = Self::ALL.into_iter().find(|s| s.name().eq_ignore_ascii_case(name));
        found.ok_or_else(|| SynthError::UnknownScene {
            name: name.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}

impl fmt::Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl Paint {
    /// Reflectance of the base at a point.
    pub(crate) fn albedo(&self, p: Vec3, normal: Vec3, part: u8) -> Vec3 {
        match self {
            Self::Plain(color) => *color,
            Self::Temple => temple::albedo(p, normal, part),
            Self::Elephant => elephant::albedo(p, part),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_is_closed_and_faces_outward_and_stands_on_the_table() {
        for scene in Scene::ALL {
            let shape = scene.shape();
            assert_eq!(shape.parts.len(), shape.mesh.faces.len());
            assert!(crate::shape::is_closed(&shape.mesh), "{scene} is not closed");
            assert!(shape.mesh.signed_volume() > 0.0, "{scene} is inside out");
            let aabb = shape.mesh.aabb().unwrap();
            assert!(aabb.min.z.abs() < 1e-4, "{scene} stands at {}", aabb.min.z);
            assert!((0.1..0.5).contains(&aabb.diagonal()), "{scene} is no desk object");
        }
    }

    #[test]
    fn albedo_is_physical_everywhere() {
        for scene in Scene::ALL {
            let shape = scene.shape();
            let paint = if scene == Scene::Temple { Paint::Temple } else { Paint::Elephant };
            for f in 0..shape.mesh.faces.len() {
                let p = shape.mesh.corners(f)[0].coords.cast();
                let n = shape.mesh.face_area_vector(f).try_normalize(0.0).unwrap_or_default().cast();
                let c = paint.albedo(p, n, shape.parts[f]);
                assert!(c.iter().all(|c| (0.0..=1.0).contains(c)), "{scene}: {c}");
            }
        }
    }

    #[test]
    fn names_round_trip_and_a_wrong_one_is_told_what_there_is() {
        for scene in Scene::ALL {
            assert_eq!(scene.name().parse::<Scene>().unwrap(), scene);
        }
        assert!("tempel".parse::<Scene>().unwrap_err().to_string().contains("temple"));
    }
}
