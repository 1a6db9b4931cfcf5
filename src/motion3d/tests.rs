//! Scenes of the unit tests: those of the tests of the public interface, whitened.

use super::model::input::{Noise, Placement};
use super::model::observations::Observations;
use super::model::whitening::Whitening;
use crate::{math, motion3d};

#[allow(dead_code)]
#[path = "../../tests/motion3d/scenes.rs"]
pub(crate) mod scenes;

impl scenes::Scene {
    pub fn observations(&self) -> Observations {
        Whitening::new(&self.flow(), &Noise::StandardDeviation(self.noise_std), Placement::Start).whitened()
    }
}
