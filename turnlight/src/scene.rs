//! Several models in one scene, as a file (`docs/playback.md`).

use crate::Error;
use crate::panorama::read_panorama;
use capture::{Aabb, Image};
use nalgebra::{Quaternion, UnitQuaternion};
use render::Pose;
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};
use texture::Model;

/// Objects in a scene; each costs memory for its texture.
pub const MOST_OBJECTS: usize = 256;

/// Bytes of a scene file: far more than so many objects take.
const MOST_BYTES: u64 = 1 << 20;

/// Coordinates and scales beyond this are no scene's.
const FARTHEST: f64 = 1e12;

/// Models, where they stand, and what is behind them.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Each file once.
    pub models: Vec<Model>,
    /// Which model stands where.
    pub objects: Vec<Placed>,
    /// Linear radiance from all around, as [`read_panorama`] gives it.
    pub backdrop: Option<Image<[f32; 3]>>,
}

/// One object of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Index into the models.
    pub model: usize,
    /// Where it stands.
    pub pose: Pose,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneKeys {
    objects: Vec<ObjectKeys>,
    backdrop: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectKeys {
    model: PathBuf,
    #[serde(default)]
    translation: [f64; 3],
    /// x, y, z, w, as in glTF.
    #[serde(default = "unturned")]
    rotation: [f64; 4],
    #[serde(default = "unscaled")]
    scale: f64,
}

fn unturned() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn unscaled() -> f64 {
    1.0
}

impl Scene {
    /// One model where it stands.
    pub fn of(model: Model) -> Self {
        Self { models: vec![model], objects: vec![Placed { model: 0, pose: Pose::default() }], backdrop: None }
    }

    /// Reads a scene (`.json`), or one model (anything else). Names in a scene are relative to its folder.
    ///
    /// # Errors
    /// Where the file, a model or the backdrop is missing or broken; where there are no objects or more than
    /// [`MOST_OBJECTS`]; where a pose is not finite, a rotation has no length or a scale is not positive.
    pub fn read(path: &Path) -> Result<Self, Error> {
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json")) {
            return Ok(Self::of(read_model(path)?));
        }
        let refused = |fault: String| Error::Failed(format!("{}: {fault}", path.display()));
        let file = std::fs::File::open(path).map_err(|fault| refused(format!("{fault}; check the path")))?;
        let mut text = String::new();
        // Of a pipe the length is known at its end alone.
        file.take(MOST_BYTES + 1)
            .read_to_string(&mut text)
            .map_err(|fault| refused(format!("{fault}; check the file")))?;
        if text.len() as u64 > MOST_BYTES {
            return Err(refused(format!("more than {MOST_BYTES} bytes are no scene; give a smaller file")));
        }
        let keys: SceneKeys = serde_json::from_str(&text)
            .map_err(|fault| refused(format!("no scene ({fault}); docs/playback.md says what one holds")))?;
        if keys.objects.is_empty() || keys.objects.len() > MOST_OBJECTS {
            return Err(refused(format!("{} objects; list 1 to {MOST_OBJECTS}", keys.objects.len())));
        }
        // Before anything is loaded.
        let poses = keys.objects.iter().enumerate();
        let poses = poses.map(|(k, object)| pose(object).map_err(|fault| refused(format!("object {k}: {fault}"))));
        let poses: Vec<Pose> = poses.collect::<Result<_, _>>()?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut scene = Self { models: Vec::new(), objects: Vec::new(), backdrop: None };
        let mut read: Vec<PathBuf> = Vec::new();
        for (object, pose) in keys.objects.iter().zip(poses) {
            let file = folder.join(&object.model);
            let known = read.iter().position(|other| *other == file);
            if known.is_none() {
                scene.models.push(read_model(&file)?);
                read.push(file);
            }
            scene.objects.push(Placed { model: known.unwrap_or(read.len() - 1), pose });
        }
        scene.backdrop = keys.backdrop.map(|backdrop| read_panorama(&folder.join(backdrop))).transpose()?;
        Ok(scene)
    }
}

impl Scene {
    /// The box around all objects; `None` where there is no vertex.
    pub fn aabb(&self) -> Option<Aabb> {
        aabb_of(self.objects.iter().map(|placed| (&self.models[placed.model], &placed.pose)))
    }
}

