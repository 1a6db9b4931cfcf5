//! The two precisions that every algorithm is written for.

use std::fmt::{Debug, Display};
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// `f32` or `f64`: the precision a computation runs in.
///
/// `f32` is the fast path for 8- and 16-bit images; `f64` is used for `f64` input and wherever second
/// differences of smooth data would drown in `f32` rounding.
///
/// Deliberately not bound to `nalgebra::RealField`, whose method names collide with the lane operations;
/// small decompositions run in `f64` through nalgebra, hot loops through `simd`.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Debug
    + Display
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
{
    /// Rounds a double to this precision.
    fn from_f64(value: f64) -> Self;
    /// Widens to a double, exactly.
    fn to_f64(self) -> f64;
    /// Not a number.
    fn nan() -> Self {
        Self::from_f64(f64::NAN)
    }
    /// Neither NaN nor infinite.
    fn finite(self) -> bool {
        self.to_f64().is_finite()
    }
}

impl Real for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}
