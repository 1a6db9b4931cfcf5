//! Whether residuals are those of noise: where points move otherwise, residuals have the same sign as their neighbours'.

use super::super::kernels::depths;
use super::super::motion::Motion;
use super::super::neighbours::Tree;
use super::super::observations::Observations;
use super::{APART, LEAST, Rival, obeying};

/// Neighbours whose residuals are looked at, points from which on there are enough of them, and deviations by which they go together.
const NEAREST: usize = 8;
const ENOUGH: usize = 50;
const TOGETHER: f64 = 3.0;

/// Residuals whose mean square, in units of noise, is less than this do not matter.
const LITTLE: f64 = 0.25;

/// The share of the points that obey the cheapest motion that another must have, to be the scene's.
const MOST: f64 = 0.5;

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

/// The cheapest of the candidates, which are sorted, whose residuals are those of noise; of those that about as many points obey as the first.
///
/// What a thing that moves by itself and the scene obey together may be more points than obey the scene's motion alone, but it leaves residuals in both.
pub(super) fn like_noise(observations: &Observations, candidates: &[(Motion, f64)]) -> Option<usize> {
    let of = |place: usize| obeying(observations, &candidates[place].0);
    let first = of(0);
    if !alike(observations, &candidates[0].0, &first) {
        return Some(0);
    }
    let least = (MOST * first.len() as f64).max(LEAST as f64);
    (1..candidates.len()).find(|&place| {
        let points = of(place);
        points.len() as f64 > least && !alike(observations, &candidates[place].0, &points)
    })
}

/// What may be the scene's motion instead of `found`, which leaves more than noise: the cheapest of the candidates, which are sorted, that is another one.
pub(super) fn next(candidates: &[(Motion, f64)], found: &Motion) -> Option<Rival> {
    let &(motion, cost) = candidates.iter().find(|(motion, _)| motion.angle_to(found).to_degrees() > APART)?;
    Some(Rival { motion, excess: cost - candidates[0].1, others: true })
}
