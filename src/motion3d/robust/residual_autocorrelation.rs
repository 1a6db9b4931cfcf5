//! Residual autocorrelation: points of another motion have residuals of the same sign as their neighbours'.

use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::neighbours::Tree;

/// Minimum number of points for the test.
pub(crate) const MIN_POINTS: usize = 50;

/// Most points of a cell whose residuals are compared, and deviations by which they go together.
const CELL: usize = 12;
const TOGETHER: f64 = 3.0;

/// Whether the residuals of neighbours among `points` have the same sign more often than noise does.
pub(crate) fn is_autocorrelated(observations: &Observations, motion: &Motion, points: &[u32]) -> bool {
    if points.len() < MIN_POINTS {
        return false;
    }
    let seen = depths(observations, motion).e;
    let sites: Vec<[f64; 3]> = points.iter().map(|&k| observations.site[k as usize]).collect();
    let tree = Tree::new(&sites);
    let (mut products, mut squares, mut pairs) = (0.0, 0.0, 0.0);
    for cell in tree.cells(CELL) {
        let count = cell.len() as f64;
        let residuals = || tree.order()[cell.clone()].iter().map(|&k| seen[points[k as usize] as usize]);
        let (sum, square) = (residuals().sum::<f64>(), residuals().map(|e| e * e).sum::<f64>());
        products += sum * sum - square;
        squares += square;
        pairs += count * (count - 1.0);
    }
    // Each pair comes twice.
    products > TOGETHER * (squares / points.len() as f64) * (2.0 * pairs).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::{Scene, W, oblique};

    #[test]
    fn residuals_of_another_motion_are_alike_and_those_of_noise_are_not() {
        let mut chance = 0;
        for seed in 0..100 {
            let points = Scene::oblique(400, 0.02, seed).observations();
            let all: Vec<u32> = (0..400).collect();
            chance += u32::from(is_autocorrelated(&points, &oblique(), &all));
            // Off by half of the rotation, about a deviation of a point.
            let near = Motion::new(oblique().translation, W.map(|w| 1.5 * w));
            assert!(is_autocorrelated(&points, &near, &all), "{seed}");
        }
        assert!(chance <= 3, "{chance}");
    }
}
