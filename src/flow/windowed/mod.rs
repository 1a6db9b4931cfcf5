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
//! First-order propagation of white pixel noise through smoothing, stencils and window, noise of the coefficients included; the noise itself
//! is [`Common::noise`](crate::flow::Common::noise) or comes from the residual. Measured on textures of 2 and 3 px with 2 and 4 grey levels of noise, rounded to whole grey
//! levels, windows of 3 to 6 px: the normalised error squared of the six parameters about their mean over noise realisations is 5 to 6.3 (6 is exact) with the noise
//! known, for every row set, smoothed by 0.7 to 2 px or not. Against the truth it is 5 to 7.2 while motion is slow (0.1 px/frame), with the noise from the residual as well.
//!
//! What discretisation adds is a bias that no noise model knows. At 0.3 px/frame and more it shows: 5.3 to 8.4 with the noise known and smoothing, 4.7 to 5.9
//! with the noise from the residual, where the misfit shows too and widens the covariance. It dominates (8 to 20) without smoothing, most for the rows
//! that use second derivatives, whose coefficients are then mostly noise ([`RowSet::Jet`], [`RowSet::All`] with 4 grey levels), and wherever a noise of about a
//! grey level or less is declared on texture of 2 px or finer. Smooth, or leave the noise to the residual.
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
mod estimate;
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
