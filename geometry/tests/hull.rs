//! The visual hull against answers derived by hand.

#![allow(clippy::unwrap_used, reason = "a test: failing is what unwrap is for")]

mod hull_support;

use capture::{Aabb, BinaryMatte, Camera, Image, View};
use geometry::depth::mean_silhouette_iou;
use geometry::{Hull, HullOptions, choose_hull, visual_hull};
use hull_support::{from_matte, looking_at_origin, sees_sphere, sphere_ring, view};
use nalgebra::{Point2, Point3, Vector3};
use std::f64::consts::PI;

fn resolution(n: usize) -> HullOptions {
    HullOptions { resolution: Some(n), ..HullOptions::default() }
}

/// The hull, checked to be what every hull must be.
fn closed_hull(views: &[View], options: &HullOptions) -> Hull {
    let hull = visual_hull(views, options).unwrap();
    let check = hull.mesh.check().unwrap();
    assert!(check.closed_manifold && check.volume > 0.0, "{check:?}");
    assert!(hull.report.conflicts * 1000 <= hull.report.crossings, "{:?}", hull.report);
    hull
}

fn cube_box(half: f64) -> Option<Aabb> {
    Some(Aabb { min: Point3::new(-half, -half, -half), max: Point3::new(half, half, half) })
}

/// Views spread over half a turn across the axis make of every section of a sphere the
/// regular 2n-gon around it, so the volume grows by (2n/π) tan(π/2n).
#[test]
fn orthographic_ring_gives_the_regular_polygon() {
    for n in [2, 3, 4, 6] {
        // From 10⁵ radii away rays are parallel to 10⁻⁵; 50 pixels a radius.
        let views: Vec<View> = (0..n)
            .map(|i| {
                let a = PI * i as f64 / n as f64;
                let camera = looking_at_origin(Point3::new(a.cos(), a.sin(), 0.0) * 1e5, Vector3::z(), 50.0 * 1e5, 128);
                view(i, camera, 8, |p| sees_sphere(&camera, p, Point3::origin(), 1.0))
            })
            .collect();
        let ratio = closed_hull(&views, &resolution(100)).mesh.signed_volume() / (4.0 / 3.0 * PI);
        let expected = 2.0 * n as f64 / PI * (PI / (2.0 * n as f64)).tan();
        assert!((ratio / expected - 1.0).abs() < 2e-3, "{n}: {ratio} against {expected}");
    }
}

/// Views along the axes of a square of 64 pixels around the middle of 96, at 32 pixels a unit.
fn axis_views(inside: impl Fn(usize, Point2<f64>) -> bool) -> Vec<View> {
    let eyes = [(Vector3::x(), Vector3::z()), (Vector3::y(), Vector3::z()), (Vector3::z(), Vector3::y())];
    let camera = |i: usize| looking_at_origin(Point3::from(eyes[i].0 * 1e6), eyes[i].1, 32.0 * 1e6, 96);
    (0..3).map(|i| view(i, camera(i), 1, |p| inside(i, p))).collect()
}

fn in_square(p: Point2<f64>, half: f64) -> bool {
    (p.x - 48.0).abs() < half && (p.y - 48.0).abs() < half
}

#[test]
fn cube_from_three_axis_views_is_exact_but_for_its_edges() {
    let views = axis_views(|_, p| in_square(p, 32.0));
    // Cells of 1/32 meet every contour vertex and edge exactly: all ties.
    for n in [64, 37] {
        let options = HullOptions { aabb: cube_box(1.5), binary: BinaryMatte::Midpoints, ..resolution(n) };
        let hull = closed_hull(&views, &options);
        let bounds = hull.mesh.aabb().unwrap();
        assert!((bounds.min - Point3::new(-1.0, -1.0, -1.0)).amax() < 1e-5, "{bounds:?}");
        assert!((bounds.max - Point3::new(1.0, 1.0, 1.0)).amax() < 1e-5, "{bounds:?}");
        // Marching squares cuts 1/8 px² off a square corner, the mesh at most half a cell² off an edge.
        let cut = 12.0 * 2.0 * (1.0 / 8192.0 + 0.5 * hull.cell * hull.cell);
        let volume = hull.mesh.signed_volume();
        assert!(volume < 8.0 && volume > 8.0 - cut, "{volume}");
        assert_eq!(hull.mesh.check().unwrap().euler, 2);
        assert_eq!(hull.report.wall_crossings, [[0, 0]; 3]);
    }
}

#[test]
fn hole_in_one_silhouette_is_a_tunnel() {
    let views = axis_views(|i, p| in_square(p, 32.0) && !(i == 2 && in_square(p, 10.0)));
    assert_eq!(closed_hull(&views, &resolution(60)).mesh.check().unwrap().euler, 0);
}

