use super::books::index_bits;
use super::color::{log_luv, log_luv_code, luminance_code, rgb, ycrcb};
use super::options::radical_inverse;
use super::*;
use crate::btf::{Budget, Precision, fixtures};
use capture::btf::{BtfDirection, bonn_directions};
use proptest::prelude::*;

/// Lambertian with stripes whose place depends on the view, and a highlight of width `1/gloss`.
fn striped(side: usize, directions: &[Vector3<f64>]) -> Btf {
    let mut samples = Vec::new();
    for view in directions {
        for light in directions {
            let half = (view + light).normalize();
            for i in 0..side * side {
                let x = (i % side) as f64 + 0.1 * side as f64 * view.x / view.z.max(0.2);
                let stripe = 0.5 + 0.5 * (x * std::f64::consts::TAU / side as f64).cos();
                let gloss = 0.25 * half.z.powi(40);
                let albedo = [0.2 + 0.5 * stripe, 0.3 + 0.2 * stripe, 0.25];
                samples.extend(albedo.map(|a| (a * light.z + gloss) as f32));
            }
        }
    }
    fixtures::btf([side, side], directions, samples)
}

/// The same colour everywhere.
fn flat(side: usize, directions: &[Vector3<f64>], color: [f32; 3]) -> Btf {
    fixtures::btf([side, side], directions, color.repeat(side * side * directions.len() * directions.len()))
}

/// The inner rings: 19 directions.
fn few() -> Vec<Vector3<f64>> {
    bonn_directions()[..19].to_vec()
}

fn options(btf: &Btf, aim: Aim, precision: Precision) -> Options {
    Options { aim, ..Options::new(btf, Budget::Standard, precision, 0).unwrap() }
}

fn fitted(btf: &Btf, threshold: f64, precision: Precision) -> MultilevelVq {
    fit(btf, &options(btf, Aim::Threshold(threshold), precision)).unwrap().0
}

/// RMSE over all samples, levels.
fn rmse(btf: &Btf, codec: &MultilevelVq) -> f64 {
    let mut sum = 0.0;
    for (v, view) in btf.views.iter().enumerate() {
        for (l, light) in btf.lights.iter().enumerate() {
            let decoded = codec.picture(&light.cast(), &view.cast());
            sum += decoded.iter().zip(btf.picture(v, l)).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        }
    }
    255.0 * (sum / btf.samples.len() as f64).sqrt()
}

fn stored(codec: &MultilevelVq) -> Vec<u8> {
    let material = Material {
        name: String::new(),
        encoding: Encoding::Srgb,
        exposure: 1.0,
        includes_cosine: true,
        texel_pitch_mm: None,
        raw_bytes: 0,
        codec: Codec::MultilevelVq(codec.clone()),
    };
    let (bytes, parts) = material.to_bytes();
    bytes[parts[0].bytes as usize..].to_vec()
}

fn random(count: usize, seed: u32) -> impl Iterator<Item = f32> {
    let mut state = seed;
    std::iter::repeat_with(move || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (((word >> 22) ^ word) >> 8) as f32 / (1 << 24) as f32
    })
    .take(count)
}

fn of_degrees(theta: f32, phi: f32) -> Vector3<f32> {
    let ((st, ct), (sp, cp)) = (theta.to_radians().sin_cos(), phi.to_radians().sin_cos());
    Vector3::new(st * cp, st * sp, ct)
}

#[test]
fn onion_slices_have_their_known_angles() {
    let along = Grid { axis: Axis::Along, ..Grid::PAPER };
    for (direction, alpha, beta) in [
        ((0.0, 0.0), 0.0, 0.0),
        ((60.0, 90.0), 60.0, 0.0),
        ((60.0, 270.0), -60.0, 0.0),
        ((45.0, 45.0), 35.2644, 30.0),
        ((45.0, 225.0), -35.2644, -30.0),
        ((75.0, 0.0), 0.0, 75.0),
        ((75.0, 345.0), -44.0070, 68.9094),
    ] {
        let [a, s] = along.onion(&of_degrees(direction.0, direction.1));
        assert!((a.to_degrees() - alpha).abs() < 2e-3, "{direction:?}: α {}", a.to_degrees());
        assert!((s.asin().to_degrees() - beta).abs() < 2e-3, "{direction:?}: β {}", s.asin().to_degrees());
    }
    assert_eq!(along.onion(&Vector3::new(-1.0, -8.7e-8, 0.0))[0], 0.0, "α of a pole");
}

