//! Flow of single pixels from the gradient equation in a small window: M. Chiba and S. Ozawa, equations (1)
//! to (10).

use super::equations::Equations;
use super::kernels::kernels_of;
use super::options::LocalFlowOptions;
use crate::track::gradient::noise::{NOISE_SAMPLES, noise_of};
use crate::track::gradient::shift::shifted;
use crate::types::Frame;

/// Weakest gradient that counts, over the noise.
const OVER_NOISE: f64 = 0.7;

/// Flow at every pixel of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalFlow {
    /// `(u, v)`, px/frame; NaN where there is no solution.
    pub flow: Frame<[f64; 2]>,
    /// Where it was accepted.
    pub accepted: Frame<bool>,
}

/// What moves, and where to (11).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanFlow {
    /// Mean flow over what moves, px/frame; zero where nothing does.
    pub velocity: [f64; 2],
    /// Mean place of what moves in the first frame, px; NaN where nothing does.
    pub centroid: [f64; 2],
    /// How many pixels move.
    pub count: usize,
}

impl LocalFlowOptions {
    /// The weakest gradient that counts between these frames.
    pub(super) fn least(&self, first: &Frame<f64>, second: &Frame<f64>) -> f64 {
        if self.min_sigma > 0.0 { self.min_sigma.max(OVER_NOISE * noise_of(first, second, NOISE_SAMPLES)) } else { 0.0 }
    }

    /// Flow from the better of two starts (25): none, and a velocity that all pixels may have. One correction
    /// (7) is made. Windows with gradients up to `flat`, grey levels/px, are flat: their condition number (8)
    /// is infinite.
    pub(super) fn flow_from(
        &self,
        first: &Frame<f64>,
        second: &Frame<f64>,
        starts: &[[f64; 2]],
        flat: f64,
    ) -> LocalFlow {
        let (kernels, least) = (kernels_of(self.order), self.least(first, second).max(flat));
        let equations: Vec<_> = starts
            .iter()
            .map(|start| (*start, Equations::new(first, &shifted(second, *start), kernels, self.window)))
            .collect();
        let (width, height) = first.size();
        let mut out = LocalFlow::none(width, height);
        for at in 0..width * height {
            let best = equations.iter().min_by(|a, b| a.1.residual(at).total_cmp(&b.1.residual(at)));
            let Some((start, equations)) = best else { continue };
            if let Some((step, accepted)) = equations.step(at, self, least) {
                out.flow.data_mut()[at] = [start[0] + step[0], start[1] + step[1]];
                out.accepted.data_mut()[at] = accepted;
            }
        }
        out
    }
}

impl LocalFlow {
    fn none(width: usize, height: usize) -> Self {
        Self { flow: Frame::filled(width, height, [f64::NAN; 2]), accepted: Frame::filled(width, height, false) }
    }

    /// Mean flow over the accepted pixels that move along x or along y by at least `eps` px/frame (11).
    pub fn mean(&self, eps: f64) -> MeanFlow {
        let (mut velocity, mut centroid, mut count) = ([0.0; 2], [0.0; 2], 0usize);
        let pixels = self.flow.data().iter().zip(self.accepted.data()).enumerate();
        for (at, (flow, _)) in pixels.filter(|(_, (_, accepted))| **accepted) {
            if flow[0].abs() >= eps || flow[1].abs() >= eps {
                let place = [at % self.flow.width(), at / self.flow.width()];
                for k in 0..2 {
                    velocity[k] += flow[k];
                    centroid[k] += place[k] as f64;
                }
                count += 1;
            }
        }
        let over = |sum: [f64; 2]| sum.map(|s| s / count as f64);
        MeanFlow { velocity: if count > 0 { over(velocity) } else { [0.0; 2] }, centroid: over(centroid), count }
    }
}

