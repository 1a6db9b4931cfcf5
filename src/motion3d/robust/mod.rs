//! Inliers of one motion among outliers.
//!
//! * `search`: every direction with the best of many rotations, refined to motions with many inliers. `noise`
//!   estimates unknown noise from these inliers, whether few points have outliers at all, and (for
//!   `diagnostics`) whether few of them decide.
//! * `competing_motions`: other motions with about as many inliers, the choice among many outliers, and
//!   objects that noise hides.
//! * `depth_consistency`: inliers whose depth is that of their neighbours in the same cell;
//!   `outlier_posterior`: the probability that an inlier is an outlier, which weighs the points of the
//!   solution.
//! * `two_motions`: whether residuals are those of two motions.

mod competing_motions;
mod depth_consistency;
mod noise;
mod outlier_posterior;
mod search;
mod two_motions;

use crate::ablation::keeps;
use crate::math::{random::CounterRng, truncated_std};
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, Scaled, UNKNOWNS};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::finite_rotation::changes_inliers;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use crate::motion3d::solver::starts::{SEARCHED, STARTS, at_most};
use competing_motions::{among_many_outliers, competing_motions, hidden_object, second};
use depth_consistency::DepthConsistency;
pub(crate) use noise::{has_high_leverage, larger, one_noise};
use outlier_posterior::OutlierPosterior;
pub(crate) use outlier_posterior::weighted_by_posterior;
use search::{graduated, robust_motions};
use std::borrow::Cow;

/// Residual, in units of noise, from which on a point is an outlier; depths behind the camera may be as
/// far.
const INLIER: f64 = 3.0;

/// The least angle between different motions, degrees.
const APART: f64 = 10.0;

/// When a motion of a set of inliers that is not final is reached.
const STOPPING: StoppingCriteria = StoppingCriteria { deviations: 1e-2, ..StoppingCriteria::FULL };

/// A relative change of the noise that does not change the inliers.
const SETTLED_NOISE: f64 = 0.02;

/// Rounds towards a fixed set of inliers, and towards the noise of few points.
const ROUNDS: usize = 10;
const FEW_ROUNDS: usize = 4;

/// Share of outliers among the inliers from which on they matter for the search.
const MATTER: f64 = 0.03;

/// Two motions of different points of which neither has a tenth of all points more than the other: which is
/// the scene's is undecided.
const MAJORITY: f64 = 0.1;

/// Below so many points a few of them can agree by chance far better than the noise of all is.
const SELECTED: usize = 100;

/// By how much, in nats, outliers must shorten the description of the residuals to be believed.
const SURE: f64 = 10.0;

/// A motion and its inliers.
#[derive(Debug, Clone)]
pub(crate) struct Consensus {
    pub motion: Motion,
    /// Indices among the observations, ascending.
    pub inliers: Vec<u32>,
    /// Other motions with about as many inliers, and how much more each costs, in squared units of noise;
    /// the best first.
    pub competing: Vec<Alternative>,
    /// Of few points whose outliers are not believed: by how much, in nats, these would shorten the
    /// description of the residuals.
    pub shorter: Option<f64>,
    /// Whether so many outliers fit by chance that least squares on all inliers would follow them.
    pub many: bool,
    /// Probability that points are outliers that fit by chance; `None` if unknown.
    pub outliers: Option<OutlierPosterior>,
}

impl Consensus {
    fn new(motion: Motion, inliers: Vec<u32>) -> Self {
        Self { motion, inliers, competing: Vec::new(), shorter: None, many: false, outliers: None }
    }
}

/// Motions with their truncated costs, the cheapest first.
type Candidates = Vec<(Motion, f64)>;

