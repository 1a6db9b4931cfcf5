//! The local 2-jet of brightness, `i = (I, Ix, Iy, Ixx, Ixy, Iyy)`, at a pixel.
//!
//! It is the least-squares quadratic through a neighbourhood (WO2010/098160, (32), (33) for 3x3; paragraph
//! 0081 for others). A rectangle of any size is computed separably, a free set of points directly. For white
//! pixel noise of variance s2 the jet's covariance is `s2 (B^T B)^-1`, B holding a row `[1, ex, ey, ex^2/2,
//! ex ey, ey^2/2]` for each offset `(ex, ey)`: with it the six numbers are a sufficient statistic of all the
//! pixels.
//!
//! ```
//! use jacoflow::jet::{JetStencil, Neighbourhood};
//! use jacoflow::types::Frame;
//! let frame = Frame::from_fn(5, 5, |x, y| (3 * x + 2 * x * y) as f64);
//! let stencil = JetStencil::new(&Neighbourhood::default(), (1.0, 1.0))?;
//! let jet = stencil.at(&frame, 2, 1);
//! assert!((jet[1] - 5.0).abs() < 1e-12 && (jet[4] - 2.0).abs() < 1e-12);
//! # Ok::<(), jacoflow::Error>(())
//! ```

mod neighbourhood;
mod planes;
mod rows;
mod separable;
mod stencil;
mod time;

pub use neighbourhood::Neighbourhood;
pub use planes::JetPlanes;
pub(crate) use rows::{JetRows, starts};
pub use stencil::{JetStencil, Reach};
pub use time::{JetRates, TimeScheme};
