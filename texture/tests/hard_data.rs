//! Data that break programs, through every codec: what each answers stands in the table of `docs/btf-codecs.md`, a row a
//! test here.

use capture::btf::{Btf, Encoding, bonn_directions};
use nalgebra::Vector3;
use texture::btf::multilevel_vq::Variant;
use texture::btf::{Answer, Budget, CodecKind, FitOptions, Material, Precision, Score, Synthesized, fit, score};

const SIDE: usize = 6;

/// The zenith, and six directions each 30° and 60° from it.
fn directions() -> Vec<Vector3<f64>> {
    let all = bonn_directions();
    let ring = |first: usize, step: usize| (0..6).map(move |k| first + step * k);
    [0].into_iter().chain(ring(7, 2)).chain(ring(37, 3)).map(|at| all[at]).collect()
}

/// Matt bumps with a little gloss, 0 to 0.9.
fn bumps(x: usize, y: usize, light: &Vector3<f64>, view: &Vector3<f64>) -> [f64; 3] {
    let phase = |at: usize| (at as f64 / SIDE as f64 * std::f64::consts::TAU).sin();
    let normal = Vector3::new(0.2 * phase(x), 0.2 * phase(y), 1.0).normalize();
    let gloss = 0.2 * (light + view).normalize().dot(&normal).max(0.0).powi(12);
    [0.6, 0.5, 0.3].map(|albedo| albedo * light.dot(&normal).max(0.0) + gloss)
}

fn measured(
    [width, height]: [usize; 2],
    [views, lights]: [Vec<Vector3<f64>>; 2],
    shade: impl Fn(usize, usize, &Vector3<f64>, &Vector3<f64>) -> [f64; 3],
) -> Btf {
    let mut samples = Vec::new();
    for view in &views {
        for light in &lights {
            let texel = |at: usize| shade(at % width, at / width, light, view).map(|v| v as f32);
            samples.extend((0..width * height).flat_map(texel));
        }
    }
    Btf {
        name: "hard".into(),
        views,
        lights,
        width,
        height,
        encoding: Encoding::Srgb,
        exposure: 1.0,
        includes_cosine: true,
        texel_pitch_mm: None,
        samples,
        measured: Vec::new(),
    }
}

fn usual() -> Btf {
    measured([SIDE, SIDE], [directions(), directions()], bumps)
}

fn options(codec: CodecKind) -> FitOptions {
    let budget = match codec {
        CodecKind::GaussianMixture => Budget::Components(16),
        CodecKind::MultilevelVq => Budget::Quality(70.0),
        _ => Budget::Standard,
    };
    FitOptions { codec, budget, precision: Precision::Compact, seed: 1, books: Variant::default() }
}

/// Fitted, written and read again.
fn coded(btf: &Btf, codec: CodecKind) -> Material {
    let (material, _) = fit(btf.clone(), &options(codec)).unwrap_or_else(|fault| panic!("{codec}: {fault}"));
    Material::from_bytes(&material.to_bytes().0).unwrap_or_else(|fault| panic!("{codec}: {fault}"))
}

/// The tile under a light and a view; all it says are numbers.
fn picture(material: &Material, light: &Vector3<f64>, view: &Vector3<f64>) -> Vec<f32> {
    let frame = material.codec.frame();
    let (light, view) = (light.cast(), view.cast());
    let picture = match material.codec.answer() {
        Answer::Sampler(sampler) => sampler.picture(&light, &view),
        Answer::Synthesizer(s) => s.picture([frame.width, frame.height], 1, &light, &view),
    };
    assert!(picture.iter().all(|v| v.is_finite()), "{}", material.codec.kind());
    picture
}

fn judged(material: &Material, btf: &Btf) -> Score {
    match material.codec.answer() {
        Answer::Sampler(sampler) => score(btf, sampler),
        Answer::Synthesizer(s) => score(btf, &Synthesized::new(s, [btf.width, btf.height], 1)),
    }
}

fn is_sampler(material: &Material) -> bool {
    matches!(material.codec.answer(), Answer::Sampler(_))
}

/// Every codec returns it.
#[test]
fn constant_texels() {
    let btf = measured([SIDE, SIDE], [directions(), directions()], |_, _, _, _| [0.4, 0.3, 0.2]);
    for &codec in CodecKind::ALL {
        let material = coded(&btf, codec);
        for view in &btf.views {
            let found = picture(&material, &btf.lights[3], view);
            let is_it = |(i, v): (usize, &f32)| (v - [0.4, 0.3, 0.2][i % 3]).abs() < 0.02;
            assert!(found.iter().enumerate().all(is_it), "{codec}: {found:?}");
        }
    }
}

/// Stay dark, and the others bright; books of slices share the light of views beside them where views are as few as here.
#[test]
fn all_black_views() {
    let is_black = |v: &Vector3<f64>| v.x > 0.3 && v.z < 0.6;
    let btf =
        measured(
            [SIDE, SIDE],
            [directions(), directions()],
            |x, y, l, v| {
                if is_black(v) { [0.0; 3] } else { bumps(x, y, l, v) }
            },
        );
    for &codec in CodecKind::ALL {
        let material = coded(&btf, codec);
        let mean = |view: &Vector3<f64>| {
            let found = picture(&material, &btf.lights[0], view);
            found.iter().sum::<f32>() / found.len() as f32
        };
        let most = if codec == CodecKind::MultilevelVq { 0.25 } else { 0.06 };
        for view in &btf.views {
            let is_right = if is_black(view) { mean(view) < most } else { mean(view) > 0.35 };
            assert!(is_right, "{codec}: {} from {view:?}", mean(view));
        }
    }
}

