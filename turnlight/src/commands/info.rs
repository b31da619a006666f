//! `turnlight info`

use super::{read_capture, read_file};
use crate::Answer;
use crate::arguments::InfoArgs;
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::capture::{LoadOptions, detect_format, doctor};
use turnlight::geometry::mesh::io::read_mesh;
use turnlight::inspect::{self, MeshFacts, ModelFacts};
use turnlight::stages::{Observer, Stages};
use turnlight::texture::{self, Model};

pub(crate) fn run(args: &InfoArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let extension = args.path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "ply" | "obj" => mesh(&args.path),
        "glb" => glb(&args.path),
        _ => capture(args, observer),
    }
}

fn mesh(path: &Path) -> Result<Answer, Error> {
    let facts: MeshFacts = inspect::mesh_facts(&read_mesh(path)?.mesh)?;
    Ok(Answer { text: facts.text(), json: json!(facts) })
}

/// A model of ours, or any mesh.
fn glb(path: &Path) -> Result<Answer, Error> {
    let bytes = read_file(path)?;
    match Model::from_glb(&bytes, path) {
        Ok(model) => {
            let facts: ModelFacts = inspect::model_facts(&model)?;
            Ok(Answer { text: facts.text(), json: json!(facts) })
        }
        // What names our extension was meant to be a model; its fault is the one to hear of.
        Err(fault) if bytes.windows(EXTENSION.len()).any(|w| w == EXTENSION) => Err(fault.into()),
        Err(_) => mesh(path),
    }
}

const EXTENSION: &[u8] = texture::EXTENSION.as_bytes();

/// Up to this many views are looked at; more say nothing new.
const CHECKED_VIEWS: usize = 48;

fn capture(args: &InfoArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let (format, _) = detect_format(&args.path)?;
    let capture = read_capture(&args.path, args.ignore_masks)?;
    let count = capture.frames.len();
    let positions: Vec<usize> = (0..count).step_by(count.div_ceil(CHECKED_VIEWS).max(1)).collect();
    let mut stages = Stages::new(observer);
    let views = stages.run("load", |_| capture.load_views(&positions, &LoadOptions::default()))?;
    let check = stages.run("check", |_| doctor::check(&capture, &views));
    let mut json = json!(check);
    json["format"] = json!(format.to_string());
    Ok(Answer { text: inspect::capture_text(&format.to_string(), &check), json })
}
