//! Model files: what is read is what was written, and no bytes do harm.

#![allow(clippy::unwrap_used, reason = "tests")]

mod support;

use capture::btf::{Btf, Encoding};
use gltf::binary::Glb;
use nalgebra::Vector3;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::f32::consts::PI;
use std::path::Path;
use std::sync::LazyLock;
use support::{all_around, ball, cast_cube, cube, film, fit, glossy, ring, usual};
use texture::btf::multilevel_vq::Variant;
use texture::btf::{self, Budget, CodecKind, Precision};
use texture::{EXTENSION, MaterialLayer, Method, Model};

/// A small file of each method, in the order of `Method::ALL`, and one with materials.
static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let views = film(&all_around(), cast_cube, glossy);
    let plain = Method::ALL.into_iter().map(|method| fit(&views, &cube(), method, &usual()).0.to_glb().unwrap());
    let mut coated = fit(&views, &cube(), Method::DynTex, &usual()).0;
    coated.lay(vec![paint(&[3, 1], [0.8, 0.2, 0.1]), paint(&[5], [0.1, 0.2, 0.8])]).unwrap();
    plain.chain([coated.to_glb().unwrap()]).collect()
});

const COATED: usize = Method::ALL.len();

/// Matt paint on charts, measured under few directions.
fn paint(charts: &[u32], albedo: [f32; 3]) -> MaterialLayer {
    let polar = |k: usize| Vector3::new((0.3 * k as f64).sin(), 0.0, (0.3 * k as f64).cos());
    let directions: Vec<_> = (0..4).map(polar).collect();
    let lit = |light: &Vector3<f64>| albedo.map(|a| a * light.z as f32).repeat(2 * 3);
    let btf = Btf {
        name: "paint".to_owned(),
        samples: directions.iter().flat_map(|_| directions.iter().flat_map(lit)).collect(),
        views: directions.clone(),
        lights: directions,
        width: 2,
        height: 3,
        encoding: Encoding::Linear,
        exposure: PI,
        includes_cosine: true,
        texel_pitch_mm: None,
        measured: Vec::new(),
    };
    let btf = btf.encoded(Encoding::Srgb);
    let (codec, budget) = (CodecKind::Ptm, Budget::Standard);
    let options = btf::FitOptions { codec, budget, precision: Precision::Full, seed: 1, books: Variant::default() };
    let (bytes, _) = btf::fit(btf, &options).unwrap().0.to_bytes();
    MaterialLayer::new(charts.to_vec(), 0.5, bytes).unwrap()
}

fn read(bytes: &[u8]) -> Result<Model, String> {
    Model::from_glb(bytes, Path::new("model.glb")).map_err(|fault| fault.to_string())
}

fn file(method: Method) -> &'static [u8] {
    &FILES[Method::ALL.iter().position(|&m| m == method).unwrap()]
}

/// The file with its JSON changed.
fn with_json(bytes: &[u8], change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut glb = Glb::from_slice(bytes).unwrap();
    let mut root: Value = serde_json::from_slice(&glb.json).unwrap();
    change(&mut root);
    glb.json = Cow::Owned(serde_json::to_vec(&root).unwrap());
    glb.to_vec().unwrap()
}

fn extension(root: &mut Value) -> &mut Value {
    &mut root["materials"][0]["extensions"][EXTENSION]
}

#[track_caller]
fn assert_refused(bytes: &[u8], part: &str) {
    let fault = read(bytes).expect_err("a broken file was read");
    assert!(fault.starts_with("model.glb: ") && fault.contains(part), "{fault}");
}

#[test]
fn writing_what_was_read_gives_the_same_bytes() {
    // A ring and a general layout; a ball, whose facets look in all directions.
    let ring_files = Method::ALL.map(|m| {
        let views = film(&ring(11, 17.0), cast_cube, glossy);
        fit(&views, &ball(), m, &usual()).0.to_glb().unwrap()
    });
    for bytes in FILES.iter().chain(&ring_files) {
        let model = read(bytes).unwrap();
        assert!(model.to_glb().unwrap() == *bytes, "{:?}", model.method);
    }
}

#[test]
fn a_stored_model_looks_like_the_one_fitted() {
    let views = film(&all_around(), cast_cube, glossy);
    for method in Method::ALL {
        let (fitted, _) = fit(&views, &cube(), method, &usual());
        let stored = read(&fitted.to_glb().unwrap()).unwrap();
        for eye in [all_around()[4], [2.0, 3.0, 2.0].into(), [-4.0, 1.0, -1.0].into()] {
            let (a, b) = (fitted.atlas(&eye), stored.atlas(&eye));
            let differences = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
            let largest = differences.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(largest < 0.5, "{method:?}: {largest}");
        }
    }
}

