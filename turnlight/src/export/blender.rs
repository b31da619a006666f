//! A model with the add-on that plays it in Blender.

use super::zip::archive;
use crate::Error;
use crate::output::OutputFolder;
use render::blender::FILES;

/// What Blender installs.
pub const ADD_ON: &str = "turnlight-addon.zip";
const MODEL: &str = "model.glb";
const README: &str = "README.txt";

const TEXT: &str = "\
This folder plays model.glb in Blender, 4.2 or newer.

1. Edit > Preferences > Get Extensions > Install from Disk: turnlight-addon.zip, once.
   From a script: bpy.ops.extensions.package_install_files(filepath='turnlight-addon.zip', repo='user_default')
2. File > Import > Turnlight: model.glb.
   From a script: bpy.ops.import_scene.turnlight(filepath='model.glb')

The object follows the scene's camera in renders, frame by frame, and in viewports that look through it; any other
viewport shows it as seen from there. A saved .blend holds the model. Opened without the add-on, it shows the object as
it was seen last. The import sets the scene's view transform to Standard, which shows colours as photographed.
";

/// Writes the add-on, `model` (the bytes of a `.glb`, not looked at: the add-on refuses by itself what is no model) and
/// a few lines on what to do with them below `folder`.
///
/// # Errors
/// Names the file and what the system said.
pub fn write(model: &[u8], folder: &OutputFolder) -> Result<(), Error> {
    folder.write(ADD_ON, &archive(FILES.iter().map(|file| (file.path, file.bytes)))?)?;
    folder.write(MODEL, model)?;
    folder.write(README, TEXT.as_bytes())
}
