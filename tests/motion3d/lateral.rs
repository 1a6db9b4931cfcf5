//! Section 5 of the paper: variances by theory against those of many trials, signs, errors.

use jacoflow::math::random::CounterRng;
use jacoflow::motion3d::*;

const ALL: [LateralWeights; 3] = [LateralWeights::Likelihood, LateralWeights::Ones, LateralWeights::Shrunk];

fn depths(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.5 + k as f64 / (n - 1) as f64).collect()
}

fn flow(depths: &[f64], angle: f64, noise_std: f64, seed: u64) -> Vec<[f64; 2]> {
    let rng = CounterRng::new(seed);
    let (y, x) = angle.sin_cos();
    let noise = |k: usize, j: u64| noise_std * rng.normal(2 * k as u64 + j);
    depths.iter().enumerate().map(|(k, nu)| [nu * x + noise(k, 0), nu * y + noise(k, 1)]).collect()
}

/// The difference of two angles.
fn between(a: f64, b: f64) -> f64 {
    (a - b).sin().atan2((a - b).cos())
}

/// Mean squared errors over many trials: of maximum likelihood, of weights of 1, of shrunk weights; and the
/// mean variances reported.
fn squares(n: usize, noise_std: f64, told: Option<f64>, trials: u64) -> ([f64; 3], [f64; 3]) {
    let (nu, angle) = (depths(n), 2.2);
    let (mut errors, mut variances) = ([0.0; 3], [0.0; 3]);
    for seed in 0..trials {
        let flow = flow(&nu, angle, noise_std, seed);
        for (k, weights) in ALL.into_iter().enumerate() {
            let found = estimate_lateral(&flow, told, weights).unwrap();
            errors[k] += between(found.angle, angle).powi(2) / trials as f64;
            variances[k] += found.variance / trials as f64;
        }
    }
    (errors, variances)
}

#[test]
fn variances_are_those_of_theory() {
    // The mean of 3000 squares scatters by 2.6 %.
    for noise_std in [0.1, 0.30369, 0.6, 1.0] {
        let bound = lateral_bound(&depths(1000), noise_std).unwrap();
        for told in [Some(noise_std), None] {
            let (errors, variances) = squares(1000, noise_std, told, 3000);
            for (k, want) in [bound.likelihood, bound.ones, bound.shrunk].into_iter().enumerate() {
                assert!((errors[k] / want - 1.0).abs() < 0.06, "{noise_std} {:?}: {} is not {want}", ALL[k], errors[k]);
                assert!(
                    (variances[k] / want - 1.0).abs() < 0.06,
                    "{noise_std} {:?}: {}, not {want}",
                    ALL[k],
                    variances[k]
                );
            }
            // On the same noise.
            assert!(errors[2] < 1.01 * errors[0].min(errors[1]), "{noise_std}: {errors:?}");
        }
    }
}

#[test]
fn few_points_in_large_noise_exceed_the_first_order() {
    let bound = lateral_bound(&depths(50), 1.0).unwrap();
    let (errors, _) = squares(50, 1.0, Some(1.0), 3000);
    assert!((1.1..1.5).contains(&(errors[0] / bound.likelihood)), "{}", errors[0] / bound.likelihood);
    assert!(errors[2] < 1.02 * errors[0].min(errors[1]), "{errors:?}");
}

/// Weights of 1 beat maximum likelihood above the crossover only; shrunk weights lie below both and above the
/// bound.
#[test]
fn the_lines_cross_where_they_are_said_to() {
    for depths in [depths(101), vec![0.4, 0.4, 1.6, 0.4, 1.6], vec![-0.2, 0.5, 2.0]] {
        let crossover = lateral_bound(&depths, 1.0).unwrap().crossover;
        for (factor, ones_win) in [(0.1, false), (0.99, false), (1.01, true), (10.0, true)] {
            let told = lateral_bound(&depths, factor * crossover).unwrap();
            assert_eq!(told.ones < told.likelihood, ones_win, "{factor}: {told:?}");
            assert!(told.bound < told.shrunk && told.shrunk < told.likelihood.min(told.ones), "{factor}: {told:?}");
        }
    }
}

