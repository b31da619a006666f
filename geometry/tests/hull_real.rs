//! Hulls of real captures; skipped, saying so, where `shared/data` is absent.

mod hull_support;

use geometry::depth::mean_silhouette_iou;
use geometry::{HullOptions, visual_hull};
use hull_support::{middlebury, shared};
use std::time::Instant;

fn check_ring(name: &str) {
    let Some(folder) = shared(name) else { return };
    let views = middlebury(&folder);
    for (consensus, grow_px) in [(0, 0.0), (0, 0.5), (1, 0.0), (1, 0.5), (2, 0.0)] {
        let start = Instant::now();
        let hull = visual_hull(&views, &HullOptions { consensus, grow_px, ..HullOptions::default() }).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let check = hull.mesh.check().unwrap();
        let iou = mean_silhouette_iou(&hull.mesh, &views);
        println!(
            "{name} {consensus} {grow_px}: IoU {iou:.4}, {seconds:.2} s, {check:?}\n{:?} {:?} {}",
            hull.report,
            hull.aabb,
            views.iter().filter(|v| v.is_complete).count()
        );
        assert!(check.closed_manifold && check.volume > 0.0);
    }
}

#[test]
fn temple_ring_is_closed_and_reprojects() {
    check_ring("templeRing");
}

#[test]
fn dino_ring_is_closed_and_reprojects() {
    check_ring("dinoRing");
}
