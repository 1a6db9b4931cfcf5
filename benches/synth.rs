//! Time of one 640 x 480 frame of each kind of scene, on one thread.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use jacoflow::parallel::Threads;
use jacoflow::synth::{SceneOptions, build};
use std::hint::black_box;

const SIZE: (usize, usize) = (640, 480);

fn frames(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("synth");
    group.throughput(Throughput::Elements((SIZE.0 * SIZE.1) as u64)).sample_size(10);
    let one = Threads::new(Some(1)).expect("a positive number");
    for (name, carrier) in [
        ("ramp", None),
        ("affine", Some("noise")),
        ("affine", Some("speckle")),
        ("affine", Some("particles")),
        ("disc", Some("noise")),
        ("vortex", Some("particles")),
        ("turbulence", Some("particles")),
    ] {
        let options = SceneOptions {
            width: SIZE.0,
            height: SIZE.1,
            carrier: carrier.map(String::from),
            ..SceneOptions::default()
        };
        let scene = build(name, &options).expect("a known scene");
        let label = carrier.map_or_else(|| name.to_string(), |carrier| format!("{name} of {carrier}"));
        group.bench_function(label, |bencher| bencher.iter(|| one.install(|| black_box(scene.frame(2.0)))));
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
