//! 256- and 512-bit lanes.
//!
//! # Safety
//! The methods are safe to call only because values of these types are made solely inside functions that
//! [`dispatch`](super::dispatch) enters after checking the processor: the types are private to `simd`
//! and reach kernels only as `SimdReal::Avx2` and `SimdReal::Avx512`.

mod patches;

use super::lanes::Lanes;
#[allow(clippy::wildcard_imports)]
use core::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Added to these, whole numbers stand with the bias in the lowest bits: `2^23 + 127`, `2^52 + 1023`.
const BIASED_F32: f32 = 8_388_735.0;
const BIASED_F64: f64 = 4_503_599_627_371_519.0;

/// Round towards minus infinity, without a flag for inexact results.
const FLOOR: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;

macro_rules! operators {
    ($name:ident: $($operator:ident $function:ident $instruction:ident),*) => {$(
        impl $operator for $name {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}

macro_rules! lanes {
    (
        $name:ident, $vector:ty, $scalar:ty, $count:literal, $mask:ty,
        $set1:ident, $load:ident, $store:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
        $fmadd:ident, $fnmadd:ident, $sqrt:ident, $min:ident, $max:ident,
        |$la:ident, $lb:ident| $lt:expr, |$sm:ident, $sy:ident, $sn:ident| $select:expr,
        |$fa:ident| $floor:expr, |$pa:ident| $power:expr, $patches:path
    ) => {
        #[derive(Clone, Copy)]
        pub(crate) struct $name($vector);

        operators!($name: Add add $add, Sub sub $sub, Mul mul $mul, Div div $div);
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $sub($set1(-0.0), self.0) })
            }
        }
        impl Lanes for $name {
            type Scalar = $scalar;
            type Mask = $mask;
            const LANES: usize = $count;
            #[inline(always)]
            fn splat(value: $scalar) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $set1(value) })
            }
            #[inline(always)]
            fn load(source: &[$scalar]) -> Self {
                let source = &source[..$count];
                // SAFETY: see the module's note; the slice holds enough values, and the load is unaligned.
                Self(unsafe { $load(source.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, target: &mut [$scalar]) {
                let target = &mut target[..$count];
                // SAFETY: see the module's note; the slice holds enough values, and the store is unaligned.
                unsafe { $store(target.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $fmadd(self.0, factor.0, term.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, factor: Self, term: Self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $fnmadd(self.0, factor.0, term.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: see the module's note.
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($la, $lb) = (self.0, other.0);
                // SAFETY: see the module's note.
                unsafe { $lt }
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                let ($sm, $sy, $sn) = (mask, yes.0, no.0);
                // SAFETY: see the module's note.
                Self(unsafe { $select })
            }
            #[inline(always)]
            fn floor(self) -> Self {
                let $fa = self.0;
                // SAFETY: see the module's note.
                Self(unsafe { $floor })
            }
            #[inline(always)]
            fn power_of_two(self) -> Self {
                let $pa = self.0;
                // SAFETY: see the module's note.
                Self(unsafe { $power })
            }
            #[inline(always)]
            fn sum_patches(plane: &[$scalar], stride: usize, column: Self, row: Self, weights: [Self; 4]) -> [Self; 4] {
                // SAFETY: see the module's note.
                unsafe { $patches(plane, stride, column.0, row.0, weights.map(|w| w.0)) }.map(Self)
            }
        }
    };
}

lanes! {
    F32x8, __m256, f32, 8, __m256,
    _mm256_set1_ps, _mm256_loadu_ps, _mm256_storeu_ps, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_div_ps,
    _mm256_fmadd_ps, _mm256_fnmadd_ps, _mm256_sqrt_ps, _mm256_min_ps, _mm256_max_ps,
    |a, b| _mm256_cmp_ps::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm256_blendv_ps(n, y, m),
    |a| _mm256_floor_ps(a),
    |a| _mm256_castsi256_ps(_mm256_slli_epi32::<23>(_mm256_castps_si256(_mm256_add_ps(a, _mm256_set1_ps(BIASED_F32))))),
    patches::f32x8
}
lanes! {
    F64x4, __m256d, f64, 4, __m256d,
    _mm256_set1_pd, _mm256_loadu_pd, _mm256_storeu_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd,
    _mm256_fmadd_pd, _mm256_fnmadd_pd, _mm256_sqrt_pd, _mm256_min_pd, _mm256_max_pd,
    |a, b| _mm256_cmp_pd::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm256_blendv_pd(n, y, m),
    |a| _mm256_floor_pd(a),
    |a| _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(_mm256_add_pd(a, _mm256_set1_pd(BIASED_F64))))),
    patches::f64x4
}
lanes! {
    F32x16, __m512, f32, 16, __mmask16,
    _mm512_set1_ps, _mm512_loadu_ps, _mm512_storeu_ps, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_div_ps,
    _mm512_fmadd_ps, _mm512_fnmadd_ps, _mm512_sqrt_ps, _mm512_min_ps, _mm512_max_ps,
    |a, b| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm512_mask_blend_ps(m, n, y),
    |a| _mm512_roundscale_ps::<FLOOR>(a),
    |a| _mm512_castsi512_ps(_mm512_slli_epi32::<23>(_mm512_castps_si512(_mm512_add_ps(a, _mm512_set1_ps(BIASED_F32))))),
    patches::f32x16
}
lanes! {
    F64x8, __m512d, f64, 8, __mmask8,
    _mm512_set1_pd, _mm512_loadu_pd, _mm512_storeu_pd, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd,
    _mm512_fmadd_pd, _mm512_fnmadd_pd, _mm512_sqrt_pd, _mm512_min_pd, _mm512_max_pd,
    |a, b| _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
    |m, y, n| _mm512_mask_blend_pd(m, n, y),
    |a| _mm512_roundscale_pd::<FLOOR>(a),
    |a| _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(_mm512_add_pd(a, _mm512_set1_pd(BIASED_F64))))),
    patches::f64x8
}
