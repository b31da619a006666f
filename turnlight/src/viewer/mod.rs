//! What a window shows of a model, without the window: where the eye is, what is on either side of the divider, and the
//! picture that comes of it.
//!
//! - [`Exhibit`]: a scene under a name, and in false colour;
//! - [`split`]: two pictures in one frame;
//! - [`photographs`]: the photograph nearest to the eye, and [`difference`](mod@difference) from it;
//! - [`pick`]: the facet under a pixel; [`dome`](mod@dome): where it was photographed from; [`basis`]: its layers.
//!
//! A method's picture is [`Projector::frame`], which is what `turnlight render` writes.

pub mod basis;
pub mod difference;
pub mod dome;
mod exhibit;
pub mod false_colour;
mod panel;
pub mod photographs;
pub mod pick;
pub mod split;

pub use exhibit::Exhibit;
pub use panel::Panel;

use crate::projector::{Choice, Painter, Projector};
use crate::{Error, playback};
use capture::{Aabb, Camera, Capture, Image, reduced};
use difference::{Difference, difference};
use dome::{Axes, Dome};
use nalgebra::{Point3, Vector3};
use photographs::{Photographs, through_plane};
use pick::Picked;
use render::blend::Pin;
use render::cpu::ScenePlayer;
use render::material::{Coats, Light, Lighting};
use render::orbit::{Orbit, contained};
use render::path::up_axis;
use render::{Pose, RenderOptions};
use std::time::Instant;
use texture::{Appearance, Model};

/// What stands behind objects without a backdrop.
pub const BACKGROUND: [u8; 3] = [27, 29, 33];

/// Longest side at which differences from a photograph are found, in pixels.
const LONGEST_DIFFERENCE: usize = 800;

/// Frames whose times are kept.
pub const TIMES: usize = 240;

/// What one side of the picture shows; numbers are those of exhibits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The object, as a method has it.
    Method(usize),
    /// Its facets.
    Facets(usize),
    /// How many layers they have.
    Ranks(usize),
    /// How far a method is from the photograph nearest to the eye.
    Difference(usize),
    /// That photograph.
    Photograph,
}

impl Side {
    /// The exhibit it is about.
    pub fn exhibit(self) -> Option<usize> {
        match self {
            Self::Method(k) | Self::Facets(k) | Self::Ranks(k) | Self::Difference(k) => Some(k),
            Self::Photograph => None,
        }
    }
}

/// Where light on materials comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lamp {
    /// Over the left shoulder of whoever looks.
    WithEye,
    /// A far light, degrees about the axis and above the plane across it.
    Fixed {
        /// About the axis.
        azimuth_deg: f64,
        /// Above the plane.
        elevation_deg: f64,
    },
}

/// How a viewer starts.
#[derive(Clone, Debug, Default)]
pub struct ViewerOptions {
    /// The axis that points up; by default that of the capture's turntable, else z.
    pub up: Option<Vector3<f64>>,
    /// Photographs of the object.
    pub capture: Option<Capture>,
    /// Who draws.
    pub renderer: Choice,
}

/// The state of a window.
#[derive(Debug)]
pub struct Viewer<'a> {
    exhibits: &'a [Exhibit],
    drawn: Vec<Drawn<'a>>,
    orbit: Orbit,
    /// The middle of the first exhibit.
    centre: Point3<f64>,
    photographs: Option<Photographs>,
    /// The photograph from whose place the eye looks.
    visited: Option<usize>,
    difference: Option<Found>,
    /// What the left side shows, or the whole picture.
    pub left: Side,
    /// What the right side shows, if the picture is split.
    pub right: Option<Side>,
    /// Where it is split, as a share of the width.
    pub divider: f64,
    /// What shines on materials.
    pub lamp: Lamp,
    /// They are brightened by so many stops.
    pub stops: f64,
    seen: Option<Seen>,
    times_ms: Vec<f64>,
    notes: Vec<String>,
}

/// An exhibit, and who draws it.
#[derive(Debug)]
struct Drawn<'a> {
    exhibit: &'a Exhibit,
    coats: &'a [Option<Coats<'a>>],
    projector: Projector<'a>,
    why_cpu: Option<String>,
    facets: Option<ScenePlayer<'a>>,
    ranks: Option<ScenePlayer<'a>>,
    /// Draws for comparison with photographs, with nothing behind it.
    compared: Option<ScenePlayer<'a>>,
    picked: Option<Picked>,
    /// Weights held fast, and of which object.
    pins: Vec<(usize, Pin)>,
}

