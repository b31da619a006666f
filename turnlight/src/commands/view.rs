//! `turnlight view`

use super::read_file;
use crate::Answer;
use crate::arguments::ViewArgs;
use serde_json::json;
use std::path::Path;
use turnlight::Error;
use turnlight::serve::Server;
use turnlight::texture::Model;

/// Serves until the process is ended, `announce` being told the address first, or shows until the window is closed.
pub(crate) fn run(args: &ViewArgs, announce: impl FnOnce(&Answer) -> Result<(), Error>) -> Result<(), Error> {
    match args.models.as_slice() {
        [model] if args.web.web => serve(args, model, announce),
        models if args.web.web => {
            Err(Error::Arguments(format!("--web shows one model; {} are named, leave the others out", models.len())))
        }
        _ => window(args),
    }
}

fn serve(args: &ViewArgs, model: &Path, announce: impl FnOnce(&Answer) -> Result<(), Error>) -> Result<(), Error> {
    let bytes = read_file(model)?;
    Model::from_glb(&bytes, model)?;
    let server = Server::bind(args.page.site(bytes), args.web.port)?;
    let url = server.url();
    announce(&Answer { text: format!("{url}\nopen it in a browser; Ctrl-C ends it"), json: json!({"url": url}) })?;
    server.run();
    Ok(())
}

#[cfg(feature = "window")]
fn window(args: &ViewArgs) -> Result<(), Error> {
    use super::{check_extension, choice, read_capture};
    use turnlight::output::check_writable;
    use turnlight::playback;
    use turnlight::viewer::{Exhibit, Viewer, ViewerOptions};
    use turnlight::window::{WindowOptions, show};

    let wanted = &args.window;
    if let Some(picture) = &wanted.screenshot {
        check_extension(picture, &["png"])?;
        check_writable(picture)?;
    }
    let exhibits = Exhibit::read_all(&args.models)?;
    let capture = wanted.capture.as_deref().map(|path| read_capture(path, false)).transpose()?;
    let models = || exhibits.iter().map(|exhibit| &exhibit.scene.models);
    let tiles: Vec<Vec<_>> = models().map(|models| models.iter().map(playback::tiles).collect()).collect();
    let coats = models()
        .zip(&tiles)
        .map(|(models, tiles)| models.iter().zip(tiles).map(|(model, tiles)| playback::coats(model, tiles)).collect());
    let coats: Vec<Vec<_>> = coats.collect();
    let up = args.page.axis().map(Into::into);
    let viewer = Viewer::new(&exhibits, &coats, ViewerOptions { up, capture, renderer: choice(wanted.renderer) })?;
    let name = args.models[0].file_stem().map_or_else(|| "view".to_owned(), |name| name.to_string_lossy().into_owned());
    let options = WindowOptions {
        name,
        size: wanted.size,
        panels: wanted.panels.clone().unwrap_or_default(),
        has_panels: wanted.panels.is_some(),
        screenshot: wanted.screenshot.clone(),
    };
    show(viewer, &options)
}

#[cfg(not(feature = "window"))]
fn window(_: &ViewArgs) -> Result<(), Error> {
    Err(Error::Arguments(
        "this turnlight was built without a window; show the model in a browser with --web, draw it with `turnlight \
         render`, or build it with --features window"
            .to_owned(),
    ))
}
