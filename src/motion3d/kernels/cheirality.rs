//! Sums of one step towards the most likely motion that has no depth behind the camera.

use super::{Everywhere, Planes, UPPER, add_to_rotation, at, both_axes, dot, over_chunks, see, total, turn};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::{Matrix2x3, SMatrix};
use std::ops::AddAssign;

/// The sums of one Gauss-Newton step, with depths that must not be negative.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FrontEquations {
    pub h: SMatrix<f64, 5, 5>,
    pub gradient: SMatrix<f64, 5, 1>,
    /// `sum min over nu >= 0 of |f - nu G u - R w|^2`.
    pub cost: f64,
}

struct FrontSums<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
}

const SUMS: usize = 21;

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
    let mut h = SMatrix::<f64, 5, 5>::zeros();
    for (value, &(i, j)) in sums.iter().zip(&UPPER) {
        h[(i, j)] = *value;
        h[(j, i)] = *value;
    }
    let mut gradient = SMatrix::<f64, 5, 1>::from_column_slice(&sums[15..20]);
    let mut cost = sums[20];
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&motion.w());
        add_to_rotation(&mut h, &known.information, 1.0);
        gradient.fixed_rows_mut::<3>(2).add_assign(&pull);
        cost += square;
    }
    FrontEquations { h, gradient, cost }
}
