//! Scenes that do not determine a motion: no translation, one plane.

use super::plane_flow::PlaneFlow;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::{Depths, depths};
use crate::motion3d::model::derotation::HalfTurn;
use crate::motion3d::model::motion::{Motion, Rows};
use crate::motion3d::model::observations::{Observations, ROUNDING};
use crate::motion3d::model::whitening::Intake;
use crate::motion3d::solver::refine::{Effort, refine};
use crate::motion3d::solver::starts::at_most;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::borrow::Cow;

/// Least squares for the rotation alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RotationOnly {
    pub rotation: Vector3<f64>,
    /// Covariance of `w`, in squared units of noise.
    pub covariance: Matrix3<f64>,
    /// Squared residuals, in squared units of noise.
    pub chi2: f64,
}

impl RotationOnly {
    /// The same after all measurements were multiplied by `factor`.
    pub fn in_units(self, factor: f64) -> Self {
        let square = factor * factor;
        Self { covariance: self.covariance / square, chi2: self.chi2 * square, ..self }
    }
}

/// Least share of the information that is not rounding.
const DETERMINED: f64 = 1e-12;

/// Times that a plane's other rotation is taken out of displacements.
const TURNS: usize = 5;

/// Points that are asked first whether they are a plane.
const FEW: usize = 1000;

/// Deviations of a standard normal that a share of 0.001 lies beyond.
const RARE: f64 = 3.0902;

/// Standard deviations by which the best of all directions explains pure noise better than any one would, and
/// a margin; what few points add to that.
const SEARCHED: f64 = 5.5;
const FEW_POINTS: f64 = 12.0;

/// How far, in standard deviations, a chi-squared value of `degrees` degrees of freedom lies from its
/// expectation (E. Wilson, M. Hilferty 1931: its cube root is nearly normal).
pub(crate) fn chi2_deviation(chi2: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    ((chi2 / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Whether chance gives so large a value or a larger one more often than once in a thousand times.
pub(crate) fn by_chance(chi2: f64, degrees: f64) -> bool {
    chi2_deviation(chi2, degrees) < RARE
}

/// The rotation that explains the flow best without a translation; `None` where the points do not determine
/// it.
pub(crate) fn rotation_only(observations: &Observations) -> Option<RotationOnly> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let plane = |p: usize| observations.plane(p);
    for (component, first) in [6, 9].into_iter().enumerate() {
        let r = [plane(first), plane(first + 1), plane(first + 2)];
        let f = plane(12 + component);
        let mut sums = [0.0; 9];
        for (((&x, &y), &z), &f) in r[0].iter().zip(r[1]).zip(r[2]).zip(f) {
            for (sum, value) in sums.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z, x * f, y * f, z * f]) {
                *sum += value;
            }
        }
        let [xx, xy, xz, yy, yz, zz, xf, yf, zf] = sums;
        normal += Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        right += Vector3::new(xf, yf, zf);
    }
    if let Some(known) = &observations.prior {
        normal += known.information;
        right += known.pull(&Vector3::zeros()).0;
    }
    // Points at one place tell of two of three unknowns; what rounding adds is no information.
    if SymmetricEigen::new(normal).eigenvalues.min() <= DETERMINED * normal.trace() {
        return None;
    }
    let factor = normal.cholesky()?;
    let rotation = factor.solve(&right);
    let mut chi2 = observations.pulled(&rotation);
    for (component, first) in [6, 9].into_iter().enumerate() {
        let r = [plane(first), plane(first + 1), plane(first + 2)];
        for (((&x, &y), &z), &f) in r[0].iter().zip(r[1]).zip(r[2]).zip(plane(12 + component)) {
            let rest = f - (x * rotation.x + y * rotation.y + z * rotation.z);
            chi2 += rest * rest;
        }
    }
    let covariance = factor.inverse();
    rotation.iter().chain(covariance.iter()).all(|value| value.is_finite()).then_some(RotationOnly {
        rotation,
        covariance,
        chi2,
    })
}

/// The rotation alone, where chance explains what it leaves: of errors that points share there are fewer.
pub(crate) fn turning(observations: &Observations) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    by_chance(rotation.chi2, (2 * observations.n - 3) as f64 / observations.shared).then_some(rotation)
}

/// The same where the noise is to be estimated: `cost` is what the best motion leaves of the flow.
///
/// If there were no translation, that would take no more away than the same share of any noise, and what the
/// choice of a direction takes.
pub(crate) fn turning_in_unknown_noise(observations: &Observations, cost: f64) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    let n = observations.n as f64;
    // A wrong rotation that is said to be known is no noise of the flow.
    let chi2 = rotation.chi2 - observations.pulled(&rotation.rotation);
    let sigma2 = chi2 / (2.0 * n - 3.0);
    let left = cost / (n - 5.0).max(1.0);
    let none = chi2 <= ROUNDING * ROUNDING * observations.median_flow().powi(2) * n;
    (none || (left / sigma2).ln() > -SEARCHED / n.sqrt() - FEW_POINTS / n).then_some(rotation)
}

/// The other motion of a scene that is one plane `nu = n . eta`: `(n / |n|, w + n x u)`, with the plane `|n|
/// u`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Twin {
    pub motion: Motion,
    /// Squared depths behind the camera, in units of their deviation, that it has, and how far it is from a
    /// known rotation.
    pub behind: f64,
}

