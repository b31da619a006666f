//! Encoded sRGB and linear light (IEC 61966-2-1), both from 0 (black) to 1 (white).

/// Linear light of an encoded value.
pub fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The encoded value of linear light; above white it goes on.
pub fn encoded(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_survives_the_way_to_light_and_back() {
        for level in 0..=255 {
            let value = f64::from(level) / 255.0;
            assert!((255.0 * encoded(linear(value)) - f64::from(level)).abs() < 1e-3, "{level}");
        }
        // Where the straight part meets the power, and the middle grey of photographers.
        assert!((linear(0.040_45 + 1e-9) - linear(0.040_45)).abs() < 1e-7);
        assert!((encoded(0.18) - 0.461).abs() < 1e-3);
    }
}
