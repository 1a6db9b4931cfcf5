//! Frozen turbulence.

use super::{Make, Parameter, SceneKind};
use crate::synth::motion::Turbulence;

pub(super) const KIND: SceneKind = SceneKind {
    name: "turbulence",
    summary: "a random velocity field without divergence, energy spectrum k^(-5/3)",
    parameters: &[
        Parameter { name: "speed", default: Some(1.0), meaning: "root-mean-square speed, px/frame" },
        Parameter {
            name: "longest",
            default: Some(128.0),
            meaning: "longest wave, px; the shortest is an eighth of it",
        },
    ],
    make: Make::Motion(|settings| {
        // Not the carrier's own stream of random numbers.
        let seed = settings.options.random_state.wrapping_add(0x5eed);
        Ok(Box::new(Turbulence::new(settings.value("speed"), settings.positive("longest")?, seed)))
    }),
};
