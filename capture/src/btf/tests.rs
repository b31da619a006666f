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
fn the_table_of_light_is_the_formula() {
    for k in 0..=200_000 {
        let sample = k as f32 / 160_000.0;
        let (found, exact) = (Encoding::Srgb.decode(sample), crate::srgb::linear(f64::from(sample)));
        assert!((f64::from(found) - exact).abs() <= 6e-8 + 1e-7 * exact, "{sample}: {found} {exact}");
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

/// A folder with a picture of one grey level per named pair of angles.
fn folder(names: &[(&str, u8)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, level) in names {
        image::RgbImage::from_pixel(3, 2, image::Rgb([*level; 3])).save(folder.path().join(name)).unwrap();
    }
    folder
}

#[test]
fn angles_are_read_from_names_and_missing_pairs_filled() {
    let folder = folder(&[
        ("00000 tl000 pl000 tv000 pv000.png", 51),
        ("00001 tl030 pl090 tv000 pv000.png", 102),
        ("tl000_pl000_tv045_pv180.png", 204),
    ]);
    let btf = read(folder.path(), None).unwrap();
    assert_eq!((btf.views.len(), btf.lights.len(), btf.width, btf.height), (2, 2, 3, 2));
    assert!((btf.lights[1] - Vector3::new(0.0, 0.5, 0.75_f64.sqrt())).norm() < 1e-12);
    assert_eq!([0, 1, 2, 3].map(|pair| btf.is_measured(pair / 2, pair % 2)), [true, true, true, false]);
    // The light that is missing of the second view is filled from the other one.
    assert!((btf.picture(1, 1)[0] - 0.8).abs() < 1e-6 && (btf.picture(0, 1)[0] - 0.4).abs() < 1e-6);
}

#[test]
fn floats_are_read_as_linear_radiance() {
    let folder = tempfile::tempdir().unwrap();
    for (name, radiance) in [("tl000 pl000 tv000 pv000.exr", 0.125), ("tl060 pl090 tv000 pv000.exr", 25_000.0)] {
        let texel = |x: u32, y: u32| image::Rgb([radiance, radiance * x as f32, radiance * y as f32]);
        image::Rgb32FImage::from_fn(3, 2, texel).save(folder.path().join(name)).unwrap();
    }
    let btf = read_folder(folder.path(), None).unwrap();
    assert_eq!((btf.encoding, btf.views.len(), btf.lights.len()), (Encoding::Linear, 1, 2));
    let expected = |radiance: f32| [0.0, 1.0].map(|y| [0.0, 1.0, 2.0].map(|x| [radiance, radiance * x, radiance * y]));
    for (light, radiance) in [(0, 0.125), (1, 25_000.0)] {
        assert_eq!(btf.picture(0, light), expected(radiance).as_flattened().as_flattened(), "{light}");
    }
    // 12 bits a sample.
    assert_eq!(btf.raw_bytes(), 2 * 6 * 3 * 12 / 8);
}

/// A hole of one channel is filled from the other light.
#[test]
fn floats_that_are_no_numbers_are_filled() {
    let folder = tempfile::tempdir().unwrap();
    for (name, first) in [("tl000 pl000 tv000 pv000.exr", f32::NAN), ("tl060 pl090 tv000 pv000.exr", 7.0)] {
        let texel = |x: u32, y: u32| image::Rgb([if (x, y) == (0, 0) { first } else { 1.0 }, 2.0, 3.0]);
        image::Rgb32FImage::from_fn(3, 2, texel).save(folder.path().join(name)).unwrap();
    }
    assert_eq!(read_folder(folder.path(), None).unwrap().picture(0, 0)[..4], [7.0, 2.0, 3.0, 1.0]);
}

#[test]
fn two_pictures_of_one_pair_are_refused() {
    let folder = folder(&[("0 tl000 pl000 tv000 pv000.png", 1), ("1 tl000 pl360 tv000 pv000.png", 2)]);
    assert!(read(folder.path(), None).unwrap_err().to_string().contains("same view and light"));
}

#[test]
fn a_list_of_lights_names_its_pictures() {
    let folder = folder(&[("lion 1.png", 51), ("lion 2.png", 255)]);
    let list = folder.path().join("dirs.lp");
    std::fs::write(&list, "2\r\nlion 1.png  0 0\t2\r\nlion 2.png 3   0 4\r\n").unwrap();
    let btf = read(folder.path(), Some(1)).unwrap();
    assert_eq!((btf.views.len(), btf.width, btf.height), (1, 1, 1));
    assert!((btf.lights[1] - Vector3::new(0.6, 0.0, 0.8)).norm() < 1e-12);
    assert!((btf.picture(0, 0)[0] - 0.2).abs() < 1e-6 && btf.picture(0, 1)[0] == 1.0);
    for (text, said) in
        [("3\na 0 0 1\n", "3 pictures are announced"), ("1\na 0 0 -1\n", "below the surface"), ("", "number")]
    {
        std::fs::write(&list, text).unwrap();
        assert!(read(&list, None).unwrap_err().to_string().contains(said), "{text}");
    }
}

#[test]
fn what_is_no_material_is_named() {
    let file = tempfile::Builder::new().suffix(".txt").tempfile().unwrap();
    assert!(read(file.path(), None).unwrap_err().to_string().contains("no measured material"));
    assert!(read("nowhere.btf".as_ref(), None).is_err());
}

#[test]
fn pictures_with_nothing_in_them_count_as_not_measured() {
    let mut btf = ramp(3);
    btf.samples[12..24].fill(f32::NAN);
    btf.samples[0] = f32::NAN;
    assert_eq!(btf.check().unwrap(), 13);
    assert_eq!([0, 1, 2].map(|light| btf.is_measured(0, light)), [true, false, true]);
}

#[test]
fn letters_of_a_name_are_no_angles() {
    let folder =
        folder(&[("bottle sample tl030 pl000 tv000 pv000.png", 9), ("bottle sample tl000 pl000 tv000 pv000.png", 9)]);
    assert_eq!(read(folder.path(), None).unwrap().lights.len(), 2);
}
