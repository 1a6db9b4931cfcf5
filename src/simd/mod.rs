//! Run-time choice of the instruction set, and the lane type that kernels are generic over.
//!
//! A kernel is written once as a [`Kernel`] whose `run` is generic over [`Lanes`]; [`dispatch`] compiles it
//! for AVX-512, AVX2+FMA and for plain scalars, and picks at run time. The scalar twin is the same source
//! with one lane and no fused multiply-add: it is the oracle in tests and the path on other processors.
//!
//! Closures do not inherit target features, so a kernel is a struct with its arguments as fields and
//! `#[inline(always)]` on `run` and on everything hot that it calls.

mod exponential;
mod lanes;
mod scalar;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(crate) use exponential::exp;
pub(crate) use lanes::{Lanes, SimdReal};

use crate::error::{Error, Result};
use std::any::Any;
use std::sync::OnceLock;

/// The environment variable that sets the level.
const VARIABLE: &str = "JACOFLOW_SIMD";

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Inner {
    Scalar,
    Avx2,
    #[cfg(feature = "avx512")]
    Avx512,
}

/// An instruction-set level that this processor has: holding a value proves it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Level(Inner);

impl Level {
    /// Plain scalar code, on every processor.
    pub const SCALAR: Self = Self(Inner::Scalar);

    /// AVX2 with fused multiply-add, if the processor has both.
    pub fn avx2() -> Option<Self> {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
            return Some(Self(Inner::Avx2));
        }
        None
    }

    /// AVX-512 (F, DQ, VL), if the processor has it and the crate was built with the feature `avx512`.
    pub fn avx512() -> Option<Self> {
        #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
        if Self::avx2().is_some()
            && std::is_x86_feature_detected!("avx512f")
            && std::is_x86_feature_detected!("avx512dq")
            && std::is_x86_feature_detected!("avx512vl")
        {
            return Some(Self(Inner::Avx512));
        }
        None
    }

    /// Every level of this processor, slowest first.
    pub fn available() -> Vec<Self> {
        [Some(Self::SCALAR), Self::avx2(), Self::avx512()].into_iter().flatten().collect()
    }

    /// The default level: that of [`Level::from_environment`], else the best. Read once.
    pub fn detect() -> Self {
        static LEVEL: OnceLock<Level> = OnceLock::new();
        *LEVEL.get_or_init(|| {
            let best = *Self::available().last().unwrap_or(&Self::SCALAR);
            Self::from_environment().ok().flatten().unwrap_or(best)
        })
    }

    /// The level that `JACOFLOW_SIMD` names (`scalar`, `avx2`, `avx512`); none when unset or empty.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `JACOFLOW_SIMD` for another word or a level that this processor lacks.
    pub fn from_environment() -> Result<Option<Self>> {
        match std::env::var_os(VARIABLE).filter(|name| !name.is_empty()) {
            Some(name) => Self::named(VARIABLE, &name.to_string_lossy()).map(Some),
            None => Ok(None),
        }
    }

    /// `choice`, after making sure that without one the environment does not ask for nonsense: a mistake
    /// there must not go unnoticed.
    pub fn check(choice: Option<Self>) -> Result<Option<Self>> {
        if choice.is_none() {
            Self::from_environment()?;
        }
        Ok(choice)
    }

    /// The level called `name` (`scalar`, `avx2`, `avx512`).
    ///
    /// # Errors
    /// [`Error::Argument`] for another word or a level that this processor lacks.
    pub fn parse(name: &str) -> Result<Self> {
        Self::named("simd", name)
    }

    /// As [`Level::parse`]; errors blame `argument`.
    fn named(argument: &'static str, name: &str) -> Result<Self> {
        let level = match name {
            "scalar" => Some(Self::SCALAR),
            "avx2" => Self::avx2(),
            "avx512" => Self::avx512(),
            _ => None,
        };
        level.ok_or_else(|| {
            let have: Vec<_> = Self::available().iter().map(|l| l.name()).collect();
            Error::argument(argument, format!("one of {}", have.join(", ")), name)
        })
    }

    /// The level's name, as [`Level::parse`] takes it.
    pub fn name(self) -> &'static str {
        match self.0 {
            Inner::Scalar => "scalar",
            Inner::Avx2 => "avx2",
            #[cfg(feature = "avx512")]
            Inner::Avx512 => "avx512",
        }
    }
}

