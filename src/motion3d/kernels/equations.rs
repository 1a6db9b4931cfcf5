//! Sums of one Gauss-Newton step.

use super::{
    Everywhere, View, add_products, add_to_rotation, along_axes, at, both_axes, over_chunks, see, slope_row, symmetric,
    total,
};
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
    /// What depths behind the camera speak against a motion: the noise of depths near 0 leaves `sum (nu^ /
    /// sd)^2` of no more than their number.
    pub fn cheirality_cost(&self) -> f64 {
        (self.behind - self.reversed).max(0.0)
    }
}

struct EquationSums<'a> {
    view: View<'a>,
    inverse_cut: f64,
}

const EQUATION_SUMS: usize = 27;

impl Kernel<f64> for EquationSums<'_> {
    type Output = [f64; EQUATION_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; EQUATION_SUMS] {
        let View { planes, motion, tangent, floor } = self.view;
        let (motion, axes) = (Everywhere::<V>::new(motion), both_axes::<V>(tangent));
        let (floor, cut, one) = (V::splat(floor), V::splat(self.inverse_cut), V::constant(1.0));
        let mut sums = [V::zero(); EQUATION_SUMS];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let seen = see(&planes, i, &motion, floor);
            let e2 = seen.across * seen.across * seen.inverse;
            // Tukey's weight (1 - (e / cut)^2)^2, 1 without a cut.
            let rest = one - (e2 * cut).min(one);
            let weight = rest * rest * seen.inverse;
            let nu = seen.along * seen.inverse;
            let [a, b] = along_axes(&planes, i, &seen, &axes);
            let d = slope_row(nu, [a, b], &seen);
            add_products(&mut sums, &d, weight);
            for row in 0..5 {
                sums[15 + row] = (d[row] * weight).mul_add(seen.across, sums[15 + row]);
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
        let view = View::new(observations, &range, motion, tangent);
        dispatch(observations.level, EquationSums { view, inverse_cut })
    });
    let cost = cut.map_or(sums[23], |cut| cut * cut / 3.0 * sums[24]);
    let (h, gradient, cost) = with_prior(observations, motion, &sums, cost);
    let mut p = Matrix5::zeros();
    (p[(0, 0)], p[(0, 1)], p[(1, 0)], p[(1, 1)]) = (sums[20], sums[21], sums[21], sums[22]);
    Equations { h, gradient, p, cost, behind: sums[25], reversed: sums[26] }
}

/// `H` and the gradient of the first 20 sums, and the cost, with what is known of the rotation.
fn with_prior(observations: &Observations, motion: &Motion, sums: &[f64], mut cost: f64) -> (Matrix5, Vector5, f64) {
    let (mut h, mut gradient) = (symmetric(&sums[..15]), Vector5::from_column_slice(&sums[15..20]));
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&motion.w());
        add_to_rotation(&mut h, &known.information, 1.0);
        gradient.fixed_rows_mut::<3>(2).add_assign(&pull);
        cost += square;
    }
    (h, gradient, cost)
}

/// The sums of one Gauss-Newton step, with depths that must not be negative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrontEquations {
    pub h: Matrix5,
    pub gradient: Vector5,
    /// `sum min over nu >= 0 of |f - nu G u - R w|^2`.
    pub cost: f64,
}

struct FrontSums<'a>(View<'a>);

const FRONT_SUMS: usize = 21;

impl Kernel<f64> for FrontSums<'_> {
    type Output = [f64; FRONT_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; FRONT_SUMS] {
        let View { planes, motion, tangent, floor } = self.0;
        let (motion, axes) = (Everywhere::<V>::new(motion), both_axes::<V>(tangent));
        let (floor, one, none) = (V::splat(floor), V::constant(1.0), V::zero());
        let mut sums = [V::zero(); FRONT_SUMS];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let seen = see(&planes, i, &motion, floor);
            let before = V::select(seen.along.lt(none), none, one);
            let weight = before * seen.inverse;
            let nu = seen.along * seen.inverse;
            let [a, b] = along_axes(&planes, i, &seen, &axes);
            let d = slope_row(nu, [a, b], &seen);
            add_products(&mut sums, &d, weight);
            for row in 0..5 {
                sums[15 + row] = (d[row] * weight).mul_add(seen.across, sums[15 + row]);
            }
            // A point that would lie behind has depth 0: all that is left of it is what the rotation does not
            // explain.
            let behind = (one - before) * seen.inverse;
            let rest_x = seen.along.mul_add(seen.t[0], seen.across * seen.t[1]) * behind;
            let rest_y = seen.across.neg_mul_add(seen.t[0], seen.along * seen.t[1]) * behind;
            let counts = behind * seen.s2;
            let mut k = 9;
            for row in 0..3 {
                let (rx, ry) = (at::<V>(&planes, 6 + row, i), at::<V>(&planes, 9 + row, i));
                for column in row..3 {
                    let product = rx * at::<V>(&planes, 6 + column, i);
                    let product = ry.mul_add(at::<V>(&planes, 9 + column, i), product);
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
        dispatch(observations.level, FrontSums(View::new(observations, &range, motion, tangent)))
    });
    let (h, gradient, cost) = with_prior(observations, motion, &sums, sums[20]);
    FrontEquations { h, gradient, cost }
}
