//! Values that the theory gives without chance.

use super::scenes::{oblique, smooth};
use jacoflow::motion3d::*;

fn near(got: f64, want: f64, name: &str) {
    assert!((got - want).abs() < 6e-4 * want.abs(), "{name}: {got} is not {want}");
}

/// 21 x 21 points on [-0.6, 0.6]^2 with the depths called smooth.
fn grid() -> (Vec<[f64; 2]>, Vec<f64>) {
    let at = |i: usize| -0.6 + 0.06 * i as f64;
    let points: Vec<[f64; 2]> = (0..441).map(|k| [at(k % 21), at(k / 21)]).collect();
    let depths = points.iter().map(|p| smooth(p[0] / 0.6, p[1] / 0.6)).collect();
    (points, depths)
}

fn bound_of(motion: &Motion) -> MotionBound {
    let (points, depths) = grid();
    let flow = vec![[0.0; 2]; points.len()];
    motion_bound(
        &Flow::Plane { points: &points, flow: &flow, camera: None },
        &Noise::StandardDeviation(0.1),
        motion,
        &depths,
    )
    .unwrap()
}

#[test]
fn bound_maximum_likelihood_and_ideal_weights_on_the_grid() {
    let lateral = bound_of(&Motion::new([1.0, 0.0, 0.0], [0.0; 3]));
    let oblique = bound_of(&oblique());
    let want = [
        (&lateral, [1.632, 1.808, 1.634], [[23.71, 36.13, 14.53], [26.71, 36.13, 14.90], [23.74, 36.13, 14.53]]),
        (&oblique, [2.840, 4.219, 2.873], [[37.05, 41.41, 21.66], [58.46, 57.31, 27.92], [37.53, 41.85, 21.77]]),
    ];
    for (got, directions, rotations) in want {
        for (i, covariance) in [got.bound, got.likelihood, got.ideal].iter().enumerate() {
            near(got.direction_std[i], directions[i], "direction");
            for j in 0..3 {
                near(1e3 * covariance[2 + j][2 + j].sqrt(), rotations[i][j], "rotation");
            }
        }
    }
}

#[test]
fn the_bound_is_that_of_pixels_too() {
    let camera = Intrinsics::new([[500.0, 2.0, 320.0], [0.0, 480.0, 240.0], [0.0, 0.0, 1.0]]).unwrap();
    let (points, depths) = grid();
    let motion = oblique();
    let pixels: Vec<[f64; 2]> = points.iter().map(|&p| camera.to_pixel(p)).collect();
    let flow = vec![[0.0; 2]; points.len()];
    // The covariance that is 0.1^2 on the plane: K S K^t.
    let k = camera.matrix();
    let s = |i: usize, j: usize| (0..2).map(|m| k[i][m] * k[j][m]).sum::<f64>() * 0.01;
    let covariances: Vec<f64> = points.iter().flat_map(|_| [s(0, 0), s(0, 1), s(1, 0), s(1, 1)]).collect();
    let there = Flow::Plane { points: &pixels, flow: &flow, camera: Some(&camera) };
    let got = motion_bound(&there, &Noise::Covariances(&covariances), &motion, &depths).unwrap();
    let want = bound_of(&motion);
    for i in 0..3 {
        assert!((got.direction_std[i] - want.direction_std[i]).abs() < 1e-9 * want.direction_std[i]);
    }
}

/// Section 5 of the paper: translation in the image plane, no rotation, one unknown; (29), (31), the bound
/// and where the lines cross.
#[test]
fn one_unknown_has_its_closed_forms() {
    let depths: Vec<f64> = (0..101).map(|k| 0.5 + f64::from(k) / 100.0).collect();
    let bound = lateral_bound(&depths, 0.3).unwrap();
    near(bound.likelihood, 8.8940e-4, "(29)");
    near(bound.ones, 8.9109e-4, "(31)");
    near(bound.bound, 8.2128e-4, "bound");
    near(bound.crossover, 0.30369, "crossover");
}

#[test]
fn points_that_determine_nothing_have_no_bound() {
    let (points, flow) = (vec![[0.1, 0.2]; 8], vec![[0.0; 2]; 8]);
    let points = Flow::Plane { points: &points, flow: &flow, camera: None };
    let motion = Motion::new([1.0, 0.0, 0.0], [0.0; 3]);
    let error = motion_bound(&points, &Noise::StandardDeviation(0.1), &motion, &[1.0; 8]).unwrap_err();
    assert!(matches!(error, jacoflow::Error::NotObservable(_)), "{error}");
    assert!(
        motion_bound(&points, &Noise::Unknown, &motion, &[1.0; 8]).unwrap_err().to_string().starts_with("noise_std: ")
    );
    assert!(
        motion_bound(&points, &Noise::StandardDeviation(0.1), &motion, &[1.0])
            .unwrap_err()
            .to_string()
            .starts_with("inv_depth: ")
    );
}

#[test]
fn too_few_places_have_no_bound_whatever_rounding_makes_of_them() {
    let motion = oblique();
    let bound = |points: &[[f64; 2]]| {
        let flow = vec![[0.0; 2]; points.len()];
        let depths: Vec<f64> = (0..points.len()).map(|k| 0.5 + 0.37 * (k % 3) as f64).collect();
        let points = Flow::Plane { points, flow: &flow, camera: None };
        motion_bound(&points, &Noise::StandardDeviation(0.01), &motion, &depths)
    };
    let rng = jacoflow::math::random::CounterRng::new(5);
    let places = |n: usize, trial: u64, half: f64| -> Vec<[f64; 2]> {
        let at = |k: u64| half * (2.0 * rng.stream(trial).uniform(k) - 1.0);
        (0..n as u64).map(|k| [at(2 * k), at(2 * k + 1)]).collect()
    };
    for trial in 0..100 {
        for few in [3, 4] {
            let error = bound(&places(few, trial, 0.6)).unwrap_err().to_string();
            assert!(error.starts_with("points: "), "{few} {trial}: {error}");
        }
        let two = places(2, trial, 0.6);
        let twice: Vec<_> = (0..20).map(|k| two[k % 2]).collect();
        assert!(matches!(bound(&twice), Err(jacoflow::Error::NotObservable(_))), "{trial}");
        // A long lens does determine a motion, if badly.
        assert!(bound(&places(30, trial, 0.02)).is_ok(), "{trial}");
    }
}
