//! Exact cases, invariances and extremes.

use super::*;
use crate::math::random::CounterRng;
use crate::mixture::options::CovariancePrior;
use crate::mixture::points::Points;
use crate::parallel::Threads;

/// Case D1 of twenty points in the plane, without random numbers: points, weights, responsibilities (20, 3).
fn case_d1() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let (mut x, mut w, mut r) = (vec![], vec![], vec![]);
    for n in 0..20 {
        let (at, odd) = (f64::from(n), f64::from(n % 2));
        x.extend([6.0 * odd - 3.0 + 0.5 * (3.0 * at).sin(), odd + 0.7 * (2.0 * at).cos()]);
        w.push(f64::from(1 + 7 * n % 5));
        let row = [0, 1, 2].map(|k| f64::from(1 + (n + 2 * k) % 3) + if k == 1 { odd } else { 0.0 });
        r.extend(row.map(|value| value / row.iter().sum::<f64>()));
    }
    (x, w, r)
}

/// Options of case D1: `S0 = I`, no merging, exactly `rounds` rounds.
fn options(rounds: usize) -> DirichletOptions {
    DirichletOptions {
        n_components: 3,
        covariance_prior: CovariancePrior::Isotropic(1.0),
        merge: false,
        max_iter: rounds,
        tol: None,
        ..DirichletOptions::default()
    }
}

fn assert_near(got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len());
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() <= tolerance, "{got} is not {want}");
    }
}

/// Case D1 with other options.
fn d1(options: &DirichletOptions) -> DirichletMixture {
    let (x, w, r) = case_d1();
    fit_dirichlet_from(&Points { dimensions: 2, values: &x, weights: Some(&w) }, options, &r).unwrap()
}

#[test]
fn case_d1_has_its_published_figures() {
    let one = d1(&options(1));
    assert_near(&one.weights, &[0.372_619_047_6, 0.314_285_714_3, 0.313_095_238_1], 1e-9);
    assert_near(&one.means[..2], &[0.207_655_743_3, 0.549_303_724_6], 1e-9);
    let [xx, xy, yy] = [0, 1, 3].map(|at| one.covariances[at]);
    assert_near(&[xx, xy, yy], &[8.304_617_046_8, 1.259_068_652_3, 0.413_569_300_4], 1e-9);
    assert_near(&[one.lower_bound], &[-252.482_663_656_7], 1e-9);
    let (x, w, _) = case_d1();
    let (logs, _) = one.log_densities(&Points { dimensions: 2, values: &x, weights: None }).unwrap();
    let likelihood: f64 = logs.iter().zip(&w).map(|(log, w)| w * log).sum();
    assert_near(&[likelihood], &[-202.968_331_173_4], 1e-9);

    let five = d1(&options(5));
    assert_near(&five.weights, &[0.373_641_412_6, 0.318_920_006_7, 0.307_438_580_6], 1e-9);
    assert_near(&[five.lower_bound], &[-251.104_797_753_5], 1e-9);

    let fifty = d1(&options(50));
    assert_near(&fifty.counts, &[30.0, 16.057_621_094_8, 13.942_378_905_2], 1e-9);
    assert_near(&fifty.means[..2], &[3.345_230_331_5, 1.027_437_120_3], 1e-9);
    assert_near(&[fifty.lower_bound], &[-110.868_222_661_9], 1e-9);
}

#[test]
fn concentration_and_inference_of_case_d1() {
    let half = d1(&DirichletOptions { weight_concentration: 0.5, ..options(50) });
    assert_near(&half.weights, &[0.504_201_680_7, 0.272_430_545_0, 0.223_367_774_3], 1e-9);

    // Of variational Bayes the expectations of the logarithms are published: they are those of the counts.
    let five = d1(&DirichletOptions { inference: Inference::Vb, ..options(5) });
    let logs = sticks::log_proportions(&five.counts, 1.0, Inference::Vb);
    let proportions: Vec<f64> = logs.iter().map(|log| log.exp()).collect();
    assert_near(&proportions, &[0.444_085_478_3, 0.302_767_529_2, 0.222_411_085_4], 1e-9);
}

#[test]
fn merging_of_case_d1() {
    let merged = d1(&DirichletOptions { merge: true, ..options(50) });
    assert_near(&merged.counts, &[30.0, 30.0, 0.0], 1e-9);
    assert_near(&merged.means[2..4], &[-3.342_932_669_4, -0.030_359_543_6], 1e-9);
    assert_near(&[merged.lower_bound], &[-100.959_059_839_9], 1e-9);
    assert_eq!(merged.n_active(), 2);
}
