use super::*;
use crate::flow::coarse_to_fine::brightness_scale::BrightnessScale;
use crate::flow::coarse_to_fine::pyramid::{ComparedFrames, Pyramid};
use crate::math::random::CounterRng;
use crate::types::Frame;

const AS_IT_IS: BrightnessScale = BrightnessScale { mean: 0.0, gain: 1.0, contrast: 40.0 };

/// Gaussian spots of standard deviation `sigma` px, moved by `(u, v)`.
fn spots(sigma: f64, (u, v): (f64, f64)) -> Frame<f64> {
    let (width, height, cell) = (128, 112, 5);
    let rng = CounterRng::new(7);
    let hash = |i: usize, j: usize, k: usize| rng.uniform(((i * 100 + j) * 2 + k) as u64);
    Frame::from_fn(width, height, |x, y| {
        let (mut sum, cells) = (0.0, 2);
        let (ci, cj) = ((x as f64 - u) / cell as f64 + 20.0, (y as f64 - v) / cell as f64 + 20.0);
        for i in ci as usize - cells..=ci as usize + cells {
            for j in cj as usize - cells..=cj as usize + cells {
                let px = ((i as f64 - 20.0) + hash(i, j, 0)) * cell as f64 + u;
                let py = ((j as f64 - 20.0) + hash(i, j, 1)) * cell as f64 + v;
                let d = (x as f64 - px).powi(2) + (y as f64 - py).powi(2);
                sum += 200.0 * (-0.5 * d / (sigma * sigma)).exp();
            }
        }
        sum
    })
}

fn measured(sigma: f64, flow: (f64, f64)) -> PeakLocking {
    let half = (0.5 * flow.0, 0.5 * flow.1);
    let frames = [spots(sigma, (-half.0, -half.1)), spots(sigma, half)];
    let mut pyramid = Pyramid::default();
    pyramid.fill(Level::detect(), &[&frames[0], &frames[1]], AS_IT_IS, None, (Some(1), 0));
    let mut motion = Planes::new(64, 56, 6);
    for y in 0..56 {
        motion.line_mut(0, y).fill(flow.0);
        motion.line_mut(1, y).fill(flow.1);
    }
    PeakLocking::measure(Level::detect(), (&pyramid.levels()[0], ComparedFrames::All), &motion, None)
}

#[test]
fn fine_spots_lock_and_broad_ones_do_not() {
    let fine = measured(0.7, (0.5, 0.5));
    let broad = measured(1.6, (0.5, 0.5));
    for c in 0..2 {
        assert!((0.01..0.03).contains(&fine.amplitude[c]), "{fine:?}");
        assert!(broad.amplitude[c].abs() < 0.15 * fine.amplitude[c], "{broad:?}");
    }
    assert_eq!(fine.cycles, 0.5);
    // At integer displacements there is no bias.
    assert!(measured(0.7, (2.0, -1.0)).amplitude.iter().all(|a| a.abs() < 0.05));
}

#[test]
fn correction_undoes_the_pull_and_its_derivative() {
    let locking = PeakLocking { amplitude: [0.02, 0.01], variance: [0.0; 2], cycles: 0.5 };
    let mut motion = Planes::<f64>::new(40, 3, 6);
    let truth = |k: usize, x: usize| 0.3 + 0.11 * x as f64 - 2.0 * k as f64;
    for k in 0..2 {
        for x in 0..40 {
            let (sine, slope) = locking.phase(truth(k, x));
            motion.line_mut(k, 1)[x] = truth(k, x) + locking.amplitude[k] * sine;
            motion.line_mut(2 + k, 1)[x] = 0.05 * (1.0 + locking.amplitude[k] * slope);
        }
    }
    locking.correct(Level::detect(), &mut motion);
    for k in 0..2 {
        for x in 0..40 {
            // To first order in the amplitude.
            assert!((motion.at(k, x, 1) - truth(k, x)).abs() < 1.5e-3, "{k} {x}");
            assert!((motion.at(2 + k, x, 1) - 0.05).abs() < 0.05 * 0.008);
        }
    }
}

#[test]
fn the_series_is_the_sine() {
    for i in -40..40 {
        let turns = f64::from(i) * 0.083;
        assert!((sine::<f64>(turns) - (TAU * turns).sin()).abs() < 4e-6);
    }
}
