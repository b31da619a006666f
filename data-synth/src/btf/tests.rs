//! What is known of a bidirectional texture function without tracing it.

use super::analytic::{self, grooves};
use super::patch::Patch;
use super::*;
use crate::material::Finish;
use nalgebra::Vector3;
use std::f64::consts::PI;

const DIRECT: BtfOptions = BtfOptions { size: 4, seed: 1, samples: 64, surfaces: 1 };

fn studio(patch: Patch, options: BtfOptions) -> BtfStudio {
    BtfStudio::of(Some(Tile::new(patch)), options)
}

fn relief(cells: usize, albedo: f32, height: impl Fn(f64, f64) -> f64) -> Patch {
    let mut patch = Patch::new(1.0, Finish::Matt);
    patch.relief(cells, height, |_| Vec3::repeat(albedo));
    // Facets, as the closed forms have them.
    patch.normals.fill(Vec3::zeros());
    patch
}

/// 45° grooves along y whose ridges lie in the reference plane.
fn groove_patch(albedo: f32) -> Patch {
    relief(2, albedo, |x, _| if (x - 0.5).abs() < 1e-9 { -0.5 } else { 0.0 })
}

/// Mean over the tile under each light, first channel.
fn means(view: &[f32]) -> Vec<f64> {
    let texels = view.len() / DIRECTIONS;
    view.chunks_exact(texels)
        .map(|c| c.iter().step_by(3).map(|&v| f64::from(v)).sum::<f64>() / (texels / 3) as f64)
        .collect()
}

#[test]
fn a_plane_is_lambertian_for_every_view_and_light() {
    let studio = studio(relief(3, 0.7, |_, _| 0.0), BtfOptions { size: 3, samples: 2, surfaces: 3, seed: 0 });
    for view in 0..DIRECTIONS {
        let samples = studio.view(view).unwrap();
        for (light, image) in BtfDirection::all().iter().zip(samples.chunks_exact(27)) {
            let expected = 0.7 / PI * light.vector().z;
            assert!(image.iter().all(|&v| (f64::from(v) - expected).abs() < 1e-6), "view {view}, {light:?}: {image:?}");
        }
    }
}

#[test]
fn grooves_shade_and_hide_as_the_closed_form_says() {
    let studio = studio(groove_patch(0.5), DIRECT);
    let directions = BtfDirection::all();
    for view in [0, 1, 4, 8, 19, 30, 37, 45, 57, 63, 75] {
        for (light, mean) in directions.iter().zip(means(&studio.view(view).unwrap())) {
            let expected = 0.5 / PI * grooves(light.vector(), directions[view].vector());
            assert!((mean - expected).abs() < 2.5e-3, "view {view}, {light:?}: {mean} against {expected}");
        }
    }
}

#[test]
fn one_wall_of_a_groove_goes_dark_beyond_45_degrees() {
    // Seen from the front, lit across the grooves: both walls are lit whole up to 45°, one is dark beyond.
    let towards = Vector3::z();
    for (theta_deg, walls) in [(30.0_f64, 2.0), (60.0, 1.0)] {
        let (s, c) = theta_deg.to_radians().sin_cos();
        let light = Vector3::new(s, 0.0, c);
        let lit = (c + s) / 2.0_f64.sqrt() / (1.0 + (s / c).max(1.0)) + (walls - 1.0) * (c - s) / 8.0_f64.sqrt();
        assert!((grooves(light, towards) - lit).abs() < 1e-12);
    }
}

#[test]
fn no_material_reflects_more_than_its_albedo() {
    // By quadrature over the lights, whose solid angles are good to 1 % of a cosine.
    let options = BtfOptions { size: 6, samples: 64, surfaces: 8, seed: 3 };
    for view in [0, 20, 60] {
        let mean = means(&studio(groove_patch(0.8), options).view(view).unwrap());
        let reflected: f64 = BtfDirection::all().iter().zip(mean).map(|(l, m)| l.solid_angle() * m).sum();
        // Light between the walls is reflected several times: less than the albedo, more than without.
        assert!((0.5..0.8 * 1.03).contains(&reflected), "view {view}: {reflected}");
    }
}

#[test]
fn swapping_light_and_eye_changes_nothing_on_average() {
    // Of a periodic surface, the mean over the plane divided by the light's cosine is a BRDF.
    let bumps = |x: f64, y: f64| 0.12 * ((std::f64::consts::TAU * x).sin() + (std::f64::consts::TAU * y).cos());
    let studio = studio(relief(24, 0.6, bumps), BtfOptions { size: 8, samples: 64, surfaces: 3, seed: 2 });
    let directions = BtfDirection::all();
    let brdf = |view: usize, light: usize| means(&studio.view(view).unwrap())[light] / directions[light].vector().z;
    for (a, b) in [(0, 40), (10, 62), (25, 70)] {
        let (forth, back) = (brdf(a, b), brdf(b, a));
        assert!((forth / back - 1.0).abs() < 0.03, "{a} and {b}: {forth} against {back}");
    }
}

