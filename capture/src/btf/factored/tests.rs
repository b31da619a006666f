use super::*;
use proptest::prelude::*;

const VIEWS: usize = 2;
const LIGHTS: usize = 3;
const WIDTH: usize = 3;
const HEIGHT: usize = 2;

/// A file of rank two: `U = [1, pair]`, `SV = [texel + channel, 0.5]`, texels counted from the bottom.
fn file(size: u8, colour_model: u32) -> Vec<u8> {
    let mut out = b"!DFMF08FCR".to_vec();
    let word = |out: &mut Vec<u8>, n: usize| out.extend((n as u32).to_le_bytes());
    let float = |out: &mut Vec<u8>, x: f32| out.extend(x.to_le_bytes());
    let number = |out: &mut Vec<u8>, x: f64| match size {
        2 => out.extend(f16::from_f64(x).to_le_bytes()),
        4 => out.extend((x as f32).to_le_bytes()),
        _ => out.extend(x.to_le_bytes()),
    };
    word(&mut out, 4 + 4 + 240 + 4 + 12 + 4);
    word(&mut out, 2);
    out.extend([b' '; 240]);
    float(&mut out, 4.0);
    (0..3).for_each(|_| float(&mut out, 1.0));
    word(&mut out, 1);
    word(&mut out, VIEWS);
    for view in 0..VIEWS {
        float(&mut out, 0.4 * view as f32);
        float(&mut out, 0.0);
        word(&mut out, LIGHTS);
        for light in 0..LIGHTS {
            float(&mut out, 0.5 * light as f32);
            float(&mut out, 1.0);
        }
    }
    word(&mut out, WIDTH);
    word(&mut out, HEIGHT);
    word(&mut out, 0);
    word(&mut out, 2);
    out.extend(colour_model.to_le_bytes());
    out.extend([0; 48]);
    for channel in 0..3 {
        out.push(size);
        word(&mut out, 2);
        word(&mut out, VIEWS * LIGHTS);
        word(&mut out, WIDTH * HEIGHT);
        (0..2).for_each(|_| number(&mut out, 1.0));
        (0..VIEWS * LIGHTS).for_each(|pair| [1.0, pair as f64].iter().for_each(|&x| number(&mut out, x)));
        (0..WIDTH * HEIGHT).for_each(|t| [(t + channel) as f64, 0.5].iter().for_each(|&x| number(&mut out, x)));
    }
    out
}

fn parsed(bytes: &[u8], crop: Option<usize>) -> Result<Btf, String> {
    parse(bytes, "x".into(), crop).map_err(|f| f.fault)
}

#[test]
fn the_product_is_read_with_rows_from_the_bottom() {
    for size in [2, 4, 8] {
        let btf = parsed(&file(size, 0), None).unwrap();
        assert_eq!((btf.views.len(), btf.lights.len(), btf.width, btf.height), (VIEWS, LIGHTS, WIDTH, HEIGHT));
        assert_eq!(btf.texel_pitch_mm, Some(0.25));
        // Pair (1, 2) is 5; the top left texel is the file's texel 3.
        assert_eq!(btf.picture(1, 2)[..3], [3.0 + 2.5, 4.0 + 2.5, 5.0 + 2.5]);
    }
}

#[test]
fn a_crop_is_the_middle_of_the_whole() {
    let (whole, part) = (parsed(&file(4, 0), None).unwrap(), parsed(&file(4, 0), Some(1)).unwrap());
    assert_eq!((part.width, part.height), (1, 1));
    assert_eq!(part.picture(1, 1), &whole.picture(1, 1)[3..6]);
}

#[test]
fn grey_in_logarithmic_yuv_is_grey() {
    let rgb = Colour::LogYuv.rgb([0.5_f32.ln(), 0.0, 0.0]);
    assert!(rgb.iter().all(|c| (c - 0.5).abs() < 5e-5), "{rgb:?}");
}

#[test]
fn a_factorisation_without_components_asks_for_no_memory() {
    let mut bytes = file(4, 0);
    // K of the first channel: after the mean and the transform, and the size of its numbers.
    let at = bytes.len() - 3 * (1 + 12 + 4 * (2 + 2 * VIEWS * LIGHTS + 2 * WIDTH * HEIGHT)) + 1;
    bytes[at..at + 4].fill(0);
    assert!(parsed(&bytes, None).unwrap_err().contains("without components"));
}

proptest! {
    #[test]
    fn damaged_files_are_refused_or_read_but_never_fatal(at in 0usize..1024, value: u8, cut in 0usize..1024) {
        let mut bytes = file(4, 11);
        let length = bytes.len();
        bytes[at % length] = value;
        let _ = parsed(&bytes, None);
        prop_assert!(parsed(&bytes[..cut % length], None).is_err());
    }
}
