//! Beaudet's operators: value and first derivatives at the centre of a polynomial fitted to 5 x 5 pixels.
//!
//! P. R. Beaudet, "Rotationally invariant image operators" (1978): the least-squares polynomial of total
//! degree `order` in a square neighbourhood; its coefficients are correlations with fixed masks.

use nalgebra::DMatrix;
use std::sync::OnceLock;

/// Pixels on each side of the centre.
pub const REACH: usize = 2;
/// Pixels along a side.
pub const SIDE: usize = 2 * REACH + 1;
/// A mask, row by row from y = -2 on, columns from x = -2 on.
pub type KernelMask = [[f64; SIDE]; SIDE];

/// Masks of one degree.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivativeKernels {
    /// Value at the centre.
    pub value: KernelMask,
    /// Derivative along x, 1/px.
    pub x: KernelMask,
    /// Derivative along y, 1/px: the transpose.
    pub y: KernelMask,
}

/// The masks of [`derivative_kernels`], made once.
pub(super) fn kernels_of(order: usize) -> &'static DerivativeKernels {
    static KERNELS: OnceLock<[DerivativeKernels; 4]> = OnceLock::new();
    &KERNELS.get_or_init(|| [1, 2, 3, 4].map(derivative_kernels))[order.clamp(1, 4) - 1]
}

/// Largest gradient that rounding to whole grey levels makes of a flat picture, grey levels/px: half a level
/// at each pixel, by the mask along x.
pub(super) fn gradient_of_rounding(order: usize) -> f64 {
    0.5 * kernels_of(order).x.iter().flatten().map(|k| k.abs()).sum::<f64>()
}

/// The masks for polynomials of total degree `order`, 1 to 4 (clamped).
pub fn derivative_kernels(order: usize) -> DerivativeKernels {
    let order = order.clamp(1, 4) as i32;
    let powers: Vec<(i32, i32)> = (0..=order).flat_map(|n| (0..=n).map(move |b| (n - b, b))).collect();
    // Coordinates within -1 .. 1 keep the fourth powers small.
    let at = |k: usize| (k as f64 - REACH as f64) / REACH as f64;
    let monomials = DMatrix::from_fn(SIDE * SIDE, powers.len(), |p, k| {
        at(p % SIDE).powi(powers[k].0) * at(p / SIDE).powi(powers[k].1)
    });
    let normal = monomials.tr_mul(&monomials);
    // 25 distinct points carry every polynomial of degree four: nothing is singular.
    let fit = normal
        .cholesky()
        .map_or_else(|| DMatrix::zeros(powers.len(), SIDE * SIDE), |c| c.solve(&monomials.transpose()));
    let row = |power: (i32, i32), factor: f64| -> KernelMask {
        let k = powers.iter().position(|p| *p == power).unwrap_or(0);
        std::array::from_fn(|y| std::array::from_fn(|x| factor * fit[(k, y * SIDE + x)]))
    };
    let scale = 1.0 / REACH as f64;
    DerivativeKernels { value: row((0, 0), 1.0), x: row((1, 0), scale), y: row((0, 1), scale) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(mask: &KernelMask, f: impl Fn(f64, f64) -> f64) -> f64 {
        let mut sum = 0.0;
        for (j, row) in mask.iter().enumerate() {
            for (i, w) in row.iter().enumerate() {
                sum += w * f(i as f64 - 2.0, j as f64 - 2.0);
            }
        }
        sum
    }

    fn assert_mask(got: &KernelMask, want: &[[f64; 5]; 5], over: f64) {
        for (g, w) in got.iter().flatten().zip(want.iter().flatten()) {
            assert!((g - w / over).abs() < 1e-12, "{g} {}", w / over);
        }
    }

    #[test]
    fn masks_are_those_of_the_literature() {
        let ramp = [[-2.0, -1.0, 0.0, 1.0, 2.0]; 5];
        let cubic = [
            [31.0, -44.0, 0.0, 44.0, -31.0],
            [-5.0, -62.0, 0.0, 62.0, 5.0],
            [-17.0, -68.0, 0.0, 68.0, 17.0],
            [-5.0, -62.0, 0.0, 62.0, 5.0],
            [31.0, -44.0, 0.0, 44.0, -31.0],
        ];
        let quadratic = [
            [-13.0, 2.0, 7.0, 2.0, -13.0],
            [2.0, 17.0, 22.0, 17.0, 2.0],
            [7.0, 22.0, 27.0, 22.0, 7.0],
            [2.0, 17.0, 22.0, 17.0, 2.0],
            [-13.0, 2.0, 7.0, 2.0, -13.0],
        ];
        for order in 1..=4 {
            let k = derivative_kernels(order);
            assert_mask(&k.x, if order < 3 { &ramp } else { &cubic }, if order < 3 { 50.0 } else { 420.0 });
            match order {
                1 => assert_mask(&k.value, &[[1.0; 5]; 5], 25.0),
                2 | 3 => assert_mask(&k.value, &quadratic, 175.0),
                _ => {
                    for (got, want) in k.value[2].iter().zip([0.078367, 0.200816, 0.441633, 0.200816, 0.078367]) {
                        assert!((got - want).abs() < 1e-6);
                    }
                }
            }
            for (i, row) in k.y.iter().enumerate() {
                for (j, w) in row.iter().enumerate() {
                    assert!((w - k.x[j][i]).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn masks_are_exact_for_every_monomial_up_to_their_degree() {
        for order in 1..=4usize {
            let k = derivative_kernels(order);
            for (a, b) in (0..=order as i32).flat_map(|n| (0..=n).map(move |b| (n - b, b))) {
                let f = |x: f64, y: f64| x.powi(a) * y.powi(b);
                assert!((apply(&k.value, f) - f64::from((a, b) == (0, 0))).abs() < 1e-11, "{order} {a} {b}");
                assert!((apply(&k.x, f) - f64::from((a, b) == (1, 0))).abs() < 1e-11, "{order} {a} {b}");
                assert!((apply(&k.y, f) - f64::from((a, b) == (0, 1))).abs() < 1e-11, "{order} {a} {b}");
            }
        }
    }

    #[test]
    fn rounding_makes_no_larger_gradient_than_it_is_said_to() {
        for order in 1..=4 {
            let mask = derivative_kernels(order).x;
            let at = |x: f64, y: f64| mask[(y + 2.0) as usize][(x + 2.0) as usize];
            let worst = apply(&mask, |x, y| 0.5 * at(x, y).signum());
            assert!((worst - gradient_of_rounding(order)).abs() < 1e-12, "{order}");
        }
        assert!((gradient_of_rounding(2) - 0.3).abs() < 1e-12);
    }
}