#[test]
fn a_header_that_is_cut_off_or_lies_is_refused() {
    let bytes = file(Method::Static);
    for end in 0..40 {
        assert!(read(&bytes[..end]).is_err(), "{end} bytes");
    }
    for length in [0u32, 1, 11, 12, u32::MAX] {
        let mut lying = bytes.to_vec();
        lying[8..12].copy_from_slice(&length.to_le_bytes());
        // What lies after a header that stops early is ignored or missed; neither may panic.
        let _ = read(&lying);
    }
    assert_refused(&[&bytes[..8], &5u32.to_le_bytes(), &bytes[12..]].concat(), "header");
}

#[test]
fn a_small_file_cannot_ask_for_much_memory() {
    let huge = json!([32_768, 32_768]);
    let lumigraph = with_json(file(Method::Lumigraph), |root| extension(root)["atlasSize"] = huge.clone());
    assert_refused(&lumigraph, "an atlas of");
    let no_rays = with_json(file(Method::Lumigraph), |root| {
        extension(root)["atlasSize"] = json!([8192, 8192]);
        extension(root)["rays"] = json!([]);
    });
    assert_refused(&no_rays, "no rays");
    let larger = with_json(file(Method::Lumigraph), |root| extension(root)["atlasSize"] = json!([8192, 8192]));
    assert_refused(&larger, "declared");
    let repeated = with_json(file(Method::DynTex), |root| {
        let layer = extension(root)["layers"][0].clone();
        extension(root)["layers"] = Value::Array(vec![layer; 10_000]);
    });
    assert_refused(&repeated, "share images");
    let many = with_json(file(Method::DynTex), |root| root["accessors"][3]["count"] = json!(u64::MAX / 2));
    assert_refused(&many, "more elements");
}

#[test]
fn parts_that_contradict_each_other_are_refused() {
    let change = |key: &str, value: Value| with_json(file(Method::DynTex), |root| extension(root)[key] = value);
    assert_refused(&change("version", json!(2)), "version 2");
    assert_refused(&change("method", json!("best")), "best");
    assert_refused(&change("layers", json!([])), "no layers");
    assert_refused(&change("coefficientScales", json!([1.0])), "coefficient scales");
    assert_refused(&change("directions", json!(null)), "directions");
    assert_refused(&change("ringAxis", json!([5.0, 0.0, 0.0])), "unsound");
    assert_refused(&change("facetMap", json!(9999)), "missing");
    let elsewhere = with_json(file(Method::DynTex), |root| root["bufferViews"][0]["buffer"] = json!(1));
    assert_refused(&elsewhere, "another buffer");
    let interleaved = with_json(file(Method::DynTex), |root| root["bufferViews"][0]["byteStride"] = json!(24));
    assert_refused(&interleaved, "interleaved");
}

#[test]
fn offsets_of_accessors_are_heeded() {
    // Positions moved to the end of a longer view, as an exporter that packs buffers leaves them.
    let bytes = file(Method::Static);
    let packed = with_json(bytes, |root| {
        let view = root["accessors"][1]["bufferView"].as_u64().unwrap() as usize;
        let start = root["bufferViews"][view]["byteOffset"].take();
        let length = root["bufferViews"][view]["byteLength"].as_u64().unwrap();
        root["bufferViews"][view]["byteOffset"] = json!(0);
        root["bufferViews"][view]["byteLength"] = json!(start.as_u64().unwrap() + length);
        root["accessors"][1]["byteOffset"] = start;
    });
    assert_eq!(read(&packed).unwrap().mesh, read(bytes).unwrap().mesh);
    let beyond = with_json(bytes, |root| root["accessors"][1]["byteOffset"] = json!(1u64 << 40));
    assert_refused(&beyond, "past the end");
}