/// The other motion where the flow is that of one plane as far as its noise lets tell; `None` where it is
/// not, or where both motions are the same.
///
/// `distinct`: least angle between both directions, rad, that is no mere error of the estimate; `unknown`:
/// the noise is what the motion leaves.
pub(crate) fn twin(
    intake: &Intake<'_>,
    observations: &Observations,
    motion: &Motion,
    distinct: f64,
    unknown: bool,
) -> Option<Twin> {
    // The ratio of two independent variances, one of twice as many numbers as the other, deviates by so much
    // more than one alone.
    let usual = if unknown { 3.0f64.sqrt() } else { 1.0 };
    let fits = |plane: &PlaneFlow| chi2_deviation(plane.chi2, plane.free / observations.shared) < usual * RARE;
    // What is far from a plane is so for few points already.
    if observations.n > FEW {
        PlaneFlow::fit(&at_most(observations, FEW, CounterRng::new(0))).filter(fits)?;
    }
    let plane = PlaneFlow::fit(observations).filter(fits)?;
    let Depths { mut nu, s2, .. } = depths(observations, motion);
    if let Some(turn) = &observations.turn {
        let middle = turn.middle(&motion.u());
        for nu in &mut nu {
            *nu = middle.depth(*nu);
        }
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for k in (0..observations.n).filter(|&k| s2[k] > 0.0) {
        let eta = place(observations, motion, k, nu[k]);
        normal += s2[k] * eta * eta.transpose();
        right += s2[k] * nu[k] * eta;
    }
    let n = normal.cholesky()?.solve(&right);
    let u = motion.u();
    // What a plane leaves of each depth.
    let rest = |k: usize| (observations.row(k).g * u).dot(&plane.rest[k]) / s2[k];
    if n.norm() <= 0.0 || bent(observations, &s2, rest) {
        return None;
    }
    let (other, seen) = other_motion(intake, observations, motion, &n)?;
    let behind = |motion: &Motion| -> f64 {
        let at = depths(&seen, motion);
        let behind: f64 = (0..seen.n).map(|k| at.nu[k].min(0.0).powi(2) * at.s2[k]).sum();
        behind + seen.pulled(&motion.w())
    };
    let angle = other.u().cross(&u).norm().atan2(other.u().dot(&u).abs());
    let signs = [other, other.reversed()].map(|motion| Twin { motion, behind: behind(&motion) });
    let better = if signs[1].behind < signs[0].behind { signs[1] } else { signs[0] };
    (angle > distinct).then_some(better)
}

/// A point's `eta`, where `nu = n . eta` holds for a plane. Half way along a displacement it is the picture
/// of the point half way, which a displacement that changes the depth has at `m + nu^2 t_z / 4 G(m) t`.
fn place(observations: &Observations, motion: &Motion, k: usize, nu: f64) -> Vector3<f64> {
    let [x, y, z] = observations.position[k];
    if observations.spherical {
        return Vector3::new(x, y, z);
    }
    let Some(turn) = observations.turn else { return Vector3::new(x, y, 1.0) };
    let t = turn.mean * motion.u();
    let along = Rows::plane([x, y]).g * t * (0.25 * nu * nu * t.z);
    Vector3::new(x + along.x, y + along.y, 1.0)
}

/// The other motion of a plane, and the points as it sees them: displacements with its own rotation taken
/// out, where another one was.
fn other_motion<'a>(
    intake: &Intake<'_>,
    observations: &'a Observations,
    motion: &Motion,
    n: &Vector3<f64>,
) -> Option<(Motion, Cow<'a, Observations>)> {
    let Some(turn) = observations.turn else {
        let other = Motion::of(&n.normalize(), &(motion.w() + n.cross(&motion.u())));
        // What the estimate is off by is in the plane, too.
        let other = refine(observations, other, None, Effort::FULL).motion;
        return Some((other, Cow::Borrowed(observations)));
    };
    // In the axes half way the translation is V' u and rotations are V' w.
    let back = turn.mean.try_inverse()?;
    let w = motion.w() + back * n.cross(&(turn.mean * motion.u()));
    let mut other = Motion::of(&(back * n).normalize(), &w);
    let mut seen = observations.clone();
    for _ in 0..TURNS {
        seen = intake.turned(&seen, HalfTurn::of(&other));
        other = refine(&seen, other, None, Effort::FULL).motion;
    }
    Some((other, Cow::Owned(seen)))
}

/// Whether a curved surface explains the depths better than a plane by more than chance and the error of the
/// motion would have it: all depths together tell that with less certainty.
///
/// `rest`: what a plane leaves of each depth.
fn bent(observations: &Observations, s2: &[f64], rest: impl Fn(usize) -> f64) -> bool {
    const TERMS: usize = 9;
    let terms = if observations.spherical { TERMS } else { 6 };
    let mut sums = nalgebra::SMatrix::<f64, TERMS, { TERMS + 1 }>::zeros();
    for k in (0..observations.n).filter(|&k| s2[k] > 0.0) {
        let [x, y, z] = observations.position[k];
        let height = if observations.spherical { z } else { 1.0 };
        let row = [height, x, y, x * x, x * y, y * y, x * z, y * z, z * z, rest(k)];
        for i in 0..terms {
            for j in (i..terms).chain([TERMS]) {
                sums[(i, j)] += s2[k] * row[i] * row[j];
            }
        }
    }
    let normal = nalgebra::DMatrix::from_fn(terms, terms, |i, j| sums[(i.min(j), i.max(j))]);
    let right = nalgebra::DVector::from_fn(terms, |i, _| sums[(i, TERMS)]);
    // Without a solution (points on a line) nothing is known of the bending.
    let Some(factor) = normal.cholesky() else { return false };
    let explained = right.dot(&factor.solve(&right));
    !by_chance(explained, (terms - 3 + 5) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_those_of_chi_squared() {
        // Upper 0.001 quantiles of chi-squared with 7, 100 and 597 degrees of freedom.
        for (degrees, quantile) in [(7.0, 24.322), (100.0, 149.449), (597.0, 709.5)] {
            assert!((chi2_deviation(quantile, degrees) - RARE).abs() < 0.05, "{degrees}");
        }
    }
}
