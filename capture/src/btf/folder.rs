//! Folders of pictures whose names say view and light in whole degrees:
//!
//! ```text
//! tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.jpg    University of Bonn, 2003
//! tvTTT_pvPPP/tlTTT_plPPP_tvTTT_pvPPP.exr          ÚTIA, Prague
//! ```
//!
//! Angles are read from the names, never from the position. `btf.json` beside them, which
//! `turnlight btf synth` writes, says encoding and exposure; without it, EXR pictures are linear and
//! all others sRGB. A pair without a picture is filled from the nearest light of its view, or else from the
//! nearest view under its light.

use super::pictures::{is_deep, read_pictures};
use super::{Btf, BtfDirection, Encoding};
use crate::CaptureError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One file of the grid.
struct Picture {
    path: PathBuf,
    view: BtfDirection,
    light: BtfDirection,
}

/// What `btf.json` says.
#[derive(Default, serde::Deserialize)]
#[serde(default)]
struct Description {
    name: Option<String>,
    encoding: Option<Encoding>,
    exposure: Option<f32>,
    includes_cosine: Option<bool>,
    texel_pitch_mm: Option<f64>,
}

/// Reads a folder, cut to its middle `crop` × `crop` texels where that is less than all.
///
/// # Errors
/// Names the file that cannot be read, or is of another size, or twice for one pair; and a folder that holds none.
pub fn read_folder(folder: &Path, crop: Option<usize>) -> Result<Btf, CaptureError> {
    let pictures = find_pictures(folder)?;
    let Some(first) = pictures.first() else {
        let remedy = "name them like `00008 tl000 pl000 tv030 pv030.png`, in degrees";
        return Err(CaptureError::invalid(folder, "it holds no picture whose name says view and light", remedy));
    };
    let description = describe(folder)?;
    let deep = is_deep(&first.path);
    let views = distinct(pictures.iter().map(|p| p.view));
    let lights = distinct(pictures.iter().map(|p| p.light));
    let default = if deep { Encoding::Linear } else { Encoding::Srgb };
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut btf = Btf {
        name: description.name.unwrap_or(name),
        views: views.iter().map(|d| d.vector()).collect(),
        lights: lights.iter().map(|d| d.vector()).collect(),
        width: 0,
        height: 0,
        encoding: description.encoding.unwrap_or(default),
        exposure: description.exposure.unwrap_or(1.0),
        includes_cosine: description.includes_cosine.unwrap_or(true),
        texel_pitch_mm: description.texel_pitch_mm,
        samples: Vec::new(),
        measured: Vec::new(),
    };
    read_pictures(&mut btf, &grid(&pictures, &views, &lights)?, crop)?;
    btf.check()?;
    Ok(btf)
}

/// All pictures below a folder, by name.
fn find_pictures(folder: &Path) -> Result<Vec<Picture>, CaptureError> {
    let mut pictures = Vec::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(&folder).map_err(|e| CaptureError::io(&folder, e))? {
            let entry = entry.map_err(|e| CaptureError::io(&folder, e))?;
            let path = entry.path();
            if entry.file_type().map_err(|e| CaptureError::io(&path, e))?.is_dir() {
                pending.push(path);
            } else if let Some([tv, pv, tl, pl]) = angles(&path) {
                let [view, light] =
                    [(tv, pv), (tl, pl)].map(|(theta_deg, phi_deg)| BtfDirection { theta_deg, phi_deg });
                pictures.push(Picture { path, view, light });
            }
        }
    }
    pictures.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(pictures)
}

/// Polar angle and azimuth of view and light in a file's name.
fn angles(path: &Path) -> Option<[u16; 4]> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    if !["jpg", "jpeg", "png", "exr"].contains(&extension.as_str()) {
        return None;
    }
    let stem = path.file_stem()?.to_str()?;
    let after = |tag: &str| {
        // The letters may stand in a name too, without digits after them.
        stem.match_indices(tag).find_map(|(at, _)| {
            let digits = &stem[at + tag.len()..];
            let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            digits[..end].parse::<u16>().ok()
        })
    };
    let [tv, pv, tl, pl] = [after("tv")?, after("pv")?, after("tl")?, after("pl")?];
    (tv <= 90 && tl <= 90).then_some([tv, pv % 360, tl, pl % 360])
}

fn describe(folder: &Path) -> Result<Description, CaptureError> {
    let path = folder.join("btf.json");
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Description::default()),
        Err(e) => return Err(CaptureError::io(&path, e)),
    };
    let description: Description = serde_json::from_str(&text).map_err(|e| {
        CaptureError::invalid(&path, e.to_string(), "mend it, or take it away to read the pictures as sRGB")
    })?;
    match description.exposure {
        Some(exposure) if !(exposure > 0.0 && exposure.is_finite()) => {
            Err(CaptureError::invalid(&path, format!("its exposure is {exposure}"), "give a positive number"))
        }
        _ => Ok(description),
    }
}

/// In the order of polar angle and azimuth: that of Bonn.
fn distinct(directions: impl Iterator<Item = BtfDirection>) -> Vec<BtfDirection> {
    let mut all: Vec<BtfDirection> = directions.collect();
    all.sort_by_key(|d| (d.theta_deg, d.phi_deg));
    all.dedup();
    all
}

/// The file of each pair, (view, light).
fn grid<'a>(
    pictures: &'a [Picture],
    views: &[BtfDirection],
    lights: &[BtfDirection],
) -> Result<Vec<Option<&'a Path>>, CaptureError> {
    let number = |all: &[BtfDirection]| -> BTreeMap<(u16, u16), usize> {
        all.iter().enumerate().map(|(i, d)| ((d.theta_deg, d.phi_deg), i)).collect()
    };
    let (view_number, light_number) = (number(views), number(lights));
    let mut grid = vec![None; views.len() * lights.len()];
    for p in pictures {
        let view = view_number[&(p.view.theta_deg, p.view.phi_deg)];
        let light = light_number[&(p.light.theta_deg, p.light.phi_deg)];
        let place = &mut grid[view * lights.len() + light];
        if let Some(other) = place.replace(p.path.as_path()) {
            let fault = format!("it shows the same view and light as {}", other.display());
            return Err(CaptureError::invalid(&p.path, fault, "leave one of the two"));
        }
    }
    Ok(grid)
}
