//! A model with its player, as files that any static server serves.

use crate::Error;
use crate::output::OutputFolder;
use render::web::{FILES, MODEL, MODEL_MEDIA_TYPE};
use std::borrow::Cow;

/// One file of a site.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiteFile {
    /// Where it lies, with `/` between parts.
    pub path: &'static str,
    /// What a server says it is.
    pub media_type: &'static str,
    /// What it holds.
    pub bytes: Cow<'static, [u8]>,
}

/// The files of a model's player.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Site {
    /// All of them; no path twice.
    pub files: Vec<SiteFile>,
}

impl Site {
    /// The player around `model`, the bytes of a `.glb`. They are not looked at: the page refuses by itself what is
    /// no model.
    pub fn new(model: Vec<u8>) -> Self {
        let player = FILES.iter().map(|file| SiteFile {
            path: file.path,
            media_type: file.media_type,
            bytes: Cow::Borrowed(file.bytes),
        });
        let model = SiteFile { path: MODEL, media_type: MODEL_MEDIA_TYPE, bytes: Cow::Owned(model) };
        Self { files: player.chain([model]).collect() }
    }

    /// Writes every file below `folder`.
    ///
    /// # Errors
    /// Names the file and what the system said.
    pub fn write(&self, folder: &OutputFolder) -> Result<(), Error> {
        self.files.iter().try_for_each(|file| folder.write(file.path, &file.bytes))
    }
}
