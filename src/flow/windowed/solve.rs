//! The normal equations of a window from its moments, one lane a pixel.

use super::{moments::Moments, plan::Plan};
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::{Lanes, SimdReal};

/// Moment of the power x^a y^b that a product of columns of blocks `k` and `l` needs (0: flow, 1: d/dx, 2:
/// d/dy).
const POWER: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The upper triangle of `sum w T^T A^T A T` at row `j` of the group, column `c`: with `u = u0 + x u_x + y
/// u_y` column `u_x` of `A T` is `x A_u + A_{u_x}`, and so on.
#[inline(always)]
pub(super) fn normal_matrix<V: Lanes<Scalar = T>, T: SimdReal>(
    plan: Plan,
    sums: &Moments<T>,
    at: (usize, usize),
) -> [V; ENTRIES] {
    let own = plan.columns == 6;
    let mut n = [V::zero(); ENTRIES];
    for a in 0..6 {
        let (k, flow_a) = (a / 2, a % 2);
        for b in a..6 {
            let (l, flow_b) = (b / 2, b % 2);
            let mut sum = sums.load(plan, plan.place(flow_a.min(flow_b), flow_a.max(flow_b)), POWER[k][l], at);
            if own && l > 0 {
                sum = sum + sums.load(plan, plan.place(flow_a, b), k, at);
            }
            if own && k > 0 {
                sum = sum + sums.load(plan, plan.place(flow_b, a), l, at);
                sum = sum + sums.load(plan, plan.place(a, b), 0, at);
            }
            n[upper(a, b)] = sum;
        }
    }
    n
}

/// `sum w T^T A^T b` at the same place.
#[inline(always)]
pub(super) fn right_side<V: Lanes<Scalar = T>, T: SimdReal>(
    plan: Plan,
    sums: &Moments<T>,
    at: (usize, usize),
) -> [V; 6] {
    let mut right = [V::zero(); 6];
    for (a, sum) in right.iter_mut().enumerate() {
        *sum = sums.load(plan, Some(plan.right(a % 2)), a / 2, at);
        if a > 1 && plan.columns == 6 {
            *sum = *sum + sums.load(plan, Some(plan.right(a)), 0, at);
        }
    }
    right
}
