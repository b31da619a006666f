use super::autoregression::{NEIGHBOURS, Scalar, ScalarCovariances, ScalarModel, estimate, estimate_with};
use super::*;
use crate::btf::car2d::{Car2d, Causal};
use crate::btf::car3d::{Car3d, VectorModel};
use crate::btf::container::Stored;
use crate::btf::gmrf::{Gmrf, Markov};
use crate::btf::multilevel_vq::Variant;
use crate::btf::{Codec, CodecKind, FitOptions, Material, Synthesizer, fixtures, statistics};
use capture::btf::Encoding;
use proptest::prelude::*;
use std::sync::LazyLock;

fn covariances(field: &[f64], size: [usize; 2]) -> ScalarCovariances {
    let zeros = || vec![0.0; field.len()];
    Covariances::of(&[[field.to_vec(), zeros(), zeros()]], size).along(&Vector3::x())
}

fn numbers_of(offsets: &[[i32; 2]]) -> Vec<usize> {
    offsets.iter().map(|o| NEIGHBOURS.iter().position(|n| n == o).unwrap()).collect()
}

/// Raster recursion over a torus, passing over it until its start is forgotten.
fn recursion(noise: &[f64], size: usize, passes: usize) -> Vec<f64> {
    let mut field = vec![0.0; size * size];
    for i in (0..passes).flat_map(|_| 0..size * size) {
        let (x, y) = (i % size, i / size);
        let (left, up) = ((x + size - 1) % size, (y + size - 1) % size);
        let mean = 0.5 * field[y * size + left] + 0.4 * field[up * size + x] - 0.2 * field[up * size + left];
        field[i] = mean + noise[i];
    }
    field
}

const RECURSION: [[i32; 2]; 3] = [[1, 0], [0, 1], [1, 1]];

#[test]
fn a_simulated_autoregression_is_recovered() {
    let field = recursion(&noise::gaussian_field(3, 0, 256 * 256), 256, 2);
    let variance = field.iter().map(|v| v * v).sum::<f64>() / field.len() as f64;
    // 1 / ((1 − 0.25) (1 − 0.16)): it is separable.
    assert!((variance - 1.587).abs() < 0.03, "{variance}");
    let model = estimate_with::<Causal>(&covariances(&field, [256; 2]), &numbers_of(&RECURSION));
    for (found, truth) in model.coefficients.iter().zip([0.5, 0.4, -0.2]) {
        assert!((found - truth).abs() < 0.01, "{:?}", model.coefficients);
    }
    assert!((model.sigma - 1.0).abs() < 0.01, "{}", model.sigma);
    let chosen = estimate::<Causal>(&covariances(&field, [256; 2]));
    assert!(numbers_of(&RECURSION).iter().all(|s| chosen.neighbours.contains(s)), "{:?}", chosen.neighbours);
    assert!(chosen.neighbours.len() <= 5, "{:?}", chosen.neighbours);
}

#[test]
fn the_fixed_point_of_the_recursion_is_what_is_synthesized() {
    let model = Scalar { neighbours: numbers_of(&RECURSION), coefficients: vec![0.5, 0.4, -0.2], sigma: 1.0 };
    let filter = |wave: &Wave| Matrix3::identity() * Causal::filter(&model, wave).unwrap();
    let field = &filtered_noise([24; 2], 5, 0, filter)[0];
    let seeded = noise::gaussian_field(5, 0, 24 * 24);
    let mean = seeded.iter().sum::<f64>() / seeded.len() as f64;
    let passed = recursion(&seeded.iter().map(|v| v - mean).collect::<Vec<_>>(), 24, 30);
    assert!(field.iter().zip(&passed).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn colours_that_depend_on_their_neighbours_are_recovered() {
    let size = 128;
    let truth = Matrix3::new(0.5, 0.2, 0.0, 0.0, 0.4, 0.0, 0.1, 0.0, 0.3);
    let noise = [0, 1, 2].map(|c| noise::gaussian_field(9, c, size * size));
    let mut field = vec![Vector3::zeros(); size * size];
    for i in (0..2).flat_map(|_| 0..size * size) {
        let left = i / size * size + (i + size - 1) % size;
        field[i] = truth * field[left] + Vector3::new(noise[0][i], noise[1][i], 0.5 * noise[2][i]);
    }
    let channels = [0, 1, 2].map(|c| field.iter().map(|v| v[c]).collect());
    let model = VectorModel::estimate_with(&Covariances::of(&[channels], [size; 2]), &numbers_of(&[[1, 0]]));
    // Their standard errors are up to 1/64: the third channel varies half as much as the others.
    assert!((model.coefficients[0] - truth).norm() < 0.05, "{}", model.coefficients[0]);
    let noise = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.5));
    assert!((model.factor - noise).norm() < 0.03, "{}", model.factor);
}