/// A reflectance: samplers keep it.
#[test]
fn one_texel() {
    let btf = measured([1, 1], [directions(), directions()], bumps);
    for &codec in CodecKind::ALL {
        let material = coded(&btf, codec);
        assert!(!is_sampler(&material) || judged(&material, &btf).rmse < 6.0, "{codec}: {:?}", judged(&material, &btf));
        picture(&material, &Vector3::z(), &Vector3::z());
    }
}

/// Answers for all lights, the same by codecs that interpolate; lobes, components and range maps know how far others are.
#[test]
fn one_light() {
    let btf = measured([SIDE, SIDE], [directions(), vec![Vector3::z()]], bumps);
    for &codec in CodecKind::ALL {
        let (material, view) = (coded(&btf, codec), &btf.views[2]);
        let [there, elsewhere] = [0.0, 0.6].map(|x| picture(&material, &Vector3::new(x, 0.0, 1.0 - x / 3.0), view));
        let is_same = there.iter().zip(&elsewhere).all(|(a, b)| (a - b).abs() < 0.01);
        let interpolates =
            [CodecKind::MultilevelVq, CodecKind::Pca, CodecKind::PcaView, CodecKind::LocalPca].contains(&codec);
        assert!(is_same || !interpolates, "{codec}");
        assert!(
            !is_sampler(&material) || judged(&material, &btf).rmse < 12.0,
            "{codec}: {:?}",
            judged(&material, &btf)
        );
    }
}

/// Are filled from the nearest light, and count in no figure.
#[test]
fn missing_directions() {
    let mut btf = usual();
    let length = 3 * btf.texels();
    for pair in [5, 40, 41, 42, 100] {
        btf.samples[pair * length..(pair + 1) * length].fill(f32::NAN);
    }
    assert_eq!(btf.check().expect("it can be filled"), 5 * length);
    let whole = usual();
    for &codec in CodecKind::ALL {
        let [found, known] = [&btf, &whole].map(|data| judged(&coded(data, codec), data));
        assert_eq!((found.pictures, known.pictures), (164, 169));
        assert!(found.rmse < 1.5 * known.rmse + 1.0, "{codec}: {} {}", found.rmse, known.rmse);
    }
}

/// Beyond the outermost ring it is about as at it: never far outside what was measured.
#[test]
fn grazing_directions() {
    let btf = usual();
    let grazing =
        [Vector3::x(), Vector3::new(-0.6, 0.8, 0.0), Vector3::new(0.0, -1.0, 1e-9), Vector3::new(0.3, 0.2, -0.9)];
    for &codec in CodecKind::ALL {
        let material = coded(&btf, codec);
        for (light, view) in grazing.iter().flat_map(|l| grazing.iter().map(move |v| (l, v))) {
            let found = picture(&material, light, view);
            assert!(found.iter().all(|v| (-0.3..1.3).contains(v)), "{codec}: {found:?}");
        }
    }
}

/// Are coded as logarithms.
#[test]
fn a_range_of_a_million() {
    let mut btf = measured([SIDE, SIDE], [directions(), directions()], |x, y, l, v| {
        bumps(x, y, l, v).map(|s| 1e-3 * (23.0 * s).exp())
    });
    btf.encoding = Encoding::Linear;
    let highest = btf.samples.iter().copied().fold(0.0, f32::max);
    let lowest = btf.samples.iter().copied().fold(f32::MAX, f32::min);
    assert!(highest / lowest > 1e6, "{lowest} {highest}");
    for &codec in CodecKind::ALL {
        let material = coded(&btf, codec);
        assert!(matches!(material.encoding, Encoding::Log { .. }), "{codec}");
        let found = judged(&material, &btf.clone().encoded(material.encoding));
        let stops = found.rmse_stops.expect("a high range");
        assert!(stops < if is_sampler(&material) { 1.0 } else { 4.0 }, "{codec}: {stops}");
    }
}

/// Count twice, and cost nothing else.
#[test]
fn duplicated_samples() {
    let twice = [directions(), directions()].concat();
    let (once, doubled) = (usual(), measured([SIDE, SIDE], [directions(), twice], bumps));
    for &codec in CodecKind::ALL {
        let [one, two] = [&once, &doubled].map(|data| judged(&coded(data, codec), &once).rmse);
        assert!(two < 1.5 * one + 1.0, "{codec}: {one} {two}");
    }
}

/// Are filled when data are read or checked, and refused by fits.
#[test]
fn what_is_no_number() {
    for bad in [f32::NAN, f32::INFINITY] {
        let mut btf = usual();
        btf.samples[777] = bad;
        for &codec in CodecKind::ALL {
            let fault = fit(btf.clone(), &options(codec)).expect_err("it is no number").to_string();
            assert!(fault.contains("Btf::check"), "{codec}: {fault}");
        }
        assert_eq!(btf.check().expect("it can be filled"), 1);
        picture(&coded(&btf, CodecKind::MultilevelVq), &Vector3::z(), &Vector3::z());
    }
}
