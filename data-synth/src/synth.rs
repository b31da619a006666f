//! From a scene and options to a capture in memory.

use crate::error::SynthError;
use crate::film::{Exposure, expose};
use crate::light::LightRig;
use crate::noise::SensorNoise;
use crate::scene::Scene;
use crate::trace::PathLimits;
use crate::turntable::{Layout, Station, cameras, room_yaw, stations};
use capture::{Aabb, Camera, View};
use geometry::Mesh;
use nalgebra::Vector3;

/// What the light is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightFrame {
    /// To the room, as on a turntable: the object turns under it, and highlights slide over it.
    Room,
    /// To the object, as when one walks around it.
    Object,
}

/// How a scene is filmed.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthOptions {
    /// Number of views, 1 to 10000.
    pub views: usize,
    /// Picture width in pixels, 1 to 16384.
    pub width: usize,
    /// Picture height in pixels, 1 to 16384.
    pub height: usize,
    /// Of everything random; the same seed gives the same bytes.
    pub seed: u64,
    /// Paths per pixel, 1 to 65536; powers of two are stratified best.
    pub samples_per_pixel: u32,
    /// Surfaces a path of light may touch, 1 to 16; 1 is direct light only.
    pub surfaces: usize,
    /// What the light is fixed to.
    pub light: LightFrame,
    /// Where the cameras stand.
    pub layout: Layout,
    /// Sensor noise, none for ideal pictures.
    pub sensor_noise: Option<SensorNoise>,
}

/// Pictures whose truth is known.
#[derive(Clone, Debug)]
pub struct SynthCapture {
    /// What was filmed.
    pub scene: Scene,
    /// Pictures, mattes and exact cameras.
    pub views: Vec<View>,
    /// Unit direction from the object to the key light, one per view.
    pub light_directions: Vec<Vector3<f64>>,
    /// The true surface.
    pub mesh: Mesh,
    /// The object's box.
    pub aabb: Aabb,
    /// What it took, and how noisy it is.
    pub report: SynthReport,
}

/// Cost and noise of a synthetic capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynthReport {
    /// Rays of every kind.
    pub rays: u64,
    /// Root mean square over object pixels and channels of the renderer's own noise, in levels of
    /// 255 of sRGB, from the difference of two halves of the samples (which errs high: a half is
    /// stratified less finely than the whole). `None` at one sample per pixel.
    pub noise_rms: Option<f64>,
}

impl Default for SynthOptions {
    /// What `turnlight demo` films.
    fn default() -> Self {
        Self {
            views: 40,
            width: 480,
            height: 360,
            seed: 0,
            samples_per_pixel: 8,
            surfaces: 2,
            light: LightFrame::Room,
            layout: Layout::Rings { elevations_deg: vec![12.0, 35.0] },
            sensor_noise: None,
        }
    }
}

impl SynthOptions {
    fn check(&self) -> Result<(), SynthError> {
        let within = |option: &'static str, value: u64, most: u64| {
            let allowed = || format!("between 1 and {most}");
            let ok = (1..=most).contains(&value);
            if ok { Ok(()) } else { Err(SynthError::Option { option, value: value.to_string(), allowed: allowed() }) }
        };
        within("views", self.views as u64, 10_000)?;
        within("width", self.width as u64, 16_384)?;
        within("height", self.height as u64, 16_384)?;
        within("samples_per_pixel", u64::from(self.samples_per_pixel), 65_536)?;
        within("surfaces", self.surfaces as u64, 16)?;
        self.sensor_noise.map_or(Ok(()), |n| n.check())
    }
}

/// Films a scene.
///
/// # Errors
/// Names the option that is out of range.
pub fn synthesize(scene: Scene, options: &SynthOptions) -> Result<SynthCapture, SynthError> {
    synthesize_with(scene, options, |_, _| {})
}

/// [`synthesize`] that tells `progress` the number of views done, and of all, after each view.
///
/// # Errors
/// Names the option that is out of range.
pub fn synthesize_with(
    scene: Scene,
    options: &SynthOptions,
    mut progress: impl FnMut(usize, usize),
) -> Result<SynthCapture, SynthError> {
    options.check()?;
    let stations = stations(&options.layout, options.views, options.seed)?;
    let built = scene.build();
    let aabb = built.mesh.aabb().ok_or(SynthError::Scene { fault: "it has no vertices" })?;
    let cameras = cameras(&stations, &built.mesh, &aabb, [options.width, options.height]);
    let rig = LightRig::studio(aabb.center().coords.cast(), 0.5 * aabb.diagonal() as f32);
    // White: what a second surface adds can then not stand out of its neighbours as a speckle.
    let limits = PathLimits { surfaces: options.surfaces, clamp: 1.0 };
    let mut film = Film { views: Vec::new(), light_directions: Vec::new(), rays: 0, noise: (0.0, 0) };
    for (view, (station, camera)) in stations.iter().zip(&cameras).enumerate() {
        let rig = rig_for(&rig, options.light, station);
        let samples = options.samples_per_pixel;
        let exposure = Exposure { world: &built.world, rig: &rig, limits, samples, seed: options.seed, view };
        film.add(camera, &exposure, options.sensor_noise, &aabb);
        progress(view + 1, options.views);
    }
    let noise_rms = (film.noise.1 > 0).then(|| (film.noise.0 / film.noise.1 as f64).sqrt());
    let report = SynthReport { rays: film.rays, noise_rms };
    Ok(SynthCapture {
        scene,
        views: film.views,
        light_directions: film.light_directions,
        mesh: built.mesh,
        aabb,
        report,
    })
}

