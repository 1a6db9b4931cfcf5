//! The windowed affine estimate with transport: the equations of WO2010/098160, (31)/(34), summed over a
//! Gaussian window.
//!
//! A pixel alone gives twelve equations for its six unknowns, `[J(i); J(i')] m = [i'; i'']`, and on busy
//! texture they are poor. A window gives thousands, provided that the unknowns are *transported*: at the
//! offset `(dx, dy)` from the centre the affine motion is `m(p) = T m`, with `u + u_x dx + u_y dy`, `v + v_x
//! dx + v_y dy` and the same Jacobian. The estimate minimises `sum_p w(p) |A_p T_p m - b_p|^2`, w a Gaussian
//! of [`WindowedOptions::sigma`], `A_p`, `b_p` the rows chosen by [`RowSet`]; all rows weigh the same. Its
//! normal matrix `sum w T^T A^T A T` consists of the moments 1, dx, dy, dx^2, dx dy, dy^2 of products of
//! jets, which are separable sums.
//!
//! Motion should stay below about a pixel a frame for fine texture, or below the texture's own scale: there
//! is no pyramid here.
//!
//! # Pixels without data
//! Samples that are NaN, infinite or masked out take with them every pixel whose jet (or smoothing) touches
//! them: those have no equations of their own, get NaN and status `NonFinite` or `Masked`. Windows leave such
//! pixels out and go on with the rest, normalised by the weight that remains; below
//! [`WindowedOptions::min_weight`] there is no estimate. At the frame's edge windows are cut off in the same
//! way; only pixels that have no jet themselves (a rim of one pixel for 3x3) get status `Border`. A pixel
//! whose window touches nothing damaged has the same bits as without the damage.
//!
//! # Covariance
//! First-order propagation of white pixel noise through smoothing, stencils and window, noise of the
//! coefficients included, and beside it the outer products of the biases that can be foreseen: the pull of
//! that noise towards zero with what truncation does to this image under the motion found (third and fourth
//! derivatives, the difference in time, smoothing under strain), and the smoothing of flow that is not affine
//! in the window, all to leading order. The noise is [`EstimatorOptions::noise`](crate::flow::EstimatorOptions::noise) or read
//! from the highest frequencies of the frames, where motion hardly shows; then a residual beyond noise and
//! truncation, as at motion boundaries, widens the covariance. Directions that only noise seems to determine
//! get the wide deviation that they deserve.
//!
//! Measured (`calibration_over_every_setting` of the tests): the normalised error squared of the six
//! parameters against the truth, over noise realisations (6 is exact). Textures of 2 and 3 px with 1, 2 and 4
//! grey levels of noise, rounded to whole grey levels; windows of 3, 4 and 6 px; 1, 3 and 12 rows; motion of
//! 0.1 to 0.6 px/frame; a mean over 8 realisations of 64 pixels a case, which is uncertain by about 0.3.
//! Smoothed by 0.7 to 2 px, all 432 cases lie between 4.3 and 7.3 with the noise known and between 3.7 and
//! 7.2 with the noise from the frames; the low ones are those smoothed most. Without smoothing row 1 is at
//! 4.7 to 6.2; rows that use second derivatives of raw frames, of which noise is a large part, reach 12.8.
//!
//! With the noise known, edges as sharp as a pixel (speckle and particles of 3 px) and curved flow are not
//! covered; from the frames the residual covers them.
//!
//! # Which rows
//! Measured at a single level where the known flow is below a pixel a frame (Middlebury, Yosemite, particle
//! images, speckle, pairs and triples; and all but the speckle again reduced to a quarter), frames smoothed
//! by 1 px, window 4 px: rows 1-3 gave the least mean error or one within a sixth of the least, in flow and
//! Jacobian; hence the default. Row 1 alone is the cheapest and 1.0 to 2.6 times as far off, for one thing
//! because a stencil smooths brightness less than its gradient. Twelve rows were best on Yosemite (by a
//! sixth) and are best on band-limited texture (by half); they need three frames. Smoothing by 1 px took the
//! error of rows 1-3 to 0.3-0.9 times that of raw frames on most of these, and to 1.2-1.4 times on speckle
//! and one Middlebury pair.

mod combine;
mod covariance;
mod covariance_kernels;
mod detail;
mod estimate;
mod floor;
mod hidden;
mod misfit;
mod misfit_planes;
mod noise;
mod noise_setting;
mod options;
mod results;
mod rows;
mod run;
mod sandwich;
mod solve;
mod sound;
mod support;
mod tile;
mod window;

pub use options::{RowSet, WindowedOptions};
pub(super) use run::Windowed;
