//! Weighted particles of one target: centre x, y (px), velocity u, v (px/frame), width, height (px).

use super::{camera::CameraMotion, noise::Noise};
use crate::filter::particle::{Resampling, effective_sample_size, normalise_log_weights};
use crate::math::random::CounterRng;

/// Components of a particle.
pub(super) const COMPONENTS: usize = 6;
/// Standard deviation of the velocity at the start, px/frame in a picture of 480 rows.
const START_VELOCITY: f64 = 3.0;
/// Bounds of width and height over those at the start.
const SIZE_RANGE: [f64; 2] = [0.25, 4.0];

pub(super) type Particle = [f64; COMPONENTS];

/// Purposes of random numbers: independent streams of one target at one frame.
#[derive(Debug, Clone, Copy)]
pub(super) enum Purpose {
    Start,
    Selection,
    Transition,
    QuickStart,
}

/// The stream of a target at a frame: the same however many targets there are.
pub(super) fn stream(seed: u64, target: u64, frame: usize, purpose: Purpose) -> CounterRng {
    CounterRng::new(seed).stream(target).stream(frame as u64).stream(purpose as u64)
}

/// Particles and their weights, which sum to 1.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Cloud {
    pub particles: Vec<Particle>,
    pub weights: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub mean: Particle,
    pub noise: Noise,
    /// Factor of all lengths.
    pub scale: f64,
}

impl Cloud {
    /// A cloud about a mean, with the start's spread.
    pub fn begin(start: &Start, count: usize, rng: CounterRng) -> Self {
        let Start { mean: [x, y, u, v, w, h], noise, scale } = *start;
        let particle = |i: usize| {
            let z = |component: usize| rng.normal((i * COMPONENTS + component) as u64);
            let speed = START_VELOCITY * scale;
            let [across, down] = size_steps(&noise, z(4), z(5));
            [
                x + noise.position * z(0),
                y + noise.position * z(1),
                u + speed * z(2),
                v + speed * z(3),
                w * across.exp(),
                h * down.exp(),
            ]
        };
        Self { particles: (0..count).map(particle).collect(), weights: vec![1.0 / count as f64; count] }
    }

    /// 1 / sum of squared weights.
    pub fn effective_sample_size(&self) -> f64 {
        effective_sample_size(&self.weights)
    }

    /// Resamples to `count` particles if the effective sample size is below `threshold` times their number,
    /// or if the number changes.
    pub fn select(&mut self, scheme: Resampling, threshold: f64, count: usize, rng: CounterRng) {
        let enough = self.effective_sample_size() >= threshold * self.weights.len() as f64;
        if enough && threshold < 1.0 && count == self.weights.len() {
            return;
        }
        let mut indices = Vec::with_capacity(count);
        scheme.indices(&self.weights, count, &rng, &mut indices);
        self.particles = indices.iter().map(|&i| self.particles[i]).collect();
        self.weights = vec![1.0 / count as f64; count];
    }

    /// Moves every particle by the camera's motion, its velocity and noise (equations (1) and (2) of the
    /// paper).
    pub fn predict(&mut self, camera: &CameraMotion, noise: &Noise, first_size: [f64; 2], rng: CounterRng) {
        let growth = camera.growth();
        for (i, particle) in self.particles.iter_mut().enumerate() {
            let z = |component: usize| rng.normal((i * COMPONENTS + component) as u64);
            let [x, y, u, v, w, h] = *particle;
            let c = camera.at([x, y]);
            let [across, down] = size_steps(noise, z(4), z(5));
            let within = |side: f64, first: f64| side.clamp(SIZE_RANGE[0] * first, SIZE_RANGE[1] * first);
            *particle = [
                x + c[0] + u + noise.position * z(0),
                y + c[1] + v + noise.position * z(1),
                u + noise.velocity * z(2),
                v + noise.velocity * z(3),
                within(w * growth * across.exp(), first_size[0]),
                within(h * growth * down.exp(), first_size[1]),
            ];
        }
    }

    /// Multiplies the weights by likelihoods. Returns false, and changes nothing, if all products are zero.
    pub fn weigh(&mut self, log_likelihood: &[f64]) -> bool {
        let mut logs: Vec<f64> = self.weights.iter().zip(log_likelihood).map(|(w, l)| w.ln() + l).collect();
        if normalise_log_weights(&mut logs).is_none() {
            return false;
        }
        self.weights = logs.iter().map(|log| log.exp()).collect();
        true
    }

    /// Weighted mean of the particles.
    pub fn mean(&self) -> Particle {
        let mut mean = [0.0; COMPONENTS];
        for (particle, &weight) in self.particles.iter().zip(&self.weights) {
            for (sum, value) in mean.iter_mut().zip(particle) {
                *sum += weight * value;
            }
        }
        mean
    }

    /// Weighted covariance of the particles about their mean.
    pub fn covariance(&self, mean: &Particle) -> [[f64; COMPONENTS]; COMPONENTS] {
        let mut covariance = [[0.0; COMPONENTS]; COMPONENTS];
        for (particle, &weight) in self.particles.iter().zip(&self.weights) {
            for i in 0..COMPONENTS {
                for j in 0..=i {
                    covariance[i][j] += weight * (particle[i] - mean[i]) * (particle[j] - mean[j]);
                }
            }
        }
        for i in 0..COMPONENTS {
            for j in 0..i {
                covariance[j][i] = covariance[i][j];
            }
        }
        covariance
    }

    /// Adds `by` to position and velocity of every particle.
    pub fn shift(&mut self, by: [f64; 4]) {
        for particle in &mut self.particles {
            for (value, by) in particle.iter_mut().zip(by) {
                *value += by;
            }
        }
    }

    /// Smallest and largest centre and largest size: x, y, then width and height.
    pub fn reach(&self) -> ([f64; 2], [f64; 2], [f64; 2]) {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        let mut size = [0.0f64; 2];
        for particle in &self.particles {
            for i in 0..2 {
                low[i] = low[i].min(particle[i]);
                high[i] = high[i].max(particle[i]);
                size[i] = size[i].max(particle[4 + i]);
            }
        }
        (low, high, size)
    }
}

/// Steps of the logarithms of width and height from two standard normal numbers.
fn size_steps(noise: &Noise, first: f64, second: f64) -> [f64; 2] {
    match noise.aspect {
        None => [noise.size * first, noise.size * second],
        Some(aspect) => [noise.size * first + aspect * second, noise.size * first - aspect * second],
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn prediction_moves_with_camera_and_velocity_and_limits_the_size() {
        let camera = CameraMotion { origin: [0.0; 2], shift: [2.0, 1.0], jacobian: [[0.1, 0.0], [0.0, 0.1]] };
        let still = Noise { position: 0.0, velocity: 0.0, size: 0.0, aspect: None };
        let mut one = Cloud { particles: vec![[10.0, 20.0, 3.0, 4.0, 8.0, 400.0]], weights: vec![1.0] };
        one.predict(&camera, &still, [8.0, 90.0], stream(0, 0, 1, Purpose::Transition));
        let [x, y, u, v, w, h] = one.particles[0];
        assert!((x - 16.0).abs() < 1e-12 && (y - 27.0).abs() < 1e-12 && (u, v) == (3.0, 4.0));
        assert!((w - 8.0 * 0.1f64.exp()).abs() < 1e-12 && h == 360.0);
    }
}
