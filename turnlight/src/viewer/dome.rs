//! The directions in which a facet was photographed, as a plot: the axis in the middle, the plane across it a circle.
//!
//! Azimuthal and equidistant: the radius is the angle from the axis, 1 at a right angle, 2 at the far side.

use nalgebra::{Point3, Vector3};
use render::path::usable_axis;
use std::f64::consts::FRAC_PI_2;
use texture::directions::DirectionComplex;

/// Steps in which an arc is drawn.
const STEPS: usize = 10;

/// What is plotted; x to the right and y up, azimuth counter-clockwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Dome {
    /// Where the facet was seen from.
    pub sites: Vec<[f64; 2]>,
    /// Arcs between neighbours, as polylines.
    pub arcs: Vec<Vec<[f64; 2]>>,
    /// Where the eye is.
    pub eye: [f64; 2],
    /// The sites it is blended of and their shares, largest first; shares sum to 1.
    pub shares: Vec<(usize, f64)>,
    /// Radius that holds everything, at least 1.
    pub reach: f64,
}

/// Axes of a plot: to the right, up in the plot, out of the middle; unit and perpendicular.
#[derive(Clone, Copy, Debug)]
pub struct Axes([Vector3<f64>; 3]);

impl Axes {
    /// About `up`, of any length; none gives z.
    pub fn about(up: &Vector3<f64>) -> Self {
        let up = usable_axis(*up);
        let side = Vector3::ith(up.iamin(), 1.0);
        let right = (side - up * up.dot(&side)).normalize();
        Self([right, up.cross(&right), up])
    }

    /// Where a direction, of any length, is plotted.
    fn place(&self, direction: &Vector3<f64>) -> [f64; 2] {
        let [x, y, z] = self.0.map(|axis| axis.dot(direction));
        let level = x.hypot(y);
        let radius = level.atan2(z) / FRAC_PI_2;
        if level > 0.0 { [radius * x / level, radius * y / level] } else { [radius, 0.0] }
    }
}

/// The plot of a facet at `centre`, seen from `eye`; all in the same coordinates.
pub fn dome(complex: &DirectionComplex, centre: &Point3<f64>, eye: &Point3<f64>, axes: &Axes) -> Dome {
    let sites = complex.sites();
    let mut pairs: Vec<[u32; 2]> = complex
        .triangles()
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .chain(complex.edges().iter().copied())
        .collect();
    pairs.iter_mut().for_each(|pair| pair.sort_unstable());
    pairs.sort_unstable();
    pairs.dedup();
    let arc = |&[a, b]: &[u32; 2]| {
        let (from, to) = (sites[a as usize], sites[b as usize]);
        (0..=STEPS).map(|k| axes.place(&from.lerp(&to, k as f64 / STEPS as f64))).collect()
    };
    let looks = eye - centre;
    let entries = complex.blend(&looks).map_or(Vec::new(), |blend| blend.entries.to_vec());
    let mut shares: Vec<(usize, f64)> =
        entries.into_iter().filter(|entry| entry.1 > 0.0).map(|(site, share)| (site as usize, share)).collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    plot(
        sites.iter().map(|site| axes.place(site)).collect(),
        pairs.iter().map(arc).collect(),
        axes.place(&looks),
        shares,
    )
}

/// The plot of the cameras at `eyes` about `centre`, of which nothing is interpolated.
pub fn dome_of_eyes(eyes: &[Point3<f64>], centre: &Point3<f64>, eye: &Point3<f64>, axes: &Axes) -> Dome {
    let sites = eyes.iter().map(|other| axes.place(&(other - centre))).collect();
    plot(sites, Vec::new(), axes.place(&(eye - centre)), Vec::new())
}

fn plot(sites: Vec<[f64; 2]>, arcs: Vec<Vec<[f64; 2]>>, eye: [f64; 2], shares: Vec<(usize, f64)>) -> Dome {
    let reach = sites.iter().chain([&eye]).map(|[x, y]| x.hypot(*y)).filter(|r| r.is_finite()).fold(1.0, f64::max);
    Dome { sites, arcs, eye, shares, reach }
}

#[cfg(test)]
mod tests {
    use super::*;
    use texture::directions::Layout;

    #[test]
    fn the_axis_is_in_the_middle_and_angles_are_radii() {
        let axes = Axes::about(&Vector3::new(0.0, 0.0, 2.0));
        for (direction, radius) in
            [([0.0, 0.0, 1.0], 0.0), ([0.0, 3.0, 0.0], 1.0), ([1.0, 0.0, -1.0], 1.5), ([0.0, 0.0, -1.0], 2.0)]
        {
            let [x, y] = axes.place(&direction.into());
            assert!((x.hypot(y) - radius).abs() < 1e-12, "{direction:?}");
        }
        assert!(Axes::about(&Vector3::repeat(f64::NAN)).0[2] == Vector3::z());
    }

    #[test]
    fn an_eye_at_a_site_takes_it_whole_and_lies_on_it() {
        let sites: Vec<Vector3<f64>> =
            [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [-1.0, 0.2, 0.5], [0.1, -1.0, 0.6], [0.1, 0.0, 1.0]]
                .map(|d: [f64; 3]| Vector3::from(d).normalize())
                .to_vec();
        let complex = DirectionComplex::build(&sites, Layout::General);
        let (centre, axes) = (Point3::new(1.0, 2.0, 3.0), Axes::about(&Vector3::z()));
        for (k, site) in sites.iter().enumerate() {
            let dome = dome(&complex, &centre, &(centre + site * 5.0), &axes);
            assert_eq!(dome.shares[0].0, k);
            assert!((dome.shares[0].1 - 1.0).abs() < 1e-9);
            assert!((0..2).all(|i| (dome.eye[i] - dome.sites[k][i]).abs() < 1e-9));
        }
        let between = dome(&complex, &centre, &(centre + sites[4] + sites[0] * 0.5), &axes);
        assert!((between.shares.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(between.shares.len() >= 2 && between.arcs.len() >= 7);
    }
}