#[test]
fn hull_holds_the_sphere_and_reprojects() {
    let views = sphere_ring(16, 0.4, 4.0, 300.0, 200, 1.0);
    let hull = closed_hull(&views, &HullOptions::default());
    // One pixel is 4/300; mattes of 16 levels place the contour to a tenth of a pixel or two.
    let nearest = hull.mesh.positions.iter().map(|p| p.coords.norm()).fold(f64::INFINITY, f64::min);
    assert!(nearest > 1.0 - 0.2 * 4.0 / 300.0, "{nearest}");
    let iou = mean_silhouette_iou(&hull.mesh, &views);
    assert!(iou > 0.995, "{iou}");
    assert_eq!(hull.report.conflicts, 0);
}

#[test]
fn order_of_views_and_number_of_threads_do_not_matter() {
    let mut views = sphere_ring(9, 0.3, 4.0, 150.0, 96, 1.0);
    let options = HullOptions { aabb: cube_box(1.3), ..resolution(40) };
    let first = visual_hull(&views, &options).unwrap().mesh;
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| visual_hull(&views, &HullOptions { consensus: 2, ..resolution(40) }).unwrap().mesh)
    };
    assert_eq!(run(1), run(5));
    views.reverse();
    views.swap(2, 5);
    assert_eq!(visual_hull(&views, &options).unwrap().mesh, first);
}

#[test]
fn units_do_not_matter() {
    let scaled = |scale: f64| {
        let mut views = sphere_ring(8, 0.3, 4.0, 150.0, 96, 1.0);
        views.iter_mut().for_each(|v| v.camera.translation *= scale);
        let hull = closed_hull(&views, &resolution(32));
        (hull.mesh.signed_volume() / scale.powi(3), hull.mesh.faces.len())
    };
    let (volume, faces) = scaled(1.0);
    for scale in [1e-6, 1e6] {
        assert!((scaled(scale).0 / volume - 1.0).abs() < 1e-6);
        assert!(scaled(scale).1.abs_diff(faces) < 20);
    }
}

#[test]
fn one_view_is_a_cone_cut_by_the_box() {
    let views = sphere_ring(1, 0.0, 4.0, 150.0, 96, 1.0);
    let hull = closed_hull(&views, &HullOptions { aabb: cube_box(1.2), ..resolution(30) });
    assert!(hull.report.wall_crossings[0][0] > 0 && hull.report.wall_crossings[0][1] > 0);
    // Both walls across the viewing direction; the cone is about twice as wide behind as in front.
    let message = visual_hull(&views, &HullOptions::default()).unwrap_err().to_string();
    assert!(message.contains("one direction"), "{message}");
    let twice = [views[0].clone(), views[0].clone()];
    let again = closed_hull(&twice, &HullOptions { aabb: cube_box(1.2), ..resolution(30) });
    assert_eq!(again.mesh, hull.mesh);
    assert!(visual_hull(&twice, &HullOptions::default()).is_err());
}

#[test]
fn empty_and_impossible_views_are_named() {
    let mut views = sphere_ring(4, 0.2, 4.0, 150.0, 96, 1.0);
    let blank = Image::filled(96, 96, 0);
    let message = |views: &[View]| visual_hull(views, &resolution(20)).unwrap_err().to_string();
    let saved = std::mem::replace(&mut views[2].matte, blank);
    assert!(message(&views).contains("view 2 (view002): the silhouette is empty"));
    views[2].matte = saved;
    views[1].camera.rotation *= -1.0;
    assert!(message(&views).contains("view 1") && message(&views).contains("rotation"));
    views[1].camera.translation.x = f64::NAN;
    assert!(message(&views).contains("finite"));
    assert!(message(&[]).contains("no views"));
    let full = from_matte(0, views[0].camera, Image::filled(96, 96, 255));
    assert!(message(&[full.clone(), full]).contains("nothing carves"));
}

/// A ring in which view 3 sees the sphere somewhere else.
fn ring_with_a_wrong_mask() -> Vec<View> {
    let mut views = sphere_ring(12, 0.3, 4.0, 150.0, 160, 1.0);
    let camera = views[3].camera;
    views[3] = view(3, camera, 2, |p| (p.x - 25.0).hypot(p.y - 25.0) < 15.0);
    views
}

#[test]
fn silhouettes_that_exclude_each_other_name_the_culprit() {
    let error = visual_hull(&ring_with_a_wrong_mask(), &resolution(40)).unwrap_err().to_string();
    assert!(error.contains("view 3 (view003) dissents most") && error.contains("consensus"), "{error}");
}