#[test]
fn a_raised_stripe_shifts_by_its_height_times_the_tangent() {
    // White, 0.2 wide, 0.1 above a black plane. Seen from phi = 0 it moves towards −x on the reference
    // plane: what lies at x + h tan θ below it is hidden.
    let mut patch = relief(1, 0.0, |_, _| 0.0);
    let corners = [[0.4, 0.0], [0.6, 0.0], [0.6, 1.0], [0.4, 1.0]];
    let ids = corners.map(|[x, y]| patch.vertex(Vector3::new(x, y, 0.1), Vector3::z(), Vec3::repeat(1.0)));
    patch.mesh.faces.extend([[ids[0], ids[1], ids[2]], [ids[0], ids[2], ids[3]]]);
    let studio = studio(patch, BtfOptions { size: 50, samples: 4, surfaces: 1, seed: 0 });
    let middle = |view: usize| {
        let samples = studio.view(view).unwrap();
        let row: Vec<f64> = samples[..150].iter().step_by(3).map(|&v| f64::from(v)).collect();
        let sum: f64 = row.iter().sum();
        row.iter().enumerate().map(|(x, v)| (x as f64 + 0.5) / 50.0 * v).sum::<f64>() / sum
    };
    // 60° and 45° along +x: the ray that meets height h crosses z = 0 at x − h tan θ.
    for (view, theta_deg) in [(0, 0.0_f64), (19, 45.0), (37, 60.0)] {
        let expected = 0.5 - 0.1 * theta_deg.to_radians().tan();
        assert!((middle(view) - expected).abs() < 4e-3, "{theta_deg}°: {} against {expected}", middle(view));
    }
}

#[test]
fn rows_run_down_and_azimuths_turn_from_x_to_y() {
    // A ramp that rises towards +y is brightest when lit from −y (phi 270).
    let ramp = |_: f64, y: f64| 0.3 * y;
    let mut patch = relief(8, 0.5, ramp);
    patch.mesh.faces.retain(|f| f.iter().all(|&v| patch.mesh.positions[v as usize].y < 0.99));
    let studio = studio(patch, BtfOptions { size: 8, samples: 4, ..DIRECT });
    let samples = studio.view(0).unwrap();
    let texel = |light: usize, row: usize| samples[light * 192 + (row * 8 + 4) * 3];
    let all = BtfDirection::all();
    let light = |phi_deg| all.iter().position(|d| *d == BtfDirection { theta_deg: 60, phi_deg }).unwrap();
    assert!(texel(light(270), 4) > texel(light(90), 4));
    // The top of the ramp is missing: the first row, y near 1, is black.
    assert!(texel(0, 0) == 0.0 && texel(0, 7) > 0.0);
}

