//! Points as those of two motions, where one of all leaves residuals that are not those of noise.
//!
//! A moving object and the scene may fit a third motion together with residuals as small as noise, but those
//! of each pull the estimate another way: a score test of parts of the picture shows it.

use super::{APART, INLIER, cheaper_sign, search::robust_motions, truncated};
use crate::math::{chi2_deviation, random::CounterRng};
use crate::motion3d::kernels::{depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, UNKNOWNS};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::solver::{refine::StoppingCriteria, refine::refine};
use crate::scattered::{Neighbours, Tree};
use nalgebra::SymmetricEigen;
use std::ops::Range;

/// Minimum number of points that are tested for a second motion.
pub(crate) const MIN_TESTED: usize = 50;

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// Parts of the picture from which two motions are looked for.
const PARTS: usize = 4;

/// What two motions must explain more than one if that of more points has another direction: twice the
/// unknowns of one more, and which points have it.
const ANOTHER: f64 = 20.0;

/// What they must explain more wherever their directions are, if parts that deviate lie apart and the noise
/// was given: so many unknowns, the second motion's own and the place and size of its region, each times
/// `ln n` (G. Schwarz 1978). Where noise hides the difference both fits stay near the third motion that they
/// share, although neither the scene nor the object has it. Outliers that fit by chance deviate in one part.
const ADDED: f64 = 8.0;

/// What they must explain more of each point in unknown noise, if that of fewer points has another direction:
/// unknown noise may be errors that go together, which look like the motion of a few.
const EACH: f64 = 0.12;

/// Returns what may be the scene's motion instead of `found` if its inliers `points` have structured
/// residuals: if two motions explain them better, that of more points if it is another one, else the farther.
/// `None` if the gain is too small for another motion. `unknown`: the noise was not given.
///
/// A third motion between those of an object and the scene may have more inliers than the scene's motion
/// alone, and every search may end there; but it leaves residuals in both.
pub(crate) fn competing_motion(
    observations: &Observations,
    found: &Motion,
    points: &[u32],
    unknown: bool,
    rng: CounterRng,
) -> Option<Alternative> {
    let parts = deviating_parts(observations, found, points)?;
    let own = observations.subset(points);
    let (n, together) = (own.n as f64, refine(&own, *found, StoppingCriteria::FULL).equations.cost);
    let division = Division::of(own);
    let divided = |part: &Vec<u32>| division.from(part, found, rng);
    let two = parts
        .iter()
        .take(PARTS)
        .filter_map(divided)
        .min_by(|a: &TwoMotionFit, b: &TwoMotionFit| a.cost.total_cmp(&b.cost))?;
    let [more, fewer] = two.motions;
    let [turned, turned_fewer] = [more, fewer].map(|motion| motion.angle_to(found));
    let is_another = turned.to_degrees() > APART;
    let (differs, needed) = if is_another {
        (true, ANOTHER)
    } else if unknown {
        (turned_fewer.to_degrees() > APART, ANOTHER.max(EACH * n))
    } else {
        (lie_apart(&parts), ADDED * n.ln())
    };
    if !differs || together - two.cost <= needed {
        return None;
    }
    let motion = if is_another || turned > turned_fewer { more } else { fewer };
    let excess = truncated(observations, &motion, INLIER) - truncated(observations, found, INLIER);
    Some(Alternative { motion, excess: excess.max(0.0) })
}

/// Whether two of the parts have no point in common; of others one holds the other.
fn lie_apart(parts: &[Vec<u32>]) -> bool {
    let holds = |one: &[u32], other: &[u32]| one.contains(&other[0]);
    parts.iter().any(|one| parts.iter().any(|other| !holds(one, other) && !holds(other, one)))
}

/// The smallest parts, as a share of the points, and the fewest points of one.
const PART: usize = 16;
const MIN_PART: usize = 8;

/// Standard deviations by which one of about thirty parts differs in one of five pictures by chance: the fit
/// of two motions decides then.
const FAR: f64 = 2.5;

/// Information about a combination of the unknowns that a part has of its own, as a share of all; less is
/// rounding.
const ROUNDING: f64 = 1e-6;

