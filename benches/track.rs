//! Time of a frame in the trackers. Particle tracker: two targets that look alike in 720 x 480. Gradient
//! tracker: a 256 x 256 scene with a 13 px target, with a camera that stands still or moves, and
//! a target of 80 px in 720 x 480.
//!
//! One thread. `python -m benchmarks.tables.tracking` times the same beside OpenCV's trackers.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use jacoflow::parallel::Threads;
use jacoflow::synth::targets::{TargetScene, TargetSceneOptions};
use jacoflow::track::Tracker;
use jacoflow::track::gradient::{GradientOptions, GradientTracker, Start};
use jacoflow::track::particle::{ParticleMode, ParticleOptions, ParticleTracker};
use jacoflow::types::{AnyColourFrame, Frame, TargetBox};
use std::hint::black_box;
use std::time::Duration;

/// Frames of a lap, after which the scene is where it began.
const LAP: usize = 50;
/// Frames of the scene of the particle tracker.
const PARTICLE_FRAMES: usize = 20;

/// A scene: an even square on a lap over a smooth background that a camera may sway over.
struct Scene {
    name: &'static str,
    size: (usize, usize),
    side: f64,
    radius: f64,
    sway: f64,
}

const SCENES: [Scene; 3] = [
    Scene { name: "256x256, 13 px, still camera", size: (256, 256), side: 13.0, radius: 20.0, sway: 0.0 },
    Scene { name: "256x256, 13 px, swaying camera", size: (256, 256), side: 13.0, radius: 20.0, sway: 12.0 },
    Scene { name: "720x480, 80 px, still camera", size: (720, 480), side: 80.0, radius: 30.0, sway: 0.0 },
];

impl Scene {
    fn centre(&self, t: usize) -> [f64; 2] {
        let angle = std::f64::consts::TAU * (t % LAP) as f64 / LAP as f64;
        [self.size.0 as f64 / 2.0 + self.radius * angle.cos(), self.size.1 as f64 / 2.0 + self.radius * angle.sin()]
    }

    fn frame(&self, t: usize) -> Frame<f64> {
        let [cx, cy] = self.centre(t);
        let sway = self.sway * (std::f64::consts::TAU * (t % LAP) as f64 / LAP as f64).sin();
        let cover = |off: f64| (self.side / 2.0 - off.abs() + 0.5).clamp(0.0, 1.0);
        Frame::from_fn(self.size.0, self.size.1, |x, y| {
            let (x, y) = (x as f64, y as f64);
            let (u, v) = (x - sway, y);
            let behind = 90.0 + 20.0 * (0.17 * u + 0.05 * v).sin() + 15.0 * (0.13 * v - 0.07 * u).cos();
            let target = 180.0 + 25.0 * (0.3 * (x - cx)).sin() * (0.25 * (y - cy)).cos();
            let a = cover(x - cx) * cover(y - cy);
            f64::round(a * target + (1.0 - a) * behind)
        })
    }

    fn start(&self) -> Start {
        Start::Box(TargetBox::about(self.centre(0), self.side, self.side))
    }
}

fn track(criterion: &mut Criterion) {
    for scene in &SCENES {
        let frames: Vec<_> = (0..LAP).map(|t| scene.frame(t)).collect();
        let mut group = criterion.benchmark_group(scene.name);
        group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
        let options = GradientOptions::default();
        let mut tracker = GradientTracker::new(&frames[0], scene.start(), &options).expect("a valid start");
        let mut next = 0;
        group.bench_function("gradient", |bencher| {
            bencher.iter(|| {
                next += 1;
                black_box(tracker.update(&frames[next % LAP]).expect("frames of one size"))
            });
        });
        group.finish();
    }
}

/// Two people who walk towards each other before a handheld camera, 720 x 480.
fn particles(criterion: &mut Criterion) {
    let scene_options =
        TargetSceneOptions { scale: 1.0, frames: Some(PARTICLE_FRAMES), ..TargetSceneOptions::default() };
    let scene = TargetScene::new("people_handheld", scene_options).expect("a known scene");
    let frames: Vec<_> = (0..PARTICLE_FRAMES).map(|t| AnyColourFrame::U8(scene.frame(t))).collect();
    let targets: Vec<_> = (0..scene.target_count()).map(|k| (k as u64, scene.target_box(0, k))).collect();
    let mut group = criterion.benchmark_group("720x480, two people, particle filters");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    for mode in ParticleMode::ALL {
        let options =
            ParticleOptions { mode, threads: Threads::new(Some(1)).expect("one thread"), ..ParticleOptions::default() };
        let begun = ParticleTracker::new(&frames[0], &targets, &options).expect("boxes in the picture");
        let mut tracker = begun.clone();
        let mut next = 0;
        group.bench_function(BenchmarkId::from_parameter(mode.name()), |bencher| {
            bencher.iter(|| {
                next += 1;
                if next == PARTICLE_FRAMES {
                    (tracker, next) = (begun.clone(), 1);
                }
                black_box(tracker.update(&frames[next]).expect("frames of one size").frame)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, track, particles);
criterion_main!(benches);
