//! Hulls of real captures; skipped, saying so, where `shared/data` is absent.

#![allow(clippy::unwrap_used, reason = "a test: failing is what unwrap is for")]

mod hull_support;

use capture::View;
use geometry::depth::mean_silhouette_iou;
use geometry::{HullOptions, choose_hull, visual_hull};
use hull_support::{all_views, shared, torus};
use std::time::Instant;

/// The silhouettes are within about a pixel of the truth and the cameras within about half a pixel, so
/// a shape that fits all of them does not exist: the gates are what was reached, less 0.002.
fn check_ring(name: &str, views: &[View], least_iou: f64) {
    let choice = choose_hull(views, &HullOptions::default()).unwrap();
    let start = Instant::now();
    let hull = visual_hull(views, &choice.options).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let check = hull.mesh.check().unwrap();
    let iou = mean_silhouette_iou(&hull.mesh, views);
    println!("{name}: IoU {iou:.4} in {seconds:.2} s, {check:?}\n{:?}\n{:?}", hull.report, choice.trials);
    assert!(check.closed_manifold && check.volume > 0.0);
    assert_eq!(hull.report.conflicts, 0);
    assert_eq!(hull.report.wall_crossings, [[0, 0]; 3]);
    assert!(iou > least_iou, "{name}: {iou}");
}

#[test]
fn temple_ring_is_closed_and_reprojects() {
    let Some(folder) = shared("templeRing") else { return };
    check_ring("templeRing", &all_views(&folder), 0.974);
}

/// Over the views that the makers of the set list as good for silhouettes.
#[test]
fn dino_ring_is_closed_and_reprojects() {
    let Some(folder) = shared("dinoRing") else { return };
    let list = std::fs::read_to_string(folder.join("dinoR_good_silhouette_images.txt")).unwrap();
    let good: Vec<&str> = list.split_whitespace().collect();
    let mut views = all_views(&folder);
    views.retain(|view| good.contains(&format!("{}.png", view.name).as_str()));
    println!("{} views", views.len());
    check_ring("dinoRing", &views, 0.983);
}

#[test]
fn torus_and_sphere_reproject() {
    let Some(folder) = shared("analytic_torus") else { return };
    for masks in ["masks", "masks_aa"] {
        let views = torus(&folder, masks);
        check_ring(masks, &views, 0.997);
    }
}
