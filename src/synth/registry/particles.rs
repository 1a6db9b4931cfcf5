//! Particle images.

use super::{CarrierKind, Parameter};
use crate::synth::{ParticleImages, ParticleLook};

pub(super) const KIND: CarrierKind = CarrierKind {
    name: "particles",
    summary: "Gaussian spots that keep their shape, as in particle image velocimetry",
    parameters: &[
        Parameter { name: "density", default: Some(0.05), meaning: "particles per px^2" },
        Parameter { name: "diameter", default: Some(2.8), meaning: "diameter at e^-2 of the peak, px" },
        Parameter { name: "peak", default: Some(200.0), meaning: "brightness of the brightest particle, grey levels" },
        Parameter { name: "spread", default: Some(0.6), meaning: "spread of peak brightness, 0 to 1" },
        Parameter { name: "background", default: Some(10.0), meaning: "brightness between particles, grey levels" },
    ],
    texture: None,
    carry: Some(|settings, motion| {
        let look = ParticleLook {
            density: settings.value("density"),
            diameter: settings.value("diameter"),
            peak: settings.value("peak"),
            spread: settings.value("spread"),
            background: settings.value("background"),
        };
        let (size, options) = (settings.size(), settings.options);
        Ok(Box::new(
            ParticleImages::new(size, options.origin, look, motion, options.random_state)?.named(settings.scene),
        ))
    }),
};
