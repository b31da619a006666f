//! What shines on materials, as asked for on the command line.

use crate::arguments::LightArgs;
use turnlight::Error;
use turnlight::capture::Camera;
use turnlight::panorama::read_panorama;
use turnlight::render::material::environment::lights_of_panorama;
use turnlight::render::material::{Light, Lighting};

/// The lights of a scene; none of their own where they go with the camera.
pub(crate) struct Lamps {
    lights: Vec<Light>,
    stops: f32,
}

impl LightArgs {
    /// The lights asked for, those at a place as bright as the others at the point `lit`.
    pub(crate) fn lamps(&self, lit: [f64; 3]) -> Result<Lamps, Error> {
        let far = self.light.map(|toward| Light::directional(toward.into()));
        let near = self.point.map(|position| Light::point(position.into(), &lit.into()));
        let mut lights: Vec<Light> = far.into_iter().chain(near).collect();
        if let Some(path) = &self.environment {
            let around = lights_of_panorama(&read_panorama(path)?, self.environment_lights);
            if around.is_empty() {
                return Err(Error::Failed(format!(
                    "{}: it is black; give a panorama with light in it",
                    path.display()
                )));
            }
            lights.extend(around);
        }
        Ok(Lamps { lights, stops: self.exposure as f32 })
    }
}

impl Lamps {
    /// What shines on what this camera sees.
    pub(crate) fn seen_by(&self, camera: &Camera) -> Lighting {
        let lights = if self.lights.is_empty() { vec![Light::over_the_shoulder(camera)] } else { self.lights.clone() };
        Lighting { lights, stops: self.stops }
    }
}