#[test]
fn a_markov_field_is_valid_below_a_quarter() {
    let sides = numbers_of(&[[1, 0], [0, 1]]);
    let model = |a: f64| Scalar { neighbours: sides.clone(), coefficients: vec![a; 2], sigma: 1.0 };
    // μ = 1 − 4a at the lowest frequency.
    let gain = Markov::filter(&model(0.2), &Wave::new([0.0, 0.0])).unwrap();
    assert!((gain.re - 1.0 / 0.2_f64.sqrt()).abs() < 1e-12);
    assert!(autoregression::probes().any(|wave| Markov::filter(&model(0.26), &wave).is_none()));
    let filter = |wave: &Wave| Matrix3::identity() * Markov::filter(&model(0.2), wave).unwrap();
    let field = &filtered_noise([128; 2], 1, 0, filter)[0];
    let found = estimate_with::<Markov>(&covariances(field, [128; 2]), &sides);
    assert!(found.coefficients.iter().all(|a| (a - 0.2).abs() < 0.01), "{:?}", found.coefficients);
}

#[test]
fn what_least_squares_leaves_invalid_is_shrunk() {
    // A wave one texel from constant: no Markov field has it.
    let wave: Vec<f64> = (0..1024).map(|i| (std::f64::consts::TAU * (i % 32) as f64 / 32.0).sin()).collect();
    for model in [estimate::<Markov>(&covariances(&wave, [32; 2])), estimate::<Causal>(&covariances(&wave, [32; 2]))] {
        assert!(model.coefficients.iter().chain([&model.sigma]).all(|v| v.is_finite()), "{model:?}");
    }
    let model = estimate::<Markov>(&covariances(&wave, [32; 2]));
    assert!(autoregression::probes().all(|wave| Markov::filter(&model, &wave).is_some()));
}

#[test]
fn white_noise_has_no_neighbours() {
    let field = noise::gaussian_field(11, 0, 128 * 128);
    let all = numbers_of(&NEIGHBOURS);
    let bound = 4.5 / 128.0;
    for model in [
        estimate_with::<Markov>(&covariances(&field, [128; 2]), &all),
        estimate_with::<Causal>(&covariances(&field, [128; 2]), &all),
    ] {
        assert!(model.coefficients.iter().all(|a| a.abs() < bound), "{:?}", model.coefficients);
    }
    assert!(estimate::<Causal>(&covariances(&field, [128; 2])).neighbours.len() <= 1);
}

#[test]
fn slopes_of_a_periodic_wave_integrate_to_it() {
    let [width, height] = [24, 15];
    let phase = |i: usize| TAU * (2.0 * (i % width) as f64 / width as f64 + (i / width) as f64 / height as f64);
    const TAU: f64 = std::f64::consts::TAU;
    let slopes: Vec<[f64; 2]> = (0..width * height)
        .map(|i| [2.0 * TAU / width as f64, TAU / height as f64].map(|w| w * phase(i).cos()))
        .collect();
    let heights = range_map::integrate([width, height], &slopes);
    assert!((0..heights.len()).all(|i| (heights[i] - phase(i).sin()).abs() < 1e-10));
}

#[test]
fn pyramids_return_what_they_took_at_any_size() {
    for size in [[32, 32], [25, 31], [8, 40], [1, 1]] {
        let field = noise::gaussian_field(2, 0, size[0] * size[1]);
        let bands = pyramid::split(&field, size, 3);
        let back = pyramid::collapse(&bands, size);
        assert!(field.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12), "{size:?}");
    }
}

#[test]
fn a_tiled_map_repeats_or_is_cut_without_a_jump() {
    let map: Vec<f64> = (0..20 * 16).map(|i| (std::f64::consts::TAU * ((i % 20) as f64 / 5.0)).sin()).collect();
    let twice = tile::tiled(&map, [20, 16], [40, 32]);
    assert!((0..40 * 32).all(|i| twice[i] == i / 40 % 16 * 20 + i % 40 % 20));
    // Half a wave is missing: the steps stay as small as at the steepest place of the wave and half a wave's cut.
    let cut: Vec<f64> = tile::tiled(&map, [20, 16], [35, 16]).into_iter().map(|t| map[t]).collect();
    let step = |i: usize| (cut[i / 35 * 35 + (i + 1) % 35] - cut[i]).abs();
    assert!((0..cut.len()).all(|i| step(i) < 1.2), "{:?}", &cut[..35]);
}

