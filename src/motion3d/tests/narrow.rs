//! Covariances where the direction is known to a large share of the field only.

use super::super::*;
use super::estimators::mahalanobis;
use super::scenes::Scene;

/// The share of the estimates with the status `ok` whose 95 % ellipsoid holds the truth, and their number.
fn held(motion: Motion, (h, n, sigma): (f64, usize, f64), nu: impl Fn(f64, f64, f64) -> f64) -> (u32, u32) {
    let (mut held, mut ok) = (0, 0);
    for seed in 0..120 {
        let scene = Scene::new(motion, n, h, sigma, seed, &nu);
        let options = MotionOptions { placement: Placement::Start, ..MotionOptions::default() };
        let found = estimate_motion(&scene.flow(), &Noise::Sigma(sigma), &options).unwrap();
        if found.status == Status::Ok {
            ok += 1;
            held += u32::from(mahalanobis(&found, &motion) < 11.07);
        }
    }
    (held, ok)
}

#[test]
fn ellipsoids_hold_the_truth_in_narrow_fields() {
    let [lateral, oblique, down] =
        [[1.0, 0.0, 0.0], [0.6, 0.2, 0.75], [0.1, 1.0, 0.2]].map(|u| Motion::new(u, [0.0; 3]));
    let ground = |_: f64, y: f64, _: f64| 0.3 + 1.2 * y.max(0.0);
    let (mut all, mut of) = (0, 0);
    for (motion, layout) in [
        (lateral, (0.25, 60, 0.03)),
        (down, (0.15, 200, 0.03)),
        (oblique, (0.25, 200, 0.03)),
        (lateral, (0.25, 200, 0.06)),
    ] {
        let (held, ok) = held(motion, layout, ground);
        (all, of) = (all + held, of + ok);
    }
    assert!(of >= 200 && f64::from(all) >= 0.88 * f64::from(of), "{all} of {of}");
    // Of a wide field nothing is added to speak of.
    let (held, ok) = held(oblique, (0.6, 400, 0.03), |_, _, r| 0.5 + r);
    assert!(ok >= 110 && (0.88..0.99).contains(&(f64::from(held) / f64::from(ok))), "{held} of {ok}");
}
