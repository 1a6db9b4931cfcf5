//! How pixel noise becomes uncertainty of the motion.
//!
//! The error of the equations, `e = b - A m`, is linear in the jets of the three frames for a given m. White
//! pixel noise of variance s2 gives each frame's jet the covariance `s2 C`, so `Cov(e) = s2 sum_f G_f C
//! G_f^T` with `G_f = de / d(jet of frame f)`, and `Cov(m) = A^+ Cov(e) A^+T` to first order.

use super::lane_noise::LaneNoise;
use crate::flow::least_squares::Solution;
use crate::flow::model::MotionModel;
use crate::jet::{JetRates, JetStencil, TimeScheme};
use crate::math::Real;
use crate::types::Frame;

/// The noise of the jets and their differences.
#[derive(Debug)]
pub(super) struct NoiseModel {
    /// Covariance of a jet for pixel noise of variance 1.
    jet: [[f64; 6]; 6],
    /// Weights of the three frames in `i`, `i'` and `i''`.
    weights: [[f64; 3]; 3],
    /// Standard deviation of the pixel noise; `None`: from the residual.
    pixel: Option<f64>,
}

impl NoiseModel {
    /// For jets of `stencil` differenced by `scheme`.
    pub fn new(stencil: &JetStencil, scheme: TimeScheme, pixel: Option<f64>) -> Self {
        let mut place = [0.0; 3];
        place[scheme.frame()] = 1.0;
        Self { jet: stencil.covariance(), weights: [place, scheme.first_weights(), [1.0, -2.0, 1.0]], pixel }
    }

    /// The same for the affine model in lanes.
    pub fn lanes(&self) -> LaneNoise<f64> {
        LaneNoise::new(&self.jet, &self.weights, self.pixel)
    }

    /// Variance of the pixel noise from what the quadratics leave in the three frames; NaN when they leave
    /// nothing to judge by.
    pub fn pixel_variance<T: Real>(stencil: &JetStencil, frames: [&Frame<T>; 3], (x, y): (usize, usize)) -> f64 {
        frames.iter().map(|f| stencil.noise_variance(f, x, y).unwrap_or(f64::NAN)).sum::<f64>() / 3.0
    }

    /// Covariance of the solution of a model's equations.
    ///
    /// The pixel variance is the given one; else the residual's square over its expectation for unit noise;
    /// else, for models with as many unknowns as equations, that of the jets' fit.
    pub fn covariance<M: MotionModel<N, P>, const N: usize, const P: usize>(
        &self,
        a: &[[f64; P]; N],
        solution: &Solution<N, P>,
        pixel_variance: &dyn Fn() -> f64,
    ) -> [[f64; P]; P] {
        let mut unit = [[0.0; P]; P];
        let mut expected = 0.0;
        for g in self.gains::<M, N, P>(&solution.x) {
            let gain: [[f64; 6]; P] = std::array::from_fn(|p| {
                std::array::from_fn(|j| (0..N).map(|r| solution.inverse[p][r] * g[r][j]).sum())
            });
            for p in 0..P {
                let row: [f64; 6] = std::array::from_fn(|j| (0..6).map(|l| gain[p][l] * self.jet[l][j]).sum());
                for q in 0..P {
                    unit[p][q] += (0..6).map(|j| row[j] * gain[q][j]).sum::<f64>();
                }
            }
            // Rows of (I - A A^+) G: the part of the error that stays in the residual.
            for r in 0..N {
                let left: [f64; 6] =
                    std::array::from_fn(|j| g[r][j] - (0..P).map(|p| a[r][p] * gain[p][j]).sum::<f64>());
                expected +=
                    (0..6).map(|j| (0..6).map(|l| left[j] * self.jet[j][l] * left[l]).sum::<f64>()).sum::<f64>();
            }
        }
        let variance = match self.pixel {
            Some(sd) => sd * sd,
            None if N > P => solution.residual_square / expected,
            None => pixel_variance(),
        };
        unit.map(|row| row.map(|c| c * variance))
    }

    /// `G_f` of the three frames.
    fn gains<M: MotionModel<N, P>, const N: usize, const P: usize>(&self, m: &[f64; P]) -> [[[f64; 6]; N]; 3] {
        let mut out = [[[0.0; 6]; N]; 3];
        for j in 0..6 {
            let mut one = [0.0; 6];
            one[j] = 1.0;
            let zero = [0.0; 6];
            let parts = [
                JetRates { jet: one, first: zero, second: zero },
                JetRates { jet: zero, first: one, second: zero },
                JetRates { jet: zero, first: zero, second: one },
            ];
            for (part, weights) in parts.iter().zip(&self.weights) {
                let (a, b) = M::equations(part);
                for r in 0..N {
                    let e = b[r] - a[r].iter().zip(m).map(|(a, m)| a * m).sum::<f64>();
                    for f in 0..3 {
                        out[f][r][j] += weights[f] * e;
                    }
                }
            }
        }
        out
    }
}
