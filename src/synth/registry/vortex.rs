//! A Lamb-Oseen vortex.

use super::{Make, Parameter, SceneKind};
use crate::synth::motion::LambOseen;

pub(super) const KIND: SceneKind = SceneKind {
    name: "vortex",
    summary: "a Lamb-Oseen vortex, at rest or drifting",
    parameters: &[
        Parameter {
            name: "circulation",
            default: Some(400.0),
            meaning: "circulation, px^2/frame, clockwise on the screen",
        },
        Parameter { name: "core", default: Some(25.0), meaning: "core radius, px" },
        Parameter { name: "centre_x", default: None, meaning: "the centre's x at time 0, px; the middle of the frame" },
        Parameter { name: "centre_y", default: None, meaning: "the centre's y at time 0, px; the middle of the frame" },
        Parameter { name: "drift_x", default: Some(0.0), meaning: "drift along x, px/frame" },
        Parameter { name: "drift_y", default: Some(0.0), meaning: "drift along y, px/frame" },
    ],
    make: Make::Motion(|settings| {
        Ok(Box::new(LambOseen {
            circulation: settings.value("circulation"),
            core: settings.positive("core")?,
            centre: settings.point("centre_x", "centre_y"),
            drift: (settings.value("drift_x"), settings.value("drift_y")),
        }))
    }),
};
