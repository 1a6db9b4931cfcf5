//! What is known beforehand of the rotation, and whether the flow contradicts it.
//!
//! A rotation `w0` of information `L` beside flow whose information about `(psi, w)` is `D` leads to `w`,
//! from which both pull with the same force `g = L (w0 - w)`. The flow alone would lead to a motion that is
//! away by `D^-1 g`, and to a rotation that is `d = (L^-1 + (D^-1)_ww) g` from `w0`. Where both are right,
//! `d` has the covariance `L^-1 + C_ww` with that of the flow alone.

use crate::math::by_chance;
use crate::motion3d::kernels::{add_to_rotation, equations};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{KnownRotation, Observations};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::{Matrix5, Vector5, tangents};
use crate::motion3d::solver::covariance::inverse;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use nalgebra::{Matrix3, Vector3};

/// What a motion's covariance is made of: `own`, in which errors that the information takes for independent
/// may go together, times `wider`, and what all flow has in `common`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CovarianceParts {
    pub own: Matrix5,
    pub wider: f64,
    pub common: Matrix5,
}

impl CovarianceParts {
    /// Together.
    pub fn covariance(&self) -> Matrix5 {
        self.own * self.wider + self.common
    }
}

/// By how much the flow alone would lead to another motion, along `(psi, w)`; `None` where chance explains
/// it, or where the flow alone does not determine a motion.
///
/// `information`: of the flow and of the known rotation together.
pub(crate) fn contradiction(
    known: &KnownRotation,
    w: &Vector3<f64>,
    information: &Matrix5,
    parts: &CovarianceParts,
) -> Option<Vector5> {
    let mut of_flow = *information;
    add_to_rotation(&mut of_flow, &known.information, -1.0);
    let alone = inverse(&of_flow)?;
    let force = known.pull(w).0;
    let before = known.information.cholesky()?.inverse();
    let apart = (before + alone.fixed_view::<3, 3>(2, 2)) * force;
    // What errors do to the motion they do to that of the flow alone, which nothing holds back, the more.
    let freed = alone * information;
    let own = freed * parts.own * freed.transpose() + alone - freed * alone;
    // Of both only the flow's noise may be larger than given.
    let spread = own * parts.wider + freed * parts.common * freed.transpose();
    let expected = before + spread.fixed_view::<3, 3>(2, 2);
    let expected = 0.5 * (expected + expected.transpose());
    let square = apart.dot(&expected.cholesky()?.solve(&apart));
    (!by_chance(square, 3.0)).then(|| alone.fixed_columns::<3>(2) * force)
}

/// The motion of the flow alone, the nearest one to `motion`, and how much less likely it is with
/// the known rotation.
pub(crate) fn of_flow_alone(inliers: &Observations, motion: &Motion) -> Alternative {
    let mut alone = inliers.clone();
    alone.prior = None;
    let found = refine(&alone, *motion, StoppingCriteria::of(inliers.n)).motion;
    let cost = |motion: &Motion| equations(inliers, motion, &tangents(&motion.u()), None).cost;
    Alternative { motion: found, excess: cost(&found) - cost(motion) }
}

/// The same of a rotation alone, by its covariance without and with what all flow has in common: what is to
/// be added to that, and the motion of the flow alone.
pub(crate) fn rotation_contradiction(
    known: &KnownRotation,
    w: &Vector3<f64>,
    plain: &Matrix3<f64>,
    own: &Matrix3<f64>,
    common: &Matrix3<f64>,
) -> Option<(Matrix3<f64>, Alternative)> {
    // With a direction that nothing depends on.
    let whole = |rotation: &Matrix3<f64>, direction: f64| {
        let mut matrix = Matrix5::identity() * direction;
        matrix.fixed_view_mut::<3, 3>(2, 2).copy_from(rotation);
        matrix
    };
    let information = whole(&plain.cholesky()?.inverse(), 1.0);
    let parts = CovarianceParts { own: whole(own, 1.0), wider: 1.0, common: whole(common, 0.0) };
    let apart = contradiction(known, w, &information, &parts)?.fixed_rows::<3>(2).into_owned();
    let (alone, (force, before)) = (w - apart, known.pull(w));
    let excess = known.pull(&alone).1 - before - force.dot(&apart);
    let motion = Motion { translation: [f64::NAN; 3], rotation: alone.into() };
    Some((apart * apart.transpose(), Alternative { motion, excess }))
}
