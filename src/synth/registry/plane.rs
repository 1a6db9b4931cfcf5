//! A surface that the camera runs into.

use super::{Make, Parameter, SceneKind};
use crate::error::Error;
use crate::synth::motion::Approach;

pub(super) const KIND: SceneKind = SceneKind {
    name: "plane",
    summary: "a fronto-parallel surface coming nearer at constant speed",
    parameters: &[
        Parameter {
            name: "time_to_contact",
            default: Some(60.0),
            meaning: "frames until contact at time 0; negative: drawing away",
        },
        Parameter {
            name: "focus_x",
            default: None,
            meaning: "x of the focus of expansion, px; the middle of the frame",
        },
        Parameter {
            name: "focus_y",
            default: None,
            meaning: "y of the focus of expansion, px; the middle of the frame",
        },
    ],
    make: Make::Motion(|settings| {
        let time_to_contact = settings.value("time_to_contact");
        if time_to_contact == 0.0 {
            return Err(Error::argument("time_to_contact", "a number of frames other than 0", time_to_contact));
        }
        Ok(Box::new(Approach { time_to_contact, focus_of_expansion: settings.point("focus_x", "focus_y") }))
    }),
};
