//! The objects. To add one: a file with `build`, `albedo` and `finishes`, and a variant in [`Scene`];
//! the compiler lists the rest. `docs/synthetic-scenes.md` is the catalogue.

mod blank;
mod chance;
mod chrome;
mod clay;
mod elephant;
mod glass;
mod house;
mod jade;
mod knot;
mod mug;
mod noise;
mod plate;
mod temple;
mod wreath;

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
    /// A log cottage of L-shaped plan with bark, shingles and moss in relief.
    House,
    /// A straw wreath with flowers and a bow, of stalks thinner than a pixel.
    Wreath,
    /// A glazed mug with a handle, painted with boats.
    Mug,
    /// A silvered teapot with ebony handle and knob.
    Chrome,
    /// A thin Delft plate on a wooden stand.
    Plate,
    /// A trefoil knot of three-stranded rope.
    Knot,
    /// A die printed at the limit of what a camera resolves.
    Noise,
    /// A wine glass of clear crystal with a cut bowl.
    Glass,
    /// A rabbit of plain white plaster.
    Blank,
    /// A carved turtle of pale green jade.
    Jade,
}

/// How a scene is coloured.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Paint {
    /// One colour: for tests with closed forms.
    #[cfg_attr(not(test), expect(dead_code, reason = "closed-form tests need a plain surface"))]
    Plain(Vec3),
    /// As the scene says.
    Scene(Scene),
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
    pub const ALL: [Self; 12] = [
        Self::Temple,
        Self::Elephant,
        Self::House,
        Self::Wreath,
        Self::Mug,
        Self::Chrome,
        Self::Plate,
        Self::Knot,
        Self::Noise,
        Self::Glass,
        Self::Blank,
        Self::Jade,
    ];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Temple => "temple",
            Self::Elephant => "elephant",
            Self::House => "house",
            Self::Wreath => "wreath",
            Self::Mug => "mug",
            Self::Chrome => "chrome",
            Self::Plate => "plate",
            Self::Knot => "knot",
            Self::Noise => "noise",
            Self::Glass => "glass",
            Self::Blank => "blank",
            Self::Jade => "jade",
        }
    }

    /// One line on what it shows.
    pub fn description(self) -> &'static str {
        match self {
            Self::Temple => "a small Greek temple of matt, weathered stone",
            Self::Elephant => "a glazed elephant figurine with a painted saddle cloth",
            Self::House => "a log cottage with an inner corner; bark, shingles and moss in relief",
            Self::Wreath => "a straw wreath with flowers; stalks thinner than a pixel",
            Self::Mug => "a glazed mug painted with boats, with a handle and a deep cavity",
            Self::Chrome => "a silvered teapot: a mirror with a spout and a handle",
            Self::Plate => "a thin Delft plate with a windmill, leaning on a stand",
            Self::Knot => "a trefoil knot of rope that hides itself",
            Self::Noise => "a die printed with checks, noise and gratings at the sampling limit",
            Self::Glass => "a wine glass of clear crystal, seen through itself",
            Self::Blank => "a rabbit of plain white plaster, without texture",
            Self::Jade => "a carved jade turtle that light passes through",
        }
    }

    /// The true surface: counter-clockwise from outside, in metres; every edge has two faces. Scenes
    /// glued from several pieces are several closed surfaces that may run into each other.
    pub fn mesh(self) -> Mesh {
        self.shape().mesh
    }

    fn shape(self) -> MeshBuilder {
        match self {
            Self::Temple => temple::build(),
            Self::Elephant => elephant::build(),
            Self::House => house::build(),
            Self::Wreath => wreath::build(),
            Self::Mug => mug::build(),
            Self::Chrome => chrome::build(),
            Self::Plate => plate::build(),
            Self::Knot => knot::build(),
            Self::Noise => noise::build(),
            Self::Glass => glass::build(),
            Self::Blank => blank::build(),
            Self::Jade => jade::build(),
        }
    }

    /// What its parts are made of, by part.
    fn finishes(self) -> Vec<Finish> {
        match self {
            Self::Temple => vec![Finish::Matt],
            Self::Elephant => elephant::finishes(),
            Self::House => house::finishes(),
            Self::Wreath => wreath::finishes(),
            Self::Mug => mug::finishes(),
            Self::Chrome => chrome::finishes(),
            Self::Plate => plate::finishes(),
            Self::Knot => knot::finishes(),
            Self::Noise => noise::finishes(),
            Self::Glass => glass::finishes(),
            Self::Blank => blank::finishes(),
            Self::Jade => jade::finishes(),
        }
    }

    /// Faces that meet at a sharper angle are shaded as an edge.
    fn crease_deg(self) -> f64 {
        match self {
            Self::Temple => 32.0,
            Self::House => 40.0,
            Self::Elephant => 60.0,
            Self::Wreath => 60.0,
            Self::Mug => 60.0,
            Self::Chrome => 60.0,
            Self::Plate => 50.0,
            Self::Knot => 80.0,
            Self::Noise => 40.0,
            Self::Glass => 30.0,
            Self::Blank => 60.0,
            Self::Jade => 60.0,
        }
    }

    /// Builds the object for tracing.
    pub(crate) fn build(self) -> Built {
        let MeshBuilder { mesh, parts, .. } = self.shape();
        let normals = crate::shape::corner_normals(&mesh, self.crease_deg().to_radians());
        let world = World::new(&mesh, &normals, &parts, Paint::Scene(self), self.finishes());
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
            Self::Scene(Scene::Temple) => temple::albedo(p, normal, part),
            Self::Scene(Scene::Elephant) => elephant::albedo(p, part),
            Self::Scene(Scene::House) => house::albedo(p, normal, part),
            Self::Scene(Scene::Wreath) => wreath::albedo(p, part),
            Self::Scene(Scene::Mug) => mug::albedo(p, part),
            Self::Scene(Scene::Chrome) => chrome::albedo(p, part),
            Self::Scene(Scene::Plate) => plate::albedo(p, normal, part),
            Self::Scene(Scene::Knot) => knot::albedo(p, part),
            Self::Scene(Scene::Noise) => noise::albedo(p, part),
            Self::Scene(Scene::Glass) => glass::albedo(),
            Self::Scene(Scene::Blank) => blank::albedo(),
            Self::Scene(Scene::Jade) => jade::albedo(p),
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
            let found = shape.mesh.check().unwrap();
            assert!(found.closed_manifold && found.isolated_vertices == 0, "{scene}: {found:?}");
            assert!(found.volume > 0.0, "{scene} is inside out");
            assert!(found.triangles < 400_000, "{scene}: {} faces", found.triangles);
            let aabb = shape.mesh.aabb().unwrap();
            assert!(aabb.min.z.abs() < 1e-4, "{scene} stands at {}", aabb.min.z);
            assert!((0.1..0.5).contains(&aabb.diagonal()), "{scene} is no desk object");
        }
    }

    #[test]
    fn scenes_of_one_piece_have_the_genus_they_claim() {
        let genus = |scene| match scene {
            Scene::Mug | Scene::Chrome | Scene::Knot => Some(1),
            Scene::Elephant | Scene::Noise | Scene::Glass | Scene::Blank | Scene::Jade => Some(0),
            // Sixteen columns and the cella join floor and ceiling; the first of them opens no hole.
            Scene::Temple => Some(16),
            Scene::House | Scene::Wreath | Scene::Plate => None,
        };
        for scene in Scene::ALL {
            let Some(genus) = genus(scene) else { continue };
            let found = scene.mesh().check().unwrap();
            assert_eq!((found.components, found.euler), (1, 2 - 2 * genus), "{scene}: {found:?}");
        }
    }

    #[test]
    fn every_piece_of_a_scene_faces_outward() {
        for scene in Scene::ALL {
            let mesh = scene.mesh();
            let (piece, count) = mesh.components();
            let mut volume = vec![0.0; count];
            for (f, &piece) in piece.iter().enumerate() {
                let [a, b, c] = mesh.corners(f).map(|p| p.coords);
                volume[piece as usize] += a.dot(&b.cross(&c)) / 6.0;
            }
            let inverted = volume.iter().filter(|&&v| v <= 0.0).count();
            assert_eq!(inverted, 0, "{scene}: {inverted} of {count} pieces are inside out");
        }
    }

    #[test]
    fn albedo_is_physical_everywhere() {
        for scene in Scene::ALL {
            let shape = scene.shape();
            for f in 0..shape.mesh.faces.len() {
                let p = shape.mesh.corners(f)[0].coords.cast();
                let n = shape.mesh.face_area_vector(f).try_normalize(0.0).unwrap_or_default().cast();
                let c = Paint::Scene(scene).albedo(p, n, shape.parts[f]);
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