/// A difference, and of what.
#[derive(Debug)]
struct Found {
    exhibit: usize,
    photograph: usize,
    light: (Lamp, f64),
    pins: Vec<(usize, Pin)>,
    difference: Option<Difference>,
}

/// All that a picture depends on.
#[derive(Clone, Debug, PartialEq)]
struct Seen {
    camera: Camera,
    sides: (Side, Option<Side>, f64),
    light: (Lamp, f64),
    photograph: Option<usize>,
    pins: Vec<Vec<(usize, Pin)>>,
}

impl<'a> Viewer<'a> {
    /// A viewer of `exhibits`, which must not be empty; `coats` are those of the models of each.
    ///
    /// # Errors
    /// Where there is no exhibit; as [`Painter::new`].
    pub fn new(
        exhibits: &'a [Exhibit],
        coats: &'a [Vec<Option<Coats<'a>>>],
        options: ViewerOptions,
    ) -> Result<Self, Error> {
        let first = exhibits.first().ok_or_else(|| Error::Arguments("nothing to show; name a model".to_owned()))?;
        let unit = Aabb { min: [-0.5; 3].into(), max: [0.5; 3].into() };
        let aabb = first.scene.aabb().unwrap_or(unit);
        let filmed: Vec<Camera> = options.capture.iter().flat_map(|c| &c.frames).map(|frame| frame.camera).collect();
        let up = options.up.or_else(|| up_axis(&filmed)).unwrap_or_else(Vector3::z);
        let painter = Painter::new(options.renderer)?;
        let drawn = exhibits.iter().zip(coats).map(|(exhibit, coats)| Drawn::new(exhibit, coats, &painter));
        let mut viewer = Self {
            exhibits,
            drawn: drawn.collect(),
            orbit: Orbit::new(&aabb, filmed.first(), up),
            centre: aabb.center(),
            photographs: options.capture.map(Photographs::new).filter(|photographs| !photographs.is_empty()),
            visited: None,
            difference: None,
            left: Side::Method(0),
            right: None,
            divider: 0.5,
            lamp: Lamp::WithEye,
            stops: 0.0,
            seen: None,
            times_ms: Vec::new(),
            notes: Vec::new(),
        };
        let size = [64, 48];
        viewer.pick([32.0, 24.0], size);
        Ok(viewer)
    }

    /// The exhibits, in their order.
    pub fn exhibits(&self) -> &'a [Exhibit] {
        self.exhibits
    }

    /// Where the eye is.
    pub fn orbit(&self) -> &Orbit {
        &self.orbit
    }

    /// The eye, to be moved; it leaves the photograph it was at.
    pub fn steer(&mut self) -> &mut Orbit {
        self.visited = None;
        &mut self.orbit
    }

    /// What is seen in a frame of this size.
    pub fn camera(&self, size: [usize; 2]) -> Camera {
        let visited = self.visited.and_then(|k| self.photographs.as_ref()?.camera(k));
        visited.map_or_else(|| self.orbit.camera(size), |camera| contained(camera, size))
    }

    /// The exhibit that panels are about: that of the left side, else of the right one, else the first.
    pub fn current(&self) -> usize {
        self.left.exhibit().or_else(|| self.right?.exhibit()).unwrap_or(0)
    }

    /// What draws it, in a few words.
    pub fn device(&self) -> &str {
        self.drawn[self.current()].projector.device()
    }

    /// Why it is the CPU, where hardware was asked for.
    pub fn why_cpu(&self) -> Option<&str> {
        self.drawn[self.current()].why_cpu.as_deref()
    }

    /// Whether any model has materials.
    pub fn has_materials(&self) -> bool {
        self.drawn.iter().any(|drawn| drawn.coats.iter().any(Option::is_some))
    }

    /// What the user should know, since this was last asked.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// How long the last frames took to draw, in milliseconds, the last one last.
    pub fn times_ms(&self) -> &[f64] {
        &self.times_ms
    }

    /// Draws the picture: RGBA, opaque.
    pub fn frame(&mut self, size: [usize; 2]) -> Image<[u8; 4]> {
        let start = Instant::now();
        let frame = self.frame_of(&self.camera(size));
        if self.times_ms.len() == TIMES {
            self.times_ms.remove(0);
        }
        self.times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        frame
    }

    /// Draws the picture where it is another than the last one drawn by this.
    pub fn frame_if_changed(&mut self, size: [usize; 2]) -> Option<Image<[u8; 4]>> {
        let now = self.to_be_seen(size);
        if self.seen.as_ref() == Some(&now) {
            return None;
        }
        self.seen = Some(now);
        Some(self.frame(size))
    }

    fn to_be_seen(&self, size: [usize; 2]) -> Seen {
        let takes_photograph = |side: Side| matches!(side, Side::Photograph | Side::Difference(_));
        let photograph = [Some(self.left), self.right].into_iter().flatten().any(takes_photograph);
        Seen {
            camera: self.camera(size),
            sides: (self.left, self.right, self.divider),
            light: (self.lamp, self.stops),
            photograph: photograph.then(|| self.nearest_photograph(&self.camera(size))).flatten(),
            pins: self.drawn.iter().map(|drawn| drawn.pins.clone()).collect(),
        }
    }

    /// A picture of what is chosen, from anywhere.
    pub fn frame_of(&mut self, camera: &Camera) -> Image<[u8; 4]> {
        let Some(right) = self.right else { return self.side(self.left, camera) };
        let width = camera.intrinsics.width;
        let column = split::column(self.divider, width);
        let left = self.side(self.left, &split::cropped(camera, &(0..column)));
        split::joined(&left, &self.side(right, &split::cropped(camera, &(column..width))))
    }

    fn side(&mut self, side: Side, camera: &Camera) -> Image<[u8; 4]> {
        let lighting = self.lighting(camera);
        let Some(drawn) = side.exhibit().and_then(|k| self.drawn.get_mut(k)) else {
            return self.photograph(camera);
        };
        match side {
            Side::Facets(_) => drawn.facets().render(camera, &lighting),
            Side::Ranks(_) => drawn.ranks().render(camera, &lighting),
            Side::Difference(k) => self.difference_seen(k, camera),
            Side::Method(_) | Side::Photograph => {
                let frame = drawn.projector.frame(camera, &lighting);
                drawn.why_cpu = drawn.projector.take_note().or(drawn.why_cpu.take());
                frame
            }
        }
    }

    fn photograph(&mut self, camera: &Camera) -> Image<[u8; 4]> {
        let centre = self.centre;
        let seen = self.nearest_photograph(camera).zip(self.photographs.as_mut()).map(|(nearest, photographs)| {
            let from = photographs.camera(nearest).copied().unwrap_or(*camera);
            photographs.picture(nearest).map(|picture| through_plane(picture, &from, &centre, camera, BACKGROUND))
        });
        self.or_nothing(seen, camera)
    }

    fn difference_seen(&mut self, exhibit: usize, camera: &Camera) -> Image<[u8; 4]> {
        let centre = self.centre;
        let seen = self.difference(exhibit, camera).map(|found| {
            found.map(|(from, difference)| through_plane(&difference.colours, &from, &centre, camera, BACKGROUND))
        });
        self.or_nothing(seen, camera)
    }

    /// A picture, or the background and a note of why there is none.
    fn or_nothing(&mut self, seen: Option<Result<Image<[u8; 4]>, Error>>, camera: &Camera) -> Image<[u8; 4]> {
        let [r, g, b] = BACKGROUND;
        let i = &camera.intrinsics;
        let nothing = || Image::filled(i.width, i.height, [r, g, b, 255]);
        match seen {
            Some(Ok(picture)) => picture,
            Some(Err(fault)) => {
                self.notes.push(fault.to_string());
                nothing()
            }
            None => nothing(),
        }
    }

    /// The light on what `camera` sees.
    fn lighting(&self, camera: &Camera) -> Lighting {
        let light = match self.lamp {
            Lamp::WithEye => Light::over_the_shoulder(camera),
            Lamp::Fixed { azimuth_deg, elevation_deg } => {
                Light::directional(self.orbit.direction(azimuth_deg.to_radians(), elevation_deg.to_radians()))
            }
        };
        Lighting { lights: vec![light], stops: self.stops as f32 }
    }
}

