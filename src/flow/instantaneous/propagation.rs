//! From the noise of the jets to the covariance of the motion, in lanes.
//!
//! `J(i) m = L(m) i` with a sparse 6x6 matrix L, so the error of the equations is `e = [i' - L i; i'' - L
//! i']` and its derivative with respect to the jet of frame f is `G_f = [w1_f - w0_f L; w2_f - w1_f L]` with
//! that frame's weights in i, i', i''. With the two halves `Y1, Y2` of `A^+` the gains are `A^+ G_f = w0_f X0
//! + w1_f X1 + w2_f X2`, where `X0 = -Y1 L, X1 = Y1 - Y2 L, X2 = Y2`.
//!
//! Frames and components enter only through `W = w w^T` and the jet's covariance C. Factors `W = K K^T` and
//! `C = R S R^T` (R unit upper triangular, S diagonal) turn the covariance into a sum of squares, which
//! rounding cannot make indefinite: three combinations of X0, X1, X2 times R times the root of S.

use super::{lane_noise::LaneNoise, normal::LaneRates, normal::Normal};
use crate::simd::{Lanes, SimdReal};

/// Columns of the factored covariance: three combinations of six components.
const COLUMNS: usize = 18;

/// Factor of the covariance, a row a parameter: working memory, made once and not cleared for every vector of
/// pixels.
pub(super) type Factor<V> = [[V; COLUMNS]; 6];

/// Working memory of [`propagate`].
#[inline(always)]
pub(super) fn factor_memory<V: Lanes>() -> Factor<V> {
    [[V::zero(); COLUMNS]; 6]
}

/// Covariance of the motion for unit pixel noise.
#[inline(always)]
pub(super) fn propagate<T: SimdReal, V: Lanes<Scalar = T>>(
    normal: &Normal<V>,
    rates: &LaneRates<V>,
    noise: &LaneNoise<T>,
    columns: &mut Factor<V>,
) -> [V; 21] {
    let inverse = normal.inverse();
    let m = normal.solution.motion;
    let [_, first @ ..] = rates.minus_first;
    for (z, out) in inverse.iter().zip(columns.iter_mut()) {
        // With the signs of `minus_first` and of J's rows these are -Y1 and Y2; carried() leaves out L's
        // minus sign.
        let (y1, y2) = (weigh(z, rates.jet), weigh(z, first));
        let (l1, l2) = (carried(&y1, m), carried(&y2, m));
        // X0, X1, X2, all with the opposite sign.
        let mut x = [[V::zero(); 6]; 3];
        x[1][0] = y1[0];
        for j in 0..5 {
            x[0][j + 1] = l1[j];
            x[1][j + 1] = y1[j + 1] - l2[j];
        }
        for j in 0..6 {
            x[2][j] = -y2[j];
        }
        let k = &noise.gains;
        for j in 0..6 {
            let [x0, x1, x2] = [x[0][j], x[1][j], x[2][j]];
            out[j] = x0.mul_add(V::splat(k[0][j]), x1.mul_add(V::splat(k[1][j]), x2 * V::splat(k[3][j])));
            out[6 + j] = x1.mul_add(V::splat(k[2][j]), x2 * V::splat(k[4][j]));
            out[12 + j] = x2 * V::splat(k[5][j]);
        }
        for &(i, j, weight) in &noise.mixing {
            for at in [0, 6, 12] {
                out[at + j] = out[at + i].mul_add(V::splat(weight), out[at + j]);
            }
        }
    }
    squares(columns)
}

/// A row of `N^-1 J(part)^T`, J without its minus signs.
#[inline(always)]
fn weigh<V: Lanes>(z: &[V; 6], [a, b, p, q, r]: [V; 5]) -> [V; 6] {
    let two = V::constant(2.0);
    [
        z[0].mul_add(a, z[1] * b),
        z[0].mul_add(p, z[1].mul_add(q, z[2].mul_add(a, z[3] * b))),
        z[0].mul_add(q, z[1].mul_add(r, z[4].mul_add(a, z[5] * b))),
        z[2].mul_add(p, z[3] * q) * two,
        z[2].mul_add(q, z[3].mul_add(r, z[4].mul_add(p, z[5] * q))),
        z[4].mul_add(q, z[5] * r) * two,
    ]
}

/// `y L(m)` without L's minus sign; its first component is always zero and left out.
#[inline(always)]
fn carried<V: Lanes>(y: &[V; 6], [u, v, ux, vx, uy, vy]: [V; 6]) -> [V; 5] {
    let two = V::constant(2.0);
    let (y4, y6) = (y[3] * two, y[5] * two);
    [
        y[0].mul_add(u, y[1].mul_add(ux, y[2] * uy)),
        y[0].mul_add(v, y[1].mul_add(vx, y[2] * vy)),
        y[1].mul_add(u, y4.mul_add(ux, y[4] * uy)),
        y[1].mul_add(v, y[2].mul_add(u, y4.mul_add(vx, y[4].mul_add(ux + vy, y6 * uy)))),
        y[2].mul_add(v, y[4].mul_add(vx, y6 * vy)),
    ]
}

/// `B B^T`, upper triangle: three blocks of three rows by three, so that the sums of a block stay in
/// registers.
#[inline(always)]
fn squares<V: Lanes>(b: &Factor<V>) -> [V; 21] {
    let mut out = [V::zero(); 21];
    let [b0, b1, b2, b3, b4, b5] = b;
    macro_rules! block {
        ($(($at:literal, $x:ident, $y:ident)),*) => {{
            let mut sums = [$({ let _ = $at; V::zero() }),*];
            for k in 0..COLUMNS {
                let mut n = 0;
                $(sums[n] = $x[k].mul_add($y[k], sums[n]); n += 1;)*
                let _ = n;
            }
            let mut n = 0;
            $(out[$at] = sums[n]; n += 1;)*
            let _ = n;
        }};
    }
    block!((0, b0, b0), (1, b0, b1), (2, b0, b2), (6, b1, b1), (7, b1, b2), (11, b2, b2));
    block!(
        (3, b0, b3),
        (4, b0, b4),
        (5, b0, b5),
        (8, b1, b3),
        (9, b1, b4),
        (10, b1, b5),
        (12, b2, b3),
        (13, b2, b4),
        (14, b2, b5)
    );
    block!((15, b3, b3), (16, b3, b4), (17, b3, b5), (18, b4, b4), (19, b4, b5), (20, b5, b5));
    out
}
