//! From a scene and options to a capture in memory.

use crate::error::SynthError;
use crate::faults::Faults;
use crate::film::{Effort, Exposure, Picture, expose};
use crate::light::LightRig;
use crate::scene::Scene;
use crate::trace::PathLimits;
use crate::turntable::{Layout, Station, cameras, room_yaw, stations};
use capture::{Aabb, Camera, Image, View};
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
    /// Paths per pixel, or the noise to reach.
    pub effort: Effort,
    /// Surfaces a path of light may touch, 1 to 1000; 1 is direct light only.
    pub surfaces: usize,
    /// What the light is fixed to.
    pub light: LightFrame,
    /// Where the cameras stand.
    pub layout: Layout,
    /// What goes wrong, nothing for ideal pictures.
    pub faults: Faults,
    /// Keep depth, normals, radiance and noise of every view, for [`SynthCapture::truths`].
    pub maps: bool,
}

/// Pictures whose truth is known.
#[derive(Clone, Debug)]
pub struct SynthCapture {
    /// What was filmed.
    pub scene: Scene,
    /// How.
    pub options: SynthOptions,
    /// Pictures, mattes and cameras: exact, unless [`SynthOptions::faults`] says otherwise.
    pub views: Vec<View>,
    /// What the views do not show, one per view.
    pub truths: Vec<ViewTruth>,
    /// Unit direction from the object to the key light, one per view.
    pub light_directions: Vec<Vector3<f64>>,
    /// The true surface.
    pub mesh: Mesh,
    /// The object's box.
    pub aabb: Aabb,
    /// What it took, and how noisy it is.
    pub report: SynthReport,
}

/// What is true of a view, whatever faults its picture has.
#[derive(Clone, Debug)]
pub struct ViewTruth {
    /// The camera that took it.
    pub camera: Camera,
    /// Factor on the light, 1 without drift.
    pub exposure: f64,
    /// By pixel, where asked for.
    pub maps: Option<TruthMaps>,
}

/// The ideal picture and what it shows, by pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthMaps {
    /// Mean radiance, object on black, linear RGB, white at 1.
    pub radiance: Image<[f32; 3]>,
    /// Share of the pixel the object covers, 0 to 1.
    pub coverage: Image<f32>,
    /// Standard error of the picture, in levels of 255 of sRGB, root mean square over channels.
    pub noise: Image<f32>,
    /// Distance along the optical axis of what the ray through the pixel's centre meets, in metres;
    /// infinite where it meets nothing. What is not infinite is visible in this view.
    pub depth: Image<f32>,
    /// Unit shading normal there, in the world; zero where there is nothing.
    pub normal: Image<[f32; 3]>,
}

/// Cost and noise of a synthetic capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SynthReport {
    /// Rays of every kind.
    pub rays: u64,
    /// Root mean square over object pixels and channels of the renderer's own noise, in levels of
    /// 255 of sRGB, from how much four parts of the samples differ (which errs high: a part is
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
            effort: Effort::Samples(8),
            surfaces: 100,
            light: LightFrame::Room,
            layout: Layout::Rings { elevations_deg: vec![12.0, 35.0] },
            faults: Faults::default(),
            maps: false,
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
        match self.effort {
            Effort::Samples(n) => within("samples", u64::from(n), 65_536)?,
            Effort::Noise(levels) if (0.05..=64.0).contains(&levels) => {}
            Effort::Noise(levels) => {
                let allowed = "between 0.05 and 64 levels of 255".to_owned();
                return Err(SynthError::Option { option: "noise", value: levels.to_string(), allowed });
            }
        }
        within("surfaces", self.surfaces as u64, 1000)?;
        self.faults.check()
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
    let shutter_rad = options.faults.motion_blur_deg.to_radians();
    let limits = PathLimits { surfaces: options.surfaces };
    let mut film = Film::new(options, &built.mesh, &aabb);
    for (view, (station, camera)) in stations.iter().zip(&cameras).enumerate() {
        let rig = &rig_for(&rig, options.light, station);
        let (effort, seed) = (options.effort, options.seed);
        let lights_stay = options.light == LightFrame::Room;
        let world = &built.world;
        film.take(camera, &Exposure { world, rig, limits, effort, seed, view, shutter_rad, lights_stay });
        progress(view + 1, options.views);
    }
    let Film { views, truths, light_directions, report, .. } = film;
    let options = options.clone();
    Ok(SynthCapture { scene, options, views, truths, light_directions, mesh: built.mesh, aabb, report })
}

