//! Colour scenes of targets that look alike and hide each other before a moving camera.
//!
//! People and cars drawn from signed distances move over a textured world, which a camera that pans, shakes,
//! rolls and zooms looks at. All targets of a scene share one texture, and rectangles of the world have their
//! colours: neither colour nor texture alone distinguishes them. Lengths are those of a window of 720 x 480
//! px and are multiplied by the scale of [`TargetSceneOptions`].
//!
//! ```
//! use jacoflow::synth::targets::{TargetScene, TargetSceneOptions};
//! # fn main() -> jacoflow::Result<()> {
//! let options = TargetSceneOptions { scale: 0.25, ..TargetSceneOptions::default() };
//! let scene = TargetScene::new("people_static", options)?;
//! assert_eq!((scene.size(), scene.frame_count(), scene.target_count()), ((180, 120), 110, 2));
//! assert_eq!(scene.frame(3).size(), scene.size());
//! # Ok(())
//! # }
//! ```

mod camera;
mod list;
mod options;
mod path;
mod render;
mod scene;
mod shape;
mod sprite;
mod value_noise;
mod world;

pub use list::{SCENES, TargetSceneKind};
pub use options::TargetSceneOptions;
pub use scene::TargetScene;
