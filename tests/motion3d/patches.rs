//! Six numbers a patch: what is not known must not be reported as `ok`.

use super::scenes::mahalanobis;
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

    fn estimate(&self, method: Method) -> MotionEstimate {
        let patches =
            AffinePatches { points: &self.points, motion: &self.motion, covariances: &self.covariances, camera: None };
        let options = MotionOptions { method, placement: Placement::Start, ..MotionOptions::default() };
        estimate_patch_motion(&patches, &options).unwrap()
    }
}

/// How many estimates are confident, how many of those have the truth far outside of their ellipsoid, and how
/// many go the opposite way.
fn silently_wrong(truth: &Motion, n: u64, h: f64, r: f64, noise_std: f64, method: Method) -> (u32, u32, u32) {
    let (mut confident, mut wrong, mut opposite) = (0, 0, 0);
    for seed in 0..24 {
        let found = Made::new(truth, n, h, r, noise_std, seed).estimate(method);
        if found.status == Status::Ok {
            let turned = found.motion.angle_to(truth).to_degrees() > 90.0;
            confident += 1;
            wrong += u32::from(turned || mahalanobis(&found, truth) > 45.0);
            opposite += u32::from(turned);
        }
    }
    (confident, wrong, opposite)
}

#[test]
fn patches_that_determine_nothing_are_not_trusted() {
    let lateral = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    let oblique = Motion::new([0.6, 0.2, 0.75], [0.002, -0.003, 0.001]);
    let (mut confident, mut wrong) = (0, 0);
    for truth in [lateral, oblique] {
        for (n, h, r, noise_std) in
            [(30, 0.2, 60.0, 0.15), (10, 0.2, 60.0, 0.05), (20, 0.4, 30.0, 0.1), (100, 0.2, 30.0, 0.15)]
        {
            for method in [Method::Auto, Method::MaximumLikelihood] {
                let (sure, off, opposite) = silently_wrong(&truth, n, h, r, noise_std, method);
                assert!(opposite == 0 && off <= 1, "{truth:?} {n} {h} {r} {method:?}: {opposite}, {off} of {sure}");
                confident += sure;
                wrong += off;
            }
        }
    }
    assert!(confident > 120 && wrong * 50 <= confident, "{wrong} of {confident}");
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
            let status = again.estimate(Method::Auto).status;
            assert!(matches!(status, Status::FewPoints | Status::RotationOnly), "{places} {seed}: {status:?}");
        }
    }
}
