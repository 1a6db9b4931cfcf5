//! Optical flow together with its Jacobian and the uncertainty of both.
//!
//! From recorded or live image sequences: the flow `(u, v)`, its four spatial derivatives and their
//! covariance, filtered over time.
//!
//! # Conventions
//! Frames are `[row, col] = [y, x]`; x right, y down. Flow `(u, v)` is in px/frame along `(x, y)`. Motion
//! parameters are ordered `m = (u, v, u_x, v_x, u_y, v_y)`; the flow Jacobian is `M = [[u_x, u_y], [v_x,
//! v_y]]`; divergence `u_x + v_y`, curl `v_x - u_y`.
//!
//! # Map
//! Level by level, a module imports only from lower levels: [`ablation`], [`error`], [`types`], [`math`],
//! [`simd`], [`parallel`], [`buffer_pool`] (0); [`image`], [`scattered`] (1); [`jet`], [`io`], [`synth`] (2);
//! [`flow`], [`filter`], [`mixture`], [`motion3d`], [`segment`], [`stereo`] (3); [`temporal`], [`track`] (4);
//! [`pipeline`] (5); [`cli`], the binary (6). Each room from level 1 up, and [`filter`], is a Cargo feature
//! of its name; `default-features = false, features = ["filter"]` gives the filters alone. The Python binding
//! is a package of its own, `python/`.

// A choice of rooms uses a choice of what the lower ones offer.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]

#[doc(hidden)]
pub mod ablation;
// Public for the binding.
#[cfg(feature = "temporal")]
#[doc(hidden)]
pub mod buffer_pool;
pub mod error;
#[cfg(feature = "filter")]
pub mod filter;
#[cfg(feature = "flow")]
pub mod flow;
#[cfg(feature = "image")]
pub mod image;
#[cfg(feature = "io")]
pub mod io;
#[cfg(feature = "image")]
pub mod jet;
pub mod math;
#[cfg(feature = "mixture")]
pub mod mixture;
#[cfg(feature = "motion3d")]
pub mod motion3d;
pub mod parallel;
#[cfg(feature = "pipeline")]
pub mod pipeline;
#[cfg(feature = "motion3d")]
mod scattered;
#[cfg(feature = "segment")]
pub mod segment;
pub mod simd;
#[cfg(feature = "stereo")]
pub mod stereo;
#[cfg(feature = "synth")]
pub mod synth;
#[cfg(feature = "temporal")]
pub mod temporal;
#[cfg(feature = "track")]
pub mod track;
pub mod types;

#[cfg(feature = "cli")]
pub mod cli;

pub use error::{Error, Result};
