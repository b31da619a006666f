//! Models against the Khronos glTF validator. `cargo xtask test` installs it and says where it is;
//! without it the test skips, saying so.

use serde_json::Value;
use std::process::Command;

/// Prints the validator's issues of the file in `argv[2]`, with the module in `argv[1]`.
const SCRIPT: &str = "const validator = require(process.argv[1]);
const bytes = new Uint8Array(require('fs').readFileSync(process.argv[2]));
validator.validateBytes(bytes).then(report => console.log(JSON.stringify(report.issues)));";

/// Warnings that a vendor's extension cannot avoid.
const EXPECTED: [&str; 2] = ["UNSUPPORTED_EXTENSION", "MULTIPLE_EXTENSIONS"];

#[test]
fn every_model_is_valid_gltf() {
    let Some(module) = std::env::var_os("TURNLIGHT_GLTF_VALIDATOR") else {
        eprintln!("skipped: TURNLIGHT_GLTF_VALIDATOR does not say where the validator is; run `cargo xtask test`");
        return;
    };
    let place = tempfile::tempdir().expect("a folder");
    tests::small_capture(place.path(), 8);
    let hull = tests::turnlight(place.path(), &["hull", "capture", "-o", "hull.glb", "--quiet"]);
    assert_eq!(hull.code, Some(0), "{}", hull.stderr);
    let mut files = vec!["hull.glb".to_owned()];
    for method in ["static", "vdtm", "lumigraph", "dyntex"] {
        let file = format!("{method}.glb");
        let run = tests::turnlight(place.path(), &["model", "capture", "-o", &file, "--method", method, "--quiet"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        files.push(file);
    }
    for file in files {
        let mut node = Command::new("node");
        let output = node.args(["-e", SCRIPT]).arg(&module).arg(place.path().join(&file)).output().expect("node runs");
        assert!(output.status.success(), "{file}: {}", String::from_utf8_lossy(&output.stderr));
        let issues: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        // What every vendor's extension on an unlit material draws: the validator does not know it.
        let messages = issues["messages"].as_array().expect("messages").iter();
        let faults: Vec<&Value> = messages
            .filter(|m| {
                m["severity"].as_i64().is_some_and(|s| s < 2) && !EXPECTED.iter().any(|code| m["code"] == *code)
            })
            .collect();
        assert!(faults.is_empty(), "{file}: {faults:#?}");
        assert_eq!(issues["numErrors"], 0, "{file}");
    }
}
