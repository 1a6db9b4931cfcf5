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
