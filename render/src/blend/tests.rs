//! Every vector unit against plain arithmetic, and the whole against the atlas in `f32`.

use super::kernel::blend;
use super::pack::{Line, VALUES};
use super::weights::Weights;
use super::{Atlas, Source, Wanted};
use crate::filter::{FIXED_ONE, FIXED_PLACES};
use crate::simd::Level;
use capture::Image;
use geometry::{Mesh, TexturedMesh};
use nalgebra::{Point2, Point3, Vector3};
use texture::directions::{DirectionComplex, Layout};
use texture::{Appearance, FacetWeights, Layer, Layers, Method, Model};

/// Bytes without a pattern.
fn noise(seed: u32) -> impl FnMut() -> u8 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    }
}

/// A square of one facet per quadrant, of `ranks[quadrant]` layers of noise.
fn model(size: [usize; 2], ranks: [usize; 4], scale: f32) -> Model {
    let [width, height] = size;
    let most = ranks.into_iter().max().unwrap_or(1);
    let layer = |k: usize| {
        let mut noise = noise(k as u32 + 1);
        let texels = Image::filled(width, height, [0u8; 3]).map(|_| [noise(), noise(), noise()]);
        let (scale, offset) = if k == 0 { (1.0, 0.0) } else { (scale, -128.0 * scale) };
        Layer { texels, scale, offset, coded: Vec::new() }
    };
    let quadrant = |i: usize| (2 * u16::from(i / width >= height / 2)) + u16::from(i % width >= width / 3);
    let map = Image::from_pixels(width, height, (0..width * height).map(quadrant).collect()).unwrap();
    let sites = [Vector3::x(), Vector3::y(), Vector3::z()];
    let facet = |rank: usize| FacetWeights {
        center: Point3::origin(),
        complex: DirectionComplex::build(&sites, Layout::General),
        rank,
        table: (0..3 * rank).map(|i| if i % rank == 0 { 1.0 } else { (i as f32 * 1.7).sin() }).collect(),
    };
    let layers =
        Layers { layers: (0..most).map(layer).collect(), facet_of_texel: map, facets: ranks.map(facet).to_vec() };
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mesh = TexturedMesh {
        mesh: Mesh {
            positions: corners.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
        },
        uvs: corners.map(|[x, y]| Point2::new(x, y)).to_vec(),
        face_charts: vec![0, 0],
        atlas_size: size,
    };
    Model { mesh, method: Method::DynTex, appearance: Appearance::Layers(layers), materials: Vec::new() }
}

#[test]
fn every_vector_unit_gives_the_same_bits() {
    let levels: Vec<Level> = Level::available().collect();
    println!("{levels:?}");
    let mut noise = noise(7);
    for (pairs, groups, shift) in [(0, 2, 3), (1, 1, 0), (2, 5, 9), (10, 24, 9), (13, 3, 4)] {
        let line = |_| Line(std::array::from_fn(|_| noise().cast_signed()));
        let lines: Vec<Line> = (0..pairs * groups).map(line).collect();
        // Extremes too: sums that leave 16 bits, and some that leave 32.
        for gain in [90, 8000, i16::MAX, i16::MIN] {
            let pair = |p: usize| [gain, if p.is_multiple_of(2) { gain } else { 3 - gain.saturating_abs() }];
            let weights = Weights {
                pairs: (0..pairs).map(pair).collect(),
                base: (-77_777i32).wrapping_mul(i32::from(gain)),
                shift,
            };
            let run = |level: Level| {
                let mut out = vec![[0; VALUES]; groups];
                blend(level, &lines, &weights, &mut out);
                out
            };
            let expected = run(levels[0]);
            for &level in &levels {
                assert!(run(level) == expected, "{level:?} of {pairs} pairs, gain {gain}");
            }
        }
    }
}

#[test]
fn a_blend_is_the_atlas_to_a_fraction_of_a_level() {
    for (size, ranks, scale) in
        [([70, 45], [1, 2, 5, 20], 0.2), ([16, 16], [3; 4], 1.0), ([1, 1], [2; 4], 0.5), ([33, 100], [6; 4], 2.5)]
    {
        let model = model(size, ranks, scale);
        for level in Level::available() {
            let mut atlas = Atlas::with_level(&model, level);
            for eye in [Point3::new(1.0, 2.0, 3.0), Point3::new(9.0, 0.1, -2.0), Point3::new(9.0, 0.1, -2.0)] {
                atlas.blend(&eye, &Wanted::all(size, 3));
                let exact = model.atlas(&eye);
                for (fixed, exact) in atlas.texels().pixels().iter().zip(exact.pixels()) {
                    for c in 0..3 {
                        let clamped = exact[c].clamp(-1024.0, 1023.97);
                        let apart = (f32::from(fixed[c]) / FIXED_ONE - clamped).abs();
                        assert!(apart < 0.15, "{apart} of {exact:?}, {level:?}");
                    }
                }
            }
        }
    }
}