#[test]
fn every_material_continues_itself_across_its_border() {
    let options = BtfOptions { size: 24, samples: 4, surfaces: 1, seed: 5 };
    for material in BtfMaterial::ALL.into_iter().filter(|&m| m != BtfMaterial::Analytic) {
        let samples = BtfStudio::new(material, &options).unwrap().view(20).unwrap();
        let n = options.size;
        let at = |light: usize, x: usize, y: usize| f64::from(samples[((light * n + y) * n + x) * 3]);
        // Mean step from column x to the next, and from row to row, over all lights.
        let step = |k: usize, columns: bool| -> f64 {
            let pair =
                |l, i| if columns { at(l, k, i) - at(l, (k + 1) % n, i) } else { at(l, i, k) - at(l, i, (k + 1) % n) };
            (0..DIRECTIONS).flat_map(|l| (0..n).map(move |i| (l, i))).map(|(l, i)| pair(l, i).abs()).sum()
        };
        for columns in [true, false] {
            let inside: Vec<f64> = (0..n - 1).map(|k| step(k, columns)).collect();
            let largest = inside.iter().copied().fold(0.0, f64::max);
            let smallest = inside.iter().copied().fold(f64::MAX, f64::min);
            let border = step(n - 1, columns);
            assert!((0.8 * smallest..1.1 * largest).contains(&border), "{material}: {border} of {smallest}..{largest}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_samples_on_one_and_two_threads() {
    let measure = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = BtfOptions { size: 5, samples: 2, surfaces: 3, seed };
        pool.install(|| BtfStudio::new(BtfMaterial::Leather, &options).unwrap().view(9).unwrap())
    };
    assert_eq!(measure(1, 7), measure(2, 7));
    assert_ne!(measure(2, 7), measure(2, 8));
}

#[test]
fn analytic_quadrants_hold_their_closed_forms() {
    let btf = synthesize_btf(BtfMaterial::Analytic, &BtfOptions { size: 8, ..DIRECT }).unwrap();
    assert_eq!(btf.samples.len(), DIRECTIONS * DIRECTIONS * 8 * 8 * 3);
    let all = BtfDirection::all();
    let at =
        |v: usize, l: usize, x: usize, y: usize| f64::from(btf.samples[(((v * DIRECTIONS + l) * 8 + y) * 8 + x) * 3]);
    for (v, l) in [(0, 0), (5, 44), (70, 12)] {
        let (view, light) = (all[v].vector(), all[l].vector());
        assert!((at(v, l, 1, 1) - 0.6 / PI * light.z).abs() < 1e-6);
        assert!((at(v, l, 1, 6) - 0.5 / PI * grooves(light, view)).abs() < 1e-6);
        // Microfacets are reciprocal once the cosine is taken out.
        let forth = at(v, l, 6, 1) / light.z;
        let back = at(l, v, 6, 1) / view.z;
        assert!((forth / back - 1.0).abs() < 1e-5);
    }
    // Stripes: a mean over many points of the plane below, 0.05 tan θ further against the view.
    let (view, light) = (all[37].vector(), all[3].vector());
    let wave = |i: i32| {
        let x = (6.0 + (f64::from(i) + 0.5) / 1000.0) / 8.0 - 0.05 * 60.0_f64.to_radians().tan();
        (std::f64::consts::TAU * 4.0 * x).cos() / 1000.0
    };
    let expected = (0.4 + 0.3 * (0..1000).map(wave).sum::<f64>()) / PI * light.z;
    let radiance = analytic::radiance(8, 6, 6, light, view)[0];
    assert!((radiance - expected).abs() < 1e-6 && (at(37, 3, 6, 6) - expected).abs() < 1e-6);
}

#[test]
fn microfacets_agree_with_the_tracers_metal() {
    // The tracer adds what goes from facet to facet; without it, it is never brighter than that.
    let mut patch = Patch::new(1.0, Finish::metal(analytic::GGX_ALPHA as f32));
    patch.relief(1, |_, _| 0.0, |_| Vec3::from(analytic::GGX_REFLECTANCE.map(|c| c as f32)));
    let studio = studio(patch, BtfOptions { size: 1, samples: 1, surfaces: 1, seed: 0 });
    let samples = studio.view(19).unwrap();
    let all = BtfDirection::all();
    for (light, traced) in all.iter().zip(samples.chunks_exact(3)) {
        let exact = analytic::radiance(2, 1, 0, light.vector(), all[19].vector())[0];
        let between = f64::from(traced[0]) - exact;
        assert!((-1e-4..0.03).contains(&between), "{light:?}: {between} beside {exact}");
    }
}

#[test]
fn options_out_of_range_and_unknown_names_are_refused() {
    for (bad, name) in [
        (BtfOptions { size: 0, ..DIRECT }, "size"),
        (BtfOptions { size: 4097, ..DIRECT }, "size"),
        (BtfOptions { samples: 0, ..DIRECT }, "samples"),
        (BtfOptions { surfaces: 17, ..DIRECT }, "surfaces"),
    ] {
        let error = BtfStudio::new(BtfMaterial::Foil, &bad).unwrap_err().to_string();
        assert!(error.starts_with(name), "{error}");
    }
    let error = "velvet".parse::<BtfMaterial>().unwrap_err().to_string();
    assert!(error.contains("corduroy, knit"), "{error}");
    for material in BtfMaterial::ALL {
        assert_eq!(material.name().parse::<BtfMaterial>().unwrap(), material);
    }
}

#[test]
fn the_folder_has_the_published_names_and_reads_back() {
    let root = tempfile::tempdir().unwrap();
    let options = BtfOptions { size: 6, ..DIRECT };
    let exact = synthesize_btf(BtfMaterial::Analytic, &options).unwrap();
    let pixel = |view: usize, light: usize| &exact.samples[(view * DIRECTIONS + light) * 108..][..108];
    let name = "tv030_pv030/00332 tl015 pl180 tv030 pv030";
    for hdr in [false, true] {
        let dir = root.path().join(if hdr { "hdr" } else { "ldr" });
        let written = write_btf(BtfMaterial::Analytic, &options, hdr, &dir, |_, _| {}).unwrap();
        let read = image::open(dir.join(format!("{name}.{}", if hdr { "exr" } else { "png" }))).unwrap();
        if hdr {
            assert_eq!(read.to_rgb32f().as_raw().as_slice(), pixel(8, 4));
        } else {
            for (&level, &value) in read.to_rgb8().as_raw().iter().zip(pixel(8, 4)) {
                let expected = crate::film::encode(value * written.exposure as f32).round();
                assert_eq!(f32::from(level), expected);
            }
        }
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(dir.join("btf.json")).unwrap()).unwrap();
        assert_eq!(json["name"], "analytic");
        assert_eq!(std::fs::read_dir(&dir).unwrap().count(), DIRECTIONS + 1);
        assert!(matches!(write_btf(BtfMaterial::Foil, &options, hdr, &dir, |_, _| {}), Err(SynthError::Exists { .. })));
    }
    assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 2, "nothing is left beside it");
}
