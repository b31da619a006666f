//! What can go wrong in a run, by whose fault.

use capture::CaptureError;
use texture::TextureError;

/// A fault, in one or two lines: the file, what is wrong with it, what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What was asked for cannot be: a view that is not there, options that exclude each other.
    #[error("{0}")]
    Arguments(String),
    /// The work failed, for a reason found here.
    #[error("{0}")]
    Failed(String),
    /// A capture cannot be read, used or written.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A shape cannot be made, read or written.
    #[error(transparent)]
    Geometry(#[from] geometry::GeometryError),
    /// An appearance cannot be fitted, read or written.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// A model cannot be drawn.
    #[error(transparent)]
    Render(#[from] render::RenderError),
    /// No window can be opened.
    #[cfg(feature = "window")]
    #[error(transparent)]
    Window(#[from] render::window::WindowError),
    /// A synthetic capture cannot be made.
    #[error(transparent)]
    Synth(#[from] data_synth::SynthError),
}

impl Error {
    /// What the process should return: 2 where the arguments are wrong, 1 otherwise.
    pub fn exit_code(&self) -> u8 {
        let is_asked_wrongly = matches!(self, Self::Arguments(_) | Self::Synth(data_synth::SynthError::Option { .. }));
        if is_asked_wrongly { 2 } else { 1 }
    }
}