/// Photographs beside the model.
impl Viewer<'_> {
    /// The photographs, if there are any.
    pub fn photographs(&self) -> Option<&Photographs> {
        self.photographs.as_ref()
    }

    /// The one that was visited, where `camera` is still at its place; else the one taken from the direction nearest to it.
    pub fn nearest_photograph(&self, camera: &Camera) -> Option<usize> {
        let photographs = self.photographs.as_ref()?;
        let is_here = |k: &usize| photographs.camera(*k).is_some_and(|visited| visited.center() == camera.center());
        self.visited.filter(is_here).or_else(|| photographs.nearest(&camera.center(), &self.centre))
    }

    /// Goes to where a photograph was taken; there both fill the frame alike.
    pub fn visit(&mut self, photograph: usize) {
        if let Some(camera) = self.photographs.as_ref().and_then(|photographs| photographs.camera(photograph)) {
            self.orbit.look_as(camera);
            self.visited = Some(photograph);
        }
    }

    /// The photograph the eye is at.
    pub fn visited(&self) -> Option<usize> {
        self.visited
    }

    /// How far an exhibit is from the photograph nearest to `camera`, and the camera of its pixels; `None` without
    /// photographs, or where the two have no pixel in common.
    ///
    /// # Errors
    /// As [`Photographs::picture`].
    pub fn difference(&mut self, exhibit: usize, camera: &Camera) -> Option<Result<(Camera, &Difference), Error>> {
        let photograph = self.nearest_photograph(camera)?;
        let camera = *self.photographs.as_ref()?.camera(photograph)?;
        let factor = camera.intrinsics.width.max(camera.intrinsics.height).div_ceil(LONGEST_DIFFERENCE).max(1);
        let camera = camera.downscaled(factor);
        let light = (self.lamp, self.stops);
        let is_it = |found: &Found| {
            let of = (found.exhibit, found.photograph, found.light);
            of == (exhibit, photograph, light) && found.pins == self.drawn[exhibit].pins
        };
        if !self.difference.as_ref().is_some_and(is_it) {
            let picture = match self.photographs.as_mut()?.picture(photograph) {
                Ok(picture) => reduced(picture, factor),
                Err(fault) => return Some(Err(fault)),
            };
            let lighting = self.lighting(&camera);
            let drawn = self.drawn.get_mut(exhibit)?;
            let difference = difference(&drawn.compared().render(&camera, &lighting), &picture, BACKGROUND);
            let pins = drawn.pins.clone();
            self.difference = Some(Found { exhibit, photograph, light, pins, difference });
        }
        self.difference.as_ref()?.difference.as_ref().map(|found| Ok((camera, found)))
    }
}

