//! Flow that a rotation alone explains, so that there is no translation to estimate.

use crate::math::by_chance;
use crate::motion3d::model::observations::{Observations, ROUNDING};
use crate::motion3d::model::rows::Derotation;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::DETERMINED;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

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

/// Standard deviations by which the best of all directions explains pure noise better than any one would, and
/// a margin; what few points add to that.
const SEARCHED: f64 = 5.5;
const FEW_POINTS: f64 = 12.0;

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
    // Points at one place determine two of three unknowns; what rounding adds is no information.
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

/// Times that the likeliest rotation is taken out and found again.
const TURNS: usize = 4;

/// Displacements without the rotation that explains most of them by itself; `None` of other flow, or where
/// the points do not determine it.
pub(crate) fn without_likeliest_rotation(
    whitening: &Whitening<'_>,
    observations: &Observations,
) -> Option<Observations> {
    if !observations.displaced {
        return None;
    }
    let mut turned = observations.clone();
    for _ in 0..TURNS {
        let found = rotation_only(&turned)?;
        turned = whitening.derotated(&turned, Derotation::new(&found.rotation));
    }
    Some(turned)
}

/// The rotation alone, where chance explains what it leaves: of errors that points share there are fewer.
pub(crate) fn explained_by_rotation(observations: &Observations) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    by_chance(rotation.chi2, (2 * observations.n - 3) as f64 / observations.points_per_independent_sample)
        .then_some(rotation)
}

/// The same where the noise is to be estimated: `cost` is what the best motion leaves of the flow.
///
/// If there were no translation, that would take no more away than the same share of any noise, and what the
/// choice of a direction takes.
pub(crate) fn explained_by_rotation_in_unknown_noise(observations: &Observations, cost: f64) -> Option<RotationOnly> {
    let rotation = rotation_only(observations)?;
    let n = observations.n as f64;
    // A wrong rotation that is said to be known is no noise of the flow.
    let chi2 = rotation.chi2 - observations.pulled(&rotation.rotation);
    let sigma2 = chi2 / (2.0 * n - 3.0);
    let left = cost / (n - 5.0).max(1.0);
    let none = chi2 <= ROUNDING * ROUNDING * observations.median_flow().powi(2) * n;
    (none || (left / sigma2).ln() > -SEARCHED / n.sqrt() - FEW_POINTS / n).then_some(rotation)
}