#[test]
fn consensus_recovers_a_wrong_mask_and_is_chosen() {
    let views = ring_with_a_wrong_mask();
    let good: Vec<View> = views.iter().filter(|v| v.index != 3).cloned().collect();
    let exact = closed_hull(&good, &resolution(60)).mesh.signed_volume();
    let forgiving = closed_hull(&views, &HullOptions { consensus: 1, ..resolution(60) }).mesh.signed_volume();
    assert!((forgiving / exact - 1.0).abs() < 0.02, "{forgiving} {exact}");
    let choice = choose_hull(&views, &HullOptions::default()).unwrap();
    assert_eq!(choice.options.consensus, 1, "{:?}", choice.trials);
    assert_eq!(choose_hull(&good, &HullOptions::default()).unwrap().options.consensus, 0);
}

#[test]
fn growth_moves_the_surface_by_as_many_pixels() {
    let views = sphere_ring(24, 0.3, 40.0, 2000.0, 160, 1.0);
    let size = |grow_px| {
        let hull = closed_hull(&views, &HullOptions { grow_px, ..resolution(48) });
        hull.mesh.aabb().unwrap().size().x / 2.0
    };
    // A pixel is 40 / 2000.
    assert!((size(1.5) - size(0.0) - 0.03).abs() < 2e-3, "{} {}", size(1.5), size(0.0));
}

#[test]
fn the_frame_does_not_cut_what_other_views_hold() {
    let mut views = sphere_ring(12, 0.3, 4.0, 150.0, 96, 1.0);
    let whole = closed_hull(&views, &resolution(40)).mesh.signed_volume();
    // One camera turned so that half the sphere is out of its frame.
    let mut camera: Camera = views[5].camera;
    camera.intrinsics.cx += 48.0;
    views[5] = view(5, camera, 4, |p| sees_sphere(&camera, p, Point3::origin(), 1.0));
    assert!(!views[5].is_complete);
    let cut = closed_hull(&views, &resolution(40)).mesh.signed_volume();
    assert!(cut / whole > 0.999 && cut / whole < 1.05, "{cut} {whole}");
    // Taken for complete it does cut.
    views[5].is_complete = true;
    assert!(closed_hull(&views, &resolution(40)).mesh.signed_volume() < 0.7 * whole);
}

#[test]
fn cameras_inside_the_box_and_rays_through_them_are_no_trouble() {
    let views = sphere_ring(5, 0.0, 2.0, 80.0, 96, 0.5);
    // The first camera is at (2, 0, 0); make lattice lines run through it exactly, and nearly.
    for shift in [0.0, 1e-9, 1e-4] {
        let half = 2.5 + shift;
        let aabb = Some(Aabb { min: Point3::new(-half, -half, -half), max: Point3::new(2.5, 2.5, 2.5) });
        closed_hull(&views, &HullOptions { aabb, ..resolution(20) });
        closed_hull(&views, &HullOptions { aabb, consensus: 3, ..resolution(33) });
    }
}

#[test]
fn odd_mattes_do_not_panic() {
    let options = HullOptions { aabb: cube_box(1.0), ..resolution(16) };
    let cameras: Vec<Camera> = sphere_ring(4, 0.5, 4.0, 20.0, 12, 1.0).into_iter().map(|v| v.camera).collect();
    let mattes: [&dyn Fn(usize, usize) -> u8; 5] = [
        &|x, y| if (x + y) % 2 == 0 { 255 } else { 0 },
        &|x, y| if (x, y) == (6, 6) { 255 } else { 0 },
        &|x, _| if x == 6 { 180 } else { 0 },
        &|x, y| if x > 2 && y > 2 { 128 } else { 127 },
        &|_, y| if y > 5 { 255 } else { 0 },
    ];
    for matte in mattes {
        let make = |(i, camera): (usize, &Camera)| {
            let mut image = Image::filled(12, 12, 0u8);
            (0..144).for_each(|i| image.set(i % 12, i / 12, matte(i % 12, i / 12)));
            from_matte(i, *camera, image)
        };
        let views: Vec<View> = cameras.iter().enumerate().map(make).collect();
        for consensus in [0, 2] {
            if let Ok(hull) = visual_hull(&views, &HullOptions { consensus, ..options }) {
                assert!(hull.mesh.check().unwrap().closed_manifold);
            }
        }
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let views = sphere_ring(4, 0.2, 4.0, 50.0, 40, 1.0);
    let bad = [
        resolution(0),
        resolution(1 << 30),
        HullOptions { grow_px: f64::NAN, ..resolution(20) },
        HullOptions { aabb: cube_box(-1.0), ..resolution(20) },
        HullOptions { consensus: 4, ..resolution(20) },
    ];
    bad.iter().for_each(|options| assert!(visual_hull(&views, options).is_err(), "{options:?}"));
    let elsewhere = Aabb { min: Point3::new(5.0, 5.0, 5.0), max: Point3::new(6.0, 6.0, 6.0) };
    let error = visual_hull(&views, &HullOptions { aabb: Some(elsewhere), ..resolution(20) }).unwrap_err();
    assert!(error.to_string().contains("that it holds the object"));
}
