//! The vector trait, and its one-lane implementation by the scalars themselves.

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

macro_rules! scalar_lanes {
    ($t:ty, $bits:ty, $bias:literal, $mantissa:literal, $avx2:ident, $avx512:ident) => {
        impl Lanes for $t {
            type Scalar = $t;
            type Mask = bool;
            const LANES: usize = 1;
            #[inline(always)]
            fn splat(value: $t) -> $t {
                value
            }
            #[inline(always)]
            fn load(source: &[$t]) -> $t {
                source[0]
            }
            #[inline(always)]
            fn store(self, target: &mut [$t]) {
                target[0] = self;
            }
            // Not fused: without the instruction the fused form is a library call.
            #[inline(always)]
            fn mul_add(self, factor: $t, term: $t) -> $t {
                self * factor + term
            }
            #[inline(always)]
            fn neg_mul_add(self, factor: $t, term: $t) -> $t {
                term - self * factor
            }
            #[inline(always)]
            fn sqrt(self) -> $t {
                <$t>::sqrt(self)
            }
            #[inline(always)]
            fn min(self, other: $t) -> $t {
                if self < other { self } else { other }
            }
            #[inline(always)]
            fn max(self, other: $t) -> $t {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn lt(self, other: $t) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, yes: $t, no: $t) -> $t {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn floor(self) -> $t {
                <$t>::floor(self)
            }
            #[inline(always)]
            fn power_of_two(self) -> $t {
                <$t>::from_bits(((self as i32 + $bias) as $bits) << $mantissa)
            }
            #[inline(always)]
            fn sum_patches(plane: &[$t], stride: usize, column: $t, row: $t, weights: [$t; 4]) -> [$t; 4] {
                let patch = &plane[row as usize * stride + column as usize..][..3 * stride + 4];
                std::array::from_fn(|k| {
                    let sum = patch[k] * weights[0];
                    let sum = Lanes::mul_add(patch[stride + k], weights[1], sum);
                    let sum = Lanes::mul_add(patch[2 * stride + k], weights[2], sum);
                    Lanes::mul_add(patch[3 * stride + k], weights[3], sum)
                })
            }
        }
        impl SimdReal for $t {
            #[cfg(target_arch = "x86_64")]
            type Avx2 = super::x86::$avx2;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = super::x86::$avx512;
            #[cfg(not(target_arch = "x86_64"))]
            type Avx2 = $t;
            #[cfg(not(target_arch = "x86_64"))]
            type Avx512 = $t;
        }
    };
}

scalar_lanes!(f32, u32, 127, 23, F32x8, F32x16);
scalar_lanes!(f64, u64, 1023, 52, F64x4, F64x8);
