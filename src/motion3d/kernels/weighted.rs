//! The estimating equation with given depths in its weights.

use super::{
    Everywhere, Planes, View, add_products, add_to_rotation, along_axes, at, both_axes, over_chunks, see, slope_row,
    symmetric, total, turn,
};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{KnownRotation, Observations};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::Matrix2x3;
use std::ops::AddAssign;

/// `sum W^t W` for given depths in the weights, as the upper triangle.
struct WeightSums<'a> {
    view: View<'a>,
    nu: &'a [f64],
    /// `kappa^2`, the largest variance of the direction: weights are damped within that of the epipole.
    spread: f64,
}

/// `1 / (s^2 + g kappa^2)` with `g = |G|^2 / 2`, and nothing at the epipole: what damped weights have for `1
/// / s^2`.
#[inline(always)]
fn damped<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, i: usize, s2: V, floor: V, half_spread: V) -> V {
    let mut size = V::zero();
    for p in 0..6 {
        let g: V = at(planes, p, i);
        size = g.mul_add(g, size);
    }
    V::select(floor.lt(s2), V::constant(1.0) / size.mul_add(half_spread, s2), V::zero())
}

impl Kernel<f64> for WeightSums<'_> {
    type Output = [f64; 15];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; 15] {
        let View { planes, motion, tangent, floor } = self.view;
        let (motion, axes) = (Everywhere::<V>::new(motion), both_axes(tangent));
        let (floor, half_spread) = (V::splat(floor), V::splat(0.5 * self.spread));
        let mut sums = [V::zero(); 15];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let seen = see(&planes, i, &motion, floor);
            let d = slope_row(V::load(&self.nu[i..]), along_axes(&planes, i, &seen, &axes), &seen);
            // Each of both weights is damped: `s^2 / (s^2 + g kappa^2)`.
            let inverse = damped(&planes, i, seen.s2, floor, half_spread);
            add_products(&mut sums, &d, inverse * inverse * seen.s2);
        }
        sums.map(total)
    }
}

/// `sum D(nu)^t D(nu)` with the depths `nu` (as many as the planes have values) in the weights, which are
/// damped within `kappa^2 = spread` of the epipole.
pub(crate) fn information(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    nu: &[f64],
    spread: f64,
) -> Matrix5 {
    let sums = over_chunks(observations, |range| {
        let view = View::new(observations, &range, motion, tangent);
        dispatch(observations.level, WeightSums { view, nu: &nu[range], spread })
    });
    let mut h = symmetric(&sums);
    if let Some(known) = &observations.prior {
        add_to_rotation(&mut h, &known.information, 1.0);
    }
    h
}

/// `sum W^t D` of weights with given depths and the rows' true depths, of which those of the points' own flow
/// are an estimate.
struct SlopeSums<'a> {
    weights: WeightSums<'a>,
    /// How much of each point's own depth is in that of its weight.
    share: &'a [f64],
}

const SLOPES: usize = 21;

impl Kernel<f64> for SlopeSums<'_> {
    type Output = [f64; SLOPES];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; SLOPES] {
        let WeightSums { view: View { planes, motion, tangent, floor }, nu, spread } = self.weights;
        let (motion, axes) = (Everywhere::<V>::new(motion), both_axes(tangent));
        let (floor, half_spread) = (V::splat(floor), V::splat(0.5 * spread));
        let mut sums = [V::zero(); SLOPES];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let seen = see(&planes, i, &motion, floor);
            let [a, b] = along_axes(&planes, i, &seen, &axes);
            let nu = V::load(&nu[i..]);
            // The noise of the own depth is in both factors, by its share in the weight.
            let own = seen.along * seen.inverse;
            let both = nu.mul_add(own, (V::zero() - V::load(&self.share[i..])) * seen.inverse);
            let weight = damped(&planes, i, seen.s2, floor, half_spread);
            let psi = both * weight;
            sums[0] = (psi * a).mul_add(a, sums[0]);
            sums[1] = (psi * a).mul_add(b, sums[1]);
            sums[2] = (psi * b).mul_add(b, sums[2]);
            let (own_a, own_b) = (own * a * weight, own * b * weight);
            let (weight_a, weight_b) = (nu * a * weight, nu * b * weight);
            let mut k = 15;
            for row in 0..3 {
                let q = seen.q[row];
                sums[3 + row] = weight_a.mul_add(q, sums[3 + row]);
                sums[6 + row] = weight_b.mul_add(q, sums[6 + row]);
                sums[9 + row] = own_a.mul_add(q, sums[9 + row]);
                sums[12 + row] = own_b.mul_add(q, sums[12 + row]);
                let weighted = q * weight;
                for column in row..3 {
                    sums[k] = weighted.mul_add(seen.q[column], sums[k]);
                    k += 1;
                }
            }
        }
        sums.map(total)
    }
}

