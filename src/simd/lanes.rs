//! The vector trait, and the trait of the scalars that have vectors.

use crate::math::Real;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A few equal floating-point lanes, processed together.
///
/// Implementations other than the scalars use instructions that not every processor has; they are named only
/// inside [`dispatch`](super::dispatch), which checks first.
pub(crate) trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The type of one lane.
    type Scalar: SimdReal;
    /// The result of a comparison, one truth value a lane.
    type Mask: Copy;
    /// How many lanes.
    const LANES: usize;

    /// The same value in every lane.
    fn splat(value: Self::Scalar) -> Self;
    /// The first `LANES` values of `source` (panics when it is shorter).
    fn load(source: &[Self::Scalar]) -> Self;
    /// Writes the lanes to the first `LANES` values of `target` (panics when it is shorter).
    fn store(self, target: &mut [Self::Scalar]);
    /// `self * factor + term`, fused where the processor can.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `term - self * factor`, fused where the processor can.
    fn neg_mul_add(self, factor: Self, term: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The smaller of two (the second where the first is NaN).
    fn min(self, other: Self) -> Self;
    /// The larger of two (the second where the first is NaN).
    fn max(self, other: Self) -> Self;
    /// `self < other`; false where either is NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `yes` where the mask holds, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// The greatest whole number not above the value.
    fn floor(self) -> Self;
    /// 2 to the power of the value, a whole number that is an exponent of normal numbers: -126 to 127 in
    /// single, -1022 to 1023 in double precision.
    fn power_of_two(self) -> Self;
    /// Sums four rows of four neighbours down their columns, a patch of its own for every lane `l`:
    /// `result[k][l] = sum_j weights[j][l] plane[(row[l] + j) stride + column[l] + k]`, `j, k = 0..4`.
    ///
    /// `column` and `row` hold whole numbers below 2^31. Panics where a patch reaches beyond `plane`.
    fn sum_patches(plane: &[Self::Scalar], stride: usize, column: Self, row: Self, weights: [Self; 4]) -> [Self; 4];

    /// Zero in every lane.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(Self::Scalar::from_f64(0.0))
    }
    /// A constant in every lane.
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::splat(Self::Scalar::from_f64(value))
    }
}

/// A scalar with its vector types.
pub(crate) trait SimdReal: Real + Lanes<Scalar = Self> {
    /// 256-bit lanes.
    type Avx2: Lanes<Scalar = Self>;
    /// 512-bit lanes.
    type Avx512: Lanes<Scalar = Self>;
}
