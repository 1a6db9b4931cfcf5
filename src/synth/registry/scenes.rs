//! The scenes: each is a constant and a name in [`SCENES`].

use super::{Make, SceneKind, number};
use crate::error::Error;
use crate::synth::motion::{AffineField, Approach, LambOseen, SinusoidalShear, Turbulence, Waves};
use crate::synth::{RotatingDisc, RotatingRamp, radians_per_frame};

/// Every scene, by name.
pub const SCENES: &[SceneKind] = &[RAMP, AFFINE, PLANE, DISC, VORTEX, SHEAR, TURBULENCE, WAVES];

/// The patent's turning ramp.
const RAMP: SceneKind = SceneKind {
    name: "ramp",
    summary: "a brightness ramp turning about the scene's (0, 0): the patent's reference experiment",
    parameters: &[
        number("slope", Some(0.2), "slope of the ramp, grey levels/px"),
        number("angular_velocity", Some(std::f64::consts::PI / 100.0), "angular velocity, rad/frame"),
        number("offset", Some(128.0), "brightness at the centre, grey levels"),
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

/// A steady affine velocity field.
const AFFINE: SceneKind = SceneKind {
    name: "affine",
    summary: "steady affine motion: translation, rotation, expansion and shear in any mixture",
    parameters: &[
        number("u", Some(0.3), "flow along x at the centre, px/frame"),
        number("v", Some(-0.2), "flow along y at the centre, px/frame"),
        number("u_x", Some(0.01), "du/dx, 1/frame"),
        number("v_x", Some(0.02), "dv/dx, 1/frame"),
        number("u_y", Some(-0.02), "du/dy, 1/frame"),
        number("v_y", Some(0.01), "dv/dy, 1/frame"),
        number("centre_x", None, "the centre's x, px; the middle of the frame"),
        number("centre_y", None, "the centre's y, px; the middle of the frame"),
    ],
    make: Make::Motion(|settings| {
        let motion = crate::types::MOTION_NAMES.map(|name| settings.value(name));
        Ok(Box::new(AffineField::new(motion, settings.point("centre_x", "centre_y"))))
    }),
};

/// A surface that the camera runs into.
const PLANE: SceneKind = SceneKind {
    name: "plane",
    summary: "a fronto-parallel surface coming nearer at constant speed",
    parameters: &[
        number("time_to_contact", Some(60.0), "frames until contact at time 0; negative: drawing away"),
        number("focus_x", None, "x of the focus of expansion, px; the middle of the frame"),
        number("focus_y", None, "y of the focus of expansion, px; the middle of the frame"),
    ],
    make: Make::Motion(|settings| {
        let time_to_contact = settings.value("time_to_contact");
        if time_to_contact == 0.0 {
            return Err(Error::argument("time_to_contact", "a number of frames other than 0", time_to_contact));
        }
        Ok(Box::new(Approach { time_to_contact, focus_of_expansion: settings.point("focus_x", "focus_y") }))
    }),
};

/// A turning disc before a ground at rest.
const DISC: SceneKind = SceneKind {
    name: "disc",
    summary: "a textured disc turning before a textured ground at rest",
    parameters: &[
        number("rpm", Some(30.0), "turns a minute, clockwise on the screen"),
        number("fps", Some(60.0), "frames a second"),
        number("disc_radius", None, "radius, px; 0.4 of the frame's shorter side"),
        number("rim", Some(2.0), "distance from the edge without truth, px"),
        number("centre_x", None, "the axis' x, px; the middle of the frame"),
        number("centre_y", None, "the axis' y, px; the middle of the frame"),
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

/// A Lamb-Oseen vortex.
const VORTEX: SceneKind = SceneKind {
    name: "vortex",
    summary: "a Lamb-Oseen vortex, at rest or drifting",
    parameters: &[
        number("circulation", Some(400.0), "circulation, px^2/frame, clockwise on the screen"),
        number("core", Some(25.0), "core radius, px"),
        number("centre_x", None, "the centre's x at time 0, px; the middle of the frame"),
        number("centre_y", None, "the centre's y at time 0, px; the middle of the frame"),
        number("drift_x", Some(0.0), "drift along x, px/frame"),
        number("drift_y", Some(0.0), "drift along y, px/frame"),
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

/// Layers sliding over each other.
const SHEAR: SceneKind = SceneKind {
    name: "shear",
    summary: "parallel layers whose speed along x is a sine of y",
    parameters: &[
        number("speed", Some(1.0), "greatest speed, px/frame"),
        number("wavelength", Some(64.0), "distance after which layers repeat, px"),
        number("phase", Some(0.0), "y of a layer at rest, px"),
    ],
    make: Make::Motion(|settings| {
        Ok(Box::new(SinusoidalShear {
            speed: settings.value("speed"),
            wavelength: settings.positive("wavelength")?,
            phase: settings.value("phase"),
        }))
    }),
};

/// Frozen turbulence.
const TURBULENCE: SceneKind = SceneKind {
    name: "turbulence",
    summary: "a random velocity field without divergence, energy spectrum k^(-5/3)",
    parameters: &[
        number("speed", Some(1.0), "root-mean-square speed, px/frame"),
        number("longest", Some(128.0), "longest wave, px; the shortest is an eighth of it"),
    ],
    make: Make::Motion(|settings| {
        // Not the carrier's own stream of random numbers.
        let seed = settings.options.random_state.wrapping_add(0x5eed);
        Ok(Box::new(Turbulence::new(settings.value("speed"), settings.positive("longest")?, seed)))
    }),
};

/// Smooth random motion of one scale.
const WAVES: SceneKind = SceneKind {
    name: "waves",
    summary: "a smooth random velocity field of one wavelength, with divergence and curl",
    parameters: &[
        number("speed", Some(1.0), "root-mean-square speed, px/frame"),
        number("wavelength", Some(64.0), "length of the waves, px; each within a factor 1.2"),
    ],
    make: Make::Motion(|settings| {
        // Not the carrier's own stream of random numbers.
        let seed = settings.options.random_state.wrapping_add(0x3a7e);
        let (speed, wavelength) = (settings.value("speed"), settings.positive("wavelength")?);
        if speed.abs() > Waves::MAX_SPEED * wavelength {
            let expected = format!("at most {} wavelengths a frame", Waves::MAX_SPEED);
            return Err(Error::argument("speed", expected, format!("{speed} px/frame for waves of {wavelength} px")));
        }
        Ok(Box::new(Waves::new(speed, wavelength, seed)))
    }),
};