/// Stripes in relief under a gloss, with a grain: 16 × 16 texels, 5 views, 5 lights.
fn striped() -> Btf {
    let directions: Vec<Vector3<f64>> = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [-0.5, 0.1], [0.1, -0.6]]
        .map(|[x, y]: [f64; 2]| Vector3::new(x, y, (1.0 - x * x - y * y).sqrt()))
        .to_vec();
    let grain = noise::gaussian_field(1, 0, 256);
    let mut samples = Vec::new();
    for (view, light) in directions.iter().flat_map(|v| directions.iter().map(move |l| (v, l))) {
        for i in 0..256 {
            let phase = std::f64::consts::TAU * ((i % 16) as f64 + view.x) / 8.0;
            let n = Vector3::new(0.5 * phase.cos(), 0.0, 1.0).normalize();
            let gloss = n.dot(&((light + view).normalize())).max(0.0).powi(30);
            let level = 0.5 * n.dot(light).max(0.0) + 0.2 * gloss + 0.03 * grain[i];
            samples.extend([level, 0.8 * level, 0.3 * level + 0.1].map(|v| v.clamp(0.0, 1.0) as f32));
        }
    }
    fixtures::btf([16, 16], &directions, samples)
}

fn fitted(btf: &Btf, codec: CodecKind, budget: Budget) -> (Material, FitReport) {
    let options = FitOptions { codec, budget, precision: Precision::Compact, seed: 1, books: Variant::default() };
    super::super::fit(btf.clone(), &options).unwrap()
}

fn synthesize(material: &Material, size: [usize; 2], pair: (usize, usize), btf: &Btf) -> Vec<f32> {
    let (light, view) = (btf.lights[pair.1].cast(), btf.views[pair.0].cast());
    match &material.codec {
        Codec::Gmrf(codec) => codec.picture(size, 1, &light, &view),
        Codec::Car2d(codec) => codec.picture(size, 1, &light, &view),
        Codec::Car3d(codec) => codec.picture(size, 1, &light, &view),
        _ => Vec::new(),
    }
}

const KINDS: [CodecKind; 3] = [CodecKind::Gmrf, CodecKind::Car2d, CodecKind::Car3d];

#[test]
fn syntheses_have_the_statistics_of_the_pictures() {
    let btf = striped();
    for kind in KINDS {
        let (material, _) = fitted(&btf, kind, Budget::Components(6));
        for pair in [(0, 1), (3, 2)] {
            let made = synthesize(&material, [40, 24], pair, &btf);
            let figures = statistics::compare(btf.picture(pair.0, pair.1), [16, 16], &made, [40, 24]);
            assert!(figures.mean_difference < 3.0 && figures.earth_mover < 6.0, "{kind} {figures:?}");
            assert!((figures.deviation_ratio - 1.0).abs() < 0.15, "{kind} {figures:?}");
            assert!(figures.autocorrelation < 0.35, "{kind} {figures:?}");
        }
    }
}

#[test]
fn stripes_come_from_the_range_map() {
    let btf = striped();
    let (_, report) = fitted(&btf, CodecKind::Gmrf, Budget::Components(6));
    let explained: f64 = report.notes[0].split(' ').find_map(|word| word.parse().ok()).unwrap();
    assert!(explained > 60.0, "{:?}", report.notes);
}

