//! The camera's path and how it projects the world.

use crate::math::random::CounterRng;
use std::f64::consts::{SQRT_2, TAU};

/// Periods of the hand's shake, frames. No two of them share a multiple within a scene.
const SHAKE_PERIODS: [f64; 3] = [7.3, 11.1, 17.7];
/// Period of the pan along y over that along x.
const PAN_RATIO: f64 = 0.7;

/// How a camera moves. Lengths at scale 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CameraMotion {
    /// Amplitudes of the pan along x and y, px.
    pub pan: (f64, f64),
    /// Its period along x, frames.
    pub pan_period: f64,
    /// Root mean square of the shake along each axis, px.
    pub shake: f64,
    /// Magnification in the first and the last frame; it grows exponentially.
    pub zoom: (f64, f64),
    /// Amplitude of the roll, degrees.
    pub roll: f64,
    /// Its period, frames.
    pub roll_period: f64,
}

impl CameraMotion {
    /// A camera on a tripod.
    pub(super) const STATIC: Self =
        Self { pan: (0.0, 0.0), pan_period: 100.0, shake: 0.0, zoom: (1.0, 1.0), roll: 0.0, roll_period: 80.0 };
    /// A camera in the hand that pans widely.
    pub(super) const HANDHELD: Self =
        Self { pan: (60.0, 18.0), pan_period: 110.0, shake: 2.0, roll: 0.4, roll_period: 40.0, ..Self::STATIC };
    /// A camera in a calmer hand.
    pub(super) const CALM: Self =
        Self { pan: (40.0, 12.0), pan_period: 110.0, shake: 1.5, roll: 0.4, roll_period: 40.0, ..Self::STATIC };

    /// The camera's pose in each of `frames` frames.
    pub(super) fn poses(&self, rng: CounterRng, frames: usize, scale: f64) -> Vec<Pose> {
        let phase = |period: usize, axis: usize| TAU * rng.uniform((2 * period + axis) as u64);
        let phases: [[f64; 2]; 3] = std::array::from_fn(|period| [phase(period, 0), phase(period, 1)]);
        let amplitude = self.shake * SQRT_2 / (SHAKE_PERIODS.len() as f64).sqrt();
        let last = frames.saturating_sub(1).max(1) as f64;
        let pose = |frame: usize| {
            let t = frame as f64;
            let shake = |axis: usize| -> f64 {
                SHAKE_PERIODS.iter().zip(&phases).map(|(period, phase)| (TAU * t / period + phase[axis]).sin()).sum()
            };
            let x = self.pan.0 * (TAU * t / self.pan_period).sin() + amplitude * shake(0);
            let y = self.pan.1 * (TAU * t / (PAN_RATIO * self.pan_period)).sin() + amplitude * shake(1);
            let zoom = self.zoom.0 * (self.zoom.1 / self.zoom.0).powf(t / last);
            let (sin, cos) = (self.roll.to_radians() * (TAU * t / self.roll_period).sin()).sin_cos();
            Pose { centre: [scale * x, scale * y], zoom, sin, cos }
        };
        (0..frames).map(pose).collect()
    }
}

/// Where the camera looks in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pose {
    /// The world point in the middle of the window, relative to the world's centre, px.
    pub centre: [f64; 2],
    /// Magnification.
    pub zoom: f64,
    /// Sine of the roll.
    pub sin: f64,
    /// Cosine of the roll.
    pub cos: f64,
}

impl Pose {
    /// The angle by which upright objects of the world are turned in the window, rad, from x towards y.
    pub(super) fn angle(&self) -> f64 {
        -self.sin.atan2(self.cos)
    }

    /// The world point at an offset from the window's middle.
    pub(super) fn to_world(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x, y) = (x / self.zoom, y / self.zoom);
        [self.centre[0] + self.cos * x - self.sin * y, self.centre[1] + self.sin * x + self.cos * y]
    }

    /// The offset from the window's middle at which a world point is seen.
    pub(super) fn to_window(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x, y) = (x - self.centre[0], y - self.centre[1]);
        [self.zoom * (self.cos * x + self.sin * y), self.zoom * (self.cos * y - self.sin * x)]
    }
}
