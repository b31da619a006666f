//! How long does a picture take? One view of each kind of scene, 16 paths a pixel.
//!
//! `cargo bench -p data-synth --bench film`; beside Mitsuba 3: `benches/film_vs_mitsuba.py`.

use data_synth::{Effort, Layout, Scene, SynthOptions, synthesize};

fn main() {
    divan::main();
}

#[divan::bench(args = ["temple", "elephant", "wreath", "glass", "blank"], sample_count = 3)]
fn view(bencher: divan::Bencher, name: &str) {
    let scene: Scene = name.parse().expect("a scene");
    let options = SynthOptions {
        views: 1,
        width: 320,
        height: 240,
        effort: Effort::Samples(16),
        layout: Layout::Rings { elevations_deg: vec![20.0] },
        ..SynthOptions::default()
    };
    let rays = synthesize(scene, &options).expect("a picture").report.rays;
    bencher.counter(divan::counter::ItemsCount::new(rays)).bench(|| synthesize(scene, &options));
}
