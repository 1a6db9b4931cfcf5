//! The patent's turning ramp.

use super::{Make, Parameter, SceneKind};
use crate::synth::RotatingRamp;

pub(super) const KIND: SceneKind = SceneKind {
    name: "ramp",
    summary: "a brightness ramp turning about the scene's (0, 0): the patent's reference experiment",
    parameters: &[
        Parameter { name: "slope", default: Some(0.2), meaning: "slope of the ramp, grey levels/px" },
        Parameter {
            name: "angular_velocity",
            default: Some(std::f64::consts::PI / 100.0),
            meaning: "angular velocity, rad/frame",
        },
        Parameter { name: "offset", default: Some(128.0), meaning: "brightness at the centre, grey levels" },
    ],
    make: Make::Whole(|settings| {
        let (width, height) = settings.size();
        Ok(Box::new(RotatingRamp {
            width,
            height,
            origin: settings.options.origin,
            slope: settings.value("slope"),
            angular_velocity: settings.value("angular_velocity"),
            offset: settings.value("offset"),
        }))
    }),
};
