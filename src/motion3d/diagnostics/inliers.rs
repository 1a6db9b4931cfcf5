//! What a choice of points makes of an estimate: who obeys, what the choice leaves in doubt, what noise that
//! was estimated from it is worth.

use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::result::{MotionEstimate, Status};
use crate::motion3d::robust;
use crate::motion3d::robust::Consensus;

/// Tells of all points that obey, beside those that the motion was estimated from; their depths are their
/// own.
pub(crate) fn with_all_inliers(mut found: MotionEstimate, all: &Observations, kept: &Consensus) -> MotionEstimate {
    for &k in &kept.inliers {
        let source = all.source[k as usize] as usize;
        if !found.inliers[source] {
            found.inliers[source] = true;
            found.inverse_depth_smooth[source] = found.inverse_depth[source];
        }
    }
    found
}

/// Too few points to tell outliers from large noise, or from those that decide, make a motion doubtful that
/// nothing worse is said against. That there is none, or too little of one, is said of the same doubtful
/// choice of points and no surer; what else is told says more.
///
/// A rotation alone is not doubted if it leaves one noise of all points, which is the shorter description of
/// them.
pub(crate) fn doubted(found: MotionEstimate, all: &Observations, kept: &Consensus) -> MotionEstimate {
    let doubtful = kept.doubtful;
    let few = match found.status {
        Status::Ok => doubtful || robust::hangs_on_few(all, &found),
        Status::RotationOnly => doubtful && !(kept.whole && robust::one_noise(&found.residuals)),
        Status::LowSnr => doubtful,
        _ => false,
    };
    if few { MotionEstimate { status: Status::FewPoints, ..found } } else { found }
}

/// What a covariance that is a multiple of an estimated variance is to be multiplied with: of errors in units
/// of that, which have Student's distribution with `f` degrees of freedom, the variance is `f / (f - 2)` (W.
/// Gosset 1908).
///
/// Residuals cut off as those of outliers tell less of the variance than all would.
pub(crate) fn of_estimated_noise(points: usize, cut: bool) -> f64 {
    let free = points.saturating_sub(5) as f64 * if cut { TOLD_BY_CUT } else { 1.0 };
    let free = free.max(2.0 * 2.0);
    free / (free - 2.0)
}

/// The information about a variance that is left where residuals beyond 2.5 deviations are cut off and the
/// points chosen by it: 0.69 by the cut alone.
const TOLD_BY_CUT: f64 = 0.6;
