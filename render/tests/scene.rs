//! Models played from their 8-bit layers look as the reference draws their textures in `f32`.

#[path = "support/models.rs"]
mod models;
mod support;

use capture::{Camera, Image};
use models::{bumpy_ball, dyntex, lumigraph, still, vdtm};
use nalgebra::{Point3, Rotation3, Vector3};
use render::blend::Pin;
use render::cpu::{Object, ScenePlayer};
use render::material::Lighting;
use render::{Pose, RenderOptions, reference};
use support::look_at;
use texture::{Appearance, Model};

const SIZE: [usize; 2] = [200, 180];

fn options(supersample: usize) -> RenderOptions {
    RenderOptions { supersample, background: None }
}

fn camera(turn: f64, distance: f64) -> Camera {
    let eye = Point3::new(distance * turn.cos(), distance * turn.sin(), 0.3 * distance * (2.0 * turn).sin());
    look_at(eye, Point3::origin(), 200.0, 201, 151)
}

/// Object pixels, and those of them further apart than one level.
fn apart(a: &Image<[u8; 4]>, b: &Image<[u8; 4]>) -> [usize; 2] {
    assert_eq!((a.width(), a.height()), (b.width(), b.height()));
    let pairs = a.pixels().iter().zip(b.pixels()).filter(|(p, q)| p[3] > 0 || q[3] > 0);
    pairs.fold([0, 0], |[all, off], (p, q)| [all + 1, off + usize::from((0..4).any(|c| p[c].abs_diff(q[c]) > 1))])
}

fn assert_alike(what: &str, a: &Image<[u8; 4]>, b: &Image<[u8; 4]>) {
    let [all, off] = apart(a, b);
    println!("{what}: {off} of {all}");
    assert!(all > 500 && off * 1000 <= all, "{what}: {off} of {all} pixels are apart");
}

fn reference_of(model: &Model, camera: &Camera, options: &RenderOptions) -> Image<[u8; 4]> {
    reference::render(&model.mesh, &model.atlas(&camera.center()), camera, options)
}

/// One player, as its eye goes round, near and far, over and over.
fn assert_plays(what: &str, model: &Model) {
    for supersample in [1, 2] {
        let mut player = ScenePlayer::new(&[Object::new(model)], options(supersample));
        for (k, distance) in [3.0, 2.2, 12.0, 3.0, 1.3].into_iter().enumerate() {
            let camera = camera(1.1 * k as f64, distance);
            let frame = player.render(&camera, &Lighting::default());
            assert_alike(what, &reference_of(model, &camera, &options(supersample)), &frame);
        }
    }
}

#[test]
fn a_static_texture_plays() {
    assert_plays("static", &still(bumpy_ball(9, SIZE)));
}

#[test]
fn photographs_play() {
    assert_plays("vdtm", &vdtm(bumpy_ball(9, SIZE), 12));
}

#[test]
fn a_basis_plays() {
    assert_plays("dyntex", &dyntex(bumpy_ball(9, SIZE), 9, 30, |facet| 1 + facet % 9));
}

#[test]
fn rays_play() {
    assert_plays("lumigraph", &lumigraph(bumpy_ball(9, SIZE), 9));
}

/// The nearest of several objects shows, wherever each of them stands.
#[test]
fn objects_hide_each_other() {
    let model = dyntex(bumpy_ball(7, SIZE), 5, 20, |_| 5);
    let rotation = Rotation3::from_euler_angles(0.4, 0.2, -1.0).into_inner();
    let near = Pose { rotation, translation: Vector3::new(1.5, 0.6, 0.1), scale: 0.4 };
    let far = Pose { translation: Vector3::new(-1.0, 0.0, 0.0), ..Pose::default() };
    let camera = camera(0.2, 4.0);
    let object = |pose| Object { pose, ..Object::new(&model) };
    let alone = |pose: Pose| ScenePlayer::new(&[object(pose)], options(1)).render(&camera, &Lighting::default());
    let (near_alone, far_alone) = (alone(near), alone(far));
    for objects in [[object(near), object(far)], [object(far), object(near)]] {
        let both = ScenePlayer::new(&objects, options(1)).render(&camera, &Lighting::default());
        let mut hidden = 0;
        for ((p, n), f) in both.pixels().iter().zip(near_alone.pixels()).zip(far_alone.pixels()) {
            assert_eq!(p, if n[3] > 0 { n } else { f });
            hidden += usize::from(n[3] > 0 && f[3] > 0);
        }
        assert!(hidden > 300, "nothing is hidden: {hidden}");
    }
}

