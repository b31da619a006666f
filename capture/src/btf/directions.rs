//! The 81 directions under which the University of Bonn measured its materials in 2003.
//!
//! Rings of constant polar angle from the pole outward, in each the azimuth from 0 in equal steps
//! (Sattler, Sarlette, Klein, "Efficient and Realistic Visualization of Cloth", EGSR 2003). One list
//! serves light and view.

use nalgebra::Vector3;

/// Number of directions of light, and of view.
pub const DIRECTIONS: usize = 81;
/// Polar angle and number of azimuths of each ring, from the pole outward.
const RINGS: [(u16, u16); 6] = [(0, 1), (15, 6), (30, 12), (45, 18), (60, 20), (75, 24)];
/// Half of what lies between two rings.
const HALF_RING_DEG: f64 = 7.5;

/// A direction from the surface towards the light or the eye, in whole degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BtfDirection {
    /// From the normal, 0 to 75.
    pub theta_deg: u16,
    /// From x towards y, 0 to 359.
    pub phi_deg: u16,
}

impl BtfDirection {
    /// All directions, in the order of the measurement.
    pub fn all() -> Vec<Self> {
        let ring =
            |(theta_deg, count): (u16, u16)| (0..count).map(move |k| Self { theta_deg, phi_deg: k * (360 / count) });
        RINGS.into_iter().flat_map(ring).collect()
    }

    /// The unit vector; z is the normal of the reference plane.
    pub fn vector(self) -> Vector3<f64> {
        let (st, ct) = f64::from(self.theta_deg).to_radians().sin_cos();
        let (sp, cp) = f64::from(self.phi_deg).to_radians().sin_cos();
        Vector3::new(st * cp, st * sp, ct)
    }

    /// The solid angle it stands for in a sum over [`BtfDirection::all`], in steradians: its share of
    /// the band between the polar angles half way to the neighbouring rings.
    pub fn solid_angle(self) -> f64 {
        let theta = f64::from(self.theta_deg);
        let edge = |deg: f64| deg.max(0.0).to_radians().cos();
        let band = std::f64::consts::TAU * (edge(theta - HALF_RING_DEG) - edge(theta + HALF_RING_DEG));
        let count = RINGS.iter().find(|ring| ring.0 == self.theta_deg).map_or(1, |ring| ring.1);
        band / f64::from(count)
    }
}

/// The unit vectors of [`BtfDirection::all`].
pub fn bonn_directions() -> Vec<Vector3<f64>> {
    BtfDirection::all().into_iter().map(BtfDirection::vector).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_the_published_one() {
        let all = BtfDirection::all();
        assert_eq!(all.len(), DIRECTIONS);
        for (index, theta_deg) in [(0, 0), (1, 15), (7, 30), (19, 45), (37, 60), (57, 75)] {
            assert_eq!(all[index], BtfDirection { theta_deg, phi_deg: 0 });
            assert!(index == 0 || all[index - 1].theta_deg < theta_deg);
        }
        // View 8 of the measured folders is called tv030_pv030.
        assert_eq!(all[8], BtfDirection { theta_deg: 30, phi_deg: 30 });
        assert_eq!(all[80], BtfDirection { theta_deg: 75, phi_deg: 345 });
    }

    #[test]
    fn solid_angles_integrate_a_cosine_to_pi() {
        let integral: f64 = BtfDirection::all().iter().map(|d| d.solid_angle() * d.vector().z).sum();
        assert!((integral / std::f64::consts::PI - 1.0).abs() < 0.01, "{integral}");
    }
}
