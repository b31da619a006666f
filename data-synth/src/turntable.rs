//! Where the cameras stand. The object is at rest in the world; the cameras go around it, which is
//! the same as a still camera and a turning table, if the lights go around with them.

use crate::error::SynthError;
use crate::sampler::splitmix;
use capture::{Aabb, Camera, Intrinsics};
use geometry::Mesh;
use nalgebra::{Matrix3, Point3, Vector3};
use std::f64::consts::{PI, TAU};

/// How the views are spread.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// Full turns at fixed elevations, in degrees above the table; views are shared evenly among the
    /// rings, and neighbouring rings start half a step apart.
    Rings {
        /// Elevation of each ring, in (−89, 89).
        elevations_deg: Vec<f64>,
    },
    /// One path of several turns that climbs from one elevation to another.
    Spiral {
        /// Elevation of the first view, in degrees.
        from_deg: f64,
        /// Elevation of the last view, in degrees.
        to_deg: f64,
        /// Full turns, positive.
        turns: f64,
    },
    /// Random over the upper hemisphere, uniform in solid angle above the lowest elevation.
    Hemisphere {
        /// The lowest elevation, in degrees.
        above_deg: f64,
    },
}

/// Full angle of view across the shorter side: a short telephoto, as one films objects with.
const VIEW_ANGLE_DEG: f64 = 24.0;
/// Share of the frame the object may fill in the view where it looks largest.
const FILL: f64 = 0.92;
/// Steeper than this, "up" is no longer defined well enough.
const MAX_ELEVATION_DEG: f64 = 89.0;

/// Direction of a camera from the middle of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Station {
    /// Counter-clockwise seen from above, from +x, in radians.
    pub(crate) azimuth: f64,
    /// Above the table, in radians.
    pub(crate) elevation: f64,
}

/// Where `views` cameras stand.
pub(crate) fn stations(layout: &Layout, views: usize, seed: u64) -> Result<Vec<Station>, SynthError> {
    match layout {
        Layout::Rings { elevations_deg } => rings(elevations_deg, views),
        Layout::Spiral { from_deg, to_deg, turns } => {
            let (from, to) = (elevation(*from_deg)?, elevation(*to_deg)?);
            if !(turns.is_finite() && *turns > 0.0) {
                return Err(refuse("turns", turns, "a positive number"));
            }
            let last = views.saturating_sub(1).max(1) as f64;
            let at = |i: usize| Station {
                azimuth: TAU * turns * i as f64 / views as f64,
                elevation: from + (to - from) * i as f64 / last,
            };
            Ok((0..views).map(at).collect())
        }
        Layout::Hemisphere { above_deg } => {
            let low = elevation(*above_deg)?.sin();
            let high = MAX_ELEVATION_DEG.to_radians().sin();
            let uniform =
                |i: usize, k: u64| (splitmix(seed ^ splitmix(2 * i as u64 + k)) >> 11) as f64 / (1_u64 << 53) as f64;
            let at =
                |i| Station { azimuth: TAU * uniform(i, 0), elevation: (low + (high - low) * uniform(i, 1)).asin() };
            Ok((0..views).map(at).collect())
        }
    }
}

fn rings(elevations_deg: &[f64], views: usize) -> Result<Vec<Station>, SynthError> {
    if elevations_deg.is_empty() || elevations_deg.len() > views {
        return Err(refuse("elevations", elevations_deg.len(), "between one and as many as there are views"));
    }
    let n = elevations_deg.len();
    let mut stations = Vec::with_capacity(views);
    for (ring, &degrees) in elevations_deg.iter().enumerate() {
        let elevation = elevation(degrees)?;
        // Ring sizes differ by one at most.
        let count = (ring + 1) * views / n - ring * views / n;
        let offset = if ring % 2 == 1 { 0.5 } else { 0.0 };
        stations.extend((0..count).map(|i| Station { azimuth: TAU * (i as f64 + offset) / count as f64, elevation }));
    }
    Ok(stations)
}

fn elevation(degrees: f64) -> Result<f64, SynthError> {
    if degrees.is_finite() && degrees.abs() <= MAX_ELEVATION_DEG {
        Ok(degrees.to_radians())
    } else {
        Err(refuse("elevation", degrees, "between -89 and 89 degrees"))
    }
}

fn refuse(option: &'static str, value: impl ToString, allowed: &str) -> SynthError {
    SynthError::Option { option, value: value.to_string(), allowed: allowed.to_owned() }
}

