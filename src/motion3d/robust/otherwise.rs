//! Whether residuals are those of noise, and what motion it may be instead.

use super::super::kernels::depths;
use super::super::motion::Motion;
use super::super::observations::Observations;
use super::alike::{ENOUGH, alike};
use super::regions::pull_apart;
use super::{APART, Rival, obeying};

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// What may be the scene's motion instead of `found`, if the `points` that obey that move otherwise all the same: of the candidates, cheapest first, one that is another and leaves noise, else the first that is another. `None` where all agree, as where errors of flow go together and that is not told.
///
/// What a thing that moves by itself and the scene obey together may be more points than obey the scene's motion alone, but it leaves residuals in both.
pub(super) fn instead(
    observations: &Observations,
    candidates: &[(Motion, f64)],
    found: &Motion,
    points: &[u32],
) -> Option<Rival> {
    if !otherwise(observations, found, points) {
        return None;
    }
    let other = |(motion, _): &&(Motion, f64)| motion.angle_to(found).to_degrees() > APART;
    let noise = |(motion, _): &&(Motion, f64)| {
        let points = obeying(observations, motion);
        points.len() >= ENOUGH && !otherwise(observations, motion, &points)
    };
    let others = || candidates.iter().filter(other);
    let &(motion, cost) = others().find(noise).or_else(|| others().next())?;
    Some(Rival { motion, excess: (cost - candidates[0].1).max(0.0), others: true })
}

/// Whether `points`, which obey `motion`, move otherwise all the same: residuals of neighbours have the same sign, or those of a part pull the estimate another way than those elsewhere.
fn otherwise(observations: &Observations, motion: &Motion, points: &[u32]) -> bool {
    if points.len() < ENOUGH {
        return false;
    }
    let seen = depths(observations, motion).e;
    let squares: f64 = points.iter().map(|&k| seen[k as usize].powi(2)).sum();
    let noise = squares > LITTLE * points.len() as f64;
    noise && (alike(observations, motion, points) || pull_apart(observations, motion, points))
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
        assert!(otherwise(&points, &near, &all));
        assert!(!otherwise(&points, &near, &all[..ENOUGH - 1]));
        let settled = Scene::oblique(400, 0.0, 1).observations();
        assert!(!otherwise(&settled, &oblique(), &all));
    }
}
