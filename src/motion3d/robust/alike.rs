//! Whether residuals are those of noise: where points move otherwise, residuals have the same sign as their neighbours'.

use super::super::kernels::depths;
use super::super::motion::Motion;
use super::super::neighbours::Tree;
use super::super::observations::Observations;
use super::{APART, Rival, obeying};

/// Neighbours whose residuals are looked at, points from which on there are enough of them, and deviations by which they go together.
const NEAREST: usize = 8;
const ENOUGH: usize = 50;
const TOGETHER: f64 = 3.0;

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// Whether the residuals of neighbours among `points` have the same sign more often than noise does.
pub(super) fn alike(observations: &Observations, motion: &Motion, points: &[u32]) -> bool {
    if points.len() < ENOUGH {
        return false;
    }
    let seen = depths(observations, motion).e;
    let sites: Vec<[f64; 3]> = points.iter().map(|&k| observations.site[k as usize]).collect();
    let tree = Tree::new(&sites);
    let places: Vec<u32> = (0..points.len() as u32).collect();
    let lists = tree.nearest(&places, NEAREST);
    let residual = |place: usize| seen[points[tree.order()[place] as usize] as usize];
    let (mut products, mut squares) = (0.0, 0.0);
    for place in 0..points.len() {
        let own = residual(place);
        squares += own * own;
        products += lists.of(place).iter().map(|&near| own * residual(near as usize)).sum::<f64>();
    }
    let variance = squares / points.len() as f64;
    // Each of these pairs may come twice.
    let pairs = (NEAREST * points.len()) as f64;
    variance > LITTLE && products > TOGETHER * variance * (2.0 * pairs).sqrt()
}

/// What may be the scene's motion instead of `found`, which leaves more than noise: of the candidates, cheapest first, one that is another and leaves noise, else the first that is another. `None` where all agree, as where errors of flow go together and that is not told.
///
/// What a thing that moves by itself and the scene obey together may be more points than obey the scene's motion alone, but it leaves residuals in both.
pub(super) fn next(observations: &Observations, candidates: &[(Motion, f64)], found: &Motion) -> Option<Rival> {
    let other = |(motion, _): &&(Motion, f64)| motion.angle_to(found).to_degrees() > APART;
    let noise = |(motion, _): &&(Motion, f64)| {
        let points = obeying(observations, motion);
        points.len() >= ENOUGH && !alike(observations, motion, &points)
    };
    let others = || candidates.iter().filter(other);
    let &(motion, cost) = others().find(noise).or_else(|| others().next())?;
    Some(Rival { motion, excess: (cost - candidates[0].1).max(0.0), others: true })
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::scenes::{Scene, W, oblique};
    use super::*;

    #[test]
    fn residuals_of_another_motion_are_alike_and_those_of_noise_are_not() {
        let mut chance = 0;
        for seed in 0..100 {
            let points = Scene::oblique(400, 0.02, seed).observations();
            let all: Vec<u32> = (0..400).collect();
            chance += u32::from(alike(&points, &oblique(), &all));
            // Off by half of the rotation, about a deviation of a point.
            let near = Motion::new(oblique().translation, W.map(|w| 1.5 * w));
            assert!(alike(&points, &near, &all), "{seed}");
            // Off by far less than noise.
            let settled = Scene::oblique(400, 0.0, seed).observations();
            assert!(!alike(&settled, &oblique(), &all), "{seed}");
            // Of few nobody knows.
            assert!(!alike(&points, &near, &all[..ENOUGH - 1]));
        }
        assert!(chance <= 3, "{chance}");
    }
}
