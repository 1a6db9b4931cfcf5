//! Particle images, as particle image velocimetry takes them.

use jacoflow::parallel::Threads;
use jacoflow::synth::motion::{AffineField, LambOseen};
use jacoflow::synth::{ParticleImages, ParticleLook, Scene};

fn still() -> AffineField {
    AffineField::new([0.0; 6], (0.0, 0.0))
}

#[test]
fn frames_equal_the_brightness_function_even_after_many_turns() {
    let vortex = LambOseen { circulation: 300.0, core: 8.0, centre: (20.0, 16.0), drift: (0.2, 0.0) };
    let scene = ParticleImages::new((40, 33), (-3.0, 2.0), ParticleLook::default(), vortex, 7).unwrap();
    for t in [0.0, 1.0, 30.0] {
        let frame = Threads::new(Some(2)).unwrap().install(|| scene.frame(t));
        for (column, row) in [(0, 0), (20, 16), (39, 32), (5, 31), (33, 3)] {
            assert_eq!(frame.get(column, row), scene.brightness(column as f64 - 3.0, row as f64 + 2.0, t));
        }
    }
}

#[test]
fn a_shift_by_whole_pixels_moves_the_picture() {
    let motion = AffineField::new([2.0, -1.0, 0.0, 0.0, 0.0, 0.0], (0.0, 0.0));
    let scene = ParticleImages::new((64, 64), (0.0, 0.0), ParticleLook::default(), motion, 3).unwrap();
    let (first, second) = (scene.frame(0.0), scene.frame(1.0));
    for y in 1..63 {
        for x in 2..64 {
            assert!((second.get(x, y - 1) - first.get(x - 2, y)).abs() < 1e-9);
        }
    }
}

#[test]
fn density_and_brightness_are_as_asked() {
    let look = ParticleLook { density: 0.03, spread: 0.0, background: 0.0, peak: 100.0, diameter: 3.0 };
    let scene = ParticleImages::new((400, 300), (0.0, 0.0), look, still(), 1).unwrap();
    let mean = scene.frame(0.0).data().iter().sum::<f64>() / 120_000.0;
    // A spot's volume is A pi d^2 / 8.
    let want = 0.03 * 100.0 * std::f64::consts::PI * 9.0 / 8.0;
    assert!((mean / want - 1.0).abs() < 0.05, "{mean} against {want}");
}

#[test]
fn unusable_looks_are_named() {
    let make = |look| ParticleImages::new((8, 8), (0.0, 0.0), look, still(), 0).err().map(|e| e.to_string());
    let look = ParticleLook::default();
    assert!(make(ParticleLook { density: 0.0, ..look }).unwrap().contains("density"));
    assert!(make(ParticleLook { diameter: -1.0, ..look }).unwrap().contains("diameter"));
    assert!(make(ParticleLook { spread: 2.0, ..look }).unwrap().contains("spread"));
    assert!(make(look).is_none());
}
