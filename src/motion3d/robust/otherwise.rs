//! Whether residuals are those of noise, and what motion it may be instead.

use super::super::kernels::depths;
use super::super::motion::Motion;
use super::super::observations::Observations;
use super::alike::{ENOUGH, alike};
use super::narrowing::Narrowing;
use super::regions::pulling;
use super::{APART, Rival, STARTS, candidates, cheaper_sign, obeying};
use crate::math::random::CounterRng;
use std::collections::HashSet;

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// Parts of the picture without which the scene's motion is looked for.
const PARTS: usize = 4;

/// What may be the scene's motion instead of `found`, if the `points` that obey that move otherwise all the same: of the candidates, cheapest first, one that is another and leaves noise, else the first that is another. `None` where all agree, as where errors of flow go together and that is not told.
///
/// What a thing that moves by itself and the scene obey together may be more points than obey the scene's motion alone, but it leaves residuals in both. It may be what every search among all points ends at: then others are made without a part that pulls another way.
pub(super) fn instead(observations: &Observations, found: &Motion, points: &[u32], rng: CounterRng) -> Option<Rival> {
    let parts = otherwise(observations, found, points)?;
    let among = candidates(observations, rng)?;
    let least = among[0].1;
    let another = |(motion, _): &(Motion, f64)| motion.angle_to(found).to_degrees() > APART;
    let mut others: Vec<(Motion, f64)> = among.into_iter().filter(another).collect();
    if others.is_empty() {
        others = without(observations, points, &parts, rng);
        others.retain(another);
    }
    let noise = |(motion, _): &&(Motion, f64)| {
        let points = obeying(observations, motion);
        points.len() >= ENOUGH && otherwise(observations, motion, &points).is_none()
    };
    let &(motion, cost) = others.iter().find(noise).or(others.first())?;
    Some(Rival { motion, excess: (cost - least).max(0.0), others: true })
}

/// Motions of all `points` but one of the `parts`, with what each costs on all; the cheapest first.
fn without(observations: &Observations, points: &[u32], parts: &[Vec<u32>], rng: CounterRng) -> Vec<(Motion, f64)> {
    let search = |part: &Vec<u32>| {
        let left: HashSet<u32> = part.iter().copied().collect();
        let rest: Vec<u32> = points.iter().copied().filter(|k| !left.contains(k)).collect();
        if rest.len() < ENOUGH {
            return Vec::new();
        }
        let found = Narrowing::new(&observations.subset(&rest)).motions(STARTS, rng);
        found.into_iter().map(|motion| cheaper_sign(observations, motion)).collect()
    };
    let mut found: Vec<(Motion, f64)> = parts.iter().take(PARTS).flat_map(search).collect();
    found.sort_by(|a, b| a.1.total_cmp(&b.1));
    found
}

/// Whether `points`, which obey `motion`, move otherwise all the same: residuals of neighbours have the same sign, or those of a part pull the estimate another way than those elsewhere. The parts that do.
fn otherwise(observations: &Observations, motion: &Motion, points: &[u32]) -> Option<Vec<Vec<u32>>> {
    if points.len() < ENOUGH {
        return None;
    }
    let seen = depths(observations, motion).e;
    let squares: f64 = points.iter().map(|&k| seen[k as usize].powi(2)).sum();
    if squares <= LITTLE * points.len() as f64 {
        return None;
    }
    let parts = pulling(observations, motion, points);
    (!parts.is_empty() || alike(observations, motion, points)).then_some(parts)
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::scenes::{Scene, W, oblique};
    use super::*;

    #[test]
    fn few_points_and_residuals_far_less_than_noise_tell_nothing() {
        let all: Vec<u32> = (0..400).collect();
        let near = Motion::new(oblique().translation, W.map(|w| 1.5 * w));
        let points = Scene::oblique(400, 0.02, 1).observations();
        assert!(otherwise(&points, &near, &all).is_some());
        assert!(otherwise(&points, &near, &all[..ENOUGH - 1]).is_none());
        let settled = Scene::oblique(400, 0.0, 1).observations();
        assert!(otherwise(&settled, &oblique(), &all).is_none());
    }
}
