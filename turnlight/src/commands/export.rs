//! `turnlight export`

use super::read_file;
use crate::Answer;
use crate::arguments::{ExportArgs, ExportTarget};
use serde_json::json;
use turnlight::Error;
use turnlight::export::{blender, obj};
use turnlight::output::OutputFolder;
use turnlight::texture::Model;

pub(crate) fn run(args: &ExportArgs) -> Result<Answer, Error> {
    let bytes = read_file(&args.model)?;
    let model = Model::from_glb(&bytes, &args.model)?;
    let folder = OutputFolder::create(&args.output)?;
    let hint = match args.to {
        ExportTarget::Web => {
            args.page.site(bytes).write(&folder)?;
            "serve it with any static web server; index.html is the page"
        }
        ExportTarget::Blender => {
            blender::write(&bytes, &folder)?;
            "install turnlight-addon.zip in Blender, then File > Import > Turnlight"
        }
        ExportTarget::Obj => {
            obj::write(&model, &folder)?;
            "model.obj is the mesh, model.png its picture"
        }
    };
    folder.finish()?;
    let text = format!("wrote {}: {hint}", args.output.display());
    Ok(Answer { text, json: json!({"output": args.output, "method": model.method}) })
}
