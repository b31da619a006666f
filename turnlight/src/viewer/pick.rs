//! Which facet of which object lies under a pixel.

use super::false_colour::facets;
use crate::scene::Scene;
use capture::{Camera, Ray};
use geometry::TexturedMesh;
use nalgebra::{Point2, Point3};
use texture::{Appearance, Model};

/// A spot on a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// The object's position in the scene.
    pub object: usize,
    /// The facet in its model; of a lumigraph, the chart.
    pub facet: usize,
    /// Where it was hit, in the world.
    pub point: Point3<f64>,
}

/// What is nearest along the ray of a pixel; `None` where there is nothing.
pub fn at_pixel(scene: &Scene, camera: &Camera, pixel: [f64; 2]) -> Option<Picked> {
    along(scene, &camera.ray(pixel.into())?)
}

/// What is nearest along a ray of the world. Every face is tried.
fn along(scene: &Scene, ray: &Ray) -> Option<Picked> {
    let hits = scene.objects.iter().enumerate().filter_map(|(object, placed)| {
        let pose = &placed.pose;
        // Of the same length in the object's units, so that distances are the world's.
        let local = Ray {
            origin: pose.to_object(&ray.origin),
            direction: pose.rotation.transpose() * ray.direction / pose.scale,
        };
        let model = &scene.models[placed.model];
        let (distance, uv) = nearest(&model.mesh, &local)?;
        Some((distance, object, model, uv))
    });
    let (distance, object, model, uv) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let facet = facet_at(model, uv);
    Some(Picked { object, facet, point: ray.origin + ray.direction * distance })
}

/// Distance and texture coordinates of the nearest face.
fn nearest(mesh: &TexturedMesh, ray: &Ray) -> Option<(f64, Point2<f64>)> {
    let hits = (0..mesh.mesh.faces.len()).filter_map(|face| {
        let (distance, [u, v]) = meet(&mesh.mesh.corners(face), ray)?;
        let [a, b, c] = mesh.mesh.faces[face].map(|vertex| mesh.uvs[vertex as usize]);
        Some((distance, a + (b - a) * u + (c - a) * v))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Möller and Trumbore, Fast, Minimum Storage Ray/Triangle Intersection, 1997: distance, and the shares of b and c.
fn meet(&[a, b, c]: &[Point3<f64>; 3], ray: &Ray) -> Option<(f64, [f64; 2])> {
    let (to_b, to_c) = (b - a, c - a);
    let across = ray.direction.cross(&to_c);
    let inverse = to_b.dot(&across).recip();
    let from = ray.origin - a;
    let u = from.dot(&across) * inverse;
    let turned = from.cross(&to_b);
    let (v, distance) = (ray.direction.dot(&turned) * inverse, to_c.dot(&turned) * inverse);
    // What is not a number is none of these.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0 && distance.is_finite()).then_some((distance, [u, v]))
}

fn facet_at(model: &Model, uv: Point2<f64>) -> usize {
    let texel = |map: &capture::Image<u16>| {
        let at = |share: f64, side: usize| (share * side as f64).floor() as isize;
        map.at_clamped(at(uv.x, map.width()), at(uv.y, map.height())).into()
    };
    match &model.appearance {
        Appearance::Layers(layers) => texel(&layers.facet_of_texel),
        Appearance::Lumigraph(..) => texel(&facets(model)),
    }
}