#[test]
fn onion_slices_return_the_direction() {
    let numbers: Vec<f32> = random(200_000, 1).collect();
    let made = numbers.chunks_exact(2).map(|u| {
        let (z, phi) = (u[0], std::f32::consts::TAU * u[1]);
        Vector3::new((1.0 - z * z).sqrt() * phi.cos(), (1.0 - z * z).sqrt() * phi.sin(), z)
    });
    let listed = BtfDirection::all().into_iter().map(|d| d.vector().cast());
    for axis in [Axis::Along, Axis::Perpendicular] {
        let grid = Grid { axis, ..Grid::PAPER };
        for d in made.clone().chain(listed.clone()).chain([Vector3::x(), -Vector3::x(), Vector3::y()]) {
            let [alpha, s] = grid.onion(&d);
            // Near the poles s cannot say more: it is rounded to 6·10⁻⁸.
            let tolerance = 1e-6 + 1e-7 / (1.0 - s * s).sqrt().max(1e-3);
            assert!((grid.direction(alpha, s) - d).norm() < tolerance, "{d:?}");
        }
    }
}

#[test]
fn grids_follow_the_directions() {
    let bonn = bonn_directions();
    assert_eq!(Grid::of(&bonn, &bonn), Grid { alpha: 11, beta: 11, theta: 6, phi: 24, rim_deg: 75, ..Grid::PAPER });
    let front = Grid::of(&[Vector3::z()], &bonn);
    assert_eq!((front.theta, front.phi, front.alpha), (1, 1, 11));
    assert_eq!(Grid::of(&bonn[..1], &bonn[..1]).cells(), 1);
}

#[test]
fn polar_angles_weigh_as_their_bands_but_the_zenith_more() {
    let weights = Grid { theta: 6, rim_deg: 75, ..Grid::PAPER }.view_weights();
    assert!((weights.iter().sum::<f32>() / 6.0 - 1.0).abs() < 1e-6);
    // cos 67.5° − cos 82.5° over cos 52.5° − cos 67.5°
    assert!((weights[5] / weights[4] - 1.115_36).abs() < 1e-4, "{weights:?}");
    assert!(weights[0] > 0.2, "{weights:?}");
}

#[test]
fn an_azimuth_is_the_same_after_a_turn() {
    let codec = fitted(&striped(4, &few()), 2.0, Precision::Compact);
    let view = Vector3::new(0.4, -1e-9, 0.9165);
    let (above, below) = (codec.value(3, &view, &view), codec.value(3, &view, &Vector3::new(0.4, 1e-9, 0.9165)));
    assert!((0..3).all(|c| (above[c] - below[c]).abs() < 1e-5));
}

#[test]
fn luminance_and_chroma_return_rgb() {
    for color in [[0.0, 0.0, 0.0], [1.0, 0.5, 0.25], [0.1, 0.9, 0.3]] {
        let back = rgb(ycrcb(color));
        assert!((0..3).all(|c| (back[c] - color[c]).abs() < 1e-6));
    }
    assert!((ycrcb([1.0, 0.0, 0.0])[0] - 0.299).abs() < 1e-7);
}

#[test]
fn log_luv_has_its_known_codes() {
    for (y, code) in [(0.0, 0), (-1.0, 0), (1.0, 16_384), (2.0, 16_640), (0.5, 16_128), (1e-30, 1)] {
        assert_eq!(luminance_code(y), code, "{y}");
    }
    // One step is 2^(1/256): 0.27 %.
    assert_eq!(luminance_code(1.0028), 16_385);
    assert_eq!(luminance_code(1.0026), 16_384);
    // u' = 0.1978 and v' = 0.4683 of white, by 410; those of BT.709's primaries are in its tables.
    assert_eq!(log_luv([1.0; 3]), [16_384, 81, 192]);
    for (primary, u, v) in
        [([1.0, 0.0, 0.0], 0.4507, 0.5229), ([0.0, 1.0, 0.0], 0.125, 0.5625), ([0.0, 0.0, 1.0], 0.1754, 0.1579)]
    {
        let [_, of_u, of_v] = log_luv(primary);
        assert!(
            [(of_u, u), (of_v, v)].iter().all(|(code, c)| (f64::from(*code) - 410.0 * c).abs() <= 1.0),
            "{primary:?}"
        );
    }
    // Black has the chroma of white.
    assert_eq!(log_luv([0.0; 3]), [0, 81, 192]);
    assert_eq!([0.0, 0.25, 1.0, -3.0, f32::NAN].map(log_luv_code), [0, 102, 255, 0, 0]);
}

