//! What a motion can carry: each is a constant and a name in [`CARRIERS`].

use super::{CarrierKind, number};
use crate::synth::texture::{Noise, Speckle};
use crate::synth::{ParticleImages, ParticleLook};

/// Everything that a motion can carry, by name. The first is the default.
pub const CARRIERS: &[CarrierKind] = &[NOISE, SPECKLE, PARTICLES];

/// Band-limited noise.
const NOISE: CarrierKind = CarrierKind {
    name: "noise",
    summary: "Gaussian-filtered white noise",
    parameters: &[
        number("sigma", Some(2.0), "standard deviation of the Gaussian filter, px"),
        number("std", Some(40.0), "standard deviation of brightness, grey levels"),
        number("mean", Some(128.0), "mean brightness, grey levels"),
    ],
    texture: Some(|settings, seed| {
        let (sigma, std, mean) = (settings.value("sigma"), settings.value("std"), settings.value("mean"));
        Ok(Box::new(Noise::new(sigma, std, mean, seed)?))
    }),
    carry: None,
};

/// Sprayed blobs.
const SPECKLE: CarrierKind = CarrierKind {
    name: "speckle",
    summary: "dark blobs on a bright ground, as in strain measurement",
    parameters: &[
        number("radius", Some(2.5), "mean radius of a blob, px"),
        number("coverage", Some(0.5), "share of the ground that is covered"),
        number("edge", Some(1.5), "width of a blob's edge, px"),
        number("dark", Some(30.0), "brightness of a blob, grey levels"),
        number("bright", Some(220.0), "brightness of the ground, grey levels"),
    ],
    texture: Some(|settings, seed| {
        let levels = (settings.value("dark"), settings.value("bright"));
        let (radius, coverage, edge) = (settings.value("radius"), settings.value("coverage"), settings.value("edge"));
        Ok(Box::new(Speckle::new(radius, coverage, edge, levels, seed)?))
    }),
    carry: None,
};

/// Particle images.
const PARTICLES: CarrierKind = CarrierKind {
    name: "particles",
    summary: "Gaussian spots that keep their shape, as in particle image velocimetry",
    parameters: &[
        number("density", Some(0.05), "particles per px^2"),
        number("diameter", Some(2.8), "diameter at e^-2 of the peak, px"),
        number("peak", Some(200.0), "brightness of the brightest particle, grey levels"),
        number("spread", Some(0.6), "spread of peak brightness, 0 to 1"),
        number("background", Some(10.0), "brightness between particles, grey levels"),
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
        Ok(Box::new(ParticleImages::new(size, options.origin, look, motion, options.random_state)?))
    }),
};
