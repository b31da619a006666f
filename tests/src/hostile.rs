//! Files that no player may show: a good model, broken in one place each.

use serde_json::{Value, json};

/// A broken file.
#[derive(Clone, Debug)]
pub struct Hostile {
    /// What was done to it.
    pub name: &'static str,
    /// What every player's refusal says.
    pub word: &'static str,
    /// The file.
    pub bytes: Vec<u8>,
}

/// `model`, which must have layers, broken in every way.
///
/// # Panics
/// Where it is no such model.
pub fn hostile(model: &[u8]) -> Vec<Hostile> {
    let cut = [
        ("cut in half", "cut off", model[..model.len() / 2].to_vec()),
        ("a byte short", "cut off", model[..model.len() - 1].to_vec()),
        ("empty", "cut off", Vec::new()),
        ("text", "no binary glTF", b"<html>a page that a server sends for every path</html>".to_vec()),
    ];
    let changed = CHANGES.map(|(name, word, change)| {
        let (mut root, mut body) = split(model);
        change(&mut root, &mut body);
        (name, word, joined(&root, &body))
    });
    cut.into_iter().chain(changed).map(|(name, word, bytes)| Hostile { name, word, bytes }).collect()
}

/// A model one chart of which has two materials, for players that know them.
///
/// # Panics
/// Where `model` is none.
pub fn coated_twice(model: &[u8]) -> Hostile {
    let (mut root, body) = split(model);
    let extension = root.pointer_mut(EXTENSION).unwrap_or_else(|| panic!("no extension"));
    extension["materials"] = json!([{"charts": [0]}, {"charts": [1, 0]}]);
    Hostile { name: "coated twice", word: "two materials lie on chart 0", bytes: joined(&root, &body) }
}

/// A model taken apart: the JSON and the binary chunk.
fn split(glb: &[u8]) -> (Value, Vec<u8>) {
    let length = glb.get(12..16).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes) as usize;
    (serde_json::from_slice(&glb[20..20 + length]).unwrap_or_else(|e| panic!("{e}")), glb[28 + length..].to_vec())
}

fn joined(root: &Value, body: &[u8]) -> Vec<u8> {
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let head = [b"glTF".as_slice(), &word(2), &word(28 + text.len() + body.len()), &word(text.len()), b"JSON"].concat();
    [head, text, word(body.len()).to_vec(), b"BIN\0".to_vec(), body.to_vec()].concat()
}

/// Where the data of an accessor or an image of the model's extension begins in the binary chunk.
fn place_of(root: &Value, kind: &str, index: &Value) -> usize {
    let index = index.as_u64().unwrap_or_else(|| panic!("no index in {kind}")) as usize;
    let view = root[kind][index]["bufferView"].as_u64().unwrap_or_else(|| panic!("no view of {kind}")) as usize;
    root["bufferViews"][view]["byteOffset"].as_u64().unwrap_or_else(|| panic!("no place of {kind}")) as usize
}

type Change = fn(&mut Value, &mut Vec<u8>);

const EXTENSION: &str = "/materials/0/extensions/TURNLIGHT_view_dependent_texture";

fn set(root: &mut Value, path: &str, value: Value) {
    let path = path.replace('$', EXTENSION);
    *root.pointer_mut(&path).unwrap_or_else(|| panic!("no {path}")) = value;
}

fn get(root: &Value, path: &str) -> Value {
    root.pointer(&path.replace('$', EXTENSION)).unwrap_or_else(|| panic!("no {path}")).clone()
}

/// What is done to a model, and a word of the refusal.
const CHANGES: [(&str, &str, Change); 13] = [
    ("count", "more elements", |root, _| {
        let facets = get(root, "$/facets");
        set(root, &format!("/accessors/{facets}/count"), json!(1_000_000_000));
    }),
    ("fewer coefficients", "more coefficients", |root, _| {
        let path = format!("/accessors/{}/count", get(root, "$/coefficients"));
        let count = get(root, &path).as_u64().unwrap_or_else(|| panic!("no number at {path}"));
        set(root, &path, json!(count - 1));
    }),
    ("NaN centre", "no number", |root, body| {
        let at = place_of(root, "accessors", &get(root, "$/facetCenters"));
        body[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    }),
    ("infinite scale", "no number", |root, _| set(root, "$/layers/1/scale", Value::Null)),
    ("coefficient scale", "coefficient scales", |root, _| set(root, "$/coefficientScales/0", json!("NaN"))),
    ("huge atlas", "atlas", |root, _| set(root, "$/atlasSize", json!([65536, 65536]))),
    ("huge image", "65535×65535", |root, body| {
        let at = place_of(root, "images", &get(root, "$/facetMap"));
        // Width and height in the header of a PNG.
        body[at + 16..at + 24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
    }),
    ("rotten image", "decompress", |root, body| {
        let at = place_of(root, "images", &get(root, "$/facetMap"));
        body[at + 60..at + 90].fill(0xff);
    }),
    ("vertex", "names vertex", |root, body| {
        let at = place_of(root, "accessors", &get(root, "/meshes/0/primitives/0/indices"));
        body[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    }),
    ("site", "unsound", |root, body| {
        let at = place_of(root, "accessors", &get(root, "$/edges"));
        body[at..at + 2].copy_from_slice(&u16::MAX.to_le_bytes());
    }),
    ("image elsewhere", "outside the file", |root, _| {
        let image = get(root, "$/layers/1/image");
        set(root, &format!("/images/{image}"), json!({"uri": "http://127.0.0.1:9/spy.png"}));
    }),
    ("buffer elsewhere", "outside the file", |root, _| {
        root["buffers"][0]["uri"] = json!("../../../../etc/passwd");
    }),
    ("version", "version 2", |root, _| set(root, "$/version", json!(2))),
];