#[test]
fn log_luv_returns_colours_within_its_steps() {
    let range = 1e5;
    let color = Color::LogLuv { range };
    for rgb in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.6, 0.55, 0.5], [0.9, 0.8, 0.85], [0.3, 0.5, 0.4]] {
        let held = color.of_rgb(rgb);
        let back = color.rgb(held);
        assert!((0..3).all(|c| (color.of_rgb(back)[c] - held[c]).abs() < 2e-4), "{rgb:?}: {held:?} {back:?}");
        // Half a step of u' or v' either way, each step 17 or less in the logarithms of RGB, where colours are pale.
        let most = 3.0 * 17.0 * 0.5 / 410.0 / range.ln_1p();
        let is_pale = rgb.iter().all(|c| (c - rgb[1]).abs() <= 0.1);
        assert!(!is_pale || (0..3).all(|c| (back[c] - rgb[c]).abs() < most), "{rgb:?}: {back:?}");
    }
    for odd in [[f32::NAN; 3], [-1.0, 9.0, -9.0], [2.0, 0.0, 0.0]] {
        assert!(color.rgb(odd).iter().all(|c| !c.is_infinite()));
    }
}

#[test]
fn a_high_range_is_held_in_log_luv_and_other_data_are_not() {
    let mut btf = striped(4, &few());
    let of = |btf: &Btf| Options { color: ColorSpace::LogLuv, ..options(btf, Aim::Threshold(1.0), Precision::Compact) };
    assert!(fit(&btf, &of(&btf)).is_err_and(|fault| fault.to_string().contains("LogLuv")));
    btf.encoding = Encoding::Linear;
    let btf = crate::btf::to_coded_range(btf);
    let (codec, _) = fit(&btf, &of(&btf)).unwrap();
    let usual = fitted(&btf, 1.0, Precision::Compact);
    // The step of chroma is a few levels of the logarithm; that of luminance none.
    assert!(rmse(&btf, &codec) < rmse(&btf, &usual) + 3.0, "{} {}", rmse(&btf, &codec), rmse(&btf, &usual));
    assert!(codec.tables().is_none() && usual.tables().is_some());
    let bytes = stored(&codec);
    let read = MultilevelVq::read(&mut Reader::new(&bytes), codec.frame().clone()).unwrap();
    assert!(read == codec && stored(&read) == bytes);
}

#[test]
fn the_sequence_starts_as_haltons() {
    let points: Vec<[f64; 2]> = (1..=5).map(|i| [radical_inverse(i, 2), radical_inverse(i, 3)]).collect();
    let known = [[0.5, 1.0 / 3.0], [0.25, 2.0 / 3.0], [0.75, 1.0 / 9.0], [0.125, 4.0 / 9.0], [0.625, 7.0 / 9.0]];
    for (point, known) in points.iter().zip(known) {
        assert!((0..2).all(|k| (point[k] - known[k]).abs() < 1e-15), "{point:?}");
    }
    let mut order = progressive_order(9, 5, 0);
    assert_eq!(order[0], 9 + 4);
    order.sort_unstable();
    assert_eq!(order, (0..45).collect::<Vec<_>>(), "each texel once");
}

#[test]
fn indices_take_the_bits_they_need() {
    for (count, bits) in [(1, 0), (2, 1), (3, 2), (255, 8), (256, 8), (257, 9)] {
        assert_eq!(index_bits(count), bits, "{count}");
    }
}

/// Table 1 prints ratios and sizes, but how many items the books had nowhere: what can be counted again is the raw side.
#[test]
fn ratios_are_the_published_ones() {
    let raw = |side: usize, encoding: Encoding| {
        Btf { width: side, height: side, encoding, ..fixtures::btf([0, 0], &bonn_directions(), Vec::new()) }.raw_bytes()
    };
    let (ldr, hdr) = (Encoding::Srgb, Encoding::Log { floor: 1.0, peak: 1e6 });
    for (side, encoding, bytes, published) in [
        (256, ldr, 3_084_692, "418.2"),
        (256, ldr, 632_352, "2039.9"),
        (256, hdr, 853_496, "2267.0"),
        // 780 in print.
        (256, hdr, 2_653_188, "729.3"),
        (64, ldr, 80_460, "1002.0"),
    ] {
        assert_eq!(format!("{:.1}", raw(side, encoding) as f64 / f64::from(bytes)), published);
    }
}