/// Parts of the inliers `points` of `motion`, by their places among these, whose residuals pull the estimate
/// on all of them farther than noise does, the farthest first; `None` of few points, or where residuals are
/// far less than noise.
///
/// The sums `g = sum D^t e` of a part are zero but for noise of the covariance `H_r - H_r H^-1 H_r`, with
/// `H_r = sum D^t D` over the part and `H` over all (the score test of C. R. Rao 1948). Parts are halves of
/// the points, halves of these, and so on.
fn deviating_parts(observations: &Observations, motion: &Motion, points: &[u32]) -> Option<Vec<Vec<u32>>> {
    let seen = depths(observations, motion).e;
    let squares: f64 = points.iter().map(|&k| seen[k as usize].powi(2)).sum();
    if points.len() < MIN_TESTED || squares <= LITTLE * points.len() as f64 {
        return None;
    }
    let own = observations.subset(points);
    let least = refine(&own, *motion, StoppingCriteria::FULL);
    let whiten = least.equations.h.cholesky()?.l();
    let seen = depths(&own, &least.motion);
    let row = |k: usize| whiten.solve_lower_triangular(&slopes(&own, &least.motion, &least.tangent, seen.nu[k], k));
    let rows = (0..own.n).map(row).collect::<Option<Vec<_>>>()?;
    let variance = seen.e[..own.n].iter().map(|e| e * e).sum::<f64>() / own.n as f64;
    let tree = Tree::new(&own.site[..own.n]);
    let parts = tree.halves(MIN_PART.max(own.n / PART));
    let departs = |places: &Range<usize>| {
        let (mut share, mut pull) = (Matrix5::zeros(), Vector5::zeros());
        for &k in &tree.order()[places.clone()] {
            let row = &rows[k as usize];
            share += row * row.transpose();
            pull += row * seen.e[k as usize];
        }
        score_deviation(share, &pull, variance)
    };
    let far = parts.into_iter().map(|places| (departs(&places), places)).filter(|(departs, _)| *departs > FAR);
    let mut far: Vec<(f64, Range<usize>)> = far.collect();
    far.sort_by(|a, b| b.0.total_cmp(&a.0));
    (!far.is_empty()).then(|| far.into_iter().map(|(_, places)| tree.order()[places].to_vec()).collect())
}

/// How far the `pull` of a part that has the `share` of all information is from noise, in standard
/// deviations.
fn score_deviation(share: Matrix5, pull: &Vector5, variance: f64) -> f64 {
    if !share.iter().chain(pull).all(|value| value.is_finite()) {
        return 0.0;
    }
    let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(share);
    let along = eigenvectors.transpose() * pull;
    let (mut chi2, mut degrees) = (0.0, 0.0);
    for (own, along) in eigenvalues.iter().zip(along.iter()) {
        let spread = own * (1.0 - own);
        if spread > ROUNDING {
            chi2 += along * along / (spread * variance);
            degrees += 1.0;
        }
    }
    if degrees > 0.0 { chi2_deviation(chi2, degrees) } else { 0.0 }
}

/// Neighbours that decide with a point which motion it has: moving objects are connected.
const NEAREST: usize = 8;

/// Times that points are given to the motion that they fit.
const ROUNDS: usize = 8;

/// Two motions, that of more points first, and what each point leaves with its own, summed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TwoMotionFit {
    pub motions: [Motion; 2],
    pub cost: f64,
}

/// The points that are to be divided.
pub(crate) struct Division {
    points: Observations,
    tree: Tree,
    near: Neighbours,
}

impl Division {
    /// Of more points than [`NEAREST`].
    pub fn of(points: Observations) -> Self {
        let tree = Tree::new(&points.site[..points.n]);
        let places: Vec<u32> = (0..points.n as u32).collect();
        let near = tree.nearest(&places, NEAREST);
        Self { points, tree, near }
    }

    /// The division that is reached from a `part` (by index) and the rest, both of which move as `start` or
    /// nearly so; `None` where one of both loses its points.
    pub fn from(&self, part: &[u32], start: &Motion, rng: CounterRng) -> Option<TwoMotionFit> {
        let mut second = self.points.mask(part);
        let mut motions = [*start; 2];
        for round in 0..ROUNDS {
            for (own, motion) in motions.iter_mut().enumerate() {
                let members = self.points.subset(&chosen(&second, own == 1));
                if members.n <= UNKNOWNS.max(NEAREST) {
                    return None;
                }
                // From all directions at first.
                *motion = if round == 0 {
                    robust_motions(&members, 1, rng).pop()?
                } else {
                    refine(&members, *motion, StoppingCriteria::ROUGH).motion
                };
            }
            let next = self.nearer(&motions);
            if next == second && round > 0 {
                break;
            }
            second = next;
        }
        let members = [false, true].map(|own| self.points.subset(&chosen(&second, own)));
        if members.iter().any(|members| members.n <= UNKNOWNS) {
            return None;
        }
        let fitted: [_; 2] = std::array::from_fn(|own| refine(&members[own], motions[own], StoppingCriteria::FULL));
        let cost = fitted.iter().map(|minimum| minimum.equations.cost).sum();
        let signed: [Motion; 2] = std::array::from_fn(|own| cheaper_sign(&members[own], fitted[own].motion).0);
        let motions = if members[0].n < members[1].n { [signed[1], signed[0]] } else { signed };
        Some(TwoMotionFit { motions, cost })
    }

