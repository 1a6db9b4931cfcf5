//! The windowed affine estimate with transport: the equations of WO2010/098160, (31)/(34), summed over a
//! Gaussian window.
//!
//! A pixel alone gives twelve equations for its six unknowns, `[J(i); J(i')] m = [i'; i'']`. A window gives
//! thousands, provided that the unknowns are *transported*: at the offset `(dx, dy)` from the centre the
//! affine motion is `m(p) = T m`, with `u + u_x dx + u_y dy`, `v + v_x dx + v_y dy` and the same Jacobian.
//! The estimate minimises `sum_p w(p) |A_p T_p m - b_p|^2`, `w` a Gaussian of [`WindowedOptions::sigma`],
//! `A_p`, `b_p` the rows of [`RowSet`], all of equal weight. Its normal matrix `sum w T^T A^T A T` consists
//! of the moments 1, dx, dy, dx^2, dx dy, dy^2 of products of jets, which are separable sums.
//!
//! There is no pyramid: motion should stay below a pixel a frame for fine texture (`docs/local_flow.md`).
//!
//! # Files, in the order of the data
//! `options`; `run` (crop, smoothing, strips, results to the field) with `support` (usable pixels) and
//! `combine` (frames to coefficients and time differences); `tile` (jets, product planes) with `equations`
//! (of a pixel) and `plan` (places of products and moments); `moments` (windows); `estimate` (and frames
//! carried along it) with `solve` (normal equations). The covariance: `noise` (how pixel noise enters the
//! equations), `scores` (its sums over windows) and `covariance` (noise, bias and curvature together).
//!
//! A weight of a row enters in `equations::products` (every product of the row), in `scores::Weigh` (once in
//! `own`, once in `through_second`) and in `noise::PixelNoise` (`residual`, `normal`); rows 2 and 3 share
//! planes and must weigh alike (`plan`). A set of rows needs its name in `options::RowSet`, planes in `plan`
//! and its number of rows in `run`.
//!
//! # Pixels without data
//! Samples that are NaN, infinite or masked invalidate every pixel whose jet (or smoothing) reaches them: NaN
//! with status `NonFinite` or `Masked`. Windows leave such pixels out and are normalised by the weight that
//! remains; below a tenth there is no estimate. At the frame's edge windows are cut off in the same way; only
//! pixels without a jet (a rim of one pixel for 3x3) get status `Border`. A pixel whose window reaches no
//! invalid pixel has the same bits as without them.

mod combine;
mod covariance;
mod equations;
mod estimate;
mod moments;
mod noise;
mod options;
mod plan;
mod run;
mod scores;
mod solve;
mod support;
mod tile;

pub use options::{RowSet, WindowedOptions};
pub(super) use run::Windowed;
