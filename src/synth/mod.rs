//! Moving scenes with exact truth: brightness, flow and Jacobian at every point and time.
//!
//! A scene is a function `I(x, y, t)`; a frame is that function at integer pixels. Most scenes are a
//! [`Texture`](texture::Texture) carried by a [`Motion`](motion::Motion): any of the one goes with any of the
//! other ([`Carried`]). Everything random comes from a seed through
//! [`CounterRng`](crate::math::random::CounterRng), so a scene is the same on any machine and number of
//! threads.

mod carried;
mod disc;
pub mod motion;
mod particles;
mod ramp;
pub mod registry;
mod scene;
mod sensor;
pub mod targets;
pub mod texture;
mod truth;

pub use carried::{AffineTexture, Carried};
pub use disc::{RotatingDisc, radians_per_frame};
pub use particles::{ParticleImages, ParticleLook};
pub use ramp::RotatingRamp;
pub use registry::{SceneOptions, build};
pub use scene::{Scene, check_time};
pub use sensor::{Rounding, Sensor};
pub use truth::{mean_truth, truth};
