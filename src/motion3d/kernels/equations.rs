//! Sums of one Gauss-Newton step.

use super::{Everywhere, Planes, UPPER, add_to_rotation, at, both_axes, dot, over_chunks, see, total, turn};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::Matrix2x3;
use std::ops::AddAssign;

/// The sums of one Gauss-Newton step at a motion.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Equations {
    /// `H = sum D(nu^)^t D(nu^)`.
    pub h: Matrix5,
    /// `sum D(nu^)^t e`.
    pub gradient: Vector5,
    /// `P = sum P_k`, the noise of the depths in `H`.
    pub p: Matrix5,
    /// `J = sum e^2`, or Tukey's loss where there is a cut.
    pub cost: f64,
    /// `sum (nu^ / sd)^2` over the points behind the camera.
    pub behind: f64,
    /// How many these are.
    pub reversed: f64,
}

impl Equations {
    /// What depths behind the camera speak against a motion: the noise of depths near 0 leaves
    /// `sum (nu^ / sd)^2` of no more than their number.
    pub fn cheirality_cost(&self) -> f64 {
        (self.behind - self.reversed).max(0.0)
    }
}

struct EquationSums<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
    inverse_cut: f64,
}

const EQUATION_SUMS: usize = 27;

impl Kernel<f64> for EquationSums<'_> {
    type Output = [f64; EQUATION_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; EQUATION_SUMS] {
        let motion = Everywhere::<V>::new(self.motion);
        let [first, second] = both_axes::<V>(self.tangent);
        let (floor, cut, one) = (V::splat(self.floor), V::splat(self.inverse_cut), V::constant(1.0));
        let mut sums = [V::zero(); EQUATION_SUMS];
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let e2 = seen.across * seen.across * seen.inverse;
            // Tukey's weight (1 - (e / cut)^2)^2, 1 without a cut.
            let rest = one - (e2 * cut).min(one);
            let weight = rest * rest * seen.inverse;
            let nu = seen.along * seen.inverse;
            let a = turn(&seen.t, dot(&self.planes, 0, i, &first), dot(&self.planes, 3, i, &first));
            let b = turn(&seen.t, dot(&self.planes, 0, i, &second), dot(&self.planes, 3, i, &second));
            let d = [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]];
            let mut k = 0;
            for row in 0..5 {
                let weighted = d[row] * weight;
                for column in row..5 {
                    sums[k] = weighted.mul_add(d[column], sums[k]);
                    k += 1;
                }
                sums[15 + row] = weighted.mul_add(seen.across, sums[15 + row]);
            }
            let twice = weight * seen.inverse;
            sums[20] = (a * twice).mul_add(a, sums[20]);
            sums[21] = (a * twice).mul_add(b, sums[21]);
            sums[22] = (b * twice).mul_add(b, sums[22]);
            sums[23] = sums[23] + e2;
            sums[24] = sums[24] + (one - rest * rest * rest);
            let behind = seen.along.min(V::zero());
            sums[25] = (behind * behind).mul_add(seen.inverse, sums[25]);
            sums[26] = sums[26] + V::select(seen.along.lt(V::zero()), one, V::zero());
        }
        sums.map(total)
    }
}

/// The equations at a motion, `theta = (psi, w)` with `psi` along the rows of `tangent`; with `cut`, Tukey's
/// weights that end there, in units of noise.
pub(crate) fn equations(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    cut: Option<f64>,
) -> Equations {
    let inverse_cut = cut.map_or(0.0, |cut| 1.0 / (cut * cut));
    let sums = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, EquationSums { planes, motion, tangent, floor: observations.floor, inverse_cut })
    });
    let (mut h, mut p) = (Matrix5::zeros(), Matrix5::zeros());
    for (value, &(i, j)) in sums.iter().zip(&UPPER) {
        h[(i, j)] = *value;
        h[(j, i)] = *value;
    }
    let mut gradient = Vector5::from_column_slice(&sums[15..20]);
    let mut cost = cut.map_or(sums[23], |cut| cut * cut / 3.0 * sums[24]);
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&motion.w());
        add_to_rotation(&mut h, &known.information, 1.0);
        gradient.fixed_rows_mut::<3>(2).add_assign(&pull);
        cost += square;
    }
    p[(0, 0)] = sums[20];
    p[(0, 1)] = sums[21];
    p[(1, 0)] = sums[21];
    p[(1, 1)] = sums[22];
    Equations { h, gradient, p, cost, behind: sums[25], reversed: sums[26] }
}

