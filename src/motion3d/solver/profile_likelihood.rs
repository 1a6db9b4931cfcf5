//! What a covariance leaves out where the direction is known to a large share of the field only.
//!
//! It is the inverse of the information *at the estimate*, which changes along the direction that is known
//! least. The ends of that confidence interval are where the estimating equation, with weights smoothed
//! *there* and the other unknowns solved for, is off by as much as chance makes it in one case of twenty (the
//! score test of C. Rao 1948). The reported standard deviation has these ends, and the covariance the
//! curvature of the profile and the covariance of the other unknowns there.

use super::covariance::{damping, direction_block, direction_deviation, inverse};
use super::starts::SEARCHED;
use crate::math::{carried, root};
use crate::motion3d::kernels::{Bilinear, Weighted, information};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, ROUND};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use nalgebra::{Matrix2x3, Matrix4, SMatrix, SymmetricEigen, Vector2, Vector3};

/// Standard deviations of the direction, as shares of the field, below which the theory is linear enough;
/// that where the epipole may lie among the points.
const STRAIGHT: f64 = 0.08;
const STRAIGHT_AMONG: f64 = 0.03;

/// The 0.95 quantile of chi squared with one degree of freedom.
const END: f64 = 3.841;

/// Maximum number of places of the search for an end, tolerance of its score, and longest step.
const PLACES: usize = 12;
const NEAR: f64 = 0.1;
const LONGEST: f64 = 2.0;

/// The farthest that is looked, rad: farther the direction is not known.
const FARTHEST: f64 = 1.5;

/// Standard deviation of the direction, as a share of the field, beyond which no covariance describes the
/// profile.
const BEYOND: f64 = 1.5;

/// Mean fourth power of a normal variable of variance 1.
const KURTOSIS: f64 = 3.0;

/// Weight of each end in a mean over the profile (Simpson's rule, whose ends lie at `sqrt 3` standard
/// deviations).
const SIMPSON: f64 = 1.0 / 6.0;

type Vector4 = SMatrix<f64, 4, 1>;
/// An estimate whose covariance is computed.
pub(crate) struct ProfileLikelihood<'a> {
    pub observations: &'a Observations,
    pub motion: &'a Motion,
    pub tangent: &'a Matrix2x3<f64>,
}

/// Where a profile begins: the axes, the first of which is the profile's, the line that the others follow by
/// the covariance, and what damps weights near the epipole.
struct Course<'a> {
    axes: &'a Matrix2x3<f64>,
    slope: Vector4,
    damped: f64,
}

/// One end of the confidence interval along an axis, in units of the axes there.
struct End {
    /// How far the direction is off along the axis.
    psi: f64,
    /// The other unknowns that suit it.
    rest: Vector4,
    /// Their covariance at that place.
    covariance: Matrix4<f64>,
}