/// What has been filmed so far.
struct Film<'a> {
    options: &'a SynthOptions,
    mesh: &'a Mesh,
    target: Vector3<f64>,
    views: Vec<View>,
    truths: Vec<ViewTruth>,
    light_directions: Vec<Vector3<f64>>,
    report: SynthReport,
    /// Views whose noise is in the report.
    judged: usize,
}

impl<'a> Film<'a> {
    fn new(options: &'a SynthOptions, mesh: &'a Mesh, aabb: &Aabb) -> Self {
        let report = SynthReport { rays: 0, noise_rms: None };
        let target = aabb.center().coords;
        let (views, truths, light_directions) = (Vec::new(), Vec::new(), Vec::new());
        Self { options, mesh, target, views, truths, light_directions, report, judged: 0 }
    }

    fn take(&mut self, camera: &Camera, exposure: &Exposure<'_>) {
        let (faults, seed, view) = (&self.options.faults, exposure.seed, exposure.view);
        let camera = faults.true_camera(camera, self.target, seed, view);
        let picture = expose(&camera, exposure);
        let key = exposure.rig.lights.first().and_then(|l| (l.center.cast() - self.target).try_normalize(0.0));
        self.light_directions.push(key.unwrap_or_else(Vector3::z));
        self.count(&picture);
        self.views.push(View {
            index: view,
            name: format!("{view:04}"),
            image: faults.develop(&picture, seed, view),
            matte: faults.cut(&picture.coverage, seed, view),
            is_complete: self.holds_whole(&camera),
            camera: faults.believed_camera(&camera, seed, view),
        });
        let maps = self.options.maps.then(|| TruthMaps::from(picture));
        self.truths.push(ViewTruth { camera, exposure: faults.exposure(seed, view), maps });
    }

    /// Whether all of the object is in the frame: a camera that stands off may cut it.
    fn holds_whole(&self, camera: &Camera) -> bool {
        let is_in = |p| camera.project(p).is_some_and(|q| camera.in_frame(q.pixel));
        self.mesh.positions.iter().all(is_in)
    }

    /// Adds up rays, and noise as a mean of squares over the views that show any of the object.
    fn count(&mut self, picture: &Picture) {
        self.report.rays += picture.rays;
        let Some(noise) = picture.noise_rms else { return };
        let before = self.report.noise_rms.map_or(0.0, |n| n * n * self.judged as f64);
        self.judged += 1;
        self.report.noise_rms = Some(((before + noise * noise) / self.judged as f64).sqrt());
    }
}

impl From<Picture> for TruthMaps {
    fn from(picture: Picture) -> Self {
        let Picture { radiance, coverage, noise, depth, normal, .. } = picture;
        Self { radiance, coverage, noise, depth, normal }
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
        SynthOptions { views: 2, width: 48, height: 36, effort: Effort::Samples(2), ..SynthOptions::default() }
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
    fn a_camera_that_cuts_the_object_is_known() {
        let (options, mesh) = (small(), crate::shape::sphere(0.1, 16));
        let aabb = mesh.aabb().unwrap();
        let film = Film::new(&options, &mesh, &aabb);
        let stations = stations(&options.layout, options.views, 0).unwrap();
        let camera = cameras(&stations, &mesh, &aabb, [48, 36])[0];
        assert!(film.holds_whole(&camera));
        // The ball is as high as 92 % of the frame: an eighth of its height aside, it is cut.
        let mut aside = camera;
        aside.translation.y += 0.025;
        assert!(!film.holds_whole(&aside));
    }

    #[test]
    fn options_out_of_range_are_refused_by_name() {
        for (bad, name) in [
            (SynthOptions { views: 0, ..small() }, "views"),
            (SynthOptions { width: 0, ..small() }, "width"),
            (SynthOptions { height: 1 << 20, ..small() }, "height"),
            (SynthOptions { effort: Effort::Samples(0), ..small() }, "samples"),
            (SynthOptions { effort: Effort::Noise(f64::NAN), ..small() }, "noise"),
            (SynthOptions { surfaces: 0, ..small() }, "surfaces"),
            (
                SynthOptions { faults: Faults { distortion_k1: f64::NAN, ..Faults::default() }, ..small() },
                "distortion_k1",
            ),
        ] {
            let error = synthesize(Scene::Temple, &bad).unwrap_err().to_string();
            assert!(error.starts_with(name), "{error}");
        }
    }
}