/// Flow of single pixels from the first frame to the second, one step from rest (1)-(8).
pub fn local_flow(first: &Frame<f64>, second: &Frame<f64>, options: &LocalFlowOptions) -> LocalFlow {
    options.flow_from(first, second, &[[0.0; 2]], 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    fn texture(width: usize, height: usize) -> Frame<f64> {
        Frame::from_fn(width, height, |x, y| {
            let (x, y) = (x as f64, y as f64);
            128.0 + 30.0 * (0.5 * x + 0.2 * y).sin() + 25.0 * (0.35 * y - 0.3 * x).cos() + 10.0 * (0.6 * y).sin()
        })
    }

    #[test]
    fn a_small_shift_is_found_with_its_sign() {
        let first = texture(40, 32);
        // What is at p in the first frame is at p + (0.3, -0.2) in the second.
        let second = shifted(&first, [-0.3, 0.2]);
        let found = local_flow(&first, &second, &LocalFlowOptions { min_sigma: 0.5, ..LocalFlowOptions::default() });
        let middle = found.flow.get(20, 16);
        assert!((middle[0] - 0.3).abs() < 0.03 && (middle[1] + 0.2).abs() < 0.03, "{middle:?}");
        assert!(found.accepted.get(20, 16) && !found.accepted.get(3, 16));
        let mean = found.mean(0.25);
        assert!((mean.velocity[0] - 0.3).abs() < 0.03 && (mean.centroid[0] - 19.5).abs() < 3.0, "{mean:?}");
        assert!(mean.count > 200, "{mean:?}");
    }

    #[test]
    fn the_better_start_is_chosen_pixel_by_pixel() {
        let first = texture(60, 40);
        let moved = shifted(&first, [-3.0, 1.0]);
        let second = Frame::from_fn(60, 40, |x, y| if x < 30 { first.get(x, y) } else { moved.get(x, y) });
        let found = LocalFlowOptions::default().flow_from(&first, &second, &[[0.0; 2], [2.9, -0.9]], 0.0);
        let (still, moving) = (found.flow.get(12, 20), found.flow.get(46, 20));
        assert!(still[0].abs() < 1e-9 && (moving[0] - 3.0).abs() < 0.05 && (moving[1] + 1.0).abs() < 0.05);
    }

    #[test]
    fn flat_and_noisy_pictures_are_refused_and_nan_stays_where_it_is() {
        let flat = Frame::filled(30, 30, 90.0);
        assert!(local_flow(&flat, &flat, &LocalFlowOptions::default()).mean(0.5).count == 0);
        let noisy = |seed: u64| {
            let rng = CounterRng::new(seed);
            Frame::from_fn(60, 60, |x, y| f64::round(90.0 + 2.0 * rng.normal((60 * y + x) as u64)))
        };
        let count = |min_sigma: f64| {
            let options = LocalFlowOptions { min_sigma, ..LocalFlowOptions::default() };
            local_flow(&noisy(1), &noisy(2), &options).mean(0.5).count
        };
        assert!(count(0.0) > 500 && count(2.5) == 0);
        let (first, second) = (texture(40, 32), shifted(&texture(40, 32), [-0.3, 0.2]));
        let mut broken = second.clone();
        broken.row_mut(10)[10] = f64::NAN;
        let [whole, holed] = [&second, &broken].map(|s| local_flow(&first, s, &LocalFlowOptions::default()));
        assert!(holed.flow.get(10, 10)[0].is_nan() && !holed.accepted.get(10, 10));
        assert_eq!(holed.flow.get(25, 20), whole.flow.get(25, 20));
    }

    #[test]
    fn tiny_frames_have_no_flow() {
        for (width, height) in [(0, 0), (1, 1), (4, 30), (9, 9)] {
            let frame = Frame::filled(width, height, 1.0);
            let found = local_flow(&frame, &frame, &LocalFlowOptions::default());
            assert!(found.accepted.data().iter().all(|a| !a) && found.mean(0.5).count == 0);
        }
    }
}
