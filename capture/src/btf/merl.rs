//! Isotropic reflectance as measured by Matusik, Pfister, Brand and McMillan ("A Data-Driven Reflectance
//! Model", SIGGRAPH 2003): a BTF of one texel.
//!
//! ```text
//! 3 × i32    90, 90, 180: half angle θ_h, difference angles θ_d, φ_d
//! f64        planes R, G, B; index φ_d + 180 (θ_d + 90 θ_h)
//! ```
//!
//! Values times 1/1500, 1.15/1500, 1.66/1500 are 1/sr, without the cosine. θ_h is quantised as
//! `90 √(θ_h / 90°)`, so that highlights have most cells (Rusinkiewicz, "A New Change of Variables for
//! Efficient BRDF Representation", 1998). Negative values mark what could not be measured.

use super::{Btf, Encoding, bonn_directions};
use crate::CaptureError;
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

const DIMENSIONS: [i32; 3] = [90, 90, 180];
const CELLS: usize = 90 * 90 * 180;
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

/// Half and difference angles of a pair of directions, in radians: θ_h, φ_h, θ_d, φ_d.
///
/// By arc tangents, which keep their digits where highlights are, at θ_h near 0.
pub fn half_difference(light: &Vector3<f64>, view: &Vector3<f64>) -> [f64; 4] {
    let half = (light + view).try_normalize(1e-6).unwrap_or_else(Vector3::z);
    let theta_h = half.x.hypot(half.y).atan2(half.z);
    let phi_h = if half.x.hypot(half.y) < 1e-12 { 0.0 } else { half.y.atan2(half.x) };
    let (sin_p, cos_p) = phi_h.sin_cos();
    let (sin_t, cos_t) = theta_h.sin_cos();
    // R_y(−θ_h) R_z(−φ_h) ω_i
    let turned = Vector3::new(cos_p * light.x + sin_p * light.y, cos_p * light.y - sin_p * light.x, light.z);
    let d = Vector3::new(cos_t * turned.x - sin_t * turned.z, turned.y, sin_t * turned.x + cos_t * turned.z);
    [theta_h, phi_h, d.x.hypot(d.y).atan2(d.z), d.y.atan2(d.x)]
}

/// Reads the file, at the 81 × 81 directions of Bonn.
///
/// # Errors
/// Where the file is no such table.
pub fn read_merl(path: &Path) -> Result<Btf, CaptureError> {
    let bytes = std::fs::read(path).map_err(|e| CaptureError::io(path, e))?;
    let table = table(&bytes).ok_or_else(|| {
        let fault = format!("it is no table of 3 × 90 × 90 × 180 numbers: {} bytes", bytes.len());
        CaptureError::invalid(path, fault, format!("fetch it again; {} bytes are due", 12 + 8 * 3 * CELLS))
    })?;
    let directions = bonn_directions();
    let pairs = directions.iter().flat_map(|view| directions.iter().map(move |light| (view, light)));
    let value = |(view, light): (&Vector3<f64>, &Vector3<f64>)| {
        let cell = cell(light, view);
        [0, 1, 2].map(|c| {
            let raw = number(table, c * CELLS + cell);
            if raw < 0.0 { f32::NAN } else { (raw * SCALE[c]) as f32 }
        })
    };
    let mut btf = Btf {
        name: path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        samples: pairs.flat_map(value).collect(),
        views: directions.clone(),
        lights: directions.clone(),
        width: 1,
        height: 1,
        encoding: Encoding::Linear,
        exposure: 1.0,
        includes_cosine: false,
        texel_pitch_mm: None,
        measured: Vec::new(),
    };
    btf.check()?;
    Ok(btf)
}

/// The numbers, where the header and the length are right.
fn table(bytes: &[u8]) -> Option<&[u8]> {
    let (header, table) = bytes.split_at_checked(12)?;
    let expected: Vec<u8> = DIMENSIONS.iter().flat_map(|n| n.to_le_bytes()).collect();
    (header == expected && table.len() == 8 * 3 * CELLS).then_some(table)
}

fn number(table: &[u8], index: usize) -> f64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&table[8 * index..8 * index + 8]);
    f64::from_le_bytes(bytes)
}

/// The cell of a pair of directions; φ_d and φ_d + π are one, by reciprocity.
fn cell(light: &Vector3<f64>, view: &Vector3<f64>) -> usize {
    let [theta_h, _, theta_d, phi_d] = half_difference(light, view);
    let half = ((theta_h / FRAC_PI_2).max(0.0).sqrt() * 90.0) as usize;
    let difference = (theta_d / FRAC_PI_2 * 90.0) as usize;
    let azimuth = (phi_d.rem_euclid(PI) / PI * 180.0) as usize;
    azimuth.min(179) + 180 * (difference.min(89) + 90 * half.min(89))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(theta: f64, phi: f64) -> Vector3<f64> {
        let (theta, phi) = (theta.to_radians(), phi.to_radians());
        Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    }

    #[test]
    fn half_and_difference_angles_are_the_known_ones() {
        let mirror = half_difference(&direction(30.0, 0.0), &direction(30.0, 180.0));
        assert!(mirror[0].abs() < 1e-12 && (mirror[2].to_degrees() - 30.0).abs() < 1e-9);
        let found = half_difference(&direction(60.0, 0.0), &direction(30.0, 90.0)).map(f64::to_degrees);
        for (found, known) in found.iter().zip([36.2060, 30.0, 32.1705, -54.4156]) {
            assert!((found - known).abs() < 1e-4, "{found} {known}");
        }
    }

    #[test]
    fn exchanging_light_and_eye_asks_for_the_same_cell() {
        for (a, b) in [((60.0, 10.0), (20.0, 95.0)), ((75.0, 300.0), (45.0, 20.0))] {
            let (a, b) = (direction(a.0, a.1), direction(b.0, b.1));
            assert_eq!(cell(&a, &b), cell(&b, &a));
        }
    }

    #[test]
    fn a_table_is_scaled_and_its_unmeasured_cells_filled() {
        let mut bytes: Vec<u8> = DIMENSIONS.iter().flat_map(|n| n.to_le_bytes()).collect();
        let unmeasured = cell(&direction(45.0, 0.0), &direction(45.0, 0.0));
        for plane in 0..3 {
            for i in 0..CELLS {
                let value: f64 = if plane == 1 && i == unmeasured { -1.0 } else { 1500.0 };
                bytes.extend(value.to_le_bytes());
            }
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let btf = read_merl(file.path()).unwrap();
        assert!(btf.samples.chunks_exact(3).all(|c| c[0] == 1.0 && (c[1] - 1.15).abs() < 1e-6));
        std::fs::write(file.path(), &bytes[..99]).unwrap();
        assert!(read_merl(file.path()).unwrap_err().to_string().contains("99 bytes"));
    }
}
