//! A turning disc before a ground at rest.

use super::{Make, Parameter, SceneKind};
use crate::synth::{RotatingDisc, radians_per_frame};

pub(super) const KIND: SceneKind = SceneKind {
    name: "disc",
    summary: "a textured disc turning before a textured ground at rest",
    parameters: &[
        Parameter { name: "rpm", default: Some(30.0), meaning: "turns a minute, clockwise on the screen" },
        Parameter { name: "fps", default: Some(60.0), meaning: "frames a second" },
        Parameter { name: "disc_radius", default: None, meaning: "radius, px; 0.4 of the frame's shorter side" },
        Parameter { name: "rim", default: Some(2.0), meaning: "distance from the edge without truth, px" },
        Parameter { name: "centre_x", default: None, meaning: "the axis' x, px; the middle of the frame" },
        Parameter { name: "centre_y", default: None, meaning: "the axis' y, px; the middle of the frame" },
    ],
    make: Make::Textured(|settings, texture| {
        let (width, height) = settings.size();
        let radius = if settings.value("disc_radius").is_nan() {
            0.4 * width.min(height) as f64
        } else {
            settings.positive("disc_radius")?
        };
        let seed = settings.options.random_state;
        Ok(Box::new(RotatingDisc {
            size: (width, height),
            origin: settings.options.origin,
            centre: settings.point("centre_x", "centre_y"),
            radius,
            rim: settings.value("rim"),
            angular_velocity: radians_per_frame(settings.value("rpm"), settings.positive("fps")?),
            disc: texture(seed)?,
            ground: texture(seed.wrapping_add(1))?,
        }))
    }),
};
