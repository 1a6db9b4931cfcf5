//! Which covariances are believed.
//!
//! A variance of nothing, as a rounding error or a wrong unit leaves it, would make one point decide the
//! motion by itself, and all others nothing beside it. Where a variance is below a millionth of that at the
//! end of the most precise quarter of all points, no measurement is so much better than the others: the point
//! counts as one of that quarter. A quarter of the points that are better together are believed.

use crate::math::quantile;
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen};

/// The share of a usual variance below which one is no measurement's.
const LEAST: f64 = 1e-6;

/// The share of the points that are more precise than the usual one.
const PRECISE: f64 = 0.25;

/// Usual variances, and which ones are too small beside them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Belief {
    usual: f64,
}

impl Belief {
    /// From the covariances of all points; those that are not finite do not count.
    pub fn new(covariances: impl Iterator<Item = Matrix2<f64>>) -> Self {
        let mut least: Vec<f64> = covariances.map(|given| smallest(&given)).filter(|v| v.is_finite()).collect();
        Self { usual: quantile(&mut least, PRECISE).unwrap_or(0.0) }
    }

    /// The covariance that a point counts with.
    pub fn of(self, given: Matrix2<f64>) -> Matrix2<f64> {
        if smallest(&given) < LEAST * self.usual { given + Matrix2::identity() * self.usual } else { given }
    }
}

/// The smaller eigenvalue.
fn smallest(given: &Matrix2<f64>) -> f64 {
    let (mean, half) = (0.5 * given.trace(), 0.5 * (given[(0, 0)] - given[(1, 1)]));
    // The determinant keeps digits that the difference would lose.
    given.determinant() / (mean + half.hypot(0.5 * (given[(0, 1)] + given[(1, 0)])))
}

/// The same for several numbers a point, each with a unit of its own: `size * size` values a matrix, row by
/// row.
pub(crate) fn believed(covariances: &[f64], size: usize) -> Vec<f64> {
    let diagonal = |i: usize| {
        let mut own: Vec<f64> = covariances.iter().skip(i * (size + 1)).step_by(size * size).copied().collect();
        own.retain(|value| value.is_finite());
        quantile(&mut own, PRECISE).unwrap_or(0.0)
    };
    let usual = DVector::from_fn(size, |i, _| diagonal(i));
    let one = |given: &[f64]| {
        let given = DMatrix::from_row_slice(size, size, given);
        let relative = DMatrix::from_fn(size, size, |i, j| given[(i, j)] / (usual[i] * usual[j]).sqrt());
        let finite = relative.iter().all(|value| value.is_finite());
        let small = finite && SymmetricEigen::new(relative).eigenvalues.min() < LEAST;
        if small { given + DMatrix::from_diagonal(&usual) } else { given }
    };
    covariances.chunks_exact(size * size).flat_map(|given| one(given).as_slice().to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variance_of_nothing_is_not_believed_and_a_quarter_of_small_ones_is() {
        let usual = Matrix2::new(0.04, 0.01, 0.01, 0.09);
        let nothing = Matrix2::identity() * 1e-20;
        let belief = Belief::new(std::iter::repeat_n(usual, 9).chain([nothing]));
        assert_eq!(belief.of(usual), usual);
        assert!((smallest(&belief.of(nothing)) / smallest(&usual) - 1.0).abs() < 1e-12);
        // An edge is known well across and not at all along.
        let edge = Matrix2::new(1e4, 0.0, 0.0, 0.01);
        assert_eq!(belief.of(edge), edge);
        let belief = Belief::new(std::iter::repeat_n(usual, 6).chain(std::iter::repeat_n(nothing, 3)));
        assert_eq!(belief.of(nothing), nothing);
    }

    #[test]
    fn numbers_of_a_patch_are_judged_in_their_own_units() {
        let diagonal = |scale: f64| DMatrix::from_diagonal(&DVector::from_vec(vec![scale, 1e-8 * scale]));
        let all: Vec<f64> =
            (0..8).flat_map(|k| diagonal(if k == 3 { 1e-20 } else { 1.0 }).as_slice().to_vec()).collect();
        let believed = believed(&all, 2);
        assert_eq!(believed[..12], all[..12]);
        assert!((believed[12] - 1.0).abs() < 1e-12 && (believed[15] / 1e-8 - 1.0).abs() < 1e-12);
    }
}
