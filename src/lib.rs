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
//! Level by level, a module imports only from lower levels: [`types`], [`math`], [`parallel`], [`simd`] (0);
//! [`image`] (1); [`jet`], [`io`], [`synth`] (2); [`flow`], [`filter`], [`mixture`], [`motion3d`],
//! [`segment`], [`stereo`] (3); [`temporal`], [`track`] (4); [`pipeline`] (5); the binary and the Python
//! binding (6).

#[doc(hidden)]
pub mod ablation;
pub mod error;
pub mod filter;
pub mod flow;
pub mod image;
pub mod io;
pub mod jet;
pub mod math;
pub mod mixture;
pub mod motion3d;
pub mod parallel;
pub mod pipeline;
pub mod segment;
pub mod simd;
pub mod stereo;
pub mod synth;
pub mod temporal;
pub mod track;
pub mod types;

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "python")]
mod python;

pub use error::{Error, Result};
