//! A smooth random velocity field of one scale.

use super::{Motion, PointMap, integrate, max_duration};
use crate::math::random::CounterRng;
use crate::types::AffineFlow;
use std::f64::consts::TAU;

/// Number of waves.
const WAVES: usize = 8;
/// Radians of the waves that matter passes in one step of the path integration, at rms speed.
const RADIANS_PER_STEP: f64 = 0.03;
/// Fewest steps of the path integration in one frame.
const FEWEST_STEPS: f64 = 4.0;

/// One wave `(u, v) = (along_x, along_y) sin(k . p + phase)`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    kx: f64,
    ky: f64,
    phase: f64,
    along_x: f64,
    along_y: f64,
}

/// A steady smooth velocity field of one scale with divergence and curl: eight waves of equal strength and
/// random phase, their wavelengths within a factor `2^(1/4)` of the requested one, their directions and
/// polarisations spread evenly.
///
/// Velocity and Jacobian are exact; paths have no closed form and are integrated (Runge-Kutta, fourth order;
/// steps short enough for 1e-6 px a frame up to 8 px/frame and 64 px waves).
#[derive(Debug, Clone, PartialEq)]
pub struct Waves {
    waves: [Wave; WAVES],
    steps_per_frame: f64,
}

impl Waves {
    /// Greatest speed, wavelengths a frame: each takes two hundred steps of the path integration.
    pub const MAX_SPEED: f64 = 16.0;

    /// A field whose root-mean-square speed is `speed` px/frame and whose waves are `wavelength` px long.
    pub fn new(speed: f64, wavelength: f64, seed: u64) -> Self {
        let rng = CounterRng::new(seed);
        let share = |place: usize, draw: u64| TAU * (place as f64 + rng.uniform(draw)) / WAVES as f64;
        let amplitude = speed * (2.0 / WAVES as f64).sqrt();
        let waves = std::array::from_fn(|i| {
            let draw = 4 * i as u64;
            let wave_number = TAU / wavelength * 2f64.powf(0.5 * rng.uniform(draw) - 0.25);
            // Half a turn of directions, a whole turn between a wave and what it moves (divergence to curl).
            let direction = 0.5 * share(i, draw + 1);
            let polarisation = direction + share(i * 3 % WAVES, draw + 2);
            Wave {
                kx: wave_number * direction.cos(),
                ky: wave_number * direction.sin(),
                phase: TAU * rng.uniform(draw + 3),
                along_x: amplitude * polarisation.cos(),
                along_y: amplitude * polarisation.sin(),
            }
        });
        let radians = TAU / wavelength * speed.abs();
        Self { waves, steps_per_frame: (radians / RADIANS_PER_STEP).ceil().max(FEWEST_STEPS) }
    }

    /// Velocity alone: what the path integration needs.
    fn speed(&self, x: f64, y: f64) -> (f64, f64) {
        self.waves.iter().fold((0.0, 0.0), |(u, v), w| {
            let sine = (w.kx * x + w.ky * y + w.phase).sin();
            (u + w.along_x * sine, v + w.along_y * sine)
        })
    }
}

impl Motion for Waves {
    fn velocity(&self, x: f64, y: f64, _t: f64) -> AffineFlow<f64> {
        let mut m = AffineFlow::default();
        for w in &self.waves {
            let (sine, cosine) = (w.kx * x + w.ky * y + w.phase).sin_cos();
            m.u += w.along_x * sine;
            m.v += w.along_y * sine;
            m.u_x += w.along_x * w.kx * cosine;
            m.u_y += w.along_x * w.ky * cosine;
            m.v_x += w.along_y * w.kx * cosine;
            m.v_y += w.along_y * w.ky * cosine;
        }
        m
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        integrate(move |x, y| self.speed(x, y), to - from, self.steps_per_frame)
    }

    fn max_duration(&self) -> f64 {
        max_duration(self.steps_per_frame)
    }
}
