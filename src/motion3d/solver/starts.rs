//! The search over directions: where on the half sphere the residuals are small.

use super::{refine::StoppingCriteria, refine::refine};
use crate::ablation::keeps;
use crate::math::random::CounterRng;
use crate::motion3d::kernels::best_rotation;
use crate::motion3d::model::{motion::Motion, observations::Observations};
use crate::parallel;
use nalgebra::Vector3;
use std::borrow::Cow;

/// Directions on the half sphere, about 8 degrees apart.
const DIRECTIONS: usize = 300;

/// Most points that the search looks at.
pub(crate) const SEARCHED: usize = 1000;

/// Starts that are refined, and the least angle between them, degrees.
pub(crate) const STARTS: usize = 5;
pub(crate) const APART: f64 = 12.0;

/// Starts among what a few steps on a few points lead to.
const BASINS: usize = 4;
const FEW: usize = 128;
const STEPS: StoppingCriteria = StoppingCriteria { steps: 4, tolerance: 1e-2, deviations: 0.0 };

/// Directions that are worked on together. Fixed, so that nothing depends on the number of threads.
const TOGETHER: usize = 20;

/// Evenly spread directions with `z > 0`: a Fibonacci lattice.
pub(crate) fn half_sphere() -> Vec<Vector3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5.0f64.sqrt());
    let direction = |i: usize| {
        let z = (i as f64 + 0.5) / DIRECTIONS as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        Vector3::new(radius * cos, radius * sin, z)
    };
    (0..DIRECTIONS).map(direction).collect()
}

/// Evaluates every direction of the half sphere, in groups that threads share.
pub(crate) fn evaluate<R: Send>(work: impl Fn(&Vector3<f64>) -> Option<R> + Sync) -> Vec<R> {
    let groups: Vec<Vec<R>> =
        parallel::map(half_sphere().chunks(TOGETHER), |group| group.iter().filter_map(&work).collect());
    groups.into_iter().flatten().collect()
}

/// The best of the motions, cheapest first, no two within `apart` degrees of each other (or of each other's
/// opposite).
pub(crate) fn apart(mut motions: Vec<(Motion, f64)>, apart: f64, count: usize) -> Vec<(Motion, f64)> {
    motions.sort_by(|a, b| a.1.total_cmp(&b.1));
    let limit = apart.to_radians().cos();
    let mut kept: Vec<(Motion, f64)> = Vec::with_capacity(count);
    for candidate in motions {
        if kept.iter().all(|(other, _)| other.u().dot(&candidate.0.u()).abs() < limit) {
            kept.push(candidate);
            if kept.len() == count {
                break;
            }
        }
    }
    kept
}

/// All points, or `most` random ones.
pub(crate) fn at_most(observations: &Observations, most: usize, rng: CounterRng) -> Cow<'_, Observations> {
    if observations.n > most {
        Cow::Owned(observations.subset(&rng.sample(observations.n, most)))
    } else {
        Cow::Borrowed(observations)
    }
}

/// The most promising motions by `J` on at most 1000 random points: the best of the half sphere and
/// the best of what few steps lead to.
pub(crate) fn starts(observations: &Observations, rng: CounterRng) -> Vec<Motion> {
    let searched = &*at_most(observations, SEARCHED, rng);
    let best = |u: &Vector3<f64>| best_rotation(searched, u).map(|(w, cost)| (Motion::of(u, &w), cost));
    let all = evaluate(best);
    let basins = apart(basins(searched, &all, rng.stream(7)), APART, BASINS);
    let mut starts: Vec<Motion> = Vec::new();
    for (motion, _) in apart(all, APART, STARTS).into_iter().chain(basins) {
        if !starts.contains(&motion) {
            starts.push(motion);
        }
    }
    starts
}

/// What directions all over the half sphere lead to in a few steps on few points: a minimum may be so narrow
/// that the nearest direction looks worse than hundreds of others.
fn basins(observations: &Observations, all: &[(Motion, f64)], rng: CounterRng) -> Vec<(Motion, f64)> {
    if !keeps("motion3d.basins") {
        return Vec::new();
    }
    let few = &*at_most(observations, FEW, rng);
    let descended = |&(motion, _): &(Motion, f64)| {
        let minimum = refine(few, motion, STEPS);
        (minimum.motion, minimum.equations.cost)
    };
    let motions = apart(all.to_vec(), APART, all.len());
    parallel::map_range(motions.len(), TOGETHER, |k| descended(&motions[k]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_cover_the_half_sphere() {
        let directions = half_sphere();
        assert!(directions.iter().all(|d| (d.norm() - 1.0).abs() < 1e-14 && d.z > 0.0));
        let rng = CounterRng::new(1);
        for k in 0..500 {
            let any = Vector3::new(rng.normal(3 * k), rng.normal(3 * k + 1), rng.normal(3 * k + 2)).normalize();
            let nearest = directions.iter().map(|d| d.dot(&any).abs()).fold(0.0, f64::max);
            assert!(nearest.acos().to_degrees() < 8.5, "{any}: {}", nearest.acos().to_degrees());
        }
    }
}