#[test]
fn every_direction_comes_with_its_sign_and_depths() {
    let mut nu = depths(40);
    nu[3] = -0.3;
    for step in 0..12 {
        let angle = f64::from(step) * 0.5 - 2.9;
        let mut exact = flow(&nu, angle, 0.0, 1);
        exact.push([f64::NAN, 1.0]);
        for weights in ALL {
            for noise_std in [Some(1e-6), None] {
                let found = estimate_lateral(&exact, noise_std, weights).unwrap();
                assert!(between(found.angle, angle).abs() < 1e-12, "{weights:?} {angle}: {}", found.angle);
                assert!(found.variance < 1e-12 && found.bound <= found.variance);
                assert!(found.inverse_depth[40].is_nan());
                for (got, want) in found.inverse_depth.iter().zip(&nu) {
                    assert!((got - want).abs() < 1e-12, "{got} {want}");
                }
            }
        }
    }
}

/// The axis of maximum likelihood is where the flow across is least, that of all weights where their equation
/// is zero.
#[test]
fn estimates_solve_their_equations() {
    let flow = flow(&depths(60), 0.7, 0.4, 3);
    let parts = |angle: f64| -> (Vec<f64>, Vec<f64>) {
        let (y, x) = angle.sin_cos();
        (flow.iter().map(|f| x * f[0] + y * f[1]).collect(), flow.iter().map(|f| x * f[1] - y * f[0]).collect())
    };
    let cost = |angle: f64| parts(angle).1.iter().map(|e| e * e).sum::<f64>();
    let found = |weights| estimate_lateral(&flow, Some(0.4), weights).unwrap();
    let likelihood = found(LateralWeights::Likelihood).angle;
    assert!((1..300).all(|k| cost(likelihood) < cost(likelihood + 0.01 * f64::from(k))));
    let ones = found(LateralWeights::Ones).angle;
    assert!(parts(ones).1.iter().sum::<f64>().abs() < 1e-9);
    let shrunk = found(LateralWeights::Shrunk);
    let (along, across) = parts(shrunk.angle);
    let mean = along.iter().sum::<f64>() / 60.0;
    let scatter = (along.iter().map(|m| (m - mean).powi(2)).sum::<f64>() - 59.0 * 0.16) / 60.0;
    let weight = |m: f64| mean + (scatter / (scatter + 0.16)) * (m - mean);
    assert!(along.iter().zip(&across).map(|(m, e)| weight(*m) * e).sum::<f64>().abs() < 1e-6);
    assert_eq!(shrunk.noise_std, 0.4);
    assert!(
        (found(LateralWeights::Ones).variance - 0.16 / (60.0 * (mean * mean - 0.16 / 60.0))).abs()
            < 0.1 * shrunk.variance
    );
}

#[test]
fn noise_alone_is_reported_by_its_variance() {
    let mut sure = 0;
    for seed in 0..200 {
        let noise = flow(&[0.0; 100], 0.0, 1.0, seed);
        for weights in ALL {
            // A uniform angle has the deviation pi / sqrt(3); half a radian would be information.
            sure += u32::from(estimate_lateral(&noise, Some(1.0), weights).unwrap().variance < 0.05);
        }
    }
    assert!(sure <= 6, "{sure}");
}

#[test]
fn mistakes_are_reported_by_name() {
    let refused = |flow: &[[f64; 2]], noise_std, word: &str| {
        for weights in ALL {
            let error = estimate_lateral(flow, noise_std, weights).unwrap_err().to_string();
            assert!(error.starts_with(word), "{error}");
        }
    };
    for noise_std in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
        refused(&[[1.0, 0.0]; 9], Some(noise_std), "noise_std: ");
        assert!(lateral_bound(&[1.0], noise_std).unwrap_err().to_string().starts_with("noise_std: "));
    }
    refused(&[], Some(0.1), "flow: ");
    refused(&[[1.0, 0.0]], None, "flow: ");
    refused(&[[1.0, 0.0], [f64::NAN, 0.0]], None, "flow: ");
    refused(&[[1e200, 0.0], [1.0, 0.0]], None, "flow: ");
    refused(&[[0.0, 0.0]; 9], Some(0.1), "not observable: ");
    let cancel = estimate_lateral(&[[1.0, 0.0], [-1.0, 0.0]], Some(0.1), LateralWeights::Ones).unwrap_err();
    assert!(cancel.to_string().starts_with("not observable: "), "{cancel}");
    assert!(lateral_bound(&[f64::NAN], 0.1).unwrap_err().to_string().starts_with("inv_depth: "));
    assert!(lateral_bound(&[0.0; 3], 0.1).unwrap_err().to_string().starts_with("not observable: "));
    let cancel = lateral_bound(&[1.0, -1.0], 0.1).unwrap();
    assert!(cancel.ones.is_infinite() && cancel.crossover.is_infinite());
    // Around a mean of nothing there is nothing to be drawn to.
    assert!((cancel.shrunk / cancel.likelihood - 1.0).abs() < 1e-12, "{cancel:?}");
}
