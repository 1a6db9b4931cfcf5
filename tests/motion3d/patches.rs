//! Six numbers a patch: what is not known must not be reported as `ok`.

use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

/// `n` patches in `[-h, h]^2` on the plane at distance 1, seen with a focal length of 500 px: windows of `2 r
/// + 1` px, noise of `noise_std` px, 3 px of flow in the mean.
struct Made {
    points: Vec<[f64; 2]>,
    motion: Vec<[f64; 6]>,
    covariances: Vec<f64>,
}

impl Made {
    fn new(truth: &Motion, n: u64, h: f64, r: f64, noise_std: f64, seed: u64) -> Self {
        let rng = CounterRng::new(seed);
        let place = |k: u64| [0, 1].map(|j| h * (2.0 * rng.uniform(2 * k + j) - 1.0));
        let depth = |k: u64| 0.5 + rng.stream(1).uniform(k);
        let still = Motion { rotation: [0.0; 3], ..*truth };
        let length = |k: u64| {
            let [u, v] = still.plane_flow(place(k), depth(k));
            u.hypot(v)
        };
        let scale = 3.0 / 500.0 * n as f64 / (0..n).map(length).sum::<f64>();
        let deviations: [f64; 6] =
            std::array::from_fn(|i| if i < 2 { noise_std / 500.0 } else { 3.0f64.sqrt() * noise_std / r });
        let mut out = Self { points: vec![], motion: vec![], covariances: vec![] };
        for k in 0..n {
            let nu = scale * depth(k);
            let surface = [nu, 0.8 * nu * rng.stream(2).normal(2 * k), 0.8 * nu * rng.stream(2).normal(2 * k + 1)];
            let exact = truth.affine_flow(place(k), surface);
            out.points.push(place(k));
            out.motion.push(std::array::from_fn(|i| exact[i] + deviations[i] * rng.stream(3).normal(6 * k + i as u64)));
            let entry = |e: usize| if e / 6 == e % 6 { deviations[e / 6].powi(2) } else { 0.0 };
            out.covariances.extend((0..36).map(entry));
        }
        out
    }

    fn estimate(&self) -> MotionEstimate {
        let patches =
            AffinePatches { points: &self.points, motion: &self.motion, covariances: &self.covariances, camera: None };
        let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
        estimate_patch_motion(&patches, &options).unwrap()
    }
}

/// The same two or three places again and again leave as many motions as two or three patches do.
#[test]
fn repeated_patches_are_few() {
    let oblique = Motion::new([0.6, 0.2, 0.75], [0.002, -0.003, 0.001]);
    for places in [2, 3] {
        for seed in 0..10 {
            let once = Made::new(&oblique, places, 0.4, 60.0, 0.05, seed);
            let times = |values: &[f64]| values.repeat(10);
            let again = Made {
                points: once.points.repeat(10),
                motion: once.motion.repeat(10),
                covariances: times(&once.covariances),
            };
            let status = again.estimate().status;
            assert!(matches!(status, Status::FewPoints | Status::RotationOnly), "{places} {seed}: {status:?}");
        }
    }
}
