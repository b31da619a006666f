//! `turnlight hull`

use super::check_extension;
use crate::Answer;
use crate::arguments::HullArgs;
use serde_json::json;
use turnlight::geometry::mesh::io::write_mesh;
use turnlight::stages::{Observer, Stages};
use turnlight::{Error, inspect, pipeline};

pub(crate) fn run(args: &HullArgs, observer: &dyn Observer) -> Result<Answer, Error> {
    check_extension(&args.output, &["ply", "obj", "glb"])?;
    let mut stages = Stages::new(observer);
    let (capture, views) = args.capture.load(&args.views, &mut stages)?;
    let mesh = pipeline::hull(&views, capture.aabb, &args.shape.options(), &mut stages)?;
    let iou = stages.run("check silhouettes", |_| inspect::silhouette_ious(&mesh, &views));
    stages.run("write", |_| write_mesh(&args.output, &mesh))?;
    let facts = inspect::mesh_facts(&mesh)?;
    let mean_iou = iou.iter().sum::<f64>() / iou.len().max(1) as f64;
    let text = format!("{}\nsilhouettes: mean IoU {mean_iou:.4}\nwrote {}", facts.text(), args.output.display());
    let mut json = json!(facts);
    json["mesh"] = json!(args.output);
    json["silhouette_iou_mean"] = json!(mean_iou);
    json["silhouette_iou"] = json!(iou);
    json["stages"] = json!(stages.finished());
    Ok(Answer { text, json })
}
