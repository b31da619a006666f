//! Who may import whom: the table of `docs/architecture.md`, held against the manifests.

use std::path::Path;

/// Every crate of ours, and the crates of ours it may name.
const ALLOWED: [(&str, &[&str]); 8] = [
    ("capture", &[]),
    ("geometry", &["capture"]),
    ("texture", &["capture", "geometry"]),
    ("render", &["capture", "geometry", "texture"]),
    ("data-synth", &["capture", "geometry"]),
    ("turnlight", &["capture", "geometry", "texture", "render", "data-synth"]),
    ("tests", &["capture", "geometry", "texture", "render", "data-synth", "turnlight"]),
    (".ci/xtask", &[]),
];

/// Crates from outside that only one of ours may name: `(theirs, ours)`.
const HELD: [(&str, &str); 8] = [
    ("clap", "turnlight"),
    ("egui", "render"),
    ("egui-wgpu", "render"),
    ("egui-winit", "render"),
    ("indicatif", "turnlight"),
    ("opencv", "capture"),
    ("wgpu", "render"),
    ("winit", "render"),
];

/// Names of the dependencies in a manifest, in every table whose name ends in `dependencies`.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut in_dependencies = false;
    for line in manifest.lines().map(str::trim) {
        if let Some(table) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            in_dependencies = table.ends_with("dependencies");
            // [dependencies.name] is a dependency of its own.
            if let Some((parent, name)) = table.rsplit_once('.').filter(|(parent, _)| parent.ends_with("dependencies"))
            {
                assert!(!parent.is_empty());
                names.push(name.to_owned());
            }
        } else if in_dependencies && !line.starts_with('#') && !line.is_empty() {
            let name = line.split(['.', '=', ' ']).next().unwrap_or_default();
            names.push(name.trim_matches('"').to_owned());
        }
    }
    names
}

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn manifest(folder: &str) -> String {
    let path = root().join(folder).join("Cargo.toml");
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn no_arrow_points_the_wrong_way() {
    let ours: Vec<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    for (name, allowed) in ALLOWED {
        for dependency in dependencies(&manifest(name)) {
            let is_ours = ours.contains(&dependency.as_str());
            assert!(!is_ours || allowed.contains(&dependency.as_str()), "{name} may not import {dependency}");
            let holder = HELD.iter().find(|(theirs, _)| *theirs == dependency);
            assert!(holder.is_none_or(|(_, holder)| *holder == name), "{name} may not import {dependency}");
        }
    }
}

#[test]
fn every_member_is_in_the_table() {
    let workspace = manifest(".");
    let members = workspace.lines().find_map(|line| line.strip_prefix("members = [")).expect("a list of members");
    let members: Vec<&str> = members.trim_end_matches(']').split(", ").map(|m| m.trim_matches('"')).collect();
    let mut known: Vec<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    known.sort_unstable();
    let mut listed = members.clone();
    listed.sort_unstable();
    assert_eq!(listed, known);
}

#[test]
fn a_wrong_arrow_would_be_seen() {
    let manifest = "[dependencies]\nrender.workspace = true\n[dev-dependencies]\n\"texture\" = { path = \"x\" }\n\
        [target.'cfg(unix)'.dependencies]\nturnlight = \"1\"\n[dependencies.capture]\npath = \"y\"\n[lints]\nworkspace = true\n";
    assert_eq!(dependencies(manifest), ["render", "texture", "turnlight", "capture"]);
}
