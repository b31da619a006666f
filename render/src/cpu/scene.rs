//! Models in a scene, played by what their files hold.

use super::shade::Look;
use super::{Canvas, Part, StageTimes};
use crate::blend::{Atlas, Pin, Wanted};
use crate::material::{Coats, Lighting, Lit};
use crate::{Pose, RenderOptions};
use capture::{Camera, Image};
use geometry::TexturedMesh;
use rayon::prelude::*;
use texture::Model;

/// A model and where it stands.
#[derive(Clone, Copy, Debug)]
pub struct Object<'a> {
    /// What is drawn; its materials show where `coats` lays them.
    pub model: &'a Model,
    /// Where it stands.
    pub pose: Pose,
    /// Materials laid over the model's mesh.
    pub coats: Option<&'a Coats<'a>>,
}

/// Plays models in a common scene, nearest in front: layers and rays stay as they are in the files, and of each model just
/// what is seen is blended for where the eye is ([`crate::blend`]).
#[derive(Debug)]
pub struct ScenePlayer<'a> {
    actors: Vec<Actor<'a>>,
    canvas: Canvas,
}

/// An object and its texture.
#[derive(Debug)]
struct Actor<'a> {
    mesh: &'a TexturedMesh,
    pose: Pose,
    coats: Option<&'a Coats<'a>>,
    atlas: Atlas<'a>,
    wanted: Wanted,
    lighting: Lighting,
}

impl<'a> Object<'a> {
    /// A model in its own coordinates, without materials.
    pub fn new(model: &'a Model) -> Self {
        Self { model, pose: Pose::default(), coats: None }
    }
}

impl<'a> ScenePlayer<'a> {
    /// A player of `objects`.
    pub fn new(objects: &[Object<'a>], options: RenderOptions) -> Self {
        let actor = |object: &Object<'a>| {
            let atlas = Atlas::new(object.model);
            let wanted = atlas.wanted();
            let Object { model, pose, coats } = *object;
            Actor { mesh: &model.mesh, pose, coats, atlas, wanted, lighting: Lighting::default() }
        };
        Self { actors: objects.par_iter().map(actor).collect(), canvas: Canvas::new(options) }
    }

    /// Holds weights of the layers of the object at this position fast; see [`Atlas::pin`].
    pub fn pin(&mut self, object: usize, pins: &[Pin]) {
        if let Some(actor) = self.actors.get_mut(object) {
            actor.atlas.pin(pins);
        }
    }

    /// How long the stages of the last frame took.
    pub fn times(&self) -> StageTimes {
        self.canvas.times
    }

    /// Bytes of layers and rays that the last frame read.
    pub fn bytes(&self) -> u64 {
        self.actors.iter().map(|actor| actor.atlas.bytes()).sum()
    }

    /// Draws one frame, materials under `lighting`; the same contract as [`crate::reference::render_lit`] of each model.
    pub fn render(&mut self, camera: &Camera, lighting: &Lighting) -> Image<[u8; 4]> {
        let mut frame = Image::filled(0, 0, [0; 4]);
        self.render_into(camera, lighting, &mut frame);
        frame
    }

    /// The same into the memory of another frame.
    pub fn render_into(&mut self, camera: &Camera, lighting: &Lighting, frame: &mut Image<[u8; 4]>) {
        for actor in &mut self.actors {
            actor.wanted.clear();
            actor.lighting = actor.pose.lighting(lighting);
        }
        let eye = camera.center();
        // The atlases change while the rest is lent to the canvas.
        let (mut atlases, actors): (Vec<_>, Vec<_>) = self.actors.iter_mut().map(Actor::parted).unzip();
        let parts: Vec<Part<'_>> = actors.iter().map(Standing::part).collect();
        self.canvas.draw(&parts, camera, frame, || {
            let looks = atlases.par_iter_mut().zip(&actors);
            looks.map(|(atlas, actor)| actor.look(atlas, &actor.pose.to_object(&eye))).collect()
        });
    }
}

/// An actor but for its atlas.
struct Standing<'s> {
    mesh: &'s TexturedMesh,
    pose: Pose,
    coats: Option<&'s Coats<'s>>,
    wanted: &'s Wanted,
    lighting: &'s Lighting,
    atlas_size: [usize; 2],
}

impl<'a> Actor<'a> {
    fn parted<'s>(&'s mut self) -> (&'s mut Atlas<'a>, Standing<'s>) {
        let atlas_size = self.atlas.size();
        let Self { mesh, pose, coats, atlas, wanted, lighting } = self;
        (atlas, Standing { mesh, pose: *pose, coats: *coats, wanted, lighting, atlas_size })
    }
}

impl<'s> Standing<'s> {
    fn part(&self) -> Part<'s> {
        let Self { mesh, pose, coats, wanted, atlas_size, .. } = *self;
        Part { mesh, pose, atlas_size, coats, wanted }
    }

    fn look<'b>(&self, atlas: &'b mut Atlas<'_>, eye: &nalgebra::Point3<f64>) -> Look<'b, i16>
    where
        's: 'b,
    {
        atlas.blend(eye, self.wanted);
        let lit = self.coats.map(|coats| Lit { coats, lighting: self.lighting });
        Look { chain: atlas.chain(self.wanted), lit, eye: *eye }
    }
}
