//! Flow that a rotation alone explains, and contradictions with a known rotation.
//!
//! A known rotation `w0` of information `L` and flow of information `D` about `(psi, w)` pull the estimate
//! `w` with the same force `g = L (w0 - w)`. The flow alone has a motion that is away by `D^-1 g`, and a
//! rotation that is `d = (L^-1 + (D^-1)_ww) g` from `w0`, whose covariance is `L^-1 + C_ww` if both are
//! right.

use crate::math::{by_chance, tangents};
use crate::motion3d::kernels::{add_to_rotation, equations};
use crate::motion3d::model::measurement::Measurement;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{KnownRotation, Observations, ROUNDING};
use crate::motion3d::model::options::SystematicErrors;
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::{Derotation, Matrix5, Vector5};
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::{DETERMINED, inverse};
use crate::motion3d::solver::finite_rotation::ROUNDS;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};

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
    /// From rows `f = R w + noise` of all points, and what is known of the rotation.
    pub fn of_rows<const N: usize>(
        rows: impl Iterator<Item = (SMatrix<f64, N, 3>, SVector<f64, N>)> + Clone,
        known: Option<&KnownRotation>,
    ) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (r, f) in rows.clone() {
            normal += r.tr_mul(&r);
            right += r.tr_mul(&f);
        }
        if let Some(known) = known {
            normal += known.information;
            right += known.pull(&Vector3::zeros()).0;
        }
        // Points at one place determine two of three unknowns; what rounding adds is no information.
        if SymmetricEigen::new(normal).eigenvalues.min() <= DETERMINED * normal.trace() {
            return None;
        }
        let factor = normal.cholesky()?;
        let (rotation, covariance) = (factor.solve(&right), factor.inverse());
        let left = rows.map(|(r, f)| (f - r * rotation).norm_squared()).sum::<f64>();
        let chi2 = left + known.map_or(0.0, |known| known.pull(&rotation).1);
        let finite = rotation.iter().chain(covariance.iter()).all(|value| value.is_finite());
        finite.then_some(Self { rotation, covariance, chi2 })
    }

    /// What errors that all flow has in common add to the covariance; `unit` maps flow to the plane at
    /// distance 1.
    pub fn systematic_error<const N: usize, const L: usize>(
        &self,
        all: impl Iterator<Item = Measurement<N, L>>,
        errors: &SystematicErrors,
        unit: &Matrix2<f64>,
    ) -> Matrix3<f64> {
        let response = all.map(|one| one.response(None, &SVector::zeros())).sum();
        let mut inverse = Matrix5::zeros();
        add_to_rotation(&mut inverse, &self.covariance, 1.0);
        errors.on((&inverse, &response), &self.rotation, unit).added().fixed_view::<3, 3>(2, 2).into_owned()
    }

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
    let row = |k: usize| observations.row(k);
    RotationOnly::of_rows((0..observations.n).map(|k| (row(k).r, row(k).f)), observations.prior.as_ref())
}

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
    for _ in 0..ROUNDS {
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

/// Difference `(psi, w)` to the motion of the flow alone; `None` where chance explains it, or where the flow
/// alone does not determine a motion. `information`: of the flow and of the known rotation together. The
/// motion's covariance is `own` (with correlated errors) times `wider`, plus that of systematic errors
/// (`common`).
pub(crate) fn contradiction(
    known: &KnownRotation,
    w: &Vector3<f64>,
    information: &Matrix5,
    (own, wider, common): (&Matrix5, f64, &Matrix5),
) -> Option<Vector5> {
    let mut of_flow = *information;
    add_to_rotation(&mut of_flow, &known.information, -1.0);
    let alone = inverse(&of_flow)?;
    let force = known.pull(w).0;
    let before = known.information.cholesky()?.inverse();
    let apart = (before + alone.fixed_view::<3, 3>(2, 2)) * force;
    // What errors do to the motion they do to that of the flow alone, which nothing holds back, the more.
    let freed = alone * information;
    let own = freed * own * freed.transpose() + alone - freed * alone;
    // Of both only the flow's noise may be larger than given.
    let spread = own * wider + freed * common * freed.transpose();
    let expected = before + spread.fixed_view::<3, 3>(2, 2);
    let expected = expected.symmetric_part();
    let square = apart.dot(&expected.cholesky()?.solve(&apart));
    (!by_chance(square, 3.0)).then(|| alone.fixed_columns::<3>(2) * force)
}

/// The motion of the flow alone, the nearest one to `motion`, and how much less likely it is with
/// the known rotation.
pub(crate) fn of_flow_alone(inliers: &Observations, motion: &Motion) -> Alternative {
    let found = refine(&inliers.without_prior(), *motion, StoppingCriteria::of(inliers.n)).motion;
    let cost = |motion: &Motion| equations(inliers, motion, &tangents(&motion.u()), None).cost;
    Alternative { motion: found, excess: cost(&found) - cost(motion) }
}

/// The rotation of the flow alone where what is known beforehand contradicts it; `widened`: the covariance of
/// a rotation with all errors.
pub(crate) fn contradicted_rotation(
    points: &Observations,
    widened: impl Fn(&RotationOnly) -> Matrix3<f64>,
) -> Option<RotationOnly> {
    let (known, alone) = (points.prior?, rotation_only(&points.without_prior())?);
    let (spread, off) = (known.information.cholesky()?.inverse() + widened(&alone), known.rotation - alone.rotation);
    (!by_chance(off.dot(&spread.cholesky()?.solve(&off)), 3.0)).then_some(alone)
}