impl ProfileLikelihood<'_> {
    /// How many axes of the direction, the one that is known least first, have a covariance that the theory
    /// at the estimate does not describe.
    pub fn bent(&self, covariance: &Matrix5) -> usize {
        let deviation = direction_deviation(covariance);
        let share = deviation.to_radians() / spread(&self.observations.site);
        if !share.is_finite() {
            return 0;
        }
        // Noise that is small along one axis makes a profile as narrow as the angle to that axis.
        let narrower = (self.observations.longest() / ROUND).max(1.0);
        let inside = || narrower > 1.0 || among(self.observations, self.motion, deviation);
        match share * narrower {
            // Where the epipole may lie among the points each axis needs a profile.
            share if share > STRAIGHT_AMONG && inside() => 2,
            share if share > STRAIGHT => 1,
            _ => 0,
        }
    }

    /// The covariance with what a curved profile adds, and whether that describes the profile: it has ends
    /// within the field. `weights`: the depths that weigh the equations at a motion.
    pub fn lengthened(&self, covariance: &Matrix5, mut weights: impl FnMut(&Motion) -> Vec<f64>) -> (Matrix5, bool) {
        let axes = self.bent(covariance);
        let (mut out, mut described) = (*covariance, true);
        for rank in 0..axes {
            match self.along(&out, covariance, rank, &mut weights) {
                Some((longer, ends)) => (out, described) = (longer, described && ends == 2),
                None => described = false,
            }
        }
        let share = direction_deviation(&out).to_radians() / spread(&self.observations.site);
        (out, described && (axes == 0 || share < BEYOND))
    }

    /// The covariance `so_far` with both ends along one axis of the direction by `first`: of its eigenvectors
    /// the one with the larger value is number 0. And how many ends were found.
    fn along(
        &self,
        so_far: &Matrix5,
        first: &Matrix5,
        rank: usize,
        weights: &mut impl FnMut(&Motion) -> Vec<f64>,
    ) -> Option<(Matrix5, usize)> {
        let eigen = SymmetricEigen::new(direction_block(first));
        let mut axes = eigen.eigenvectors.transpose();
        if (eigen.eigenvalues.imax() == 1) != (rank == 1) {
            axes.swap_rows(0, 1);
        }
        let mut into = Matrix5::identity();
        into.fixed_view_mut::<2, 2>(0, 0).copy_from(&axes);
        let covariance = into * so_far * into.transpose();
        let along = axes * self.tangent;
        let variance = covariance[(0, 0)];
        let slope: Vector4 = covariance.fixed_view::<4, 1>(1, 0) / variance;
        let nu = weights(self.motion);
        let at = Weighted { motion: self.motion, tangent: &along, nu: &nu };
        let damped = damping(self.observations, &at)?;
        let here = others(&information(self.observations, &at, damped))?;
        let from = Course { axes: &along, slope, damped };
        let mut ends = [1.0, -1.0].map(|sign| self.end(&from, sign * variance.sqrt(), weights));
        let found: Vec<End> = ends.iter_mut().filter_map(Option::take).collect();
        if found.is_empty() {
            return None;
        }
        let count = found.len() as f64;
        let square: f64 = found.iter().map(|end| end.psi * end.psi).sum::<f64>() / count;
        let longer = (square / END).max(variance);
        let mut line = Vector5::zeros();
        line[0] = 1.0;
        line.fixed_rows_mut::<4>(1).copy_from(&slope);
        let mut out = covariance + line * line.transpose() * (longer - variance);
        let mut rest = out.fixed_view_mut::<4, 4>(1, 1);
        for end in &found {
            // The bend that this end shows, `c = bend / psi^2`, of a normal `psi` of the new variance.
            let bend = (end.rest - slope * end.psi) * (longer / (end.psi * end.psi));
            rest += bend * bend.transpose() * (KURTOSIS / count);
            rest += (end.covariance - here) * (2.0 * SIMPSON / count);
        }
        let out = into.transpose() * out * into;
        let out = out.symmetric_part();
        inverse(&out).map(|_| (out, found.len()))
    }

    /// Where the score along the first axis is [`END`], on the side of `deviation`.
    fn end(&self, from: &Course<'_>, deviation: f64, weights: &mut impl FnMut(&Motion) -> Vec<f64>) -> Option<End> {
        let slope = &from.slope;
        let mut psi = deviation * END.sqrt();
        let mut rest = slope * psi;
        // The farthest place whose score is too small, and the nearest beyond it whose score is too large.
        let (mut inner, mut outer) = (0.0, f64::INFINITY);
        for _ in 0..PLACES {
            let (there, score) = self.at(from, psi, rest, weights)?;
            if score < END {
                inner = psi.abs();
                outer = if outer > inner { outer } else { f64::INFINITY };
            } else {
                outer = psi.abs();
                inner = if inner < outer { inner } else { 0.0 };
            }
            let longer = (END / score).sqrt().clamp(1.0 / LONGEST, LONGEST);
            let settled = (longer - 1.0).abs() < NEAR;
            let mut next = psi * longer;
            if !settled && !(inner..outer).contains(&next.abs()) {
                next = (0.5 * (inner + outer)).copysign(psi);
            }
            // The bend is carried on as a square.
            rest = slope * next + (there.rest - slope * psi) * (next / psi).powi(2);
            if settled {
                // An error of the direction is its part along the axes.
                let scale = 1.0 / self.off(from.axes, next, rest[0]).norm();
                rest[0] *= scale;
                return Some(End { psi: next * scale, rest, ..there });
            }
            if next.abs() > FARTHEST {
                return None;
            }
            psi = next;
        }
        None
    }

    /// The direction that is off by so much, of any length.
    fn off(&self, axes: &Matrix2x3<f64>, psi: f64, across: f64) -> Vector3<f64> {
        self.motion.u() + axes.transpose() * Vector2::new(psi, across)
    }

    /// The other unknowns and the score, chi squared with one degree of freedom, where the direction is off
    /// by `psi`.
    fn at(
        &self,
        &Course { axes, damped, .. }: &Course<'_>,
        psi: f64,
        guess: Vector4,
        weights: &mut impl FnMut(&Motion) -> Vec<f64>,
    ) -> Option<(End, f64)> {
        // Of any length: the equation's root does not depend on that, and so is solved by Newton's steps as
        // it stands.
        let moved = |rest: &Vector4| {
            let turn = Vector3::new(rest[1], rest[2], rest[3]);
            Motion::of(&self.off(axes, psi, rest[0]), &(self.motion.w() + turn))
        };
        let start = moved(&guess).normalized();
        let there = carried(axes, &start.u());
        let nu = weights(&start);
        let at = Weighted { motion: &start, tangent: &there, nu: &nu };
        let equation = Bilinear::new(self.observations, &at, damped);
        let of_others = |rest: &Vector4| {
            let (value, slopes) = equation.at(&moved(rest), axes);
            (value.fixed_rows::<4>(1).into_owned(), slopes.fixed_view::<4, 4>(1, 1).into_owned())
        };
        let rest = root(guess, of_others, |rest, step| rest + step)?;
        let motion = moved(&rest).normalized();
        let squares = information(self.observations, &Weighted { motion: &motion, ..at }, damped);
        let (value, _) = equation.at(&motion, &there);
        let score = value[0] * value[0] * inverse(&squares)?[(0, 0)];
        (score > 0.0 && score.is_finite()).then_some((End { psi, rest, covariance: others(&squares)? }, score))
    }
}

/// The covariance of the others where the first unknown is given.
fn others(information: &Matrix5) -> Option<Matrix4<f64>> {
    information.fixed_view::<4, 4>(1, 1).into_owned().cholesky().map(|factor| factor.inverse())
}

/// Root mean square distance of points from their middle.
fn spread(points: &[[f64; 3]]) -> f64 {
    let few = || points.iter().step_by(points.len().div_ceil(SEARCHED).max(1)).map(|at| Vector3::from(*at));
    let n = few().count().max(1) as f64;
    let middle: Vector3<f64> = few().sum::<Vector3<f64>>() / n;
    (few().map(|at| (at - middle).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Standard deviations of the direction within which the epipole may lie.
pub(crate) const REACH: f64 = 3.0;

/// Whether the epipole may lie among the points, of a direction known to `deviation` degrees.
pub(crate) fn among(observations: &Observations, motion: &Motion, deviation: f64) -> bool {
    let reach = (REACH * deviation.to_radians()).powi(2);
    let u = motion.u();
    // On average over its two rows, |G u| is |G| / sqrt 2 for a u across the line of sight.
    (0..observations.n).any(|k| {
        let g = observations.row(k).g;
        (g * u).norm_squared() < reach * 0.5 * g.norm_squared()
    })
}
