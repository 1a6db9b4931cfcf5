//! Random scenes with exact truth, and how estimates lie to it.

use super::math::random::CounterRng;
use super::motion3d::{Flow, Motion, MotionEstimate, MotionOptions, Noise, Placement, estimate_motion};
use nalgebra::{SMatrix, Vector3};

/// Rotation rate of the published scenes.
pub(crate) const W: [f64; 3] = [0.02, -0.03, 0.01];

/// The published oblique motion.
pub(crate) fn oblique() -> Motion {
    Motion::new([0.6, 0.2, 0.75], W)
}

/// Inverse depths of the published scenes, at places `(x, y) / h`: a curved wall.
pub(crate) fn smooth(x: f64, y: f64) -> f64 {
    1.0 + 0.35 * (2.0 * x + 1.0).sin() * (1.5 * y).cos() + 0.15 * y
}

/// Of ground under a far wall.
pub(crate) fn ground(y: f64) -> f64 {
    0.3 + 1.2 * y.max(0.0)
}

/// Points on the plane at distance 1 with their flow.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub motion: Motion,
    pub points: Vec<[f64; 2]>,
    pub inverse_depth: Vec<f64>,
    pub flow: Vec<[f64; 2]>,
    /// Standard deviation of the noise; that of exact flow is said to be 1e-6.
    pub noise_std: f64,
}

impl Scene {
    /// `n` points in `[-h, h]^2` whose inverse depth is a function of `(x, y) / h` and a random number.
    pub fn new(
        motion: Motion,
        n: usize,
        h: f64,
        noise_std: f64,
        seed: u64,
        depth: impl Fn(f64, f64, f64) -> f64,
    ) -> Self {
        let rng = CounterRng::new(seed);
        let at = |k: usize, j: u64| 2.0 * rng.uniform(3 * k as u64 + j) - 1.0;
        let points: Vec<[f64; 2]> = (0..n).map(|k| [h * at(k, 0), h * at(k, 1)]).collect();
        let inverse_depth: Vec<f64> =
            (0..n).map(|k| depth(at(k, 0), at(k, 1), rng.uniform(3 * k as u64 + 2))).collect();
        let noise = rng.stream(1);
        let flow = (0..n)
            .map(|k| {
                let exact = motion.plane_flow(points[k], inverse_depth[k]);
                [0, 1].map(|j| exact[j] + noise_std * noise.normal(2 * k as u64 + j as u64))
            })
            .collect();
        Self { motion, points, inverse_depth, flow, noise_std: if noise_std > 0.0 { noise_std } else { 1e-6 } }
    }

    /// Random depths from 0.5 to 1.5, the oblique motion.
    pub fn oblique(n: usize, noise_std: f64, seed: u64) -> Self {
        Self::new(Motion::new([0.6, 0.2, 0.75], [0.02, -0.03, 0.01]), n, 0.6, noise_std, seed, |_, _, r| 0.5 + r)
    }

    pub fn flow(&self) -> Flow<'_> {
        Flow::Plane { points: &self.points, flow: &self.flow, camera: None }
    }

    /// Estimates with its noise known, flow being instantaneous.
    pub fn run(&self, options: &MotionOptions) -> MotionEstimate {
        let options = MotionOptions { placement: Placement::Start, ..options.clone() };
        estimate_motion(&self.flow(), &Noise::StandardDeviation(self.noise_std), &options).unwrap()
    }
}

/// Squared Mahalanobis distance of the truth from an estimate.
pub(crate) fn mahalanobis(found: &MotionEstimate, truth: &Motion) -> f64 {
    let to = Vector3::from(truth.translation);
    let along = |a: usize| Vector3::from(found.tangent[a]).dot(&to);
    let w = Vector3::from(truth.rotation) - Vector3::from(found.motion.rotation);
    let error = SMatrix::<f64, 5, 1>::from_column_slice(&[along(0), along(1), w.x, w.y, w.z]);
    let covariance = SMatrix::<f64, 5, 5>::from_fn(|i, j| found.covariance[i][j]);
    (error.transpose() * covariance.try_inverse().unwrap() * error)[0]
}

/// 95 % of chi squared with five degrees of freedom.
pub(crate) const ELLIPSOID: f64 = 11.070;

/// How many 95 % ellipsoids hold the truth.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Held {
    pub of: u32,
    pub inside: u32,
}

impl Held {
    /// One more estimate.
    pub fn count(&mut self, found: &MotionEstimate, truth: &Motion) {
        self.of += 1;
        self.inside += u32::from(mahalanobis(found, truth) < ELLIPSOID);
    }

    pub fn share(self) -> f64 {
        f64::from(self.inside) / f64::from(self.of)
    }

    /// Whether the share is what covariances must hold: .88 to .97.
    pub fn honest(self) -> bool {
        (0.88..=0.97).contains(&self.share())
    }
}