/// A pose moves the object as moving the camera the other way would.
#[test]
fn a_posed_object_is_seen_from_where_the_eye_is_to_it() {
    let model = dyntex(bumpy_ball(7, SIZE), 5, 20, |_| 5);
    let rotation = Rotation3::from_euler_angles(0.4, 0.2, -1.0).into_inner();
    let pose = Pose { rotation, translation: Vector3::new(0.3, -0.2, 0.1), scale: 1.7 };
    let world = camera(0.7, 5.0);
    // X_c = R (s R_m X + t_m) + t = s (R R_m X + (R t_m + t) / s): depths alone are scaled.
    let to_object = Camera {
        rotation: world.rotation * pose.rotation,
        translation: (world.rotation * pose.translation + world.translation) / pose.scale,
        ..world
    };
    let posed = ScenePlayer::new(&[Object { pose, ..Object::new(&model) }], options(1));
    let (mut posed, mut plain) = (posed, ScenePlayer::new(&[Object::new(&model)], options(1)));
    let dark = Lighting::default();
    assert_alike("posed", &plain.render(&to_object, &dark), &posed.render(&world, &dark));
}

/// What a player drew before does not show, and threads do not matter.
#[test]
fn frames_depend_on_the_eye_alone() {
    let models = [
        dyntex(bumpy_ball(9, SIZE), 7, 30, |facet| 1 + facet % 7),
        lumigraph(bumpy_ball(9, SIZE), 6),
        vdtm(bumpy_ball(9, SIZE), 6),
    ];
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for model in &models {
        let mut player = ScenePlayer::new(&[Object::new(model)], options(1));
        for k in 0..6 {
            let camera = camera(2.3 * k as f64, 1.3 + k as f64);
            let played = player.render(&camera, &Lighting::default());
            let mut fresh = ScenePlayer::new(&[Object::new(model)], options(1));
            let alone = pool.install(|| fresh.render(&camera, &Lighting::default()));
            assert!(played == alone, "{:?}, frame {k}", model.method);
        }
    }
}

#[test]
fn a_scene_without_anything_is_empty() {
    let frame = ScenePlayer::new(&[], options(1)).render(&camera(0.0, 3.0), &Lighting::default());
    assert!(frame.width() == 201 && frame.pixels().iter().all(|p| *p == [0; 4]));
    let mut broken = still(bumpy_ball(3, [40, 30]));
    broken.mesh.mesh.faces.clear();
    ScenePlayer::new(&[Object::new(&broken)], options(1)).render(&camera(0.0, 3.0), &Lighting::default());
    let nowhere = Pose { translation: Vector3::repeat(f64::NAN), ..Pose::default() };
    let model = still(bumpy_ball(3, [40, 30]));
    let object = Object { pose: nowhere, ..Object::new(&model) };
    let frame = ScenePlayer::new(&[object], options(1)).render(&camera(0.0, 3.0), &Lighting::default());
    assert!(frame.pixels().iter().all(|p| *p == [0; 4]));
}

#[test]
fn held_weights_play_as_a_model_whose_tables_hold_them() {
    let model = dyntex(bumpy_ball(9, SIZE), 7, 12, |facet| 2 + facet % 6);
    let pins = [
        Pin { facet: None, layer: 3, weight: -1.5 },
        Pin { facet: Some(4), layer: 1, weight: 2.0 },
        // Of no facet, and of no layer: nothing to hold.
        Pin { facet: Some(9999), layer: 0, weight: 9.0 },
        Pin { facet: None, layer: 99, weight: 9.0 },
    ];
    let mut held = model.clone();
    let Appearance::Layers(layers) = &mut held.appearance else { panic!("layers") };
    for (f, facet) in layers.facets.iter_mut().enumerate() {
        let mine = pins.iter().filter(|pin| pin.layer < facet.rank && pin.facet.is_none_or(|of| of == f));
        for pin in mine {
            facet.table.iter_mut().skip(pin.layer).step_by(facet.rank).for_each(|weight| *weight = pin.weight);
        }
    }
    let mut player = ScenePlayer::new(&[Object::new(&model)], options(1));
    let mut other = ScenePlayer::new(&[Object::new(&held)], options(1));
    let camera = camera(0.4, 2.5);
    let free = player.render(&camera, &Lighting::default());
    player.pin(0, &pins);
    player.pin(7, &pins);
    let pinned = player.render(&camera, &Lighting::default());
    assert!(apart(&free, &pinned)[1] > 500, "nothing was held");
    assert_alike("held", &other.render(&camera, &Lighting::default()), &pinned);
    player.pin(0, &[]);
    assert_eq!(player.render(&camera, &Lighting::default()), free);
}