/// The box around the posed boxes of models; `None` where there is no vertex.
pub fn aabb_of<'a>(objects: impl IntoIterator<Item = (&'a Model, &'a Pose)>) -> Option<Aabb> {
    let corners = objects.into_iter().filter_map(|(model, pose)| Some(pose.corners(&model.mesh.mesh.aabb()?)));
    Aabb::around(corners.flatten())
}

/// Reads a model.
///
/// # Errors
/// Where the file is missing, or no model.
pub fn read_model(path: &Path) -> Result<Model, Error> {
    let bytes =
        std::fs::read(path).map_err(|fault| Error::Failed(format!("{}: {fault}; check the path", path.display())))?;
    Ok(Model::from_glb(&bytes, path)?)
}

fn pose(keys: &ObjectKeys) -> Result<Pose, String> {
    let is_number = |v: &f64| v.abs() <= FARTHEST;
    if !keys.translation.iter().all(is_number) {
        return Err(format!("its translation is {:?}; give three numbers up to {FARTHEST:e}", keys.translation));
    }
    if !(keys.scale > 1.0 / FARTHEST && is_number(&keys.scale)) {
        return Err(format!("its scale is {}; give a positive number", keys.scale));
    }
    let [x, y, z, w] = keys.rotation;
    let quaternion = keys.rotation.iter().all(is_number).then_some(Quaternion::new(w, x, y, z));
    let rotation = quaternion.and_then(|q| UnitQuaternion::try_new(q, 1e-6));
    let rotation =
        rotation.ok_or_else(|| format!("its rotation is {:?}; give a unit quaternion [x, y, z, w]", keys.rotation))?;
    let rotation = rotation.to_rotation_matrix().into_inner();
    Ok(Pose { rotation, translation: keys.translation.into(), scale: keys.scale })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn fault(json: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.json");
        std::fs::write(&path, json).unwrap();
        Scene::read(&path).unwrap_err().to_string()
    }

    #[test]
    fn hostile_scenes_are_refused_by_name() {
        let many = format!(r#"{{"objects": [{}]}}"#, vec![r#"{"model": "a.glb"}"#; MOST_OBJECTS + 1].join(","));
        for (json, word) in [
            ("", "no scene"),
            ("[]", "no scene"),
            (r#"{"objects": []}"#, "0 objects"),
            (many.as_str(), "257 objects"),
            (r#"{"objects": [{"model": "gone.glb"}]}"#, "gone.glb"),
            (r#"{"objects": [{"model": "a.glb", "translation": [1, 2]}]}"#, "no scene"),
            (r#"{"objects": [{"model": "a.glb", "translation": [0, 0, NaN]}]}"#, "no scene"),
            (r#"{"objects": [{"model": "a.glb", "translation": [0, 0, 1e300]}]}"#, "translation"),
            (r#"{"objects": [{"model": "a.glb", "rotation": [0, 0, 0, 0]}]}"#, "rotation"),
            (r#"{"objects": [{"model": "a.glb", "rotation": [1e200, 1e200, 0, 0]}]}"#, "rotation"),
            (r#"{"objects": [{"model": "a.glb", "scale": 0}]}"#, "scale"),
            (r#"{"objects": [{"model": "a.glb", "scale": -1}]}"#, "scale"),
            (r#"{"objects": [{"model": "a.glb", "colour": 1}]}"#, "colour"),
        ] {
            let message = fault(json);
            assert!(message.contains(word), "{json:.60} gives {message}");
            assert!(word == "gone.glb" || message.contains("scene.json"), "{message}");
        }
    }

    #[test]
    fn a_quaternion_turns_as_in_gltf() {
        let keys = |rotation| ObjectKeys { model: PathBuf::new(), translation: [1.0, 0.0, 0.0], rotation, scale: 2.0 };
        let half = 0.5f64.sqrt();
        // A quarter turn about z.
        let turned = pose(&keys([0.0, 0.0, half, half])).unwrap();
        assert!((turned.to_world(&Point3::new(1.0, 0.0, 0.0)) - Point3::new(1.0, 2.0, 0.0)).norm() < 1e-12);
    }
}