/// The file's parts are what the table of `books` says of the items there are: 6 bits a scale where scales differ, and the bits
/// of an index.
#[test]
fn parts_take_the_bits_of_their_entries() {
    let codec = fitted(&striped(8, &few()), 1.0, Precision::Compact);
    let grid = codec.books.grid;
    let mut out = Writer::default();
    codec.write(&mut out);
    let counts: std::collections::BTreeMap<_, _> = codec.entries().into_iter().collect();
    let count = |book: &str| counts[book];
    // u32 items; of scales their bits and range.
    let bytes = |bits: usize| bits.div_ceil(8);
    let (indices, scaled) = (|n: usize| index_bits(n) as usize, |n: usize| 6 + index_bits(n) as usize);
    let known = [
        ("grid", 7),
        ("P1", 4 + count("P1") * grid.beta),
        ("P2", 4 + 9 + bytes(count("P2") * grid.alpha * scaled(count("P1")))),
        ("C", 4 + 4 * count("C")),
        ("I1", 4 + bytes(count("I1") * grid.beta * indices(count("C")))),
        ("I2", 4 + bytes(count("I2") * grid.alpha * indices(count("I1")))),
        ("M", 4 + bytes(count("M") * (indices(count("P2")) + indices(count("I2"))))),
        ("P3", 4 + 9 + bytes(count("P3") * grid.theta * scaled(count("M")))),
        ("P4", 4 + 9 + bytes(count("P4") * grid.phi * scaled(count("P3")))),
        ("P6", 4 + 1 + 2 + 2 + 1 + 4 + 9 + bytes(64 * scaled(count("P4")))),
    ];
    let found: Vec<(&str, usize)> = out.parts().iter().map(|part| (part.name, part.bytes as usize)).collect();
    assert!(count("P2") > 2 && count("P4") > 2, "{counts:?}");
    assert_eq!(found, known);
}

#[test]
fn constant_data_take_one_item_a_book_and_no_texels() {
    let btf = flat(8, &few(), [0.5, 0.25, 0.125]);
    for precision in [Precision::Full, Precision::Compact] {
        let codec = fitted(&btf, 0.0, precision);
        assert!(codec.entries().iter().all(|(_, count)| *count == 1), "{:?}", codec.entries());
        assert_eq!(codec.plane().book.links.len(), 1, "P6 takes no bits");
        assert!(rmse(&btf, &codec) < 0.02, "{}", rmse(&btf, &codec));
        assert!(stored(&codec).len() < 170, "{}", stored(&codec).len());
    }
}

#[test]
fn the_density_of_a_constant_is_uniform() {
    let codec = fitted(&flat(2, &few(), [0.5; 3]), 1.0, Precision::Full);
    for u in [[0.0; 3], [0.3, 0.8, 0.5], [1.0 - f32::EPSILON / 2.0; 3]] {
        let (light, pdf) = codec.sample(1, &of_degrees(20.0, 33.0), u);
        assert!((pdf - 1.0 / std::f32::consts::TAU).abs() < 1e-5, "{pdf}");
        assert!((light.norm() - 1.0).abs() < 1e-5 && light.z >= 0.0);
    }
}

#[test]
fn texels_that_differ_by_a_factor_are_one_item() {
    let directions = few();
    let mut btf = striped(4, &directions);
    for picture in btf.samples.chunks_exact_mut(48) {
        let first = [picture[0]; 3];
        for (texel, out) in picture.chunks_exact_mut(3).enumerate() {
            out.copy_from_slice(&first.map(|v| v * (1.0 + texel as f32) / 16.0));
        }
    }
    let codec = fitted(&btf, 0.05, Precision::Full);
    assert_eq!(codec.entries()[6], ("P4", 1));
}

#[test]
fn a_threshold_of_0_loses_what_the_grid_loses() {
    let btf = striped(4, &few());
    let exact = Options {
        phases: [0.25, 0.25, 0.5].map(|share| Phase { share, slack: 1.0, growth: Growth::All }),
        ..options(&btf, Aim::Threshold(0.0), Precision::Full)
    };
    let (codec, _) = fit(&btf, &exact).unwrap();
    assert!(rmse(&btf, &codec) < 0.2, "{}", rmse(&btf, &codec));
}

#[test]
fn an_item_of_several_texels_is_their_mean() {
    let directions = few();
    // Of one luminance.
    let colors = [[0.5, 0.4, 0.3], [0.3, 0.4, 0.5]].map(|color| {
        let [_, cr, cb] = ycrcb(color);
        rgb([0.4, cr, cb])
    });
    let btf = fixtures::btf([2, 1], &directions, colors.concat().repeat(directions.len().pow(2)));
    let codec = fitted(&btf, 100.0, Precision::Full);
    let mean = [0, 1, 2].map(|c| 0.5 * (colors[0][c] + colors[1][c]));
    let found = codec.value(0, &Vector3::z(), &Vector3::z());
    assert!((0..3).all(|c| (found[c] - mean[c]).abs() < 2e-3), "{found:?} {mean:?}");
}

