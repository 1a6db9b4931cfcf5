//! Sums over points.
//!
//! With `T = G u`, `s = |T|`, `d = f - R w`: `s e = T_y d_x - T_x d_y` is the residual across the epipolar
//! line and `s m = T . d` the part along it (2). `lanes` has what a search repeats thousands of times (best
//! rotation, Gauss-Newton sums, depths), several points at once; `weighted` the sums with given depths, which
//! an estimate needs a few dozen times.

mod lanes;
mod weighted;

pub(crate) use lanes::{Depths, Equations, best_rotation, depths, equations};
pub(crate) use weighted::{Bilinear, front_equations, information, slope, slopes};

use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::Matrix5;
use nalgebra::{Matrix3, SMatrix};
use rayon::prelude::*;
use std::ops::{AddAssign, Range};

/// Adds up what `part` gives for each chunk, in the order of the chunks, whoever computes them.
fn over_chunks<const R: usize, const C: usize>(
    observations: &Observations,
    part: impl Fn(Range<usize>) -> SMatrix<f64, R, C> + Sync,
) -> SMatrix<f64, R, C> {
    let chunks: Vec<_> = observations.chunks().collect();
    if chunks.len() < 2 {
        return chunks.into_iter().map(&part).sum();
    }
    let parts: Vec<_> = chunks.into_par_iter().map(&part).collect();
    parts.into_iter().sum()
}

/// A symmetric matrix from its upper triangle, row by row.
fn symmetric(upper: &[f64]) -> Matrix5 {
    let mut matrix = Matrix5::zeros();
    let mut values = upper.iter();
    for i in 0..5 {
        for (j, value) in (i..5).zip(&mut values) {
            (matrix[(i, j)], matrix[(j, i)]) = (*value, *value);
        }
    }
    matrix
}

/// Adds a 3 x 3 matrix, times a factor, to the block of the rotation.
pub(crate) fn add_to_rotation(h: &mut Matrix5, information: &Matrix3<f64>, factor: f64) {
    h.fixed_view_mut::<3, 3>(2, 2).add_assign(information * factor);
}
