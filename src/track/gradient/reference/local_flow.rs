//! Flow of single pixels from the gradient equation in a small window: M. Chiba and S. Ozawa, equations (1)
//! to (10).

use super::{equations::Equations, kernels::kernels_of, options::LocalFlowOptions};
use crate::track::gradient::{noise::NOISE_SAMPLES, noise::noise_of, shift::shifted};
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
    pub(super) fn least(&self, first: &Frame<f64>, second: &Frame<f64>) -> f64 {
        if self.min_sigma > 0.0 { self.min_sigma.max(OVER_NOISE * noise_of(first, second, NOISE_SAMPLES)) } else { 0.0 }
    }

    /// Flow from the better of two starts (25), none and a common velocity, with one correction (7). Windows
    /// with gradients up to `flat`, grey levels/px, have an infinite condition number (8).
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
