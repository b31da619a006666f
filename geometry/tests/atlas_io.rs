//! Mesh files: round trips, broken files, foreign UVs.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod atlas_shapes;

use atlas_shapes::*;
use geometry::mesh::io::{read_mesh, write_mesh, write_textured_mesh};
use geometry::{GeometryError, UnwrapOptions, unwrap_mesh};
use proptest::prelude::*;

fn read_bytes(extension: &str, bytes: &[u8]) -> Result<geometry::mesh::io::MeshFile, GeometryError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("mesh.{extension}"));
    std::fs::write(&path, bytes).unwrap();
    read_mesh(&path)
}

#[test]
fn meshes_survive_a_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(12, 8);
    for extension in ["ply", "obj", "glb", "PLY"] {
        let path = folder.path().join(format!("mesh.{extension}"));
        write_mesh(&path, &mesh).unwrap();
        let read = read_mesh(&path).unwrap();
        assert_eq!(read.mesh.faces.len(), mesh.faces.len(), "{extension}");
        assert_eq!(read.mesh.positions.len(), mesh.positions.len(), "{extension}");
        assert!((read.mesh.signed_volume() / mesh.signed_volume() - 1.0).abs() < 1e-6);
        assert!(read.textured.is_none() && read.uv_fault.is_none());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4, "temporary files are left");
}

#[test]
fn an_atlas_survives_a_round_trip() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(24, 16);
    let atlas = unwrap_mesh(&mesh, &UnwrapOptions::new(texel_size(&mesh, 256))).unwrap();
    for extension in ["ply", "obj", "glb"] {
        let path = folder.path().join(format!("mesh.{extension}"));
        write_textured_mesh(&path, &atlas.mesh).unwrap();
        let read = read_mesh(&path).unwrap();
        assert_eq!(read.uv_fault, None, "{extension}");
        let textured = read.textured.unwrap();
        assert_eq!(textured.face_charts.iter().max(), atlas.mesh.face_charts.iter().max());
        let uv = |t: &geometry::TexturedMesh, f: usize| t.mesh.faces[f].map(|v| t.uvs[v as usize]);
        for f in 0..mesh.faces.len() {
            let (a, b) = (uv(&textured, f), uv(&atlas.mesh, f));
            assert!((0..3).all(|k| (a[k] - b[k]).norm() < 1e-6), "{extension}");
        }
        if extension != "obj" {
            assert_eq!(read.mesh.positions.len(), mesh.positions.len(), "{extension}: not welded");
        }
    }
}

#[test]
fn ascii_ply_with_polygons_is_read() {
    let text = "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nproperty uchar red\nelement face 1\nproperty list uchar int vertex_index\nend_header\n\
        0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n";
    let read = read_bytes("ply", text.as_bytes()).unwrap();
    assert_eq!(read.mesh.faces, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn broken_files_are_named_with_a_remedy() {
    let head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_index\nend_header\n";
    let cases = [
        ("ply", String::new(), "header"),
        ("ply", "plx\n".to_owned(), "ply"),
        ("ply", head.to_owned(), "vertex 0 of 3"),
        ("ply", format!("{head}0 0 0 1 0 0 0 1"), "vertex 2 of 3"),
        ("ply", format!("{head}0 0 0 1 0 0 0 nan 0 3 0 1 2"), "not finite"),
        ("ply", format!("{head}0 0 0 1 0 0 0 1 0 3 0 1 7"), "beyond"),
        ("ply", format!("{head}0 0 0 1 0 0 0 1 0 3 0 1 -1"), "index"),
        ("ply", format!("{head}0 0 0 1 0 0 0 1 0 2 0 1"), "no faces"),
        ("obj", "v 0 0 0\nf 1 2 3\n".to_owned(), "OBJ"),
        ("obj", "v 0 0 0\n".to_owned(), "no faces"),
        ("obj", "v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_owned(), "not finite"),
        ("glb", "glTF".to_owned(), "header"),
        ("glb", "glTF\u{2}\0\0\0\u{5}\0\0\0".to_owned(), "header"),
        ("glb", "no".to_owned(), "glTF"),
        ("stl", "solid".to_owned(), "known kind"),
    ];
    for (extension, text, expected) in cases {
        let message = read_bytes(extension, text.as_bytes()).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("mesh."), "{message}");
        assert!(message.contains("; "), "no remedy: {message}");
    }
}

#[test]
fn a_glb_whose_positions_are_missing_is_refused() {
    let json = r#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":7}}]}]}  "#;
    let chunk = [&(json.len() as u32).to_le_bytes()[..], b"JSON", json.as_bytes()].concat();
    let bytes = [b"glTF", &2u32.to_le_bytes()[..], &(12 + chunk.len() as u32).to_le_bytes(), &chunk].concat();
    let message = read_bytes("glb", &bytes).unwrap_err().to_string();
    assert!(message.contains("accessor 7 is missing"), "{message}");
}

#[test]
fn overlapping_uvs_are_not_used() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 2/1 4/2 3/3\n";
    let read = read_bytes("obj", text.as_bytes()).unwrap();
    assert!(read.textured.is_none());
    assert!(read.uv_fault.unwrap().contains("two places"));
}

fn whole_files() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let mesh = cube(1);
    let atlas = unwrap_mesh(&mesh, &UnwrapOptions::new(0.1)).unwrap();
    ["ply", "obj", "glb"]
        .into_iter()
        .map(|extension| {
            let path = folder.path().join(format!("mesh.{extension}"));
            write_textured_mesh(&path, &atlas.mesh).unwrap();
            (extension, std::fs::read(&path).unwrap())
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Any file with some bytes changed and its end cut off gives a mesh or an error.
    #[test]
    fn no_bytes_make_the_readers_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        for (extension, mut bytes) in whole_files() {
            for (place, byte) in &changes {
                let place = place.index(bytes.len());
                bytes[place] = *byte;
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            let _ = read_bytes(extension, &bytes);
        }
    }

    #[test]
    fn noise_makes_no_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for (extension, head) in [("ply", &b"ply\nformat ascii 1.0\n"[..]), ("obj", b""), ("glb", b"glTF\x02\0\0\0")] {
            let _ = read_bytes(extension, &[head, &bytes].concat());
        }
    }
}
