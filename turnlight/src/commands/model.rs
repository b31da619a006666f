//! `turnlight model`

use super::{check_extension, material};
use crate::Answer;
use crate::arguments::ModelArgs;
use serde_json::json;
use turnlight::stages::{Observer, Stages};
use turnlight::{Error, inspect, output, pipeline};

pub(crate) fn run(args: &ModelArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    check_extension(&args.output, &["glb"])?;
    let mut stages = Stages::new(observer);
    let (capture, views) = args.capture.load(&args.views, &mut stages)?;
    let (shape, fit) = (args.mesh.options(), args.fit.options());
    let (mut model, report) = pipeline::model(&views, capture.aabb, args.method.into(), &shape, &fit, &mut stages)?;
    material::lay(&mut model, &args.material, capture.unit, observer)?;
    stages.run("write", |_| output::write_file(&args.output, &model.to_glb()?))?;
    let facts = inspect::model_facts(&model)?;
    let unseen = 100.0 * report.unseen_texels as f64 / report.texels.max(1) as f64;
    let text = format!(
        "{}\n{} texels, {unseen:.1} % unseen and filled\nwrote {}",
        facts.text(),
        report.texels,
        args.output.display()
    );
    let mut json = json!(facts);
    json["model"] = json!(args.output);
    json["views"] = json!(views.len());
    json["masks"] = json!(capture.mask_source);
    json["texels"] = json!(report.texels);
    json["unseen_texels"] = json!(report.unseen_texels);
    json["stages"] = json!(stages.finished());
    Ok(Answer { text, json })
}