/// Facets and their layers.
impl<'a> Viewer<'a> {
    /// Chooses the facet under a pixel of a frame of this size, in every exhibit; where there is none the last one stays.
    /// Tells whether there was one.
    pub fn pick(&mut self, pixel: [f64; 2], size: [usize; 2]) -> bool {
        let camera = self.camera(size);
        let found: Vec<Option<Picked>> =
            self.drawn.iter().map(|drawn| pick::at_pixel(&drawn.exhibit.scene, &camera, pixel)).collect();
        for (drawn, found) in self.drawn.iter_mut().zip(&found) {
            drawn.picked = found.or(drawn.picked);
        }
        found.iter().any(Option::is_some)
    }

    /// The facet chosen in an exhibit.
    pub fn picked(&self, exhibit: usize) -> Option<Picked> {
        self.drawn.get(exhibit)?.picked
    }

    /// The model of the object whose facet is chosen, and where it stands.
    pub fn picked_model(&self, exhibit: usize) -> Option<(&'a Model, Pose, Picked)> {
        let drawn = self.drawn.get(exhibit)?;
        let picked = drawn.picked?;
        let placed = drawn.exhibit.scene.objects.get(picked.object)?;
        Some((&drawn.exhibit.scene.models[placed.model], placed.pose, picked))
    }

