//! Motions beside the one that most points obey, and which of several it is among many strays.

use super::depth_consistency::Gate;
use super::graduated_weights::{Narrowing, narrow};
use super::{APART, FEWEST, INLIER, MAJORITY, Rival, cheaper_sign, mixture, obeying};
use crate::math::random::CounterRng;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::starts::sample;
use rayon::prelude::*;

/// Points that do not obey among which a second motion is looked for.
const REJECTED: usize = 128;

/// Two motions whose costs, which fluctuate by about `2 sqrt(n)`, differ by less than this times `sqrt(n)`
/// are as likely.
const UNDECIDED: f64 = 1.0;

/// The motion among strays that so many of obey that least squares follow them, from all candidates; with
/// others that are about as likely, or that about as many points obey.
pub(crate) fn among_many_strays(
    observations: &Observations,
    on: &Observations,
    gate: &Gate<'_>,
    candidates: &[(Motion, f64)],
) -> Option<(Motion, Vec<Rival>)> {
    let own = Gate::new(on);
    let softened = candidates.par_iter().filter_map(|(motion, _)| {
        let (motion, cost) = mixture::softened(on, &own, *motion)?;
        Some((motion, cost, obeying(on, &motion)))
    });
    let mut found: Vec<(Motion, f64, Vec<u32>)> = softened.collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    let majority = MAJORITY * on.n as f64;
    // A thing may be the likeliest for what it is alone, but it is not the scene.
    let most = found.iter().map(|(_, _, obeys)| obeys.len()).max()?;
    let scene = found.iter().position(|(_, _, obeys)| obeys.len() as f64 > most as f64 - majority)?;
    let (best, cost, own) = found.remove(scene);
    let mut rivals: Vec<Rival> = Vec::new();
    for (motion, other, obeys) in &found {
        let alone = obeys.iter().filter(|k| own.binary_search(k).is_err()).count() as f64;
        let as_many = alone > majority && obeys.len() as f64 > own.len() as f64 - majority;
        let as_likely = *other < cost + UNDECIDED * (on.n as f64).sqrt();
        let same = |known: &Motion| known.angle_to(motion).to_degrees() < APART;
        if (as_many || as_likely) && !same(&best) && !rivals.iter().any(|rival| same(&rival.motion)) {
            rivals.push(Rival { motion: *motion, excess: (other - cost).max(0.0), others: true });
        }
    }
    let best = if on.n == observations.n { best } else { mixture::softened(observations, gate, best)?.0 };
    Some((best, rivals))
}

/// What most points obey that do not obey `best`, refined on all, where they are so many that they may be the
/// scene: the search among all may see one thing's motion only, from five sides, which part of the other's
/// points obey by chance.
pub(crate) fn second(observations: &Observations, best: Motion, rng: CounterRng) -> Option<(Motion, f64)> {
    let obeys = obeying(observations, &best);
    let rejected: Vec<u32> = (0..observations.n as u32).filter(|k| obeys.binary_search(k).is_err()).collect();
    if rejected.len() < FEWEST || (rejected.len() as f64) < MAJORITY * observations.n as f64 {
        return None;
    }
    // What may be the scene is much of the rejected: few of them show it.
    let chosen = sample(rejected.len(), REJECTED, rng.stream(8));
    let rest = observations.subset(&chosen.iter().map(|&place| rejected[place as usize]).collect::<Vec<u32>>());
    let found = Narrowing::new(&rest).motions(1, rng).pop()?;
    let found = cheaper_sign(&rest, found).0;
    Some(cheaper_sign(observations, narrow(observations, found, INLIER)))
}

/// Of the candidates, cheapest first, those that cost about as much as the first, or that fewer points obey
/// only because others do.
pub(crate) fn rivals(observations: &Observations, candidates: &[(Motion, f64)]) -> Vec<Rival> {
    let (n, best) = (observations.n as f64, candidates[0]);
    let obeys_best = obeying(observations, &best.0);
    let limit = best.1 + INLIER * INLIER * MAJORITY * n;
    let mut found: Vec<Rival> = Vec::new();
    for (motion, cost) in candidates.iter().skip(1).take_while(|(_, cost)| *cost < limit) {
        let same = |other: &Motion| other.angle_to(motion).to_degrees() < APART;
        if same(&best.0) || found.iter().any(|rival| same(&rival.motion)) {
            continue;
        }
        let obeys = obeying(observations, motion);
        let new = obeys.iter().filter(|k| obeys_best.binary_search(k).is_err()).count();
        found.push(Rival { motion: *motion, excess: cost - best.1, others: new as f64 > MAJORITY * n });
    }
    found
}