/// Returns the motion with the most inliers, and competing motions. Points are then in units of the estimated
/// noise, if it was unknown, and derotated where that changes the inliers.
pub(crate) fn consensus(whitening: &Whitening<'_>, scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    let mut found = with_noise(whitening, scaled, rng)?;
    // Errors that go together look like other motions everywhere.
    if scaled.observations.independent && keeps("motion3d.residual_structure") {
        let on = search_sample(&scaled.observations, rng);
        let inliers = inliers_of(&on, &found.motion);
        let inliers = if on.n == scaled.observations.n { &found.inliers } else { &inliers };
        found.competing.extend(two_motions::competing_motion(&on, &found.motion, inliers, scaled.unknown, rng));
    }
    Some(found)
}

fn with_noise(whitening: &Whitening<'_>, scaled: &mut Scaled, rng: CounterRng) -> Option<Consensus> {
    if !scaled.unknown {
        return in_noise(whitening, scaled, false, rng);
    }
    let few = keeps("motion3d.single_noise") && scaled.observations.n < SELECTED;
    let of_all = few.then(|| noise::noise_std(whitening, &scaled.observations, rng)).flatten();
    let of_all = of_all.map(|noise_std| noise_std * scaled.noise_std);
    scaled.take(noise::FIRST_SHARE * scaled.observations.median_flow());
    let found = in_noise(whitening, scaled, true, rng)?;
    let Some(of_all) = of_all.map(|noise_std| noise_std / scaled.noise_std) else { return Some(found) };
    let shorter = noise::shortening(&scaled.observations, &found, of_all);
    if shorter >= SURE {
        return Some(found);
    }
    scaled.take(of_all);
    Some(Consensus { shorter: Some(shorter), ..in_noise(whitening, scaled, false, rng)? })
}

/// One search in the present noise, which is estimated again from the best candidate's residuals if it is
/// `unknown`; then all other tests of that candidate run once.
fn in_noise(whitening: &Whitening<'_>, scaled: &mut Scaled, unknown: bool, rng: CounterRng) -> Option<Consensus> {
    let mut candidates = searched(&search_sample(&scaled.observations, rng), rng)?;
    let few = scaled.observations.n < SELECTED;
    for _ in 0..if few { FEW_ROUNDS } else { ROUNDS } {
        // A robust fit of few points follows those that agree by chance: their noise is that of all inliers.
        let best =
            if few { of_candidates(&scaled.observations, candidates.clone(), rng)?.motion } else { candidates[0].0 };
        let mut changed = false;
        if unknown {
            let noise_std = truncated_std(&depths(&scaled.observations, &best).e[..scaled.observations.n], UNKNOWNS);
            changed = (noise_std - 1.0).abs() > SETTLED_NOISE;
            scaled.take(noise_std);
        }
        let inliers = scaled.observations.subset(&inliers_of(&scaled.observations, &best));
        if changes_inliers(whitening, &inliers, &best) {
            scaled.observations = whitening.derotated(&scaled.observations, best.derotation());
            changed = true;
        }
        if !changed {
            break;
        }
        let on = search_sample(&scaled.observations, rng);
        if few {
            candidates = searched(&on, rng)?;
            continue;
        }
        candidates = cheapest(&on, candidates.iter().map(|(motion, _)| graduated(&on, *motion, INLIER)));
    }
    of_candidates(&scaled.observations, candidates, rng)
}