    /// Where the chosen facet was photographed from, as `camera` sees it; of a lumigraph, where its rays come from.
    pub fn dome(&self, exhibit: usize, camera: &Camera) -> Option<Dome> {
        let (model, pose, picked) = self.picked_model(exhibit)?;
        let eye = pose.to_object(&camera.center());
        let axes = Axes::about(&(pose.rotation.transpose() * self.orbit.up()));
        match &model.appearance {
            Appearance::Layers(layers) => {
                let facet = layers.facets.get(picked.facet)?;
                Some(dome::dome(&facet.complex, &facet.center, &eye, &axes))
            }
            Appearance::Lumigraph(rays, _) => {
                Some(dome::dome_of_eyes(&rays.centers, &pose.to_object(&picked.point), &eye, &axes))
            }
        }
    }

    /// The weights of the chosen facet's layers, as `camera` sees it; of no lumigraph.
    pub fn coefficients(&self, exhibit: usize, camera: &Camera) -> Option<Vec<basis::Coefficient>> {
        let (model, pose, picked) = self.picked_model(exhibit)?;
        let facet = basis::layers(model)?.facets.get(picked.facet)?;
        Some(basis::coefficients(facet, &pose.to_object(&camera.center())))
    }

    /// Weights held fast in an exhibit, with the object whose they are.
    pub fn pins(&self, exhibit: usize) -> &[(usize, Pin)] {
        self.drawn.get(exhibit).map_or(&[], |drawn| &drawn.pins)
    }

    /// Holds a weight of an object fast, in place of what was held of the same layer.
    pub fn pin(&mut self, exhibit: usize, object: usize, pin: Pin) {
        let Some(drawn) = self.drawn.get_mut(exhibit) else { return };
        drawn.pins.retain(|(o, p)| !(*o == object && p.layer == pin.layer && p.facet == pin.facet));
        drawn.pins.push((object, pin));
        drawn.hand_over_pins();
    }

    /// Lets all weights go as the eye asks.
    pub fn unpin(&mut self, exhibit: usize) {
        let Some(drawn) = self.drawn.get_mut(exhibit) else { return };
        drawn.pins.clear();
        drawn.hand_over_pins();
    }
}

impl<'a> Drawn<'a> {
    fn new(exhibit: &'a Exhibit, coats: &'a [Option<Coats<'a>>], painter: &Painter) -> Self {
        let background = exhibit.scene.backdrop.is_none().then_some(BACKGROUND);
        let options = RenderOptions { background, ..RenderOptions::default() };
        let projector = Projector::new(&exhibit.scene, coats, options, painter);
        let (facets, ranks, compared) = (None, None, None);
        Self { exhibit, coats, projector, why_cpu: None, facets, ranks, compared, picked: None, pins: Vec::new() }
    }

    fn facets(&mut self) -> &mut ScenePlayer<'a> {
        self.facets.get_or_insert_with(|| in_false_colour(self.exhibit.facets()))
    }

    fn ranks(&mut self) -> &mut ScenePlayer<'a> {
        self.ranks.get_or_insert_with(|| in_false_colour(self.exhibit.ranks()))
    }

    fn compared(&mut self) -> &mut ScenePlayer<'a> {
        let (scene, coats, pins) = (&self.exhibit.scene, self.coats, &self.pins);
        self.compared.get_or_insert_with(|| {
            let mut player = ScenePlayer::new(&playback::objects(scene, coats), RenderOptions::default());
            (0..scene.objects.len()).for_each(|object| player.pin(object, &pins_of(pins, object)));
            player
        })
    }

    fn hand_over_pins(&mut self) {
        for object in 0..self.exhibit.scene.objects.len() {
            let pins = pins_of(&self.pins, object);
            self.projector.pin(object, &pins);
            self.compared.iter_mut().for_each(|player| player.pin(object, &pins));
        }
    }
}

fn pins_of(pins: &[(usize, Pin)], object: usize) -> Vec<Pin> {
    pins.iter().filter(|(o, _)| *o == object).map(|(_, pin)| *pin).collect()
}

fn in_false_colour(scene: &crate::scene::Scene) -> ScenePlayer<'_> {
    let options = RenderOptions { background: Some(BACKGROUND), ..RenderOptions::default() };
    ScenePlayer::new(&playback::objects(scene, &[]), options)
}
