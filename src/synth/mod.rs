//! Moving scenes with exact truth: brightness, flow and Jacobian at every point and time.
//!
//! A scene is a function `I(x, y, t)`; a frame is that function at integer pixels. Everything random comes from a seed through
//! [`CounterRng`](crate::math::random::CounterRng), so a scene is the same on any machine and number of threads.

mod ramp;
mod scene;

pub use ramp::RotatingRamp;
pub use scene::{Scene, truth};
