//! Noise of the transition, and the other numbers in which the modes differ.

use super::{options::ParticleMode, options::ParticleOptions};

/// Radius within which targets are near each other, in standard deviations of the position along each axis
/// (equation (7) of the paper).
const NEAR: f64 = 6.0;

/// Noise of the transition and the start, in a picture of 480 rows: lengths in px, times in frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// Of the position, px.
    pub position: f64,
    /// Of the velocity, px/frame.
    pub velocity: f64,
    /// Of the logarithm of the size, common to both sides.
    pub size: f64,
    /// Of the logarithm of the aspect; `None`: the sides are independent.
    pub aspect: Option<f64>,
}

impl Noise {
    /// The noise of a mode at a length scale.
    pub fn of(mode: ParticleMode, scale: f64) -> Self {
        match mode {
            ParticleMode::Paper => Self { position: 6.5 * scale, velocity: 0.2 * scale, size: 0.01, aspect: None },
            ParticleMode::Improved => {
                Self { position: 4.0 * scale, velocity: 0.35 * scale, size: 0.01, aspect: Some(0.003) }
            }
        }
    }

    /// The noise that options ask for at a length scale.
    pub fn of_options(options: &ParticleOptions, scale: f64) -> Self {
        let noise = Self::of(options.mode, scale);
        if options.uses("particle.aspect") { noise } else { Self { aspect: None, ..noise } }
    }

    /// All of it multiplied by a factor.
    pub fn times(self, factor: f64) -> Self {
        Self {
            position: factor * self.position,
            velocity: factor * self.velocity,
            size: factor * self.size,
            aspect: self.aspect.map(|aspect| factor * aspect),
        }
    }
}

/// Distance up to which targets are near each other, and parts of the foreground belong to a target, px.
pub(super) fn near_radius(scale: f64) -> f64 {
    NEAR * std::f64::consts::SQRT_2 * Noise::of(ParticleMode::Paper, scale).position
}

/// Weight of the colour similarity in the log-likelihood, no unit.
pub(super) fn colour_gain(mode: ParticleMode) -> f64 {
    match mode {
        ParticleMode::Paper => 12.0,
        ParticleMode::Improved => 15.0,
    }
}
