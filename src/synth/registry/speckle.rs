//! Sprayed blobs.

use super::{CarrierKind, Parameter};
use crate::synth::texture::Speckle;

pub(super) const KIND: CarrierKind = CarrierKind {
    name: "speckle",
    summary: "dark blobs on a bright ground, as in strain measurement",
    parameters: &[
        Parameter { name: "radius", default: Some(2.5), meaning: "mean radius of a blob, px" },
        Parameter { name: "coverage", default: Some(0.5), meaning: "share of the ground that is covered" },
        Parameter { name: "edge", default: Some(1.5), meaning: "width of a blob's edge, px" },
        Parameter { name: "dark", default: Some(30.0), meaning: "brightness of a blob, grey levels" },
        Parameter { name: "bright", default: Some(220.0), meaning: "brightness of the ground, grey levels" },
    ],
    texture: Some(|settings, seed| {
        let levels = (settings.value("dark"), settings.value("bright"));
        let (radius, coverage, edge) = (settings.value("radius"), settings.value("coverage"), settings.value("edge"));
        Ok(Box::new(Speckle::new(radius, coverage, edge, levels, seed)?))
    }),
    carry: None,
};
