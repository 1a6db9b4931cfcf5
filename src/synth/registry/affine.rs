//! A steady affine velocity field.

use super::{Make, Parameter, SceneKind};
use crate::synth::motion::AffineField;

pub(super) const KIND: SceneKind = SceneKind {
    name: "affine",
    summary: "steady affine motion: translation, rotation, expansion and shear in any mixture",
    parameters: &[
        Parameter { name: "u", default: Some(0.3), meaning: "flow along x at the centre, px/frame" },
        Parameter { name: "v", default: Some(-0.2), meaning: "flow along y at the centre, px/frame" },
        Parameter { name: "u_x", default: Some(0.01), meaning: "du/dx, 1/frame" },
        Parameter { name: "v_x", default: Some(0.02), meaning: "dv/dx, 1/frame" },
        Parameter { name: "u_y", default: Some(-0.02), meaning: "du/dy, 1/frame" },
        Parameter { name: "v_y", default: Some(0.01), meaning: "dv/dy, 1/frame" },
        Parameter { name: "centre_x", default: None, meaning: "the centre's x, px; the middle of the frame" },
        Parameter { name: "centre_y", default: None, meaning: "the centre's y, px; the middle of the frame" },
    ],
    make: Make::Motion(|settings| {
        let motion = crate::types::MOTION_NAMES.map(|name| settings.value(name));
        Ok(Box::new(AffineField::new(motion, settings.point("centre_x", "centre_y"))))
    }),
};
