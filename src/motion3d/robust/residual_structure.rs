//! Whether residuals are those of noise, and what motion it may be instead.

use super::regional_score::deviating_parts;
use super::two_motion_fit::{Division, TwoMotionFit};
use super::{APART, CompetingMotion, INLIER, truncated};
use crate::math::random::CounterRng;
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};

/// Minimum number of points for the test.
const MIN_POINTS: usize = 50;

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// Parts of the picture from which two motions are looked for.
const PARTS: usize = 4;

/// What two motions must explain more than one: twice the unknowns of one more, and which points have it. And
/// of each point, where that of more points is the same: errors of flow that go together look like the motion
/// of a few.
const ALL: f64 = 20.0;
const EACH: f64 = 0.12;

/// Returns what may be the scene's motion instead of `found` if its inliers `points` have structured
/// residuals: if two motions explain them better, that of more points, or of fewer, if it is another one.
/// `None` if the gain is too small for another motion, as with correlated errors that are given as
/// independent.
///
/// A third motion between those of an object and the scene may have more inliers than the scene's motion
/// alone, and every search may end there; but it leaves residuals in both.
pub(crate) fn competing_motion(
    observations: &Observations,
    found: &Motion,
    points: &[u32],
    rng: CounterRng,
) -> Option<CompetingMotion> {
    let parts = residual_structure(observations, found, points)?;
    let own = observations.subset(points);
    let (n, together) = (own.n as f64, refine(&own, *found, StoppingCriteria::FULL).equations.cost);
    let division = Division::of(own);
    let divided = |part: &Vec<u32>| division.from(part, found, rng);
    let two = parts
        .iter()
        .take(PARTS)
        .filter_map(divided)
        .min_by(|a: &TwoMotionFit, b: &TwoMotionFit| a.cost.total_cmp(&b.cost))?;
    let another = |motion: &&Motion| motion.angle_to(found).to_degrees() > APART;
    let gain = together - two.cost;
    let [more, fewer] = &two.motions;
    let motion = Some(more).filter(another).or_else(|| Some(fewer).filter(another).filter(|_| gain > EACH * n))?;
    let excess = truncated(observations, motion, INLIER) - truncated(observations, found, INLIER);
    (gain > ALL).then(|| CompetingMotion { motion: *motion, excess: excess.max(0.0), others: true })
}

/// Residual structure test of the inliers `points` of `motion`: the parts of the picture whose residuals pull
/// the estimate another way than those elsewhere; `None` without one.
fn residual_structure(observations: &Observations, motion: &Motion, points: &[u32]) -> Option<Vec<Vec<u32>>> {
    if points.len() < MIN_POINTS {
        return None;
    }
    let seen = depths(observations, motion).e;
    let squares: f64 = points.iter().map(|&k| seen[k as usize].powi(2)).sum();
    if squares <= LITTLE * points.len() as f64 {
        return None;
    }
    let parts = deviating_parts(observations, motion, points);
    (!parts.is_empty()).then_some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::{Scene, W, oblique};

    #[test]
    fn few_points_and_residuals_far_less_than_noise_tell_nothing() {
        let all: Vec<u32> = (0..400).collect();
        let turned = Motion::new(oblique().translation, W.map(|w| 2.0 * w));
        let structured = |seed: u64| {
            let mut scene = Scene::oblique(400, 0.02, seed);
            for k in (0..400).filter(|&k| scene.points[k][0] > 0.3) {
                let (nu, at) = (scene.inverse_depth[k], scene.points[k]);
                let (before, after) = (oblique().plane_flow(at, nu), turned.plane_flow(at, nu));
                scene.flow[k] = [0, 1].map(|j| scene.flow[k][j] + after[j] - before[j]);
            }
            let points = scene.observations();
            assert!(residual_structure(&points, &oblique(), &all[..MIN_POINTS - 1]).is_none());
            residual_structure(&points, &oblique(), &all).is_some()
        };
        assert!((0..20).filter(|&seed| structured(seed)).count() >= 10);
        let settled = Scene::oblique(400, 0.0, 1).observations();
        assert!(residual_structure(&settled, &oblique(), &all).is_none());
    }
}
