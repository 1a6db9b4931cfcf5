//! One pixel, carefully: orthogonal transformations in double precision.

use super::noise::NoiseModel;
use crate::flow::least_squares::solve;
use crate::flow::model::{ModelVisitor, MotionModel};
use crate::flow::options::RankPolicy;
use crate::jet::JetRates;
use crate::math::Real;
use crate::types::Status;

/// What is wanted of a pixel.
pub(super) struct PointRequest<'a> {
    /// Rounding noise in the jets.
    pub floor: f64,
    /// What to do where the rank is short.
    pub policy: RankPolicy,
    /// For the covariance; `None`: not wanted.
    pub noise: Option<&'a NoiseModel>,
    /// Variance of the pixel noise from the fit of the jets, for models whose equations leave no residual.
    pub pixel_variance: &'a dyn Fn() -> f64,
}

/// Everything known of one pixel, unknowns first in arrays of the largest model's size.
pub(super) struct PointEstimate {
    pub values: [f64; 6],
    pub covariance: [[f64; 6]; 6],
    pub status: Status,
    /// Root mean square residual of the equations, grey levels.
    pub residual: f64,
    pub rank: u8,
    pub condition: f64,
}

/// Standard deviation of the rounding noise in a jet that came from samples of type `T`: the type's relative
/// precision times the brightness.
pub(in crate::flow) fn rounding_floor<T: Real>(rates: &JetRates<f64>) -> f64 {
    let size = rates.jet[0].abs() + rates.first[0].abs() + rates.second[0].abs();
    // Samples are held to half the spacing of their type; the jets are computed in double precision.
    let spacing = if size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
    size * spacing
}

/// Estimates one pixel with the model it is shown.
pub(super) struct PointVisitor<'a> {
    pub rates: &'a JetRates<f64>,
    pub request: &'a PointRequest<'a>,
}

impl ModelVisitor for PointVisitor<'_> {
    type Output = PointEstimate;

    fn run<M: MotionModel<N, P>, const N: usize, const P: usize>(self) -> PointEstimate {
        let (a, b) = M::equations(self.rates);
        let solution = solve(&a, &b, self.request.floor);
        let mut out = PointEstimate {
            values: [f64::NAN; 6],
            covariance: [[f64::NAN; 6]; 6],
            status: Status::Unobservable,
            residual: (solution.residual_square / N as f64).sqrt(),
            rank: solution.rank as u8,
            condition: solution.condition,
        };
        let full = solution.rank == P;
        if full || self.request.policy == RankPolicy::MinNorm {
            out.values[..P].copy_from_slice(&solution.x);
            out.status = if full { Status::Ok } else { Status::MinNorm };
        }
        if let Some(noise) = self.request.noise.filter(|_| full) {
            let covariance = noise.covariance::<M, N, P>(&a, &solution, self.request.pixel_variance);
            for (to, from) in out.covariance.iter_mut().zip(covariance) {
                to[..P].copy_from_slice(&from);
            }
        }
        out
    }
}
