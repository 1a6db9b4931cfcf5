//! Process noise inside a Runge-Kutta step: the noise dimensions of the augmented sigma points.
//!
//! Of the 24 pairs of points of the augmented form, 12 move only the noise. Those that drive the brightness
//! are linear, so a pair contributes exactly `Q_k psi_k psi_k^T` with `psi = 1 + A/2 + A^2/6 + A^3/24`. Those
//! that drive motion component `j` by `+-sigma` are polynomials in sigma whose odd part `sigma d` and even
//! part `sigma^2 s` are computed directly: the pair contributes `Q_j d d^T + c Q_j^2 s s^T` to the
//! covariance, `Q_j s` to the mean and `Q_j d` to the covariance with component `j`. The numbers are those of
//! the 49 points.

use super::transition::{Generator, direction};
use super::vector::{plus_times, times};
use super::{Constants, PACKED, packed};
use crate::simd::Lanes;

pub(super) struct NoisePairs<V> {
    /// Full vectors of weight one: three of the Hessian's noise, odd and even parts of four derivatives'.
    pub full: [[V; 6]; 11],
    /// Vectors without curvature `(I, Ix, Iy)`: two of the gradient's noise, odd parts of u's and v's.
    pub slope: [[V; 3]; 4],
    /// Variance that `I` alone gains.
    pub brightness: V,
    /// `d` of each motion component.
    pub odd: [[V; 6]; 6],
    /// Shift of the mean.
    pub shift: [V; 6],
}

/// The contributions at mean brightness `i` (with `I` left out) and generator `a` of the mean motion.
#[inline(always)]
pub(super) fn noise_pairs<V: Lanes>(i: &[V; 6], a: &Generator<V>, constants: &Constants<V::Scalar>) -> NoisePairs<V> {
    let zero = V::zero();
    let (half, quarter, sixth) = (V::constant(0.5), V::constant(0.25), V::constant(1.0 / 6.0));
    let mut q = [zero; 12];
    for k in 0..12 {
        q[k] = V::splat(constants.q[k]);
    }
    let spread = V::splat(constants.spread);
    let mut out = NoisePairs {
        full: [[zero; 6]; 11],
        slope: [[zero; 3]; 4],
        brightness: q[0],
        odd: [[zero; 6]; 6],
        shift: [zero; 6],
    };

    // 24 psi y = 24 y + A (12 y + A (4 y + A y)), with y = sqrt(Q_k) / 24 in component k.
    for k in 1..6 {
        let mut unit = [zero; 6];
        unit[k] = q[k].sqrt() * V::constant(1.0 / 24.0);
        let (four, twelve, whole) =
            (times(&unit, V::constant(4.0)), times(&unit, V::constant(12.0)), times(&unit, V::constant(24.0)));
        if k < 3 {
            let y = a.add_slope([unit[1], unit[2]], [four[1], four[2]]);
            let y = a.add_slope(y, [twelve[1], twelve[2]]);
            let [gx, gy] = a.add_slope(y, [whole[1], whole[2]]);
            out.slope[k - 1] = [a.brightness(y, zero), gx, gy];
        } else {
            let y = a.add_slopes(&unit, &four);
            let y = a.add_slopes(&y, &twelve);
            out.full[k - 3] = a.add(&y, &whole);
        }
    }

    // The stages of the undisturbed step: y2, y3, y4 are where slopes 2, 3 and 4 are taken.
    let y2 = plus_times(i, half, &a.apply(i));
    let y3 = plus_times(i, half, &a.apply(&y2));
    let y4 = plus_times(i, V::constant(1.0), &a.apply(&y3));
    for j in 0..6 {
        let sigma = spread * q[6 + j].sqrt();
        let third = sixth + sixth;
        // Slopes 2, 3, 4: coefficients of sigma (k2, k3, k4) and its square (s3, s4).
        let along = direction(&y2, j);
        let k2 = times(&along, half);
        let y3_odd = times(&along, quarter);
        let k3 = a.add(&y3_odd, &times(&direction(&y3, j), half));
        let s3 = times(&direction(&y3_odd, j), half);
        let k4 = a.add(&k3, &direction(&y4, j));
        let s4 = a.add(&s3, &direction(&k3, j));
        let cube = direction(&s3, j);
        let (mut odd, mut even) = ([zero; 6], [zero; 6]);
        for k in 0..6 {
            odd[k] = (k2[k] + k3[k]).mul_add(third, (sigma * sigma).mul_add(cube[k], k4[k]) * sixth);
            even[k] = s3[k].mul_add(third, s4[k] * sixth);
        }
        let root = q[6 + j].sqrt();
        let weight = spread * q[6 + j];
        out.odd[j] = odd;
        out.shift = plus_times(&out.shift, q[6 + j], &even);
        if j < 2 {
            // A translation has no effect on curvature, and its even part only on I.
            out.slope[2 + j] = [odd[0] * root, odd[1] * root, odd[2] * root];
            let value = weight * even[0];
            out.brightness = value.mul_add(value, out.brightness);
        } else {
            out.full[3 + 2 * (j - 2)] = times(&odd, root);
            out.full[4 + 2 * (j - 2)] = times(&even, weight);
        }
    }
    out
}

impl<V: Lanes> NoisePairs<V> {
    /// Adds everything but the full vectors to a predicted covariance.
    #[inline(always)]
    pub(super) fn add_to(&self, cov: &mut [V; PACKED], constants: &Constants<V::Scalar>) {
        for v in &self.slope {
            for (a, b) in super::moments::TRIANGLE {
                cov[packed(a, b)] = v[a].mul_add(v[b], cov[packed(a, b)]);
            }
        }
        cov[0] = cov[0] + self.brightness;
        for j in 0..6 {
            let q = V::splat(constants.q[6 + j]);
            for k in 0..6 {
                cov[packed(6 + j, k)] = self.odd[j][k].mul_add(q, cov[packed(6 + j, k)]);
            }
            cov[packed(6 + j, 6 + j)] = cov[packed(6 + j, 6 + j)] + q;
        }
    }
}
