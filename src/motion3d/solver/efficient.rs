//! The estimating equation with smoothed depths in its weights.

use super::covariance::{PluginCovariances, damping, direction_deviation, inverse};
use super::profile_likelihood::{ProfileLikelihood, among};
use super::refine::Minimum;
use crate::math::{root, tangents};
use crate::motion3d::kernels::{Bilinear, Weighted, depths, information, slope};
use crate::motion3d::model::{motion::Motion, observations::Observations, rows::Matrix5};
use crate::scattered::{SiteSmoother, Smoothed};
use nalgebra::{Matrix2, Matrix2x3, SymmetricEigen};

/// Times that depths are smoothed and the equation is solved.
pub(crate) const ROUNDS: usize = 3;

/// A change of the direction, degrees, that is not worth another round.
const SETTLED: f64 = 0.001;

/// The farthest that the direction may come from where it began, degrees.
pub(crate) const FARTHEST: f64 = 30.0;

/// The solution of the estimating equation.
#[derive(Debug, Clone)]
pub(crate) struct Efficient {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    /// What the weights make of it, see [`sandwich`].
    pub covariance: Matrix5,
    /// The depths in the weights, `nu~`; as long as the planes.
    pub smooth: Vec<f64>,
    /// Their posterior variances; `None` of depths from elsewhere.
    pub variance: Option<Vec<f64>>,
}

impl Efficient {
    /// The covariance with what a curved profile likelihood adds, and whether it describes that.
    pub fn lengthened(&self, observations: &Observations, smoother: impl Fn() -> SiteSmoother) -> (Matrix5, bool) {
        let profile = ProfileLikelihood { observations, motion: &self.motion, tangent: &self.tangent };
        let mut made = None;
        profile.lengthened(&self.covariance, |motion: &Motion| {
            if self.variance.is_none() {
                return self.smooth.clone();
            }
            made.get_or_insert_with(&smoother).smooth(depths(observations, motion).measured()).value
        })
    }
}

/// Where weights have their depths from.
#[derive(Debug)]
pub(crate) enum WeightDepths<'a> {
    /// Smoothed again at each motion.
    Smoothed(&'a mut SiteSmoother),
    /// Known from elsewhere, as long as the planes.
    Known(Vec<f64>),
}

impl WeightDepths<'_> {
    fn at(&mut self, observations: &Observations, motion: &Motion) -> Smoothed {
        match self {
            Self::Smoothed(smoother) => smoother.smooth(depths(observations, motion).measured()),
            Self::Known(nu) => Smoothed { value: nu.clone(), share: vec![0.0; nu.len()], variance: Vec::new() },
        }
    }

    /// What known depths are to be multiplied with to be in the unit of the translation, by least squares
    /// against the depths of the flow; `None` where these are unrelated: such depths say nothing about the
    /// scene.
    fn unit(&self, observations: &Observations, motion: &Motion) -> Option<f64> {
        let Self::Known(given) = self else { return Some(1.0) };
        let own = depths(observations, motion);
        let (mut along, mut square) = (0.0, 0.0);
        for k in 0..observations.n {
            along += own.s2[k] * own.nu[k] * given[k];
            square += own.s2[k] * given[k] * given[k];
        }
        (along > RELATED * square.sqrt()).then(|| along / square)
    }
}

/// Standard deviations above zero of the factor between known depths and those of the flow, below which they
/// have nothing to do with each other.
const RELATED: f64 = 3.0;

/// Solves `sum V(nu~)^t (s e)(u, w) = 0` (19), (25) from `start`; `None` where a solution fails or leads far
/// away.
///
/// `e_k` is independent of every depth along the epipolar lines, so that a wrong depth in the weight causes
/// no bias.
pub(crate) fn efficient(
    observations: &Observations,
    start: &Motion,
    mut weights: WeightDepths<'_>,
) -> Option<Efficient> {
    let unit = weights.unit(observations, start)?;
    let mut motion = *start;
    let mut smooth = weights.at(observations, &motion);
    for round in 0..ROUNDS {
        if round > 0 {
            smooth = weights.at(observations, &motion);
        }
        smooth.value.iter_mut().for_each(|nu| *nu *= unit);
        let before = motion;
        motion = solve(observations, &before, &smooth.value)?;
        if motion.angle_to(start).to_degrees() > FARTHEST {
            return None;
        }
        if motion.angle_to(&before).to_degrees() < SETTLED {
            break;
        }
    }
    let Smoothed { value: smooth, share, variance } = smooth;
    let tangent = tangents(&motion.u());
    let share = matches!(weights, WeightDepths::Smoothed(_)).then_some(&share[..]);
    let at = Weighted { motion: &motion, tangent: &tangent, nu: &smooth };
    let covariance = sandwich(observations, &at, share)?;
    let (smooth, variance) = match weights {
        WeightDepths::Smoothed(_) => (smooth, Some(variance)),
        WeightDepths::Known(given) => (given, None),
    };
    Some(Efficient { motion, tangent, covariance, smooth, variance })
}

/// Without a solution: the covariance at `motion` by depths smoothed there.
pub(crate) fn covariance_at(
    observations: &Observations,
    motion: &Motion,
    smoother: &mut SiteSmoother,
) -> Option<Matrix5> {
    let smooth = smoother.smooth(depths(observations, motion).measured());
    let at = Weighted { motion, tangent: &tangents(&motion.u()), nu: &smooth.value };
    sandwich(observations, &at, Some(&smooth.share))
}