/// One camera per station, all at one distance and with one lens, chosen so that the object fills
/// the frame and is cut by no border.
pub(crate) fn cameras(stations: &[Station], mesh: &Mesh, aabb: &Aabb, size: [usize; 2]) -> Vec<Camera> {
    let target = aabb.center();
    let radius = 0.5 * aabb.diagonal();
    let distance = radius / (0.5 * VIEW_ANGLE_DEG.to_radians()).sin();
    let mut cameras: Vec<Camera> =
        stations.iter().map(|s| look_at(&target, s, distance, Intrinsics::pinhole(1.0, size))).collect();
    let [x, y] = extent(&cameras, mesh);
    let focal = FILL * (0.5 * size[0] as f64 / x).min(0.5 * size[1] as f64 / y);
    cameras.iter_mut().for_each(|c| c.intrinsics = Intrinsics::pinhole(focal, size));
    cameras
}

/// Largest |x/z| and |y/z| of any vertex in any camera.
fn extent(cameras: &[Camera], mesh: &Mesh) -> [f64; 2] {
    let mut extent = [1e-9_f64; 2];
    for camera in cameras {
        for p in &mesh.positions {
            let c = camera.to_camera(p);
            extent = [extent[0].max((c.x / c.z).abs()), extent[1].max((c.y / c.z).abs())];
        }
    }
    extent
}

/// The camera of a station at a distance from what it looks at, upright.
pub(crate) fn look_at(target: &Point3<f64>, station: &Station, distance: f64, intrinsics: Intrinsics) -> Camera {
    let (sa, ca) = station.azimuth.sin_cos();
    let (se, ce) = station.elevation.sin_cos();
    let outward = Vector3::new(ce * ca, ce * sa, se);
    let right = Vector3::new(-sa, ca, 0.0);
    let down = (-outward).cross(&right);
    let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), -outward.transpose()]);
    let translation = -(rotation * (target + outward * distance).coords);
    Camera { intrinsics, rotation, translation }
}

/// Angle of the room's +x, which points at the camera, in (−π, π].
pub(crate) fn room_yaw(station: &Station) -> f64 {
    let a = station.azimuth.rem_euclid(TAU);
    if a > PI { a - TAU } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::sphere;

    fn all_layouts() -> Vec<Layout> {
        vec![
            Layout::Rings { elevations_deg: vec![10.0, 35.0, 60.0] },
            Layout::Spiral { from_deg: -10.0, to_deg: 70.0, turns: 3.0 },
            Layout::Hemisphere { above_deg: 5.0 },
        ]
    }

    #[test]
    fn every_camera_looks_at_the_object_and_holds_it_whole() {
        let mesh = sphere(0.1, 16);
        let aabb = mesh.aabb().unwrap();
        for layout in all_layouts() {
            let stations = stations(&layout, 20, 3).unwrap();
            assert_eq!(stations.len(), 20);
            for camera in cameras(&stations, &mesh, &aabb, [160, 120]) {
                let middle = camera.project(&aabb.center()).unwrap().pixel;
                assert!((middle.x - 80.0).abs() < 1e-9 && (middle.y - 60.0).abs() < 1e-9);
                assert!(mesh.positions.iter().all(|p| camera.in_frame(camera.project(p).unwrap().pixel)));
                assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
                // Up in the world is up in the picture, whose rows run down.
                let above = camera.project(&(aabb.center() + Vector3::z() * 0.05)).unwrap().pixel;
                assert!(above.y < middle.y);
                // The room's +x points at the camera.
                let center = camera.center();
                assert!(stations.iter().any(|s| (center.y.atan2(center.x) - room_yaw(s)).abs() < 1e-9));
            }
        }
    }

    #[test]
    fn bad_layouts_are_refused() {
        for layout in [
            Layout::Rings { elevations_deg: vec![] },
            Layout::Rings { elevations_deg: vec![f64::NAN] },
            Layout::Rings { elevations_deg: vec![0.0; 5] },
            Layout::Spiral { from_deg: 0.0, to_deg: 90.0, turns: 1.0 },
            Layout::Spiral { from_deg: 0.0, to_deg: 10.0, turns: 0.0 },
            Layout::Hemisphere { above_deg: f64::INFINITY },
        ] {
            assert!(stations(&layout, 4, 0).is_err(), "{layout:?}");
        }
    }
}
