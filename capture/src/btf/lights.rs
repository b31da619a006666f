//! Stacks of one view under many lights, as reflectance transformation imaging (RTI) takes them: pictures,
//! and an `.lp` file beside or above them.
//!
//! ```text
//! 3                          number of pictures
//! jpg/lion_0001.jpg x y z    file, direction of the light: x right, y up, z towards the camera
//! ```

use super::pictures::{is_deep, read_pictures};
use super::{Btf, Encoding};
use crate::CaptureError;
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Reads the stack of an `.lp` file, cut to its middle `crop` × `crop` texels where that is less than all.
/// Lights need not be of unit length; the eye is above.
///
/// # Errors
/// Names the line that cannot be read, or the picture that is missing or of another size.
pub fn read_light_stack(list: &Path, crop: Option<usize>) -> Result<Btf, CaptureError> {
    let text = std::fs::read_to_string(list).map_err(|e| CaptureError::io(list, e))?;
    let entries = parse(list, &text)?;
    let folder = list.parent().unwrap_or(Path::new("."));
    let paths: Vec<Option<PathBuf>> = entries.iter().map(|(name, _)| Some(folder.join(name))).collect();
    let entries_are_deep = paths.iter().flatten().next().is_some_and(|path| is_deep(path));
    let name = list.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut btf = Btf {
        name,
        views: vec![Vector3::z()],
        lights: entries.into_iter().map(|(_, light)| light).collect(),
        width: 0,
        height: 0,
        encoding: if entries_are_deep { Encoding::Linear } else { Encoding::Srgb },
        exposure: 1.0,
        includes_cosine: true,
        texel_pitch_mm: None,
        samples: Vec::new(),
        measured: Vec::new(),
    };
    let paths: Vec<Option<&Path>> = paths.iter().map(Option::as_deref).collect();
    read_pictures(&mut btf, &paths, crop)?;
    btf.check()?;
    Ok(btf)
}

/// File names and unit directions.
fn parse(list: &Path, text: &str) -> Result<Vec<(String, Vector3<f64>)>, CaptureError> {
    let fault = |line: usize, fault: &str| {
        let remedy = "write the number of pictures, then a line `name x y z` each, the light above the surface";
        CaptureError::invalid(list, format!("line {}: {fault}", line + 1), remedy)
    };
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let count = lines.next().and_then(|(_, line)| line.trim().parse::<usize>().ok());
    let count = count.ok_or_else(|| fault(0, "no number of pictures"))?;
    let mut entries = Vec::new();
    for (at, line) in lines {
        // Names may hold blanks: the numbers are the last three words.
        let mut name = line.trim();
        let mut number = || {
            let (before, word) = name.rsplit_once(char::is_whitespace)?;
            name = before.trim_end();
            word.parse::<f64>().ok().filter(|n| n.is_finite())
        };
        let (Some(z), Some(y), Some(x)) = (number(), number(), number()) else {
            return Err(fault(at, "no name with three numbers"));
        };
        let light = Vector3::new(x, y, z).try_normalize(1e-9).filter(|light| light.z >= 0.0);
        // Lists written on Windows.
        entries.push((name.replace('\\', "/"), light.ok_or_else(|| fault(at, "the light is below the surface"))?));
    }
    if entries.len() != count || count == 0 {
        return Err(fault(0, &format!("{count} pictures are announced, {} are listed", entries.len())));
    }
    Ok(entries)
}
