//! Random scenes with exact truth.

use super::super::intake::Intake;
use super::super::observations::Observations;
use super::super::{Flow, Motion, Noise, Placement};
use crate::math::random::CounterRng;

/// Points on the plane at distance 1 with their flow.
#[derive(Debug, Clone)]
pub(in super::super) struct Scene {
    pub motion: Motion,
    pub points: Vec<[f64; 2]>,
    pub inverse_depth: Vec<f64>,
    pub flow: Vec<[f64; 2]>,
    /// Standard deviation of the noise; that of exact flow is said to be 1e-6.
    pub sigma: f64,
}

impl Scene {
    /// `n` points in `[-h, h]^2` whose inverse depth is a function of `(x, y) / h` and a random number.
    pub fn new(motion: Motion, n: usize, h: f64, sigma: f64, seed: u64, depth: impl Fn(f64, f64, f64) -> f64) -> Self {
        let rng = CounterRng::new(seed);
        let at = |k: usize, j: u64| 2.0 * rng.uniform(3 * k as u64 + j) - 1.0;
        let points: Vec<[f64; 2]> = (0..n).map(|k| [h * at(k, 0), h * at(k, 1)]).collect();
        let inverse_depth: Vec<f64> =
            (0..n).map(|k| depth(at(k, 0), at(k, 1), rng.uniform(3 * k as u64 + 2))).collect();
        let noise = rng.stream(1);
        let flow = (0..n)
            .map(|k| {
                let exact = motion.plane_flow(points[k], inverse_depth[k]);
                [0, 1].map(|j| exact[j] + sigma * noise.normal(2 * k as u64 + j as u64))
            })
            .collect();
        Self { motion, points, inverse_depth, flow, sigma: if sigma > 0.0 { sigma } else { 1e-6 } }
    }

    /// Random depths from 0.5 to 1.5, the oblique motion.
    pub fn oblique(n: usize, sigma: f64, seed: u64) -> Self {
        Self::new(Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]), n, 0.6, sigma, seed, |_, _, r| 0.5 + r)
    }

    pub fn flow(&self) -> Flow<'_> {
        Flow::Plane { points: &self.points, flow: &self.flow, camera: None }
    }

    pub fn observations(&self) -> Observations {
        Intake::new(&self.flow(), &Noise::Sigma(self.sigma), Placement::Start).whitened()
    }
}
