//! Score test for parts of the picture that have another motion than the rest. A moving object and the
//! scene may fit a third motion together with residuals as small as noise, but those of each pull the
//! estimate another way.

use crate::math::chi2_deviation;
use crate::motion3d::kernels::{depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::solver::neighbours::Tree;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use nalgebra::SymmetricEigen;
use std::ops::Range;

/// The smallest parts, as a share of the points, and the fewest points of one.
const PART: usize = 16;
const MIN_PART: usize = 8;

/// Standard deviations by which one of about thirty parts differs in one of a hundred pictures by chance.
const FAR: f64 = 3.4;

/// Information about a combination of the unknowns that a part has of its own, as a share of all; less is
/// rounding.
const ROUNDING: f64 = 1e-6;

/// Parts of `points`, by their places among these, whose residuals pull the estimate on all of them farther
/// than noise does, the farthest first.
///
/// The sums `g = sum D^t e` of a part are zero but for noise of the covariance `H_r - H_r H^-1 H_r`, with
/// `H_r = sum D^t D` over the part and `H` over all (the score test of C. R. Rao 1948). Parts are halves of
/// the points, halves of these, and so on.
pub(crate) fn deviating_parts(observations: &Observations, motion: &Motion, points: &[u32]) -> Vec<Vec<u32>> {
    tested_parts(observations, motion, points).unwrap_or_default()
}

fn tested_parts(observations: &Observations, motion: &Motion, points: &[u32]) -> Option<Vec<Vec<u32>>> {
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
    Some(far.into_iter().map(|(_, places)| tree.order()[places].to_vec()).collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::{Scene, W, oblique};

    #[test]
    fn a_part_with_another_rotation_pulls_apart_and_noise_does_not() {
        let all: Vec<u32> = (0..400).collect();
        let (mut chance, mut found) = (0, 0);
        for seed in 0..200 {
            let mut scene = Scene::oblique(400, 0.02, seed);
            chance += u32::from(!deviating_parts(&scene.observations(), &oblique(), &all).is_empty());
            // Two standard deviations of a point, most of which passes for depth.
            let turned = Motion::new(oblique().translation, W.map(|w| 2.0 * w));
            for k in (0..400).filter(|&k| scene.points[k][0] > 0.3) {
                let (nu, at) = (scene.inverse_depth[k], scene.points[k]);
                let (before, after) = (oblique().plane_flow(at, nu), turned.plane_flow(at, nu));
                scene.flow[k] = [0, 1].map(|j| scene.flow[k][j] + after[j] - before[j]);
            }
            found += u32::from(!deviating_parts(&scene.observations(), &oblique(), &all).is_empty());
        }
        assert!(chance <= 6 && found >= 150, "{chance} {found}");
    }

    #[test]
    fn parts_that_determine_nothing_pull_nowhere() {
        // Halves of eight points, and none.
        let few = Scene::oblique(16, 0.02, 1).observations();
        assert!(deviating_parts(&few, &oblique(), &(0..16).collect::<Vec<u32>>()).is_empty());
        assert!(deviating_parts(&few, &oblique(), &(0..5).collect::<Vec<u32>>()).is_empty());
    }
}
