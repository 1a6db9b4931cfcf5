//! The last steps towards the motion among points of which some are outliers.
//!
//! With the probability `g(e)` of each point that it is an inlier
//! ([`outlier_posterior`](crate::motion3d::robust::outlier_posterior)), the estimating equation is
//! `sum g(e) e D(nu~)^t = 0`. Outliers spread evenly add nothing to its mean, and nothing to its slope: when
//! the motion changes, so do those that fit it. So the slope is that of the inliers alone, the mean of
//! `g e^2 D^t D` by parts, while the squares of `g e D` are those of all points: their mean is the same, as
//! it is for every likelihood. Least squares on a fixed set of points treat outliers as inliers.

use super::depth_consistency::{DepthConsistency, Judged};
use super::outlier_posterior::{OutlierPosterior, normal};
use super::{Consensus, INLIER, MIN_POINTS, inliers_of};
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{CHUNK, Observations};
use crate::motion3d::model::rows::{Matrix5, Vector5, tangents};
use crate::motion3d::solver::covariance::{direction_spread, inverse};
use nalgebra::{Matrix2, Matrix2x3, Vector2};
use rayon::prelude::*;

/// Most Newton steps, and the square of one, in standard deviations, that is the last.
const STEPS: usize = 10;
const STEP: f64 = 0.01;

/// The square of all of them, in standard deviations, from which on the steps lead to another motion.
const FARTHEST: f64 = 11.0;

/// The longest step, rad: beyond that other points are inliers.
const LONGEST: f64 = 0.2;

/// Times that the probabilities are updated on the way to a root, and a change of the direction, rad, that
/// is not worth another.
const ROUNDS: usize = 6;
const SETTLED: f64 = 1e-3;

/// A motion with its covariance in the axes `tangent`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EstimatedMotion {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    pub covariance: Matrix5,
}

/// Sums over points that may be inliers.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// `sum g e D^t`, damped near the epipole.
    force: Vector5,
    /// Its slope by the motion.
    slope: Matrix5,
    /// The same, not damped.
    information: Matrix5,
}

/// Points and depths that weigh the equation.
struct Among<'a> {
    all: &'a Observations,
    outliers: &'a OutlierPosterior,
    /// Points with few rejected neighbours, which alone count; `None`: all do.
    has_inlier_neighbours: Option<&'a [bool]>,
    /// `nu~` by point, NaN where that is not known; `None`: the points' own.
    smooth: Option<Vec<f64>>,
    /// For points without one.
    usual: f64,
}

impl Among<'_> {
    /// What one point adds at a motion, with the depth its row has.
    fn add(&self, sums: &mut Sums, at: &EstimatedMotion, k: usize, spread: f64) {
        if self.has_inlier_neighbours.is_some_and(|has_inlier_neighbours| !has_inlier_neighbours[k]) {
            return;
        }
        let Some(odds) = self.outliers.of(k) else { return };
        let row = self.all.row(k);
        let t = row.g * at.motion.u();
        let s2 = t.norm_squared();
        if s2 <= self.all.floor {
            return;
        }
        let (s, own) = (s2.sqrt(), self.all.own());
        let p = Vector2::new(t.y, -t.x) / s;
        let d = row.f - row.r * at.motion.w();
        let (e, along) = (p.dot(&d), t.dot(&d) / s);
        if e.abs() >= INLIER * own || along <= -INLIER * own {
            return;
        }
        let nu = self.smooth.as_ref().map_or(along / s, |smooth| smooth[k]);
        let nu = if nu.is_nan() { self.usual } else { nu };
        let (turn, spin) = (at.tangent * row.g.transpose() * p * nu, row.r.transpose() * p);
        let row_of = Vector5::new(turn.x, turn.y, spin.x, spin.y, spin.z);
        let density = normal(e / own);
        let inlier = density / (density + odds.outliers);
        let damping = s2 / (s2 + 0.5 * row.g.norm_squared() * spread);
        sums.force += row_of * (damping * inlier * e);
        let information = row_of * row_of.transpose() * (inlier * odds.information);
        sums.slope += information * damping;
        sums.information += information;
    }

    /// Newton's steps to the root; `None` if they lead to another motion.
    fn root(
        &self,
        from: &EstimatedMotion,
        first: &Sums,
        spread: f64,
        farthest: f64,
    ) -> Option<(EstimatedMotion, Sums)> {
        let (mut at, mut sums, mut moved) = (*from, *first, 0.0);
        for _ in 0..STEPS {
            let change = sums.slope.cholesky()?.solve(&sums.force);
            let change = change * (LONGEST / change.norm()).min(1.0);
            let square = change.dot(&(sums.information * change));
            moved += square.sqrt();
            let within = moved * moved < farthest;
            if !within {
                return None;
            }
            at.motion = at.motion.stepped(&at.tangent, &change);
            let before = at.tangent;
            at.tangent = tangents(&at.motion.u());
            // So short a step changes the information by no more than it is known.
            if square < STEP {
                sums.information = in_axes(&sums.information, &(at.tangent * before.transpose()));
                return Some((at, sums));
            }
            sums = self.sums(&at, spread);
        }
        None
    }

    fn sums(&self, at: &EstimatedMotion, spread: f64) -> Sums {
        let chunk = |chunk: usize| {
            let mut sums = Sums::default();
            (chunk * CHUNK..((chunk + 1) * CHUNK).min(self.all.n)).for_each(|k| self.add(&mut sums, at, k, spread));
            sums
        };
        let parts: Vec<Sums> = (0..self.all.n.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
        let mut sums = parts.into_iter().fold(Sums::default(), |mut sum, part| {
            sum.force += part.force;
            sum.slope += part.slope;
            sum.information += part.information;
            sum
        });
        if let Some(prior) = &self.all.prior {
            let mut force = sums.force.fixed_rows_mut::<3>(2);
            force += prior.pull(&at.motion.w()).0;
            for matrix in [&mut sums.slope, &mut sums.information] {
                let mut block = matrix.fixed_view_mut::<3, 3>(2, 2);
                block += prior.information;
            }
        }
        sums
    }
}