/// `sum D(nu)^t D(true)`, the slope of the estimating equation with the depths `nu` in its weights, without
/// bias: true depths are taken from the points' own flow, of which `share` is in `nu`. Weights are damped
/// within `kappa^2 = spread` of the epipole.
pub(crate) fn slope(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    nu: &[f64],
    share: &[f64],
    spread: f64,
) -> Matrix5 {
    let sums = over_chunks(observations, |range| {
        let view = View::new(observations, &range, motion, tangent);
        let weights = WeightSums { view, nu: &nu[range.clone()], spread };
        dispatch(observations.level, SlopeSums { weights, share: &share[range] })
    });
    let mut slope = Matrix5::zeros();
    (slope[(0, 0)], slope[(0, 1)], slope[(1, 0)], slope[(1, 1)]) = (sums[0], sums[1], sums[1], sums[2]);
    let mut k = 15;
    for i in 0..3 {
        (slope[(0, 2 + i)], slope[(1, 2 + i)]) = (sums[3 + i], sums[6 + i]);
        (slope[(2 + i, 0)], slope[(2 + i, 1)]) = (sums[9 + i], sums[12 + i]);
        for j in i..3 {
            (slope[(2 + i, 2 + j)], slope[(2 + j, 2 + i)]) = (sums[k], sums[k]);
            k += 1;
        }
    }
    if let Some(known) = &observations.prior {
        add_to_rotation(&mut slope, &known.information, 1.0);
    }
    slope
}

/// `sum V^t h` of the bilinear residual `s e = sum_i u_i (h_i0 + sum_j h_ij w_j)`.
struct BilinearSums<'a>(WeightSums<'a>);

const BILINEAR_SUMS: usize = 60;

impl Kernel<f64> for BilinearSums<'_> {
    type Output = [f64; BILINEAR_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; BILINEAR_SUMS] {
        let WeightSums { view: View { planes, motion, tangent, floor }, nu, spread } = self.0;
        let (motion, axes) = (Everywhere::<V>::new(motion), both_axes(tangent));
        let (floor, half_spread) = (V::splat(floor), V::splat(0.5 * spread));
        let mut sums = [[V::zero(); 12]; 5];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let seen = see(&planes, i, &motion, floor);
            let d = slope_row(V::load(&nu[i..]), along_axes(&planes, i, &seen, &axes), &seen);
            // V = W s / (s^2 + g kappa^2), and nothing at the epipole.
            let scale = damped(&planes, i, seen.s2, floor, half_spread);
            for c in 0..3 {
                let column: [V; 2] = [at(&planes, c, i), at(&planes, 3 + c, i)];
                let mut h = [turn(&column, at(&planes, 12, i), at(&planes, 13, i)) * scale; 4];
                for j in 0..3 {
                    h[1 + j] = -turn(&column, at(&planes, 6 + j, i), at(&planes, 9 + j, i)) * scale;
                }
                for row in 0..5 {
                    for j in 0..4 {
                        sums[row][4 * c + j] = h[j].mul_add(d[row], sums[row][4 * c + j]);
                    }
                }
            }
        }
        let mut out = [0.0; BILINEAR_SUMS];
        for (to, lanes) in out.iter_mut().zip(sums.into_iter().flatten()) {
            *to = total(lanes);
        }
        out
    }
}

/// The frozen estimating equation `sum V^t (s e)(u, w)`: five values, each bilinear in `u` and `(1, w)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bilinear {
    sums: [f64; BILINEAR_SUMS],
    prior: Option<KnownRotation>,
}

impl Bilinear {
    /// With `D(nu)` at a motion as weights, damped within `kappa^2 = spread` of the epipole.
    pub fn new(
        observations: &Observations,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        nu: &[f64],
        spread: f64,
    ) -> Self {
        let sums = over_chunks(observations, |range| {
            let view = View::new(observations, &range, motion, tangent);
            dispatch(observations.level, BilinearSums(WeightSums { view, nu: &nu[range], spread }))
        });
        Self { sums, prior: observations.prior }
    }

    /// Its value at a motion, and its slopes along `tangent` and `w`.
    pub fn at(&self, motion: &Motion, tangent: &Matrix2x3<f64>) -> (Vector5, Matrix5) {
        let (u, w) = (motion.translation, motion.rotation);
        let (mut value, mut slope) = (Vector5::zeros(), Matrix5::zeros());
        for row in 0..5 {
            let h = |i: usize, j: usize| self.sums[12 * row + 4 * i + j];
            for i in 0..3 {
                let along = h(i, 0) + (0..3).map(|j| h(i, 1 + j) * w[j]).sum::<f64>();
                value[row] += u[i] * along;
                slope[(row, 0)] += tangent[(0, i)] * along;
                slope[(row, 1)] += tangent[(1, i)] * along;
                for j in 0..3 {
                    slope[(row, 2 + j)] += u[i] * h(i, 1 + j);
                }
            }
        }
        if let Some(known) = &self.prior {
            value.fixed_rows_mut::<3>(2).add_assign(&known.pull(&motion.w()).0);
            add_to_rotation(&mut slope, &known.information, -1.0);
        }
        (value, slope)
    }
}