#[test]
fn files_return_what_was_written() {
    let btf = striped();
    for kind in KINDS {
        for (precision, budget) in [(Precision::Full, Budget::Components(4)), (Precision::Compact, Budget::Auto)] {
            let options = FitOptions { codec: kind, budget, precision, seed: 1, books: Variant::default() };
            let (material, _) = super::super::fit(btf.clone(), &options).unwrap();
            let back = Material::from_bytes(&material.to_bytes().0).unwrap();
            assert_eq!(synthesize(&material, [20, 20], (1, 1), &btf), synthesize(&back, [20, 20], (1, 1), &btf));
            assert_eq!(material.to_bytes().0, back.to_bytes().0);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_threads() {
    let btf = striped();
    let once = fitted(&btf, CodecKind::Car3d, Budget::Auto).0.to_bytes().0;
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(alone.install(|| fitted(&btf, CodecKind::Car3d, Budget::Auto).0.to_bytes().0), once);
}

#[test]
fn a_ratio_is_reached_or_said_to_be_out_of_reach() {
    let btf = striped();
    for kind in KINDS {
        let (material, report) = fitted(&btf, kind, Budget::Ratio(9.0));
        let ratio = material.raw_bytes as f64 / material.byte_count() as f64;
        assert!((9.0..13.0).contains(&ratio), "{kind} {ratio} {:?}", report.notes);
        let (_, report) = fitted(&btf, kind, Budget::Ratio(1e6));
        assert!(report.notes.iter().any(|note| note.contains("was asked for")), "{:?}", report.notes);
    }
}

/// Cuts or repeats the test's material.
fn changed(change: impl Fn(&mut Btf)) -> Btf {
    let mut btf = striped();
    change(&mut btf);
    btf.check().unwrap();
    btf
}

#[test]
fn hard_data_has_an_answer() {
    let one_texel = changed(|btf| {
        btf.samples = btf.samples.chunks_exact(3 * 256).flat_map(|p| p[..3].to_vec()).collect();
        (btf.width, btf.height) = (1, 1);
    });
    let constant = changed(|btf| btf.samples.fill(0.4));
    let black = changed(|btf| btf.samples[..3 * 256 * 5].fill(0.0));
    let one_light = changed(|btf| {
        btf.samples = btf.samples.chunks_exact(5 * 3 * 256).flat_map(|v| v[..3 * 256].to_vec()).collect();
        btf.lights.truncate(1);
    });
    let one_view = changed(|btf| {
        btf.samples.truncate(5 * 3 * 256);
        btf.views.truncate(1);
    });
    let same_pictures = changed(|btf| btf.samples = btf.samples[..3 * 256].repeat(25));
    let bright = changed(|btf| {
        btf.encoding = Encoding::Linear;
        btf.samples.iter_mut().for_each(|s| *s = (*s * 14.0).exp() - 1.0);
    });
    let tiny = changed(|btf| btf.samples.iter_mut().for_each(|s| *s *= 1e-30));
    for (name, btf) in [
        ("one texel", one_texel),
        ("constant", constant.clone()),
        ("black", black.clone()),
        ("one light", one_light),
        ("one view", one_view),
        ("same pictures", same_pictures),
        ("bright", bright),
        ("tiny", tiny),
    ] {
        for kind in KINDS {
            let (material, _) = fitted(&btf, kind, Budget::Standard);
            for size in [[1, 1], [5, 3], [19, 33]] {
                let made = synthesize(&material, size, (0, 0), &btf);
                assert_eq!(made.len(), 3 * size[0] * size[1], "{name}");
                assert!(made.iter().all(|v| v.is_finite() && *v >= 0.0), "{name} {kind}");
            }
        }
    }
    let made = synthesize(&fitted(&constant, CodecKind::Gmrf, Budget::Standard).0, [9, 9], (2, 3), &constant);
    assert!(made.iter().all(|v| (v - 0.4).abs() < 0.01), "{made:?}");
    let made = synthesize(&fitted(&black, CodecKind::Car2d, Budget::Standard).0, [16, 16], (0, 0), &black);
    assert!(made.iter().all(|v| *v < 0.03), "{made:?}");
}

#[test]
fn directions_that_are_none_have_an_answer() {
    let btf = striped();
    let (material, _) = fitted(&btf, CodecKind::Car2d, Budget::Components(3));
    let Codec::Car2d(codec) = material.codec else { panic!() };
    for direction in [Vector3::zeros(), Vector3::new(f32::NAN, 0.0, 1.0), Vector3::new(1.0, 0.0, -1.0)] {
        assert!(codec.picture([8, 8], 0, &direction, &direction).iter().all(|v| v.is_finite()), "{direction:?}");
    }
    assert!(codec.picture([0, 8], 0, &Vector3::z(), &Vector3::z()).is_empty());
}

/// Reads changed bytes with a codec's own decoder; what passes has to answer.
fn survives<C: Stored + Synthesizer>(bytes: &[u8], frame: &Frame) {
    if let Ok(codec) = C::read(&mut Reader::new(bytes), frame.clone()) {
        let light = Vector3::new(0.3, 0.1, 0.9);
        assert!(codec.picture([9, 7], 3, &light, &light).iter().all(|v| v.is_finite()));
    }
}

/// A material of each kind, and the bytes of its header.
static WHOLE: LazyLock<[(Material, usize); 3]> = LazyLock::new(|| {
    let btf = striped();
    KINDS.map(|kind| (fitted(&btf, kind, Budget::Components(2)).0, crate::btf::container::header_bytes(&btf)))
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn damaged_files_are_refused_or_answer(changes in prop::collection::vec((0.0..1.0_f64, any::<u8>()), 1..6), end in 0.5..1.2_f64) {
        for (kind, (material, header)) in KINDS.into_iter().zip(WHOLE.iter()) {
            // The codec's part begins where the header ends.
            let mut bytes = material.to_bytes().0[*header..].to_vec();
            for &(place, value) in &changes {
                let place = (place * bytes.len() as f64) as usize;
                bytes[place] = value;
            }
            bytes.truncate((end * bytes.len() as f64) as usize);
            match kind {
                CodecKind::Gmrf => survives::<Gmrf>(&bytes, material.codec.frame()),
                CodecKind::Car2d => survives::<Car2d>(&bytes, material.codec.frame()),
                _ => survives::<Car3d>(&bytes, material.codec.frame()),
            }
        }
    }
}
