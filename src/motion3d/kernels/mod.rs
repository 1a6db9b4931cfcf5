//! The loops over points, written once for every lane width.
//!
//! With `T = G u`, `s = |T|`, `d = f - R w`: `s e = T_y d_x - T_x d_y` is the residual across the epipolar
//! line and `s m = T . d` the part along it (2). `points` has single passes (depths, best rotation, truncated
//! cost), `equations` the sums of a Gauss-Newton step, `weighted` the equation with given depths.

use crate::motion3d::model::observations::PLANES;
use crate::motion3d::model::rows::Matrix5;
mod equations;
mod points;
mod weighted;

pub(crate) use equations::{Equations, FrontEquations, equations, front_equations};
pub(crate) use points::{Depths, best_rotation, consensus, depths, slopes};
pub(crate) use weighted::{Bilinear, information, slope};

use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::simd::Lanes;
use nalgebra::{Matrix2x3, Matrix3};
use rayon::prelude::*;
use std::ops::{AddAssign, Range};

/// A motion in every lane.
struct Everywhere<V> {
    u: [V; 3],
    w: [V; 3],
}

/// A point in every lane, seen with one motion.
struct Seen<V> {
    /// `T = G u`.
    t: [V; 2],
    /// `s^2` and its inverse, which is 0 at the epipole.
    s2: V,
    inverse: V,
    /// `s p^t R`.
    q: [V; 3],
    /// `s e`.
    across: V,
    /// `s m`.
    along: V,
}

pub(crate) type Planes<'a> = [&'a [f64]; PLANES];

/// Points of one chunk with the motion that their sums are taken at, in the axes of its direction.
#[derive(Clone, Copy)]
struct View<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
}

impl<'a> View<'a> {
    fn new(
        observations: &'a Observations,
        range: &Range<usize>,
        motion: &'a Motion,
        tangent: &'a Matrix2x3<f64>,
    ) -> Self {
        Self { planes: observations.slices(range), motion, tangent, floor: observations.floor }
    }
}

impl<V: Lanes<Scalar = f64>> Everywhere<V> {
    #[inline(always)]
    fn new(motion: &Motion) -> Self {
        Self { u: splat(motion.translation), w: splat(motion.rotation) }
    }
}

// Functions and loops instead of closures throughout: a closure would be compiled without the lanes'
// instructions.

#[inline(always)]
fn splat<V: Lanes<Scalar = f64>>([x, y, z]: [f64; 3]) -> [V; 3] {
    [V::splat(x), V::splat(y), V::splat(z)]
}

/// The two axes along which the direction varies.
#[inline(always)]
fn both_axes<V: Lanes<Scalar = f64>>(tangent: &Matrix2x3<f64>) -> [[V; 3]; 2] {
    [
        splat([tangent[(0, 0)], tangent[(0, 1)], tangent[(0, 2)]]),
        splat([tangent[(1, 0)], tangent[(1, 1)], tangent[(1, 2)]]),
    ]
}

#[inline(always)]
fn at<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, p: usize, i: usize) -> V {
    V::load(&planes[p][i..])
}

#[inline(always)]
fn dot<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, first: usize, i: usize, with: &[V; 3]) -> V {
    let tail = at::<V>(planes, first + 1, i).mul_add(with[1], at::<V>(planes, first, i) * with[0]);
    at::<V>(planes, first + 2, i).mul_add(with[2], tail)
}

/// `T_y a_x - T_x a_y`.
#[inline(always)]
fn turn<V: Lanes<Scalar = f64>>(t: &[V; 2], x: V, y: V) -> V {
    t[0].neg_mul_add(y, t[1] * x)
}

#[inline(always)]
fn see<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, i: usize, motion: &Everywhere<V>, floor: V) -> Seen<V> {
    let t = [dot(planes, 0, i, &motion.u), dot(planes, 3, i, &motion.u)];
    let s2 = t[0].mul_add(t[0], t[1] * t[1]);
    let inverse = V::select(floor.lt(s2), V::constant(1.0) / s2, V::zero());
    let rx: [V; 3] = [at(planes, 6, i), at(planes, 7, i), at(planes, 8, i)];
    let ry: [V; 3] = [at(planes, 9, i), at(planes, 10, i), at(planes, 11, i)];
    let q = [turn(&t, rx[0], ry[0]), turn(&t, rx[1], ry[1]), turn(&t, rx[2], ry[2])];
    let w = &motion.w;
    let dx = rx[2].neg_mul_add(w[2], rx[1].neg_mul_add(w[1], rx[0].neg_mul_add(w[0], at(planes, 12, i))));
    let dy = ry[2].neg_mul_add(w[2], ry[1].neg_mul_add(w[1], ry[0].neg_mul_add(w[0], at(planes, 13, i))));
    Seen { s2, inverse, q, across: turn(&t, dx, dy), along: t[0].mul_add(dx, t[1] * dy), t }
}

/// `s D(nu)` for the depth 1 in both axes of the direction: `s p^t G` along them.
#[inline(always)]
fn along_axes<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, i: usize, seen: &Seen<V>, axes: &[[V; 3]; 2]) -> [V; 2] {
    [
        turn(&seen.t, dot(planes, 0, i, &axes[0]), dot(planes, 3, i, &axes[0])),
        turn(&seen.t, dot(planes, 0, i, &axes[1]), dot(planes, 3, i, &axes[1])),
    ]
}

/// `s D(nu)`.
#[inline(always)]
fn slope_row<V: Lanes<Scalar = f64>>(nu: V, [a, b]: [V; 2], seen: &Seen<V>) -> [V; 5] {
    [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]]
}

/// Adds the upper triangle of `weight d^t d`, row by row.
#[inline(always)]
fn add_products<V: Lanes<Scalar = f64>, const N: usize>(sums: &mut [V], d: &[V; N], weight: V) {
    let mut k = 0;
    for row in 0..N {
        let weighted = d[row] * weight;
        for column in row..N {
            sums[k] = weighted.mul_add(d[column], sums[k]);
            k += 1;
        }
    }
}

/// The lanes' sum, in the order of the lanes.
#[inline(always)]
fn total<V: Lanes<Scalar = f64>>(lanes: V) -> f64 {
    let mut values = [0.0; 16];
    lanes.store(&mut values[..V::LANES]);
    values[..V::LANES].iter().sum()
}

/// Adds up what `part` gives for each chunk, in the order of the chunks, whoever computes them.
fn over_chunks<const N: usize>(
    observations: &Observations,
    part: impl Fn(Range<usize>) -> [f64; N] + Sync,
) -> [f64; N] {
    let chunks: Vec<_> = observations.chunks().collect();
    let parts: Vec<[f64; N]> = if chunks.len() < 2 {
        chunks.into_iter().map(&part).collect()
    } else {
        chunks.into_par_iter().map(&part).collect()
    };
    let mut sums = [0.0; N];
    for part in &parts {
        sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
    sums
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