/// Eigenvalues that the slope may have relative to the weights' squares: beyond, the points' own depths are
/// too noisy to determine it.
const SLOPES: std::ops::Range<f64> = 0.25..4.0;

/// The least singular value of the slope relative to the largest at which known depths determine the motion.
const MIN_SLOPE_RATIO: f64 = 1e-3;

/// `A^-1 B A^-t` with `B = sum W^t W` and the slope `A = sum W^t D` of the equation, with its damped weights:
/// `B^-1` for weights with the right depths. `share`: how much of the points' own depths is in the weights;
/// `None` for depths from elsewhere, free of the flow's noise.
fn sandwich(observations: &Observations, at: &Weighted<'_>, share: Option<&[f64]>) -> Option<Matrix5> {
    let spread = damping(observations, at)?;
    let squares = information(observations, at, spread);
    let plain = inverse(&squares)?;
    let none = if share.is_none() { vec![0.0; at.nu.len()] } else { Vec::new() };
    let slope = slope(observations, at, share.unwrap_or(&none), spread);
    let whiten = squares.cholesky()?.l().try_inverse()?;
    let relative = whiten * slope * whiten.transpose();
    let determined = if share.is_some() {
        let sizes = SymmetricEigen::new(relative.symmetric_part()).eigenvalues;
        sizes.iter().all(|size| SLOPES.contains(size))
    } else {
        let sizes = relative.singular_values();
        sizes.min() > MIN_SLOPE_RATIO * sizes.max()
    };
    let back = slope.try_inverse().filter(|_| determined);
    let covariance = back.map(|back| back * squares * back.transpose());
    let covariance = covariance.map(|covariance| covariance.symmetric_part());
    if share.is_some() { covariance.or(Some(plain)) } else { covariance.filter(|own| own.cholesky().is_some()) }
}

/// The root of the equation whose weights, with the depths `nu`, are frozen at `start`.
pub(crate) fn solve(observations: &Observations, start: &Motion, nu: &[f64]) -> Option<Motion> {
    let weights = Weighted { motion: start, tangent: &tangents(&start.u()), nu };
    let equation = Bilinear::new(observations, &weights, damping(observations, &weights)?);
    let at = |motion: &Motion| equation.at(motion, &tangents(&motion.u()));
    root(*start, at, |motion, step| motion.stepped(&tangents(&motion.u()), step))
}

/// By how much the standard deviation of (17) must be above the bound's for the noise of the depths to
/// matter.
pub(crate) const NOISY: f64 = 1.3;

/// Whether (17) cannot be trusted: the noise of the depths matters, and the epipole may lie among the points.
pub(crate) fn beyond_theory(observations: &Observations, minimum: &Minimum, plugged: &PluginCovariances) -> bool {
    let deviation = direction_deviation(&plugged.likelihood);
    if deviation < NOISY * direction_deviation(&plugged.bound) {
        return false;
    }
    among(observations, &minimum.motion, deviation)
}

/// Mean square error of the minimum as the better solution has it, `C + d d^t` with their difference `d`, in
/// the minimum's axes.
pub(crate) fn nonlinearity_covariance(minimum: &Minimum, better: &Efficient) -> Matrix5 {
    let apart = better.motion.offset(&minimum.motion, &minimum.tangent);
    let axes: Matrix2<f64> = minimum.tangent * better.tangent.transpose();
    let mut into = Matrix5::identity();
    into.fixed_view_mut::<2, 2>(0, 0).copy_from(&axes);
    let error = into * better.covariance * into.transpose() + apart * apart.transpose();
    error.symmetric_part()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::model::rows::Vector5;
    use crate::motion3d::tests::scenes::Scene;

    #[test]
    fn the_slope_of_the_equation_is_its_own() {
        let scene = Scene::oblique(40, 0.1, 5);
        let observations = scene.observations();
        let tangent = tangents(&scene.motion.u());
        let mut nu = scene.inverse_depth.clone();
        nu.resize(observations.stride, 0.0);
        let weights = Weighted { motion: &scene.motion, tangent: &tangent, nu: &nu };
        let equation = Bilinear::new(&observations, &weights, 0.01);
        let at = Motion::new([0.5, 0.1, 0.8], [0.01, -0.02, 0.03]);
        let axes = tangents(&at.u());
        let (_, slope) = equation.at(&at, &axes);
        for axis in 0..5 {
            let value = |by: f64| {
                let mut step = Vector5::zeros();
                step[axis] = by;
                equation.at(&at.stepped(&axes, &step), &axes).0
            };
            let numeric = (value(1e-6) - value(-1e-6)) / 2e-6;
            let error = (numeric - slope.column(axis)).norm();
            assert!(error < 1e-6 * slope.column(axis).norm(), "{axis}: {error}");
        }
    }

    #[test]
    fn true_depths_with_exact_flow_leave_the_truth_alone() {
        let scene = Scene::oblique(40, 0.0, 5);
        let observations = scene.observations();
        let mut nu = scene.inverse_depth.clone();
        nu.resize(observations.stride, 0.0);
        let found = efficient(&observations, &scene.motion, WeightDepths::Known(nu)).unwrap();
        assert!(found.motion.angle_to(&scene.motion) < 1e-10);
    }
}