    /// Which points, with their neighbours, the second motion leaves less of.
    fn nearer(&self, motions: &[Motion; 2]) -> Vec<bool> {
        let [first, second] = motions.each_ref().map(|motion| depths(&self.points, motion).e);
        let order = self.tree.order();
        // Neighbours across the border of an object do not decide.
        let square = |e: f64| e.powi(2).min(INLIER * INLIER);
        let gain = |place: u32| {
            let k = order[place as usize] as usize;
            square(first[k]) - square(second[k])
        };
        let mut out = vec![false; self.points.n];
        for place in 0..self.points.n as u32 {
            let around: f64 = self.near.of(place as usize).iter().map(|&near| gain(near)).sum();
            out[order[place as usize] as usize] = gain(place) + around > 0.0;
        }
        out
    }
}

/// The indices of those that are `wanted`.
fn chosen(second: &[bool], wanted: bool) -> Vec<u32> {
    (0..second.len() as u32).filter(|&k| second[k as usize] == wanted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::{Scene, W, oblique};

    /// Turns the points at one side twice as fast: by two standard deviations of a point, most of which
    /// passes for depth.
    fn turn_a_part(scene: &mut Scene) {
        let turned = Motion::new(oblique().translation, W.map(|w| 2.0 * w));
        for k in (0..400).filter(|&k| scene.points[k][0] > 0.3) {
            let (nu, at) = (scene.inverse_depth[k], scene.points[k]);
            let (before, after) = (oblique().plane_flow(at, nu), turned.plane_flow(at, nu));
            scene.flow[k] = [0, 1].map(|j| scene.flow[k][j] + after[j] - before[j]);
        }
    }

    #[test]
    fn few_points_and_residuals_far_less_than_noise_show_nothing() {
        let all: Vec<u32> = (0..400).collect();
        let structured = |seed: u64| {
            let mut scene = Scene::oblique(400, 0.02, seed);
            turn_a_part(&mut scene);
            let points = scene.observations();
            assert!(deviating_parts(&points, &oblique(), &all[..MIN_TESTED - 1]).is_none());
            deviating_parts(&points, &oblique(), &all).is_some()
        };
        assert!((0..20).filter(|&seed| structured(seed)).count() >= 10);
        let settled = Scene::oblique(400, 0.0, 1).observations();
        assert!(deviating_parts(&settled, &oblique(), &all).is_none());
    }

    #[test]
    fn parts_lie_apart_unless_one_holds_the_other() {
        let [all, first, second] = [0..8, 0..4, 4..8].map(Vec::<u32>::from_iter);
        let mut parts = vec![first, all];
        assert!(!lie_apart(&parts[1..]) && !lie_apart(&parts));
        parts.push(second);
        assert!(lie_apart(&parts));
    }

    #[test]
    fn a_part_with_another_rotation_pulls_apart_and_noise_does_not() {
        let all: Vec<u32> = (0..400).collect();
        let (mut chance, mut found) = (0, 0);
        for seed in 0..80 {
            let mut scene = Scene::oblique(400, 0.02, seed);
            chance += u32::from(deviating_parts(&scene.observations(), &oblique(), &all).is_some());
            turn_a_part(&mut scene);
            found += u32::from(deviating_parts(&scene.observations(), &oblique(), &all).is_some());
        }
        assert!(chance <= 20 && found >= 76, "{chance} {found}");
    }

    #[test]
    fn both_motions_are_found_from_a_part_that_is_neither() {
        let object = Motion::new([-0.8, 0.1, 0.3], W.map(|w| 1.5 * w));
        for seed in 0..5 {
            let mut scene = Scene::new(oblique(), 400, 0.6, 0.05, seed, |_, _, r| 0.5 + r);
            let moved = Scene::new(object, 400, 0.6, 0.05, seed, |_, _, r| 0.5 + r);
            for k in (0..400).filter(|&k| scene.points[k][0] > 0.2) {
                scene.flow[k] = moved.flow[k];
            }
            let part: Vec<u32> = (0..400).filter(|&k| scene.points[k as usize][0] > 0.0).collect();
            let points = scene.observations();
            let one = refine(&points, oblique(), StoppingCriteria::FULL).equations.cost;
            let division = Division::of(points);
            let two = division.from(&part, &oblique(), CounterRng::new(seed)).unwrap();
            let off = [(0, oblique()), (1, object)].map(|(k, truth)| two.motions[k].angle_to(&truth).to_degrees());
            assert!(off[0] < 15.0 && off[1] < 15.0 && two.cost < 0.7 * one, "{seed}: {off:?} {} {one}", two.cost);
        }
    }

    #[test]
    fn points_that_move_as_one_have_no_second_motion_that_is_worth_it() {
        let points = Scene::oblique(300, 0.02, 1).observations();
        let one = refine(&points, oblique(), StoppingCriteria::FULL).equations.cost;
        let division = Division::of(points);
        let two = division.from(&(0..100).collect::<Vec<u32>>(), &oblique(), CounterRng::new(1));
        assert!(two.is_none_or(|two| two.cost > 0.75 * one));
    }
}
