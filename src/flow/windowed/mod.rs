//! The windowed affine estimate with transport: the equations of WO2010/098160, (31)/(34), summed over a Gaussian window.
//!
//! A pixel alone gives twelve equations for its six unknowns, `[J(i); J(i')] m = [i'; i'']`, and on busy texture they are poor. A window gives
//! thousands, provided that the unknowns are *transported*: at the offset `(dx, dy)` from the centre the affine motion is
//! `m(p) = T m`, with `u + u_x dx + u_y dy`, `v + v_x dx + v_y dy` and the same Jacobian. The estimate minimises
//! `sum_p w(p) |A_p T_p m - b_p|^2`, w a Gaussian of [`WindowedOptions::sigma`], `A_p`, `b_p` the rows chosen by [`RowSet`]; all rows weigh the same. Its normal matrix
//! `sum w T^T A^T A T` consists of the moments 1, dx, dy, dx^2, dx dy, dy^2 of products of jets, which are separable sums.
//!
//! Motion should stay below about a pixel a frame for fine texture, or below the texture's own scale: there is no pyramid here.
//!
//! # Pixels without data
//! Samples that are NaN, infinite or masked out take with them every pixel whose jet (or smoothing) touches them: those have no
//! equations of their own, get NaN and status `NonFinite` or `Masked`. Windows leave such pixels out and go on with the rest, normalised by the weight
//! that remains; below [`WindowedOptions::min_weight`] there is no estimate. At the frame's edge windows are cut off in the same way; only pixels that
//! have no jet themselves (a rim of one pixel for 3x3) get status `Border`. A pixel whose window touches nothing damaged has
//! the same bits as without the damage.
//!
//! # Covariance
//! First-order propagation of white pixel noise through smoothing, stencils and window, noise of the coefficients included, and beside it the outer product
//! of the biases that can be foreseen: the pull of that noise towards zero, and what truncation does to this image under the motion found (third and fourth
//! derivatives, the difference in time, smoothing under strain), to leading order. The noise is [`Common::noise`](crate::flow::Common::noise) or read from the highest frequencies of the
//! frames, where motion hardly shows; a residual far beyond noise and truncation, as at motion boundaries, widens the covariance.
//!
//! Measured: the normalised error squared of the six parameters against the truth, over noise realisations (6 is exact). Textures of 2 and 3 px with 1, 2 and 4 grey levels of noise, rounded to
//! whole grey levels; windows of 3, 4 and 6 px; 1, 3 and 12 rows; motion of 0.1 to 0.6 px/frame; a mean over 8 realisations of 64 pixels a case, which is uncertain by about 0.3.
//! Smoothed by 0.7 to 2 px, 446 of 486 cases lie between 5 and 7.5 with the noise known and 431 with the noise from the frames. Windows of 4 and 6 px stay between 4.8 and 7.6;
//! those of 3 px reach 9.3 (known) and 9.9, most with 12 rows and smoothing by 1.5 px and more, as wide as the window. Without smoothing row 1 is at 4.9 to 6.8.
//!
//! Not covered: rows that use second derivatives of raw frames where noise is a large part of those (4 grey levels on these textures with 3 rows, 2 with 12: up to 23); edges as sharp as a
//! pixel, whose higher derivatives say nothing about them (speckle and particles of 3 px: 6 to 45 with the noise known, 3 to 15 from the frames, the squared bias
//! being 0.4 to 58 times the variance); motion boundaries, lighting, flow that is not affine in the window.
//!
//! # Which rows
//! Measured at a single level where the known flow is below a pixel a frame (Middlebury, Yosemite, particle images, speckle, pairs and triples; and all but the speckle again
//! reduced to a quarter), frames smoothed by 1 px, window 4 px: rows 1-3 gave the least mean error or one within a sixth of the least, in flow and Jacobian; hence the
//! default. Row 1 alone is the cheapest and 1.0 to 2.6 times as far off, for one thing because a stencil smooths brightness less than its
//! gradient. Twelve rows were best on Yosemite (by a sixth) and are best on band-limited texture (by half); they need three frames.
//! Smoothing by 1 px took the error of rows 1-3 to 0.3-0.9 times that of raw frames on most of these, and to 1.2-1.4 times on
//! speckle and one Middlebury pair.

mod combine;
mod covariance;
mod covariance_kernels;
mod detail;
mod estimate;
mod floor;
mod misfit;
mod noise;
mod options;
mod rows;
mod run;
mod solve;
mod support;
mod tile;
mod window;

pub use options::{RowSet, WindowedOptions};
pub(super) use run::Windowed;
