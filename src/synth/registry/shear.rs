//! Layers sliding over each other.

use super::{Make, Parameter, SceneKind};
use crate::synth::motion::SinusoidalShear;

pub(super) const KIND: SceneKind = SceneKind {
    name: "shear",
    summary: "parallel layers whose speed along x is a sine of y",
    parameters: &[
        Parameter { name: "speed", default: Some(1.0), meaning: "greatest speed, px/frame" },
        Parameter { name: "wavelength", default: Some(64.0), meaning: "distance after which layers repeat, px" },
        Parameter { name: "phase", default: Some(0.0), meaning: "y of a layer at rest, px" },
    ],
    make: Make::Motion(|settings| {
        Ok(Box::new(SinusoidalShear {
            speed: settings.value("speed"),
            wavelength: settings.positive("wavelength")?,
            phase: settings.value("phase"),
        }))
    }),
};
