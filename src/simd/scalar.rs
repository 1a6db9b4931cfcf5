//! The vector traits of the scalars themselves: one lane.

#[cfg(target_arch = "x86_64")]
use super::x86::{F32x8, F32x16, F64x4, F64x8};
use super::{lanes::Lanes, lanes::SimdReal};

macro_rules! scalar_lanes {
    ($t:ty, $bits:ty, $bias:literal, $mantissa:literal) => {
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
    };
}

scalar_lanes!(f32, u32, 127, 23);
scalar_lanes!(f64, u64, 1023, 52);

macro_rules! lanes_of {
    ($t:ty, $avx2:ty, $avx512:ty) => {
        impl SimdReal for $t {
            #[cfg(target_arch = "x86_64")]
            type Avx2 = $avx2;
            #[cfg(target_arch = "x86_64")]
            type Avx512 = $avx512;
            #[cfg(not(target_arch = "x86_64"))]
            type Avx2 = $t;
            #[cfg(not(target_arch = "x86_64"))]
            type Avx512 = $t;
        }
    };
}

lanes_of!(f32, F32x8, F32x16);
lanes_of!(f64, F64x4, F64x8);