/// The sums of one Gauss-Newton step, with depths that must not be negative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrontEquations {
    pub h: Matrix5,
    pub gradient: Vector5,
    /// `sum min over nu >= 0 of |f - nu G u - R w|^2`.
    pub cost: f64,
}

pub(crate) struct FrontSums<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
}

pub(crate) const SUMS: usize = 21;

impl Kernel<f64> for FrontSums<'_> {
    type Output = [f64; SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; SUMS] {
        let motion = Everywhere::<V>::new(self.motion);
        let [first, second] = both_axes::<V>(self.tangent);
        let (floor, one, none) = (V::splat(self.floor), V::constant(1.0), V::zero());
        let mut sums = [V::zero(); SUMS];
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let before = V::select(seen.along.lt(none), none, one);
            let weight = before * seen.inverse;
            let nu = seen.along * seen.inverse;
            let a = turn(&seen.t, dot(&self.planes, 0, i, &first), dot(&self.planes, 3, i, &first));
            let b = turn(&seen.t, dot(&self.planes, 0, i, &second), dot(&self.planes, 3, i, &second));
            let d = [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]];
            let mut k = 0;
            for row in 0..5 {
                let weighted = d[row] * weight;
                for column in row..5 {
                    sums[k] = weighted.mul_add(d[column], sums[k]);
                    k += 1;
                }
                sums[15 + row] = weighted.mul_add(seen.across, sums[15 + row]);
            }
            // A point that would lie behind has depth 0: all that is left of it is what the rotation does not
            // explain.
            let behind = (one - before) * seen.inverse;
            let rest_x = seen.along.mul_add(seen.t[0], seen.across * seen.t[1]) * behind;
            let rest_y = seen.across.neg_mul_add(seen.t[0], seen.along * seen.t[1]) * behind;
            let counts = behind * seen.s2;
            let mut k = 9;
            for row in 0..3 {
                let (rx, ry) = (at::<V>(&self.planes, 6 + row, i), at::<V>(&self.planes, 9 + row, i));
                for column in row..3 {
                    let product = rx * at::<V>(&self.planes, 6 + column, i);
                    let product = ry.mul_add(at::<V>(&self.planes, 9 + column, i), product);
                    sums[k] = counts.mul_add(product, sums[k]);
                    k += 1;
                }
                sums[17 + row] = sums[17 + row] + rx.mul_add(rest_x, ry * rest_y);
            }
            let back = seen.along.min(none);
            sums[20] = sums[20] + seen.across.mul_add(seen.across, back * back) * seen.inverse;
        }
        sums.map(total)
    }
}

/// The equations at a motion, `theta = (psi, w)` with `psi` along the rows of `tangent`.
pub(crate) fn front_equations(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
) -> FrontEquations {
    let sums = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, FrontSums { planes, motion, tangent, floor: observations.floor })
    });
    let mut h = Matrix5::zeros();
    for (value, &(i, j)) in sums.iter().zip(&UPPER) {
        h[(i, j)] = *value;
        h[(j, i)] = *value;
    }
    let mut gradient = Vector5::from_column_slice(&sums[15..20]);
    let mut cost = sums[20];
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&motion.w());
        add_to_rotation(&mut h, &known.information, 1.0);
        gradient.fixed_rows_mut::<3>(2).add_assign(&pull);
        cost += square;
    }
    FrontEquations { h, gradient, cost }
}
