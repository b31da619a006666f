//! A model as Wavefront OBJ: the mesh, a material, and the one picture that a viewer without our extension shows.

use crate::Error;
use crate::output::OutputFolder;
use geometry::mesh::io::write_textured_mesh;
use render::film::write_png;
use texture::Model;

const MESH: &str = "model.obj";
const MATERIAL: &str = "model.mtl";
const PICTURE: &str = "model.png";

/// Writes `model.obj`, `model.mtl` and `model.png` below `folder`. The material asks for colour without
/// lighting (`illum 0`): the picture holds the light it was taken in.
///
/// # Errors
/// Names the file and what the system said.
pub fn write(model: &Model, folder: &OutputFolder) -> Result<(), Error> {
    let mesh = folder.place(MESH)?;
    write_textured_mesh(&mesh, &model.mesh)?;
    let plain = std::fs::read(&mesh).map_err(|fault| Error::Failed(format!("{MESH}: {fault}; write elsewhere")))?;
    let header = format!("mtllib {MATERIAL}\nusemtl photographed\n");
    folder.write(MESH, &[header.as_bytes(), plain.as_slice()].concat())?;
    folder.write(
        MATERIAL,
        format!("newmtl photographed\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd {PICTURE}\n").as_bytes(),
    )?;
    // Rounded as everywhere: a cast saturates, and truncates what is positive.
    let picture = model.still().map(|texel| {
        let [r, g, b] = texel.map(|level| (level + 0.5) as u8);
        [r, g, b, 255]
    });
    Ok(write_png(&folder.place(PICTURE)?, &picture)?)
}
