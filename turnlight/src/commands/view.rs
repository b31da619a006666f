//! `turnlight view`

use super::read_file;
use crate::Answer;
use crate::arguments::ViewArgs;
use serde_json::json;
use turnlight::Error;
use turnlight::serve::Server;
use turnlight::texture::Model;

/// Serves until the process is ended; `announce` is told the address first.
pub(crate) fn run(args: &ViewArgs, announce: impl FnOnce(&Answer) -> Result<(), Error>) -> Result<(), Error> {
    let bytes = read_file(&args.model)?;
    Model::from_glb(&bytes, &args.model)?;
    let server = Server::bind(args.page.site(bytes), args.port)?;
    let url = server.url();
    announce(&Answer { text: format!("{url}\nopen it in a browser; Ctrl-C ends it"), json: json!({"url": url}) })?;
    server.run();
    Ok(())
}
