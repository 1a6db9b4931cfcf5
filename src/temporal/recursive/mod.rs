//! Estimates of a steady motion fused over time: a recursive windowed filter, one information filter a pixel.
//!
//! The state of a pixel is its motion `m = (u, v, u_x, v_x, u_y, v_y)`, fixed to the picture (a flow that is
//! steady where it is, not where it is carried to). Every estimate `m_k` with covariance `C_k` counts by its
//! information, and what came before is forgotten by a factor `f` a frame:
//!
//! `P_k^-1 = f P_{k-1}^-1 + C_k^-1`,  `x_k = x_{k-1} + K (m_k - x_{k-1})`,  `K = P_k C_k^-1`.
//!
//! The first estimate starts it, so there is nothing to converge. (A. Gelb, ed., "Applied Optimal
//! Estimation", 1974, section 4.3, for information; section 8.3 for forgetting.)
//!
//! # Uncertainty
//! With the gain `g = tr(K) / 6` the share of one estimate's noise that is left is `V_k = (1 - g)^2 V_{k-1} +
//! g^2`, that is 1/k without forgetting and (1 - f) / (1 + f) at last. What estimates have in common does not
//! average out: with `B` the systematic part of their covariance (misfit, bias), averaged with the same
//! gains,
//!
//! `Cov(x) = (V / g) P + (1 - V) B + d d^T`,
//!
//! which for equal `C = N + B` is `V N + B`: noise falls, and `B` is the floor. Windowed and coarse-to-fine
//! estimates report `B`; for others it is [`SHARE`] of the covariance.
//!
//! Noise of consecutive estimates counts as independent. It is not: a pair shares one frame with the next, a
//! triple two. But shared frames enter with opposite signs (a difference's older frame is the newer one of
//! the difference before), so that errors are correlated negatively (down to -1/2, by
//! `tests/temporal/recursive.rs`), and the mean is better than its covariance says, never worse.
//!
//! # Motion that changes
//! *Innovation test.* `n = m_k - x_{k-1}` normalised by its covariance, `n^T S^-1 n`, has six degrees of
//! freedom while nothing changes. Beyond [`RESTART`] the pixel starts anew from `m_k`. *Drift.* The mean
//! innovation `n'` (memory of eight frames), normalised in the same way, shows slow change long before single
//! innovations do. Beyond [`FADE`] the memory is shortened by the square of the ratio (a variable forgetting
//! factor; T. Fortescue, L. Kershenbaum, B. Ydstie, 1981), and what exceeds chance of the lag `(1 - g) n'`
//! goes into the covariance as `d d^T`. A change smaller than an estimate's own noise is noticed late, and
//! until then the result lags behind by about that noise.
//!
//! # Pixels without an estimate
//! Where a time gives none (NaN, mask, no structure) only that time is lost: the state stays, its information
//! is forgotten, and the result is the prediction with status `Predicted`.
//!
//! `fusion` takes whole fields, `kernel` has one step for lanes of sites.

mod fusion;
mod kernel;
mod options;

pub use fusion::RecursiveFusion;
pub use kernel::{FADE, RESTART, SHARE};
pub use options::RecursiveOptions;
