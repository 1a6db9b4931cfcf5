//! Smooth random motion of one scale.

use super::{Make, Parameter, SceneKind};
use crate::synth::motion::Waves;

pub(super) const KIND: SceneKind = SceneKind {
    name: "waves",
    summary: "a smooth random velocity field of one wavelength, with divergence and curl",
    parameters: &[
        Parameter { name: "speed", default: Some(1.0), meaning: "root-mean-square speed, px/frame" },
        Parameter {
            name: "wavelength",
            default: Some(64.0),
            meaning: "length of the waves, px; each within a factor 1.2",
        },
    ],
    make: Make::Motion(|settings| {
        // Not the carrier's own stream of random numbers.
        let seed = settings.options.random_state.wrapping_add(0x3a7e);
        Ok(Box::new(Waves::new(settings.value("speed"), settings.positive("wavelength")?, seed)))
    }),
};