/// A computation written once for every lane width. Mark `run` `#[inline(always)]`.
pub(crate) trait Kernel<T: SimdReal> {
    /// What the computation returns.
    type Output;
    /// Does the work with vectors of type `V`.
    fn run<V: Lanes<Scalar = T>>(self) -> Self::Output;
}

/// Runs `kernel` with the widest lanes that `level` allows.
#[inline]
pub(crate) fn dispatch<T: SimdReal, K: Kernel<T>>(level: Level, kernel: K) -> K::Output {
    match level.0 {
        Inner::Scalar => kernel.run::<T>(),
        // SAFETY: a `Level` of this kind exists only on a processor with AVX2 and FMA.
        #[cfg(target_arch = "x86_64")]
        Inner::Avx2 => unsafe { run_avx2(kernel) },
        // SAFETY: a `Level` of this kind exists only on a processor with AVX-512 F, DQ and VL.
        #[cfg(all(target_arch = "x86_64", feature = "avx512"))]
        Inner::Avx512 => unsafe { run_avx512(kernel) },
        #[cfg(not(target_arch = "x86_64"))]
        _ => unreachable!("other processors have only the scalar level"),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_avx2<T: SimdReal, K: Kernel<T>>(kernel: K) -> K::Output {
    kernel.run::<T::Avx2>()
}

#[cfg(all(target_arch = "x86_64", feature = "avx512"))]
#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn run_avx512<T: SimdReal, K: Kernel<T>>(kernel: K) -> K::Output {
    kernel.run::<T::Avx512>()
}

/// `value` as a `B`, when that is what it is: chooses an instance that is compiled once for each precision.
///
/// A generic function is compiled again in every crate that calls it: each test, bench and user would compile
/// all kernels. Public generic functions therefore call an instance for `f32` or `f64` that is compiled once,
/// in this crate.
#[inline]
pub(crate) fn same<A: 'static, B: 'static>(value: &A) -> Option<&B> {
    (value as &dyn Any).downcast_ref()
}

/// `value` as a `B` to be changed, when that is what it is.
#[inline]
pub(crate) fn same_mut<A: 'static, B: 'static>(value: &mut A) -> Option<&mut B> {
    (value as &mut dyn Any).downcast_mut()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y <- |a x + y| where x > 0, else -x; exercises every lane operation.
    struct Mixed<'a, T>(T, &'a [T], &'a mut [T]);

    impl<T: SimdReal> Kernel<T> for Mixed<'_, T> {
        type Output = usize;
        #[inline(always)]
        fn run<V: Lanes<Scalar = T>>(self) -> usize {
            let a = V::splat(self.0);
            for (x, y) in self.1.chunks_exact(V::LANES).zip(self.2.chunks_exact_mut(V::LANES)) {
                let (vx, vy) = (V::load(x), V::load(y));
                let sum = vx.mul_add(a, vy);
                let value = sum.max(-sum).sqrt() / (V::splat(T::from_f64(1.0)) + vx * vx);
                V::select(V::splat(T::from_f64(0.0)).lt(vx), value, -vx).store(y);
            }
            V::LANES
        }
    }

    fn check<T: SimdReal>(tolerance: f64) {
        let x: Vec<T> = (0..64).map(|i| T::from_f64(f64::from(i) * 0.37 - 9.0)).collect();
        let y: Vec<T> = (0..64).map(|i| T::from_f64(f64::from(i).sin())).collect();
        let mut want = y.clone();
        assert_eq!(dispatch(Level::SCALAR, Mixed(T::from_f64(0.7), &x, &mut want)), 1);
        for level in Level::available() {
            let mut got = y.clone();
            dispatch(level, Mixed(T::from_f64(0.7), &x, &mut got));
            for (g, w) in got.iter().zip(&want) {
                assert!((g.to_f64() - w.to_f64()).abs() <= tolerance, "{level:?}");
            }
        }
    }

    #[test]
    fn every_level_agrees_with_the_scalar_twin() {
        check::<f32>(1e-6);
        check::<f64>(1e-14);
    }
}
