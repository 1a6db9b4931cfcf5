//! How far a motion of patches can be trusted.

use super::SEARCHED;
use super::system::System;
use crate::math::random::CounterRng;
use crate::motion3d::diagnostics::confidence_region::PLAUSIBLE;
use crate::motion3d::diagnostics::status::{FAR, SPACING, WIDE};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::result::{Alternative, MotionEstimate, Status};
use crate::motion3d::model::rows::{Matrix5, tangents};
use crate::motion3d::solver::covariance::direction_deviation;
use crate::motion3d::solver::starts::{evaluate, sample};
use nalgebra::Vector3;

/// Squared standard deviations by which the opposite must be worse to be excluded, and what other minima,
/// whose residuals are other components of the noise, may differ by through chance: this times the root of
/// their number.
const SURE: f64 = 9.0;
const CHANCE: f64 = 1.0;

/// Motions nearer than so many standard deviations, or degrees, are one.
const DISTINCT: f64 = 3.0;
const APART: f64 = 3.0;

/// What speaks for or against a motion.
pub(crate) struct Evidence<'a> {
    /// All minima that were found, maximum likelihood's first.
    pub minima: &'a [Motion],
    /// Whether the patches lie at too few places for one motion only.
    pub few: bool,
    /// Whether they are one plane, which has another motion.
    pub planar: bool,
    /// Whether their surfaces are mostly noise.
    pub low: bool,
}

/// Finds what else could be true: the status, and the other motions among the alternatives.
pub(crate) fn judge(out: &mut MotionEstimate, system: &System, evidence: &Evidence<'_>, rng: CounterRng) {
    let own = out.direction_std;
    let likelihood = direction_deviation(&Matrix5::from_fn(|i, j| out.likelihood.covariance[i][j]));
    // Not a number where it is not known.
    let deviation = own.max(likelihood);
    let found = others(system, &out.motion, evidence.minima, if own.is_finite() { own } else { 0.0 });
    let doubtful = !found.is_empty();
    for other in found {
        if out.alternatives.iter().all(|known| known.motion.angle_to(&other.motion).to_degrees() > APART) {
            out.alternatives.push(other);
        }
    }
    let motions = [out.motion, evidence.minima[0]];
    out.status = if evidence.few {
        Status::FewPoints
    } else if evidence.planar {
        Status::Ambiguous
    } else if own.is_nan() || own > WIDE || far(system, &motions, deviation, rng) {
        Status::IllConditioned
    } else if doubtful {
        Status::Ambiguous
    } else if evidence.low {
        Status::LowSnr
    } else {
        Status::Ok
    };
}

/// Other minima, and the opposites of all, that are about as likely with no patch behind the camera: each
/// with the direction and the rotation that suit it best; the likeliest first.
fn others(system: &System, motion: &Motion, minima: &[Motion], deviation: f64) -> Vec<Alternative> {
    let (_, least) = system.refine_in_front(motion);
    let distinct = (DISTINCT * deviation).max(APART).to_radians();
    let chance = CHANCE * (3.0 * system.patches.len() as f64).sqrt();
    let starts = minima.iter().flat_map(|minimum| [*minimum, minimum.reversed()]);
    let mut found: Vec<Alternative> = Vec::new();
    for (other, cost) in starts.map(|start| system.refine_in_front(&start)) {
        let excess = cost - least;
        let same = |known: &Alternative| known.motion.angle_to(&other).to_degrees() < APART;
        if excess < SURE + chance && other.angle_to(motion) > distinct && !found.iter().any(same) {
            found.push(Alternative { motion: other, excess });
        }
    }
    found.sort_by(|a, b| a.excess.total_cmp(&b.excess));
    found
}

/// Whether directions explain the patches as well as the estimate that are farther than the covariance has
/// it.
fn far(system: &System, motions: &[Motion], deviation: f64, rng: CounterRng) -> bool {
    let n = system.patches.len();
    let few = system.subset(&sample(n, SEARCHED, rng));
    let fewer = (n as f64 / few.patches.len() as f64).sqrt();
    let cost = |u: &Vector3<f64>, limit: f64| {
        let (w, cost) = few.best_rotation(u)?;
        if cost >= limit {
            return None;
        }
        let behind = |u: &Vector3<f64>| few.equations(&Motion::of(u, &w), &tangents(u), None).behind;
        Some(cost + behind(u).min(behind(&-u)))
    };
    let Some(least) = motions.iter().filter_map(|m| cost(&m.u(), f64::INFINITY)).reduce(f64::min) else { return true };
    let (limit, first) = (least + PLAUSIBLE, motions[0].u());
    let angles = evaluate(|u| {
        let plausible = cost(u, limit).is_some_and(|cost| cost < limit);
        plausible.then(|| first.cross(u).norm().atan2(first.dot(u).abs()).to_degrees())
    });
    angles.into_iter().fold(0.0, f64::max) > FAR * deviation * fewer + SPACING
}