/// Finds the inliers of the best candidate, and competing motions.
fn of_candidates(observations: &Observations, mut candidates: Candidates, rng: CounterRng) -> Option<Consensus> {
    let on = &*search_sample(observations, rng);
    if keeps("motion3d.second_motion") {
        candidates.extend(second(on, candidates.first()?.0, rng.stream(10)));
        sort(&mut candidates);
    }
    let mut competing = competing_motions(on, &candidates);
    let mut found = settle(observations, candidates.first()?.0)?;
    let gate = DepthConsistency::new(observations);
    let (mut inliers, mut outliers) = gate.passed(&found);
    let many = keeps("motion3d.many_outliers") && outliers.as_ref().is_some_and(|outliers| outliers.share > MATTER);
    if many && let Some((motion, others)) = among_many_outliers(observations, on, &gate, &candidates) {
        found = Consensus { many, ..Consensus::new(motion, inliers_of(observations, &motion)) };
        (inliers, outliers) = gate.passed(&found);
        competing = others;
    }
    found.competing = competing;
    if inliers.len() >= UNKNOWNS {
        found.inliers = inliers;
        found.outliers = outliers.filter(|_| keeps("motion3d.outlier_mixture"));
    }
    if found.inliers.len() < UNKNOWNS {
        return None;
    }
    if keeps("motion3d.hidden_object") && observations.independent {
        let on_cells = DepthConsistency::new(on);
        found.competing.extend(hidden_object(on, &on_cells, &found.motion, &candidates, rng.stream(11)));
    }
    Some(found)
}

/// The points that a search begins with.
fn search_sample(observations: &Observations, rng: CounterRng) -> Cow<'_, Observations> {
    at_most(observations, SEARCHED, rng.stream(9))
}

/// Motions with many inliers; `None` where there are none.
fn searched(observations: &Observations, rng: CounterRng) -> Option<Candidates> {
    let found = cheapest(observations, robust_motions(observations, STARTS, rng).into_iter());
    (!found.is_empty()).then_some(found)
}

/// Motions with their better signs.
fn cheapest(observations: &Observations, motions: impl Iterator<Item = Motion>) -> Candidates {
    let mut all = motions.map(|motion| cheaper_sign(observations, motion)).collect();
    sort(&mut all);
    all
}

fn sort(candidates: &mut Candidates) {
    candidates.sort_by(|a, b| a.1.total_cmp(&b.1));
}

/// The sign with the lower truncated cost, and that.
fn cheaper_sign(observations: &Observations, motion: Motion) -> (Motion, f64) {
    let signs = [motion, motion.reversed()].map(|motion| (motion, truncated(observations, &motion, INLIER)));
    if signs[1].1 < signs[0].1 { signs[1] } else { signs[0] }
}

/// `sum min(e^2 + [nu^ < 0] min((nu^ / sd)^2, cut^2 / 2), cut^2)`: an outlier counts once, and half if it is
/// on its epipolar line with a depth behind the camera, as what overtakes the camera is.
fn truncated(observations: &Observations, motion: &Motion, cut: f64) -> f64 {
    let (seen, most) = (depths(observations, motion), cut * cut);
    let behind = |k: usize| (seen.nu[k].min(0.0).powi(2) * seen.s2[k]).min(0.5 * most);
    (0..observations.n).map(|k| (seen.e[k].powi(2) + behind(k)).min(most)).sum()
}

/// Points within three standard deviations of their epipolar line and of the half space before the camera.
fn inliers_of(observations: &Observations, motion: &Motion) -> Vec<u32> {
    let seen = depths(observations, motion);
    let is_inlier = |&k: &u32| {
        let k = k as usize;
        seen.e[k].abs() < INLIER && seen.nu[k] * seen.s2[k].sqrt() > -INLIER
    };
    (0..observations.n as u32).filter(is_inlier).collect()
}

/// Maximum likelihood on the inliers, until these stay the same.
fn settle(observations: &Observations, start: Motion) -> Option<Consensus> {
    let mut motion = start;
    let mut inliers = inliers_of(observations, &motion);
    for _ in 0..ROUNDS {
        if inliers.len() < UNKNOWNS {
            return None;
        }
        motion = refine(&observations.subset(&inliers), motion, STOPPING).motion;
        let next = inliers_of(observations, &motion);
        // Of many points a few always lie on the border.
        let settled = next == inliers
            || (observations.n > SEARCHED && next.len().abs_diff(inliers.len()) * 1000 < observations.n);
        inliers = next;
        if settled {
            break;
        }
    }
    (inliers.len() >= UNKNOWNS).then_some(Consensus::new(motion, inliers))
}
