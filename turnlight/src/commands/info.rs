//! `turnlight info`

use super::{read_capture, read_file};
use crate::Answer;
use crate::arguments::InfoArgs;
use serde_json::{Value, json};
use turnlight::capture::{LoadOptions, detect_format, doctor};
use turnlight::geometry::Mesh;
use turnlight::geometry::mesh::io::read_mesh;
use turnlight::inspect::{self, MeshFacts, ModelFacts};
use turnlight::stages::{Observer, Stages};
use turnlight::texture::{self, Model};
use turnlight::{Error, truth};

pub(crate) fn run(args: &InfoArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    let extension = args.path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "ply" | "obj" => mesh(args),
        "glb" => glb(args),
        _ if args.truth.is_some() => Err(Error::Arguments(format!(
            "{}: only a mesh or a model (.ply .obj .glb) can be held against --truth; for a capture make its hull first",
            args.path.display()
        ))),
        _ => capture(args, observer),
    }
}

fn mesh(args: &InfoArgs) -> Result<Answer, Error> {
    let mesh = read_mesh(&args.path)?.mesh;
    let facts: MeshFacts = inspect::mesh_facts(&mesh)?;
    with_truth(Answer { text: facts.text(), json: json!(facts) }, &mesh, args)
}

/// Adds how near the mesh comes to the truth, where one is given.
fn with_truth(mut answer: Answer, mesh: &Mesh, args: &InfoArgs) -> Result<Answer, Error> {
    let Some(path) = &args.truth else { return Ok(answer) };
    let truth = read_mesh(path)?.mesh;
    let tolerance = args.tolerance.unwrap_or_else(|| truth::default_tolerance(&truth, None));
    let figures = truth::judge(mesh, &truth, tolerance)?;
    answer.text = format!("{}\n{}", answer.text, figures.text());
    if let (Value::Object(facts), Value::Object(more)) = (&mut answer.json, json!(figures)) {
        facts.extend(more);
    }
    Ok(answer)
}

/// A model of ours, or any mesh.
fn glb(args: &InfoArgs) -> Result<Answer, Error> {
    let bytes = read_file(&args.path)?;
    match Model::from_glb(&bytes, &args.path) {
        Ok(model) => {
            let facts: ModelFacts = inspect::model_facts(&model)?;
            with_truth(Answer { text: facts.text(), json: json!(facts) }, &model.mesh.mesh, args)
        }
        // What names our extension was meant to be a model; its fault is the one to hear of.
        Err(fault) if bytes.windows(EXTENSION.len()).any(|w| w == EXTENSION) => Err(fault.into()),
        Err(_) => mesh(args),
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
