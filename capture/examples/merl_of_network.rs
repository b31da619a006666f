//! A MERL table out of the weights of a network that was fitted to one: 675 floats in place of 33 MB.
//!
//! ```text
//! merl_of_network WEIGHTS ROW TABLE      WEIGHTS: rows of 675 little-endian f32; TABLE: the .binary file to write
//! brdf = exp(W₃ relu(W₂ relu(W₁ x + b₁) + b₂) + b₃) − 1      x = half vector without azimuth, difference vector
//! ```
//!
//! 6 → 21 → 21 → 3, weights stored input by input. Cells below the horizon, empty in a measured table, hold what the
//! network thinks of them. Source: Sztrajman, Rainer, Ritschel, Weyrich, "Neural BRDF Representation and
//! Importance Sampling", Computer Graphics Forum 40(6), 2021; the table: [`capture::btf::read_merl`].

use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};

const ROW: usize = 675;
const LAYERS: [[usize; 2]; 3] = [[6, 21], [21, 21], [21, 3]];
/// 1/sr of a table's units, R, G, B.
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [weights, row, table] = &arguments[..] else { return Err("usage: merl_of_network WEIGHTS ROW TABLE".into()) };
    let bytes = std::fs::read(weights)?;
    let number = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
    let numbers: Vec<f64> = bytes.as_chunks::<4>().0.iter().map(number).collect();
    let network = numbers.chunks_exact(ROW).nth(row.parse()?).ok_or_else(|| format!("{weights} has no row {row}"))?;
    let mut planes = [const { Vec::new() }; 3];
    for cell in 0..90 * 90 * 180 {
        let brdf = evaluate(network, inputs(cell));
        (0..3).for_each(|c| planes[c].push(brdf[c] / SCALE[c]));
    }
    let header = [90_i32, 90, 180].into_iter().flat_map(i32::to_le_bytes);
    let numbers = planes.concat().into_iter().flat_map(f64::to_le_bytes);
    std::fs::write(table, header.chain(numbers).collect::<Vec<u8>>())?;
    Ok(())
}

/// Half and difference vector at the middle of a cell: θ_h by its square root, θ_d, φ_d the fastest.
fn inputs(cell: usize) -> [f64; 6] {
    let middle = |index: usize| index as f64 + 0.5;
    let half = (middle(cell / (180 * 90)) / 90.0).powi(2) * FRAC_PI_2;
    let (difference, azimuth) = (middle(cell / 180 % 90) / 90.0 * FRAC_PI_2, middle(cell % 180) / 180.0 * PI);
    let across = difference.sin();
    [half.sin(), 0.0, half.cos(), across * azimuth.cos(), across * azimuth.sin(), difference.cos()]
}

/// Reflectance in 1/sr, R, G, B.
fn evaluate(mut weights: &[f64], inputs: [f64; 6]) -> [f64; 3] {
    let mut values = inputs.to_vec();
    for [from, to] in LAYERS {
        let (matrix, rest) = weights.split_at(from * to);
        let sum = |k: usize| rest[k] + (0..from).map(|i| values[i] * matrix[i * to + k]).sum::<f64>();
        values = (0..to).map(|k| if to == 3 { sum(k) } else { sum(k).max(0.0) }).collect();
        weights = &rest[to..];
    }
    [0, 1, 2].map(|c| (values[c].exp() - 1.0).max(0.0))
}
