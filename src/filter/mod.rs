//! Linear, extended and unscented Kalman filters and a particle filter, over batches of states.
//!
//! Names follow the literature and `filterpy`: `x`, `P`, `Q`, `R`, [`predict`](UnscentedFilter::predict),
//! [`update`](UnscentedFilter::update), residual `y`, its covariance `S`, gain `K`, `log_likelihood`. Every
//! array carries a leading batch axis and is row-major: `x` is `(B, n)`, `P` is `(B, n, n)`. A callback
//! receives the whole batch at once, so that one vectorised function call serves every state and every sigma
//! point.
//!
//! Means, covariances and noise that are not finite, symmetric and positive semi-definite are refused by name
//! at every step. Covariances stay so: every step works on their roots (`update`, `moments`), and one that an
//! unscented transform makes indefinite is repaired and counted in [`GaussianState::repairs`]. A state that
//! cannot make a step is left as it was and marked in [`GaussianState::failed`]; the batch goes on.
//!
//! `state` (with `update`, `failures`, `checks`) is what `kalman`, `extended` and `unscented` (with
//! `sigma_points` and `moments`) share, `smoother` too; a [`Manifold`] subtracts and averages angles.
//! [`particle`] stands alone. [`update_by_scalar`] serves small states on the stack.
//!
//! ```
//! use jacoflow::filter::{SigmaPoints, UnscentedFilter};
//! # fn main() -> jacoflow::Result<()> {
//! // A pendulum (angle, angular velocity), of which the sine of the angle is measured.
//! let mut ukf = UnscentedFilter::new(1, 2, 1, SigmaPoints::default())?;
//! ukf.Q = vec![1e-6, 0.0, 0.0, 1e-4];
//! ukf.R = vec![0.01];
//! for k in 0..50 {
//!     ukf.predict(|points, next| {
//!         for (p, q) in points.chunks_exact(2).zip(next.chunks_exact_mut(2)) {
//!             q.copy_from_slice(&[p[0] + 0.1 * p[1], p[1] - 0.1 * p[0].sin()]);
//!         }
//!         Ok(())
//!     })?;
//!     let z = (0.1 * f64::from(k)).cos() * 0.5;
//!     ukf.update(&[z], |points, out| {
//!         for (p, z) in points.chunks_exact(2).zip(out) {
//!             *z = p[0].sin();
//!         }
//!         Ok(())
//!     })?;
//! }
//! assert!(ukf.P[0] > 0.0 && ukf.x[0].is_finite());
//! # Ok(())
//! # }
//! ```

mod checks;
mod extended;
mod failures;
mod kalman;
mod manifold;
mod moments;
pub mod particle;
mod sigma_points;
mod smoother;
mod state;
mod unscented;
mod update;

pub use checks::{check_covariances, check_dimension, check_mean};
pub use extended::ExtendedFilter;
pub use kalman::{KalmanFilter, update_by_scalar};
pub use manifold::{Manifold, Vectors};
pub use sigma_points::SigmaPoints;
pub use smoother::Smoothed;
pub use state::GaussianState;
pub use unscented::UnscentedFilter;
