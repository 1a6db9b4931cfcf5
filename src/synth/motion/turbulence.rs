//! A random velocity field without divergence.

use super::{Motion, PointMap, integrate, max_duration};
use crate::math::random::CounterRng;
use crate::types::AffineFlow;
use std::f64::consts::TAU;

/// Number of waves.
const WAVES: u64 = 24;
/// Steps of the path integration in one frame.
const STEPS_PER_FRAME: f64 = 4.0;

/// One wave `amplitude cos(k . p + phase)` of the stream function.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    kx: f64,
    ky: f64,
    phase: f64,
    amplitude: f64,
}

/// Frozen isotropic turbulence: the stream function `psi` is a sum of 24 random waves, `u = psi_y`, `v =
/// -psi_x` (after R. H. Kraichnan, "Diffusion by a random velocity field", 1970).
///
/// Wavelengths run logarithmically from `longest` to an eighth of it, and the speed of each wave falls with
/// its wave number k as `k^(-1/3)`, which is an energy spectrum of `k^(-5/3)`. Velocity and Jacobian are
/// exact; paths have no closed form and are integrated (Runge-Kutta, fourth order, 4 steps a frame: 4e-7 px a
/// frame at a speed of 1 px/frame and 128 px waves).
#[derive(Debug, Clone, PartialEq)]
pub struct Turbulence {
    waves: Vec<Wave>,
}

impl Turbulence {
    /// A field whose root-mean-square speed is `speed` px/frame and whose longest wave is `longest` px.
    pub fn new(speed: f64, longest: f64, seed: u64) -> Self {
        let rng = CounterRng::new(seed);
        let mut waves: Vec<Wave> = (0..WAVES)
            .map(|i| {
                let wave_number = TAU / longest * 8f64.powf(i as f64 / (WAVES - 1) as f64);
                // Directions stratified, so that 24 waves are nearly isotropic.
                let direction = TAU * ((i * 7 % WAVES) as f64 + rng.uniform(2 * i)) / WAVES as f64;
                Wave {
                    kx: wave_number * direction.cos(),
                    ky: wave_number * direction.sin(),
                    phase: TAU * rng.uniform(2 * i + 1),
                    amplitude: wave_number.powf(-4.0 / 3.0),
                }
            })
            .collect();
        let energy: f64 = waves.iter().map(|w| w.amplitude.powi(2) * (w.kx * w.kx + w.ky * w.ky) / 2.0).sum();
        let scale = speed / energy.sqrt();
        for wave in &mut waves {
            wave.amplitude *= scale;
        }
        Self { waves }
    }

    /// Velocity alone: what the path integration needs.
    fn speed(&self, x: f64, y: f64) -> (f64, f64) {
        self.waves.iter().fold((0.0, 0.0), |(u, v), w| {
            let slope = -w.amplitude * (w.kx * x + w.ky * y + w.phase).sin();
            (u + slope * w.ky, v - slope * w.kx)
        })
    }
}

impl Motion for Turbulence {
    fn velocity(&self, x: f64, y: f64, _t: f64) -> AffineFlow<f64> {
        let mut m = AffineFlow::default();
        for w in &self.waves {
            let (sine, cosine) = (w.kx * x + w.ky * y + w.phase).sin_cos();
            let (slope, bend) = (-w.amplitude * sine, -w.amplitude * cosine);
            m.u += slope * w.ky;
            m.v -= slope * w.kx;
            m.u_x += bend * w.ky * w.kx;
            m.u_y += bend * w.ky * w.ky;
            m.v_x -= bend * w.kx * w.kx;
            m.v_y -= bend * w.kx * w.ky;
        }
        m
    }

    fn path_map(&self, from: f64, to: f64) -> PointMap<'_> {
        integrate(move |x, y| self.speed(x, y), to - from, STEPS_PER_FRAME)
    }

    fn max_duration(&self) -> f64 {
        max_duration(STEPS_PER_FRAME)
    }
}
