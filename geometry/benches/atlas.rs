//! How long does a hull of 20 000 faces take to unfold, and what takes the time?

#[path = "../tests/atlas_shapes/mod.rs"]
mod shapes;

use divan::Bencher;
use geometry::atlas::{PushPull, rasterize};
use geometry::{UnwrapOptions, unwrap_mesh};

fn main() {
    divan::main();
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn unwrap_hull_20k(bencher: Bencher) {
    let mesh = shapes::hull_like(20_000);
    bencher.bench(|| unwrap_mesh(&mesh, &UnwrapOptions::new(shapes::texel_size(&mesh, 1024))));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn rasterize_1024(bencher: Bencher) {
    let mesh = shapes::hull_like(20_000);
    let unwrapped = unwrap_mesh(&mesh, &UnwrapOptions::new(shapes::texel_size(&mesh, 1024)));
    bencher.with_inputs(|| unwrapped.as_ref().ok()).bench_refs(|u| u.map(|u| rasterize(&u.mesh)));
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn fill_1024_rgb(bencher: Bencher) {
    let known: Vec<bool> = (0..1024 * 1024).map(|i| (i / 64 + i / 65536) % 3 > 0).collect();
    let fill = PushPull::new([1024, 1024], &known);
    bencher.with_inputs(|| vec![0.5_f32; 3 << 20]).bench_refs(|image| fill.apply(image, 3));
}
