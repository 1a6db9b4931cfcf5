//! The choice of an instance that is compiled once for each precision.
//!
//! A generic function is compiled again in every crate that calls it: each test, bench and user would compile
//! all kernels. Public generic functions therefore call an instance for `f32` or `f64` that is compiled once,
//! in this crate.

use std::any::Any;

/// `value` as a `B`, when that is what it is.
#[inline]
pub(crate) fn same<A: 'static, B: 'static>(value: &A) -> Option<&B> {
    (value as &dyn Any).downcast_ref()
}

/// `value` as a `B` to be changed, when that is what it is.
#[inline]
pub(crate) fn same_mut<A: 'static, B: 'static>(value: &mut A) -> Option<&mut B> {
    (value as &mut dyn Any).downcast_mut()
}
