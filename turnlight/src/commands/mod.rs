//! One file per command: read, call the library, answer.

pub(crate) mod bench;
pub(crate) mod board;
pub(crate) mod btf;
mod btf_render;
pub(crate) mod capture;
pub(crate) mod compare;
pub(crate) mod demo;
pub(crate) mod export;
pub(crate) mod hull;
pub(crate) mod import;
pub(crate) mod info;
mod light;
mod material;
pub(crate) mod model;
pub(crate) mod render;
pub(crate) mod synth;
mod synth_film;
pub(crate) mod turntable;
pub(crate) mod view;

use crate::arguments::{CaptureArgs, FitArgs, MeshArgs, MethodArg, PageArgs, RendererArg, ShapeArgs};
use std::path::Path;
use turnlight::capture::{Capture, LoadOptions, MaskSource, View};
use turnlight::export::web::Site;
use turnlight::pipeline::ShapeOptions;
use turnlight::projector::Choice;
use turnlight::stages::Stages;
use turnlight::texture::{FitOptions, Method};
use turnlight::{Error, Selection};

impl From<MethodArg> for Method {
    fn from(method: MethodArg) -> Self {
        match method {
            MethodArg::Dyntex => Self::DynTex,
            MethodArg::Static => Self::Static,
            MethodArg::Vdtm => Self::Vdtm,
            MethodArg::Lumigraph => Self::Lumigraph,
        }
    }
}

impl ShapeArgs {
    fn options(&self) -> ShapeOptions {
        ShapeOptions { resolution: self.resolution.0, consensus: self.consensus.0, grow_px: self.grow.0, mesh: None }
    }
}

impl MeshArgs {
    fn options(&self) -> ShapeOptions {
        ShapeOptions { mesh: self.mesh.clone(), ..self.shape.options() }
    }
}

impl FitArgs {
    fn options(&self) -> FitOptions {
        let default = FitOptions::default();
        FitOptions {
            layers: self.layers.unwrap_or(default.layers),
            mask_erode_px: self.mask_erode.unwrap_or(default.mask_erode_px),
            ..default
        }
    }
}

impl CaptureArgs {
    fn read(&self) -> Result<Capture, Error> {
        read_capture(&self.capture, self.load.ignore_masks)
    }

    fn load_options(&self) -> LoadOptions {
        LoadOptions { downscale: self.load.downscale }
    }

    /// Reads the capture and loads the views chosen.
    fn load(&self, views: &Selection, stages: &mut Stages<'_>) -> Result<(Capture, Vec<View>), Error> {
        let capture = self.read()?;
        stages.observer().noted(&capture.mask_source.to_string());
        let positions = views.positions(capture.frames.len())?;
        let views = stages.run("load", |_| capture.load_views(&positions, &self.load_options()))?;
        Ok((capture, views))
    }
}

fn read_capture(path: &Path, ignore_masks: bool) -> Result<Capture, Error> {
    let capture = Capture::read(path)?;
    Ok(if ignore_masks { capture.without_masks() } else { capture })
}

/// Writes a capture; silhouettes that no mask gives are found once and kept, so that they can be looked at and mended.
fn write_capture(capture: &Capture, output: &Path, stages: &mut Stages<'_>) -> Result<(), Error> {
    if capture.mask_source != MaskSource::Automatic {
        return Ok(stages.run("write", |_| capture.write(output))?);
    }
    let views = stages.run("find silhouettes", |_| capture.load_all_views(&LoadOptions::default()))?;
    let mattes: Vec<_> = views.into_iter().map(|view| view.matte).collect();
    Ok(stages.run("write", |_| capture.write_with_mattes(&mattes, output))?)
}

fn choice(renderer: RendererArg) -> Choice {
    match renderer {
        RendererArg::Auto => Choice::Auto,
        RendererArg::Cpu => Choice::Cpu,
        RendererArg::Gpu => Choice::Gpu,
    }
}

impl PageArgs {
    /// The player around a model's bytes.
    fn site(&self, model: Vec<u8>) -> Site {
        let site = Site::new(model);
        match &self.up {
            Some(axis) => site.with_up(axis),
            None => site,
        }
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>, Error> {
    std::fs::read(path).map_err(|fault| Error::Failed(format!("{}: {fault}; check the path", path.display())))
}

/// Refuses an output whose extension asks for something else, before any work is done.
fn check_extension(path: &Path, known: &[&str]) -> Result<(), Error> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if known.contains(&extension.as_str()) {
        return Ok(());
    }
    let names: Vec<String> = known.iter().map(|name| format!(".{name}")).collect();
    Err(Error::Arguments(format!("{}: cannot write this kind of file; use {}", path.display(), names.join(" "))))
}
