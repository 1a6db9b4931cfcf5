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
//! Described in the `covariance` part: first-order propagation of white pixel noise through smoothing, stencils and window, the noise of the coefficients included. On
//! textures of 1.5 to 3 px with 1 to 4 grey levels of noise, windows of 3 to 6 px and smoothing of 0 to 2 px the normalised
//! error squared of the six parameters about their mean is 5 to 7. What discretisation adds is a bias that no noise model knows: with a known, small noise on
//! fine texture (below about 1.5 grey levels of noise, or texture below 2 px) it dominates. Estimating the noise from the residual, the default,
//! covers most of it, since the misfit shows there too.
//!
//! # Which rows
//! Measured at a single level on sequences with known flow of less than a pixel a frame (Middlebury, Yosemite, particle images, speckle; and the same reduced to a
//! quarter): rows 1-3 were best or near best everywhere in both flow and Jacobian, hence the default. Row 1 alone costs a third and is biased by a few
//! per cent on fine texture, because brightness and its gradient are smoothed differently by the same stencil. All twelve rows are best on clean band-limited
//! texture. Smoothing by 1 px halves the error where motion or noise are large.

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
