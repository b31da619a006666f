//! A model with its player, as files that any static server serves.

use crate::Error;
use crate::output::OutputFolder;
use render::web::{FILES, MODEL, MODEL_MEDIA_TYPE, PAGE};
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

/// Axes that may point up, as the page names them.
pub const AXES: [&str; 6] = ["x", "y", "z", "-x", "-y", "-z"];

/// Where the page says which axis that is.
const UP: &str = "<body data-up=\"\">";

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

    /// The same with `axis`, one of [`AXES`], pointing up in the page; what is none of them is left to the page.
    pub fn with_up(mut self, axis: &str) -> Self {
        let told = format!("<body data-up=\"{axis}\">");
        for file in self.files.iter_mut().filter(|file| file.path == PAGE && AXES.contains(&axis)) {
            file.bytes = Cow::Owned(String::from_utf8_lossy(&file.bytes).replace(UP, &told).into_bytes());
        }
        self
    }

    /// Writes every file below `folder`.
    ///
    /// # Errors
    /// Names the file and what the system said.
    pub fn write(&self, folder: &OutputFolder) -> Result<(), Error> {
        self.files.iter().try_for_each(|file| folder.write(file.path, &file.bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(site: &Site) -> String {
        let file = site.files.iter().find(|file| file.path == PAGE).unwrap();
        String::from_utf8(file.bytes.to_vec()).unwrap()
    }

    #[test]
    fn the_page_is_told_which_axis_points_up() {
        let site = Site::new(Vec::new());
        assert!(page(&site.clone().with_up("-y")).contains("data-up=\"-y\""));
        assert_eq!(site.clone().with_up("\"><script>"), site, "no axis, nothing said");
    }

    #[test]
    fn no_path_leads_out_of_the_folder_or_comes_twice() {
        let mut paths: Vec<&str> = Site::new(Vec::new()).files.iter().map(|file| file.path).collect();
        assert!(paths.iter().all(|path| !path.starts_with('/') && !path.contains("..")));
        paths.sort_unstable();
        assert!(paths.windows(2).all(|pair| pair[0] != pair[1]), "{paths:?}");
    }
}
