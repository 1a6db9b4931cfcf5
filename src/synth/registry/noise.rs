//! Band-limited noise.

use super::{CarrierKind, Parameter};
use crate::synth::texture::Noise;

pub(super) const KIND: CarrierKind = CarrierKind {
    name: "noise",
    summary: "Gaussian-filtered white noise",
    parameters: &[
        Parameter { name: "sigma", default: Some(2.0), meaning: "standard deviation of the Gaussian filter, px" },
        Parameter { name: "std", default: Some(40.0), meaning: "standard deviation of brightness, grey levels" },
        Parameter { name: "mean", default: Some(128.0), meaning: "mean brightness, grey levels" },
    ],
    texture: Some(|settings, seed| {
        let (sigma, std, mean) = (settings.value("sigma"), settings.value("std"), settings.value("mean"));
        Ok(Box::new(Noise::new(sigma, std, mean, seed)?))
    }),
    carry: None,
};