#[test]
fn refined_books_err_less_in_no_more_bytes() {
    let btf = striped(8, &few());
    let after = |refinements| {
        let options = Options { refinements, ..options(&btf, Aim::Threshold(4.0), Precision::Compact) };
        let (codec, _) = fit(&btf, &options).unwrap();
        (rmse(&btf, &codec), stored(&codec).len())
    };
    let (grown, refined) = (after(0), after(2));
    assert!(refined.0 < grown.0 && refined.1 <= grown.1, "{grown:?} {refined:?}");
}

#[test]
fn errors_fall_with_the_threshold_and_bytes_grow() {
    let btf = striped(8, &few());
    let coded: Vec<(f64, usize)> = [8.0, 2.0, 0.5]
        .map(|t| fitted(&btf, t, Precision::Compact))
        .iter()
        .map(|codec| (rmse(&btf, codec), stored(codec).len()))
        .collect();
    assert!(coded.windows(2).all(|w| w[1].0 < w[0].0 && w[1].1 > w[0].1), "{coded:?}");
    assert!(coded[1].0 < 3.0, "{coded:?}");
}

#[test]
fn a_ratio_is_met_and_hardly_exceeded() {
    let btf = striped(8, &few());
    let (codec, _) = fit(&btf, &options(&btf, Aim::Ratio(12.0), Precision::Compact)).unwrap();
    let ratio = btf.raw_bytes() as f64 / byte_count(&btf, &codec) as f64;
    assert!((12.0..12.8).contains(&ratio), "{ratio}");
}

#[test]
fn items_are_as_many_as_asked_for_or_the_miss_is_told() {
    let noted = |report: &FitReport| report.notes.iter().any(|note| note.contains("came nearest"));
    let btf = striped(8, &few());
    let (codec, report) = fit(&btf, &options(&btf, Aim::Entries(8), Precision::Compact)).unwrap();
    let (_, items) = codec.entries()[6];
    assert!((1..=8).contains(&items) && !noted(&report), "{items} {report:?}");
    let flat = flat(4, &few(), [0.5, 0.4, 0.3]);
    let (codec, report) = fit(&flat, &options(&flat, Aim::Entries(8), Precision::Compact)).unwrap();
    assert!(codec.entries()[6].1 == 1 && noted(&report), "{report:?}");
}

/// One item in every book is larger than was asked for: it is what is there, and the miss is told in bytes.
#[test]
fn a_ratio_that_nothing_gives_is_missed_by_the_least_there_is() {
    let btf = flat(4, &few(), [0.5, 0.4, 0.3]);
    let at = |ratio: f64| {
        let (codec, report) = fit(&btf, &options(&btf, Aim::Ratio(ratio), Precision::Compact)).unwrap();
        let note = report.notes.iter().find(|note| note.contains("came nearest")).cloned();
        (byte_count(&btf, &codec), codec, note)
    };
    let (bytes, least, note) = at(1e6);
    assert!(bytes as f64 > 100.0 * btf.raw_bytes() as f64 / 1e6, "{bytes}");
    assert!(note.as_ref().is_some_and(|note| note.starts_with(&format!("{bytes} came nearest"))), "{bytes}: {note:?}");
    assert!(least.entries().iter().all(|(_, count)| *count <= 1), "{:?}", least.entries());
    assert_eq!(at(1e5).1, least);
}

#[test]
fn similar_structure_is_accepted_by_ssim() {
    let btf = striped(4, &few());
    let by = |threshold| {
        let ssim = Options { measure: Measure::Ssim, ..options(&btf, Aim::Threshold(threshold), Precision::Compact) };
        fit(&btf, &ssim).unwrap().0
    };
    let (coarse, fine) = (by(30.0), by(1.0));
    assert!(stored(&coarse).len() < stored(&fine).len());
    assert!(rmse(&btf, &fine) < 6.0, "{}", rmse(&btf, &fine));
}