#[test]
fn materials_come_back_and_show_in_plain_viewers() {
    let model = read(&FILES[COATED]).unwrap();
    let laid: Vec<_> = model.materials.iter().map(|layer| (layer.charts.clone(), layer.tile_size)).collect();
    assert_eq!(laid, [(vec![1, 3], 0.5), (vec![5], 0.5)]);
    let sizes = model.bytes().unwrap();
    let plain = read(file(Method::DynTex)).unwrap().bytes().unwrap();
    assert_eq!(sizes.materials, model.materials.iter().map(|layer| layer.coded.len() as u64).sum::<u64>());
    assert_eq!((plain.materials, plain.appearance), (0, sizes.appearance));
    // The preview: white light from above on matt paint is its albedo, in sRGB.
    let glb = Glb::from_slice(&FILES[COATED]).unwrap();
    let root: Value = serde_json::from_slice(&glb.json).unwrap();
    let image = &root["images"][root["textures"][0]["source"].as_u64().unwrap() as usize]["bufferView"];
    let view = &root["bufferViews"][image.as_u64().unwrap() as usize];
    let number = |key: &str| view[key].as_u64().unwrap() as usize;
    let coded = &glb.bin.as_ref().unwrap()[number("byteOffset")..][..number("byteLength")];
    let preview = image::load_from_memory(coded).unwrap().into_rgb8();
    // Charts stand three in a row, 32 texels each, by faces in the same order.
    for (chart, albedo) in [(1, [0.8, 0.2, 0.1]), (3, [0.8, 0.2, 0.1]), (5, [0.1, 0.2, 0.8])] {
        let found = preview.get_pixel(32 * (chart % 3) + 16, 32 * (chart / 3) + 16).0;
        let expected = albedo.map(|a| 255.0 * Encoding::Srgb.encode(a));
        assert!((0..3).all(|c| (f32::from(found[c]) - expected[c]).abs() < 8.0), "{chart}: {found:?} {expected:?}");
    }
}

#[test]
fn materials_that_make_no_sense_are_refused() {
    let change = |at: &str, value: Value| {
        with_json(&FILES[COATED], |root| *extension(root)["materials"].pointer_mut(at).unwrap() = value)
    };
    assert_refused(&change("/0/charts", json!([6])), "chart 6");
    assert_refused(&change("/0/charts", json!([5])), "two materials");
    assert_refused(&change("/0/charts", json!([])), "no chart");
    assert_refused(&change("/0/charts", json!([-1])), "parse");
    assert_refused(&change("/0/tileSize", json!(0.0)), "measures 0");
    assert_refused(&change("/1/tileSize", json!(-2.0)), "measures -2");
    assert_refused(&change("/0/bufferView", json!(0)), "no .btfz");
    assert_refused(&change("/0/bufferView", json!(99_999)), "missing");
    let repeated = with_json(&FILES[COATED], |root| {
        let layer = extension(root)["materials"][0].clone();
        extension(root)["materials"] = Value::Array(vec![layer; 10_000]);
    });
    assert_refused(&repeated, "share bytes");
    let mut model = read(file(Method::Static)).unwrap();
    assert!(model.lay(vec![paint(&[17], [0.5; 3])]).is_err());
    assert!(MaterialLayer::new(vec![0], f64::NAN, Vec::new()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn no_change_of_a_byte_panics(
        file in 0..=COATED,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
        is_cut: bool,
    ) {
        let mut bytes = FILES[file].clone();
        changes.iter().for_each(|(at, value)| *at.get_mut(&mut bytes) = *value);
        let end = if is_cut { end.index(bytes.len()) } else { bytes.len() };
        if let Ok(model) = read(&bytes[..end]) {
            let _ = model.atlas(&[3.0, 1.0, 2.0].into());
            let _ = model.to_glb();
        }
    }

    #[test]
    fn no_number_in_the_json_panics(
        file in 0..=COATED,
        at in any::<prop::sample::Index>(),
        value in prop_oneof![Just(json!(0)), Just(json!(-1)), Just(json!(1)), Just(json!(65_535)), Just(json!(1e300)),
            Just(json!(u64::MAX)), Just(Value::Null), Just(json!([])), (0..300u64).prop_map(|v| json!(v))],
    ) {
        let bytes = with_json(&FILES[file], |root| {
            let mut numbers = Vec::new();
            leaves(root, String::new(), &mut numbers);
            let chosen: &String = at.get(&numbers);
            *root.pointer_mut(chosen).unwrap() = value;
        });
        if let Ok(model) = read(&bytes) {
            let _ = model.atlas(&[3.0, 1.0, 2.0].into());
            let _ = model.to_glb();
        }
    }
}

/// JSON pointers to everything that is no object or array.
fn leaves(value: &Value, at: String, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, v)| leaves(v, format!("{at}/{key}"), found)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| leaves(v, format!("{at}/{i}"), found)),
        _ => found.push(at),
    }
}
