//! The player of the browser: a page, a plugin for three.js' glTF loader, and three.js itself.
//!
//! `render/web` holds the files; here they are part of the program, so that an exported folder needs
//! nothing else. [`MODEL`] is the name under which the page looks for its model.

/// A file of the player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WebFile {
    /// Where it lies in the folder, with `/` between parts.
    pub path: &'static str,
    /// What a server says it is.
    pub media_type: &'static str,
    /// What it holds.
    pub bytes: &'static [u8],
}

/// The page itself.
pub const PAGE: &str = "index.html";

/// Where the page looks for its model.
pub const MODEL: &str = "model.glb";

/// What a server says a model is.
pub const MODEL_MEDIA_TYPE: &str = "model/gltf-binary";

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The player without a model.
pub const FILES: [WebFile; 6] = [
    WebFile { path: PAGE, media_type: "text/html; charset=utf-8", bytes: include_bytes!("../web/index.html") },
    WebFile { path: "style.css", media_type: "text/css; charset=utf-8", bytes: include_bytes!("../web/style.css") },
    WebFile { path: "player.js", media_type: SCRIPT, bytes: include_bytes!("../web/player.js") },
    WebFile { path: "turnlight-loader.js", media_type: SCRIPT, bytes: include_bytes!("../web/turnlight-loader.js") },
    WebFile { path: "vendor/three.min.js", media_type: SCRIPT, bytes: include_bytes!("../web/vendor/three.min.js") },
    WebFile {
        path: "vendor/LICENSE-three.txt",
        media_type: "text/plain; charset=utf-8",
        bytes: include_bytes!("../web/vendor/LICENSE-three.txt"),
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    fn text(path: &str) -> &'static str {
        let file = FILES.iter().find(|file| file.path == path).unwrap();
        std::str::from_utf8(file.bytes).unwrap()
    }

    #[test]
    fn every_import_of_the_page_is_in_its_folder() {
        for file in FILES.iter().filter(|file| file.media_type == SCRIPT && !file.path.starts_with("vendor/")) {
            for line in
                text(file.path).lines().filter(|line| line.starts_with("import ") || line.starts_with("} from "))
            {
                let Some((_, rest)) = line.split_once(" from '") else { continue };
                let name = rest.trim_end_matches("';");
                let is_here = name.strip_prefix("./").is_some_and(|path| FILES.iter().any(|file| file.path == path));
                assert!(is_here || text("index.html").contains(&format!("\"{name}\"")), "{name} in {}", file.path);
            }
        }
    }

    #[test]
    fn the_page_allows_no_foreign_address_and_names_its_model() {
        let page = text("index.html");
        assert!(page.contains("default-src 'none'"));
        assert!(!page.contains("://"), "an address in the page");
        assert!(text("player.js").contains(&format!("const MODEL = '{MODEL}'")));
        for path in ["player.js", "turnlight-loader.js"] {
            assert!(!text(path).contains("://"), "an address in {path}");
        }
    }
}
