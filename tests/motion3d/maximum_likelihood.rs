//! Maximum likelihood requested by name: as doubtful as the smoothed weights, and honest about what it lacks.

use super::scenes::{Held, Scene, W, ground, smooth};
use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

/// Two minima of one scene are as hard to separate for maximum likelihood as they are for the smoothed
/// weights.
#[test]
fn maximum_likelihood_reports_other_minima_too() {
    let (mut undecided, mut sure) = (0, 0);
    for seed in 0..150 {
        let rng = CounterRng::new(4000 + seed);
        let normal = |k: u64| [0, 1, 2].map(|j| rng.normal(3 * k + j));
        let motion = Motion::new(normal(0), normal(1).map(|w| 0.02 * w));
        let scene = Scene::new(motion, 100, 0.6, 0.2, seed, |_, y, _| ground(y));
        let status = |method| scene.run(&MotionOptions { method, ..MotionOptions::default() }).status;
        if status(Method::Efficient) == Status::Ambiguous {
            undecided += 1;
            sure += u32::from(status(Method::MaximumLikelihood) == Status::Ok);
        }
    }
    assert!(undecided >= 8 && sure <= 2, "{sure} of {undecided}");
}

/// Where the epipole may lie among noisy points maximum likelihood's own theory promises too small errors;
/// its distance from the better solution is reported.
#[test]
fn maximum_likelihood_shows_how_far_it_may_be() {
    let options = MotionOptions { method: Method::MaximumLikelihood, ..MotionOptions::default() };
    type Depth<'a> = &'a dyn Fn(f64, f64, f64) -> f64;
    let cases: [(Motion, usize, f64, Depth<'_>); 2] = [
        (Motion::new([0.05, -0.03, 1.0], W), 500, 0.1, &|_, y, _| ground(y)),
        (Motion::new([0.05, -0.03, 1.0], W), 300, 0.05, &|x, y, _| smooth(x, y)),
    ];
    for (case, (motion, n, noise_std, depth)) in cases.into_iter().enumerate() {
        let (mut told, mut by_theory) = (Held::default(), Held::default());
        for seed in 0..50 {
            let scene = Scene::new(motion, n, 0.6, noise_std, seed, depth);
            let found = scene.run(&options);
            if matches!(found.status, Status::Ok | Status::LowSnr) {
                let theory = MotionEstimate {
                    covariance: found.likelihood.covariance,
                    tangent: found.likelihood.tangent,
                    ..found.clone()
                };
                told.count(&found, &motion);
                by_theory.count(&theory, &motion);
            }
        }
        assert!(told.of >= 25 && told.share() >= 0.88, "{case}: {told:?}");
        assert!(by_theory.share() < 0.8, "{case}: {by_theory:?}");
    }
}
