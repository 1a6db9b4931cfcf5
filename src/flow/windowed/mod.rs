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
//! There is no pyramid: motion should stay below about a pixel a frame for fine texture. Equations, rows and
//! what the covariance holds: `docs/local_flow.md`.
//!
//! # Files, in the order of the data
//! `options`; `run` (crop, smoothing, strips of rows) with `support` (usable pixels) and `combine` (frames to
//! coefficients and time differences); `tile` (jets, product planes, moments) with `rows` (products of the
//! equations) and `window` (weights); `estimate` with `solve` (normal equations, status) and
//! `rounding_floor` (what rounding leaves of an even image); `results` (to the field).
//! The covariance: `noise_setting` and `noise` (how pixel noise enters the equations), `jet_matrix` (their
//! matrix as a function of the jet), `high_frequencies` (the noise of the frames), `truncation` and
//! `bias_planes` (biases of the equations and of flow that is not affine), `covariance` with
//! `covariance_kernels` (sums over windows), `sandwich` (one row of covariances), `noise_dominated`
//! (directions that only noise determines). `rows`, `noise`, `bias_planes` and `covariance` take all rows to
//! have the same weight.
//!
//! # Pixels without data
//! Samples that are NaN, infinite or masked invalidate every pixel whose jet (or smoothing) reaches them: NaN
//! with status `NonFinite` or `Masked`. Windows leave such pixels out and are normalised by the weight that
//! remains; below a tenth there is no estimate. At the frame's edge windows are cut off in the same way; only
//! pixels without a jet (a rim of one pixel for 3x3) get status `Border`. A pixel whose window reaches no
//! invalid pixel has the same bits as without them.

mod bias_planes;
mod combine;
mod covariance;
mod covariance_kernels;
mod estimate;
mod high_frequencies;
mod jet_matrix;
mod noise;
mod noise_dominated;
mod noise_setting;
mod options;
mod results;
mod rounding_floor;
mod rows;
mod run;
mod sandwich;
mod solve;
mod support;
mod tile;
mod truncation;
mod window;

pub use options::{RowSet, WindowedOptions};
pub(super) use run::Windowed;