/// Two textures of one model are two eyes', though they read the same lines.
#[test]
fn textures_of_one_model_share_its_layers_and_nothing_else() {
    let size = [70, 45];
    let model = model(size, [1, 2, 5, 20], 0.2);
    let first = Atlas::new(&model);
    let mut both = [first.another(), first.another()];
    let eyes = [Point3::new(1.0, 2.0, 3.0), Point3::new(9.0, 0.1, -2.0)];
    both.iter_mut().zip(&eyes).for_each(|(atlas, eye)| atlas.blend(eye, &Wanted::all(size, 0)));
    for (atlas, eye) in both.iter().zip(&eyes) {
        let mut alone = Atlas::new(&model);
        alone.blend(eye, &Wanted::all(size, 0));
        assert!(alone.texels() == atlas.texels());
        let (Source::Layers(one), Source::Layers(other)) = (&first.source, &atlas.source) else { return };
        assert!(std::sync::Arc::ptr_eq(&one.packed, &other.packed));
    }
    assert!(both[0].texels() != both[1].texels());
}

/// Reductions made block by block are those of the whole.
#[test]
fn mip_levels_are_those_of_the_texture() {
    for size in [[70, 45], [64, 128], [17, 3], [1, 40]] {
        let model = model(size, [4; 4], 0.3);
        let mut atlas = Atlas::new(&model);
        let wanted = Wanted::all(size, 20);
        for eye in [Point3::new(1.0, 2.0, 3.0), Point3::new(-3.0, 2.0, 3.0)] {
            atlas.blend(&eye, &wanted);
            let expected = crate::filter::MipChain::build(atlas.texels(), 20);
            let chain = atlas.chain(&wanted);
            for level in 0..=7 {
                let pairs = chain.level(level).pixels().iter().zip(expected.level(level).pixels());
                let apart = pairs.flat_map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c]))).max().unwrap();
                // Coarse levels are blended of reduced layers, the others reduced step by step: in half units each.
                assert!(apart <= if level < 4 { 0 } else { 5 }, "level {level} of {size:?} is {apart} units apart");
            }
        }
    }
}

/// A level that was not needed before is made once it is, though nothing is blended anew.
#[test]
fn what_is_fresh_is_not_blended_again() {
    let model = model([70, 45], [1; 4], 0.3);
    let mut atlas = Atlas::new(&model);
    let (near, far) = (Wanted::all([70, 45], 0), Wanted::all([70, 45], 6));
    atlas.blend(&Point3::new(1.0, 2.0, 3.0), &near);
    assert!(atlas.bytes() > 0);
    atlas.blend(&Point3::new(4.0, 2.0, -3.0), &far);
    assert_eq!(atlas.bytes(), 0);
    assert!(atlas.chain(&far).level(3) == crate::filter::MipChain::build(atlas.texels(), 3).level(3));
}

#[test]
fn weights_that_no_one_means_are_bounded() {
    let layer = |scale: f32, offset: f32| Layer { texels: Image::filled(1, 1, [0; 3]), scale, offset, coded: vec![] };
    let mut weights = Weights::default();
    for scale in [1e30, -1e30, f32::NAN, f32::INFINITY, 1e-30, 0.0] {
        let layers = vec![layer(scale, 3.0 * scale); 40];
        weights.round(&[2.0; 40], &layers);
        assert_eq!(weights.pairs.len(), 20);
        let signs: Vec<i16> = weights.pairs.iter().flatten().map(|g| g.signum()).collect();
        let expected = if scale.is_finite() && scale.abs() > 1e-20 { scale.signum() as i16 } else { 0 };
        assert!(signs.iter().all(|s| *s == expected), "{scale}: {signs:?}");
    }
    weights.round(&[1.0, 0.5, f32::NAN], &vec![layer(1.0, 0.0); 3]);
    assert_eq!((weights.pairs.clone(), weights.shift), (vec![[1 << 14, 1 << 13], [0, 0]], 14 - FIXED_PLACES));
}