#[test]
fn seeds_and_threads_decide_nothing_but_the_order() {
    let btf = striped(8, &few());
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        stored(&pool.install(|| fitted(&btf, 2.0, Precision::Compact)))
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn two_materials_share_their_books() {
    let directions = few();
    let one = striped(4, &directions);
    let mut two = one.clone();
    two.samples.iter_mut().for_each(|v| *v *= 0.5);
    let alone = stored(&fitted(&one, 2.0, Precision::Compact)).len();
    let options = options(&one, Aim::Threshold(2.0), Precision::Compact);
    let (shared, _) = fit_shared(&[one, two.clone()], &options).unwrap();
    assert_eq!(shared.materials(), 2);
    assert!(stored(&shared).len() < alone * 3 / 2);
    let error = rmse(&two, &shared.with_material(1).unwrap());
    assert!(error < 4.0, "{error}");
    assert!(shared.with_material(2).is_none());
}

#[test]
fn shared_files_tell_their_materials_apart() {
    let directions = bonn_directions();
    let names = ["ribs", "felt"];
    let [one, two] = names.map(|name| Btf { name: name.into(), ..striped(4, &directions) });
    let two = Btf { exposure: 2.5, texel_pitch_mm: Some(0.5), width: 8, height: 2, ..two };
    let asked = crate::btf::FitOptions {
        codec: crate::btf::CodecKind::MultilevelVq,
        budget: Budget::Quality(60.0),
        precision: Precision::Compact,
        seed: 1,
        books: Variant::default(),
    };
    let (material, _) = crate::btf::fit_shared(vec![one.clone(), two.clone()], &asked).unwrap();
    assert_eq!(material.raw_bytes, one.raw_bytes() + two.raw_bytes());
    let read = Material::from_bytes(&material.to_bytes().0).unwrap();
    assert!(read == material && read.members() == names);
    let felt = read.member(1).unwrap();
    assert_eq!((&*felt.name, felt.exposure, felt.texel_pitch_mm), ("felt", 2.5, Some(0.5)));
    assert_eq!((felt.codec.frame().width, felt.codec.frame().height), (8, 2));
    // As the shown one of its own file.
    let again = Material::from_bytes(&felt.to_bytes().0).unwrap();
    assert!(again == felt && again.member(0).unwrap().name == "ribs" && again.member(2).is_none());
    for codec in [crate::btf::CodecKind::Pca, crate::btf::CodecKind::GaussianMixture] {
        let asked = crate::btf::FitOptions { codec, ..asked };
        assert!(crate::btf::fit_shared(vec![one.clone(), two.clone()], &asked).is_err(), "{codec}");
        let ssim = crate::btf::FitOptions { books: Variant { measure: Measure::Ssim, ..Variant::default() }, ..asked };
        assert!(crate::btf::fit(one.clone(), &ssim).is_err(), "{codec}");
    }
    assert!(crate::btf::fit_shared(Vec::new(), &asked).is_err());
}

/// Its texels are one item, yet one of several that the book has.
#[test]
fn a_constant_material_beside_another_is_read_back() {
    let directions = few();
    let one = striped(4, &directions);
    let constant = Btf { samples: one.samples.iter().map(|_| 0.3).collect(), ..one.clone() };
    let options = options(&one, Aim::Threshold(2.0), Precision::Compact);
    for materials in [[one.clone(), constant.clone()], [constant, one.clone()]] {
        let (shared, _) = fit_shared(&materials, &options).unwrap();
        let bytes = stored(&shared);
        let read = MultilevelVq::read(&mut Reader::new(&bytes), shared.frame().clone()).unwrap();
        assert!(read == shared);
    }
    let turned = Btf { lights: one.lights.iter().rev().copied().collect(), ..one.clone() };
    let refused = fit_shared(&[one, turned], &options).unwrap_err();
    assert!(refused.to_string().contains("different directions"), "{refused}");
}

/// One logarithm holds for all of a book.
#[test]
fn high_ranges_share_a_logarithm() {
    let linear = |factor: f32| {
        let mut btf = Btf { encoding: Encoding::Linear, ..striped(2, &few()) };
        btf.samples.iter_mut().for_each(|s| *s *= factor);
        btf
    };
    let asked = crate::btf::FitOptions {
        codec: crate::btf::CodecKind::MultilevelVq,
        budget: Budget::Quality(80.0),
        precision: Precision::Compact,
        seed: 1,
        books: Variant { color: ColorSpace::LogLuv, ..Variant::default() },
    };
    let (material, _) = crate::btf::fit_shared(vec![linear(1.0), linear(4.0)], &asked).unwrap();
    let (light, view) = (Vector3::z(), Vector3::z());
    let radiance = |member: usize| {
        let member = material.member(member).unwrap();
        let Codec::MultilevelVq(codec) = &member.codec else { unreachable!("it was asked for") };
        member.encoding.decode(codec.value(0, &light, &view)[1])
    };
    assert!((radiance(1) / radiance(0) / 4.0 - 1.0).abs() < 0.1, "{} {}", radiance(0), radiance(1));
}

#[test]
fn smaller_sizes_average_radiance() {
    let btf = striped(8, &few());
    let options = Options { mip_maps: true, ..options(&btf, Aim::Threshold(1.0), Precision::Compact) };
    let (codec, _) = fit(&btf, &options).unwrap();
    assert_eq!(codec.sizes(), [[8, 8], [4, 4], [2, 2], [1, 1]]);
    let (light, view) = (Vector3::z(), Vector3::z());
    let mean: f32 = (0..64).map(|t| btf.encoding.decode(codec.value(t, &light, &view)[1])).sum::<f32>() / 64.0;
    let small = btf.encoding.decode(codec.level(3).unwrap().value(0, &light, &view)[1]);
    assert!(codec.level(4).is_none());
    assert!((small / mean - 1.0).abs() < 0.15, "{small} {mean}");
}

#[test]
fn a_brdf_is_a_material_of_one_texel() {
    let btf = striped(1, &bonn_directions());
    let codec = fitted(&btf, 1.0, Precision::Compact);
    assert!(rmse(&btf, &codec) < 1.0, "{}", rmse(&btf, &codec));
}

#[test]
fn black_stays_black_and_draws_evenly() {
    let btf = flat(4, &few(), [0.0; 3]);
    let codec = fitted(&btf, 1.0, Precision::Compact);
    assert_eq!(rmse(&btf, &codec), 0.0);
    let (_, pdf) = codec.sample(0, &Vector3::z(), [0.2, 0.9, 0.4]);
    assert!(pdf > 0.0);
}

#[test]
fn a_view_that_is_black_is_black_beside_others() {
    let directions = few();
    let mut btf = striped(4, &directions);
    let view = 48 * directions.len();
    btf.samples[3 * view..4 * view].fill(0.0);
    let codec = fitted(&btf, 1.0, Precision::Compact);
    let decoded = codec.picture(&Vector3::z(), &btf.views[3].cast());
    assert!(decoded.iter().all(|v| v.is_finite() && *v < 0.1));
}

#[test]
fn one_view_and_one_light_answer_everywhere() {
    let single = [Vector3::z()];
    for directions in
        [&single[..], &[Vector3::z(), Vector3::z()], &[Vector3::new(0.6, 0.0, 0.8), Vector3::new(-0.6, 0.0, 0.8)]]
    {
        let btf = flat(2, directions, [0.5, 0.4, 0.3]);
        let codec = fitted(&btf, 1.0, Precision::Compact);
        let value = codec.value(0, &of_degrees(50.0, 10.0), &of_degrees(80.0, 200.0));
        assert!((value[0] - 0.5).abs() < 0.01, "{value:?}");
    }
}

#[test]
fn a_range_of_a_million_stays_finite() {
    let directions = few();
    let mut btf = striped(2, &directions);
    btf.encoding = Encoding::Linear;
    btf.samples.iter_mut().enumerate().for_each(|(i, v)| *v *= if i % 97 == 0 { 1e5 } else { 0.1 });
    let btf = crate::btf::to_coded_range(btf);
    let codec = fitted(&btf, 2.0, Precision::Compact);
    for u in [[0.1, 0.5, 0.9], [0.999, 0.001, 0.5]] {
        let (light, pdf) = codec.sample(0, &of_degrees(30.0, 30.0), u);
        assert!(pdf.is_finite() && pdf > 0.0);
        assert!(codec.value(0, &light, &of_degrees(30.0, 30.0)).iter().all(|v| v.is_finite()));
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let btf = flat(1, &few(), [0.5; 3]);
    for budget in [Budget::Ratio(0.0), Budget::Ratio(f64::NAN), Budget::Quality(101.0), Budget::Components(0)] {
        assert!(Options::new(&btf, budget, Precision::Compact, 0).is_err(), "{budget:?}");
    }
    assert!(fit_shared(&[], &options(&btf, Aim::Threshold(1.0), Precision::Full)).is_err());
}

/// χ² of a million draws over 20 × 20 cells of equal solid angle against the density's integral, in standard deviations.
fn deviation(codec: &MultilevelVq, view: &Vector3<f32>, draws: usize) -> f64 {
    const SIDE: usize = 20;
    const FINE: usize = 24;
    let grid = Grid { axis: Axis::Along, ..Grid::PAPER };
    let mut expected = vec![0.0_f64; SIDE * SIDE];
    for i in 0..(SIDE * FINE).pow(2) {
        let (row, column) = (i / (SIDE * FINE), i % (SIDE * FINE));
        let at = |k: usize| (k as f32 + 0.5) / (SIDE * FINE) as f32;
        let light = grid.direction(std::f32::consts::PI * (at(row) - 0.5), 2.0 * at(column) - 1.0);
        let solid = std::f64::consts::TAU / ((SIDE * FINE).pow(2)) as f64;
        expected[row / FINE * SIDE + column / FINE] += solid * f64::from(codec.pdf(0, view, &light));
    }
    let total: f64 = expected.iter().sum();
    assert!((total - 1.0).abs() < 2e-3, "the density integrates to {total}");
    let mut counts = vec![0.0_f64; SIDE * SIDE];
    let numbers: Vec<f32> = random(3 * draws, 7).collect();
    for u in numbers.chunks_exact(3) {
        let (light, pdf) = codec.sample(0, view, [u[0], u[1], u[2]]);
        assert!(pdf > 0.0 && (light.norm() - 1.0).abs() < 1e-4);
        let [alpha, s] = grid.onion(&light);
        let cell = |x: f32| ((x * SIDE as f32) as usize).min(SIDE - 1);
        counts[cell(alpha / std::f32::consts::PI + 0.5) * SIDE + cell(0.5 * (s + 1.0))] += 1.0;
    }
    let terms = expected.iter().zip(&counts).map(|(e, n)| (n - e * draws as f64).powi(2) / (e * draws as f64));
    let freedom = (SIDE * SIDE - 1) as f64;
    (terms.sum::<f64>() - freedom) / (2.0 * freedom).sqrt()
}

#[test]
fn drawn_lights_follow_the_density() {
    let codec = fitted(&striped(2, &bonn_directions()), 1.0, Precision::Compact);
    for view in [Vector3::z(), of_degrees(40.0, 67.0)] {
        let deviation = deviation(&codec, &view, 1_000_000);
        assert!(deviation.abs() < 6.0, "{deviation} standard deviations");
    }
}

#[test]
fn drawing_by_reflectance_beats_the_cosine() {
    let codec = fitted(&striped(1, &bonn_directions()), 1.0, Precision::Compact);
    let view = of_degrees(45.0, 0.0);
    let radiance = |light: &Vector3<f32>| f64::from(Encoding::Srgb.decode(codec.value(0, light, &view)[1]));
    let variance = |estimates: &[f64]| {
        let mean = estimates.iter().sum::<f64>() / estimates.len() as f64;
        estimates.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / estimates.len() as f64
    };
    let numbers: Vec<f32> = random(30_000, 3).collect();
    let drawn: Vec<f64> = (numbers.chunks_exact(3))
        .map(|u| codec.sample(0, &view, [u[0], u[1], u[2]]))
        .map(|(light, pdf)| radiance(&light) / f64::from(pdf))
        .collect();
    let cosine: Vec<f64> = (numbers.chunks_exact(3))
        .map(|u| of_degrees((1.0 - u[0]).sqrt().acos().to_degrees(), 360.0 * u[1]))
        .map(|light| radiance(&light) / f64::from(light.z.max(1e-4)) * std::f64::consts::PI)
        .collect();
    assert!(variance(&drawn) < variance(&cosine), "{} {}", variance(&drawn), variance(&cosine));
}

#[test]
fn a_file_cut_short_or_changed_answers_or_is_refused() {
    let codec = fitted(&striped(4, &few()), 4.0, Precision::Compact);
    let bytes = stored(&codec);
    let frame = codec.frame().clone();
    let numbers: Vec<f32> = random(4000, 5).collect();
    for pick in numbers.chunks_exact(2) {
        let mut changed = bytes.clone();
        let at = (pick[0] * bytes.len() as f32) as usize % bytes.len();
        changed[at] ^= 1 << (pick[1] * 8.0) as u32;
        for hostile in [&changed[..], &bytes[..at]] {
            let Ok(read) = MultilevelVq::read(&mut Reader::new(hostile), frame.clone()) else { continue };
            let (light, pdf) = read.sample(15, &of_degrees(50.0, 100.0), [0.3, 0.6, 0.9]);
            assert!(pdf >= 0.0 && read.value(15, &light, &of_degrees(50.0, 100.0)).iter().all(|v| v.is_finite()));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn files_return_what_was_written(threshold in 0.2_f64..20.0, full: bool, mip_maps: bool, seed: u64) {
        let btf = striped(3, &bonn_directions()[..7]);
        let precision = if full { Precision::Full } else { Precision::Compact };
        let options = Options { mip_maps, seed, ..options(&btf, Aim::Threshold(threshold), precision) };
        let (codec, _) = fit(&btf, &options).unwrap();
        let bytes = stored(&codec);
        let mut from = Reader::new(&bytes);
        let read = MultilevelVq::read(&mut from, codec.frame().clone()).unwrap();
        prop_assert_eq!(from.left(), 0);
        prop_assert_eq!(&read, &codec);
        prop_assert_eq!(stored(&read), bytes);
    }
}