/// From the motion of the inner inliers, with the depths `smooth` of these in its weights (`None`: their
/// own), to the root of the equation with probabilities, if it `moves`; the covariance grows as the
/// information shrinks. `None` where nothing is known of outliers.
pub(crate) fn weighted_by_posterior(
    all: &Observations,
    known: &Consensus,
    from: &EstimatedMotion,
    smooth: Option<&[f64]>,
    moves: bool,
) -> Option<EstimatedMotion> {
    let outliers = known.outliers.as_ref()?;
    let before = plain(all, known, from, smooth)?;
    let spread = direction_spread(&inverse(&before)?);
    let among = Among::new(all, known, outliers, smooth);
    let first = among.sums(from, spread);
    let (at, sums) =
        if moves { among.root(from, &first, spread, FARTHEST).unwrap_or((*from, first)) } else { (*from, first) };
    let axes = at.tangent * from.tangent.transpose();
    Some(EstimatedMotion { covariance: scaled(&from.covariance, &before, &sums.information, &axes)?, ..at })
}

/// From a motion that was found by least squares to the root of the equation with probabilities, with
/// updated probabilities on the way; with its cost. `None` if too few are inliers.
///
/// Outliers with depths of their own, which are large, weigh most in least squares; drawn to their
/// neighbours' they weigh as inliers do.
pub(crate) fn refined_by_posterior(
    all: &Observations,
    gate: &DepthConsistency<'_>,
    start: Motion,
) -> Option<(Motion, f64)> {
    let mut motion = start;
    for round in 0..=ROUNDS {
        let inliers = inliers_of(all, &motion);
        let Judged { outliers, smooth, cost } =
            gate.judged(&motion, &inliers).filter(|_| inliers.len() >= MIN_POINTS)?;
        if round == ROUNDS {
            return Some((motion, cost));
        }
        let among = Among { all, outliers: &outliers, has_inlier_neighbours: None, smooth: Some(smooth), usual: 0.0 };
        let at = EstimatedMotion { motion, tangent: tangents(&motion.u()), covariance: Matrix5::zeros() };
        let spread = direction_spread(&inverse(&among.sums(&at, 0.0).information)?);
        let Some((next, _)) = among.root(&at, &among.sums(&at, spread), spread, f64::INFINITY) else {
            return Some((motion, cost));
        };
        let change = next.motion.angle_to(&motion);
        motion = next.motion;
        if change < SETTLED {
            return Some((motion, cost));
        }
    }
    None
}

/// `sum D^t D` of the inner inliers, all of which least squares take for such.
fn plain(all: &Observations, known: &Consensus, at: &EstimatedMotion, smooth: Option<&[f64]>) -> Option<Matrix5> {
    let inner = all.subset(&known.inner);
    let own;
    let nu = if let Some(smooth) = smooth {
        smooth
    } else {
        own = depths(&inner, &at.motion).nu;
        &own
    };
    let information = crate::motion3d::kernels::information(&inner, &at.motion, &at.tangent, nu, 0.0);
    information.iter().all(|value| value.is_finite()).then_some(information)
}

/// A matrix of `(psi, w)` in other axes of `psi`.
fn in_axes(matrix: &Matrix5, axes: &Matrix2<f64>) -> Matrix5 {
    let mut into = Matrix5::identity();
    into.fixed_view_mut::<2, 2>(0, 0).copy_from(axes);
    into * matrix * into.transpose()
}

/// The covariance after the information went from `before` to `after`, with all other parts in proportion;
/// `axes` turn those of the direction.
fn scaled(covariance: &Matrix5, before: &Matrix5, after: &Matrix5, axes: &Matrix2<f64>) -> Option<Matrix5> {
    let (before, covariance) = (in_axes(before, axes), in_axes(covariance, axes));
    let grown = after.cholesky()?.l().transpose().try_inverse()? * before.cholesky()?.l().transpose();
    let covariance = grown * covariance * grown.transpose();
    Some(0.5 * (covariance + covariance.transpose()))
}

impl<'a> Among<'a> {
    fn new(
        all: &'a Observations,
        known: &'a Consensus,
        outliers: &'a OutlierPosterior,
        smooth: Option<&[f64]>,
    ) -> Self {
        let (mut sum, mut by_point) = (0.0, None);
        if let Some(smooth) = smooth {
            let mut values = vec![f64::NAN; all.n];
            for (&k, &nu) in known.inner.iter().zip(smooth) {
                values[k as usize] = nu;
                sum += nu;
            }
            by_point = Some(values);
        }
        let has_inlier_neighbours = known.has_inlier_neighbours.as_deref();
        Self { all, outliers, has_inlier_neighbours, smooth: by_point, usual: sum / known.inner.len().max(1) as f64 }
    }
}
