use super::*;

/// A BTF of one view, whose light `l` shows the level `l / 4`.
fn ramp(lights: usize) -> Btf {
    let lights: Vec<Vector3<f64>> =
        (0..lights).map(|l| Vector3::new((0.1 * l as f64).sin(), 0.0, (0.1 * l as f64).cos())).collect();
    let samples = (0..lights.len()).flat_map(|l| [l as f32 / 4.0; 12]).collect();
    Btf {
        name: "ramp".into(),
        views: vec![Vector3::z()],
        lights,
        width: 2,
        height: 2,
        encoding: Encoding::Srgb,
        exposure: 1.0,
        includes_cosine: true,
        texel_pitch_mm: None,
        samples,
        measured: Vec::new(),
    }
}

#[test]
fn encodings_return_what_they_took() {
    for encoding in [Encoding::Srgb, Encoding::Linear, Encoding::Log { floor: 0.1, peak: 1e5 }] {
        for radiance in [0.0_f32, 1e-4, 0.02, 0.5, 1.0, 7.0, 1e5] {
            let back = encoding.decode(encoding.encode(radiance));
            assert!((back - radiance).abs() <= 2e-5 * radiance.max(1e-3), "{encoding:?} {radiance} {back}");
        }
    }
}

#[test]
fn what_is_no_number_is_taken_from_the_nearest_light() {
    let mut btf = ramp(4);
    btf.samples[12 * 2 + 5] = f32::NAN;
    btf.samples[12 * 3 + 5] = f32::INFINITY;
    assert_eq!(btf.check().unwrap(), 2);
    assert_eq!(btf.samples[12 * 2 + 5], 0.25);
    assert_eq!(btf.samples[12 * 3 + 5], 0.25);
}

#[test]
fn lengths_that_disagree_are_refused() {
    let mut btf = ramp(3);
    btf.samples.pop();
    assert!(btf.check().unwrap_err().to_string().contains("needs 36 samples, 35 are there"));
}