/// What has been filmed so far.
struct Film {
    views: Vec<View>,
    light_directions: Vec<Vector3<f64>>,
    rays: u64,
    noise: (f64, u64),
}

impl Film {
    fn add(&mut self, camera: &Camera, exposure: &Exposure<'_>, sensor: Option<SensorNoise>, aabb: &Aabb) {
        let mut picture = expose(camera, exposure);
        if let Some(sensor) = sensor {
            sensor.apply(&mut picture.image, exposure.seed, exposure.view);
        }
        let key = exposure.rig.lights.first().map(|l| l.center.cast::<f64>() - aabb.center().coords);
        let key = key.and_then(|d| d.try_normalize(0.0));
        self.light_directions.push(key.unwrap_or_else(Vector3::z));
        self.rays += picture.rays;
        self.noise = (self.noise.0 + picture.noise_squared, self.noise.1 + picture.noise_terms);
        self.views.push(View {
            index: exposure.view,
            name: format!("{:04}", exposure.view),
            image: picture.image,
            matte: picture.matte,
            is_complete: true,
            camera: *camera,
        });
    }
}

fn rig_for(rig: &LightRig, light: LightFrame, station: &Station) -> LightRig {
    match light {
        LightFrame::Room => rig.turned(room_yaw(station) as f32),
        LightFrame::Object => rig.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> SynthOptions {
        SynthOptions { views: 2, width: 48, height: 36, samples_per_pixel: 2, ..SynthOptions::default() }
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_on_one_and_two_threads() {
        let film = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| synthesize(Scene::Temple, &SynthOptions { seed, ..small() })).unwrap()
        };
        let (one, two, other) = (film(1, 7), film(2, 7), film(2, 8));
        for (a, b) in one.views.iter().zip(&two.views) {
            assert_eq!(a.image, b.image);
            assert_eq!(a.matte, b.matte);
        }
        assert_eq!(one.report, two.report);
        assert_ne!(one.views[0].image, other.views[0].image);
    }

    #[test]
    fn background_is_black_and_the_object_is_whole() {
        for scene in Scene::ALL {
            let capture = synthesize(scene, &small()).unwrap();
            for view in &capture.views {
                let covered = view.matte.pixels().iter().filter(|&&m| m >= 128).count();
                assert!((100..48 * 36).contains(&covered), "{scene}: {covered} pixels");
                let pairs = view.matte.pixels().iter().zip(view.image.pixels());
                assert!(pairs.filter(|p| *p.0 == 0).all(|p| *p.1 == [0; 3]));
                assert!((0..48).all(|x| view.matte.at(x, 0) == 0 && view.matte.at(x, 35) == 0));
            }
        }
    }

    #[test]
    fn light_follows_its_frame() {
        let room = synthesize(Scene::Temple, &small()).unwrap();
        let object = synthesize(Scene::Temple, &SynthOptions { light: LightFrame::Object, ..small() }).unwrap();
        // One view per ring, half a turn apart (the odd ring starts half a step later).
        assert!((room.light_directions[0].x + room.light_directions[1].x).abs() < 1e-6);
        assert!((object.light_directions[0] - object.light_directions[1]).norm() < 1e-9);
    }

    #[test]
    fn options_out_of_range_are_refused_by_name() {
        for (bad, name) in [
            (SynthOptions { views: 0, ..small() }, "views"),
            (SynthOptions { width: 0, ..small() }, "width"),
            (SynthOptions { height: 1 << 20, ..small() }, "height"),
            (SynthOptions { samples_per_pixel: 0, ..small() }, "samples_per_pixel"),
            (SynthOptions { surfaces: 0, ..small() }, "surfaces"),
            (
                SynthOptions {
                    sensor_noise: Some(SensorNoise { full_well: f64::NAN, read_electrons: 0.0 }),
                    ..small()
                },
                "full_well",
            ),
        ] {
            let error = synthesize(Scene::Temple, &bad).unwrap_err().to_string();
            assert!(error.starts_with(name), "{error}");
        }
    }
}
