//! Exact cases, invariances and extremes of fits.

use jacoflow::error::Result;
use jacoflow::math::random::CounterRng;
use jacoflow::mixture::{
    CovariancePrior, Fit, MixtureOptions, Points, Posterior, Retained, Seeding, Start, fit, partial_fit,
};
use jacoflow::parallel::Threads;

/// Case M1 of twenty points, without random numbers: points, frequencies, responsibilities.
fn case_m1() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let (mut x, mut f, mut r) = (vec![], vec![], vec![]);
    for n in 0..20 {
        let (at, odd) = (f64::from(n), f64::from(n % 2));
        x.extend([
            6.0 * odd - 3.0 + 0.5 * (3.0 * at).sin(),
            odd + 0.7 * (2.0 * at).cos(),
            0.3 * (5.0 * at + 1.0).sin(),
        ]);
        f.push(f64::from(1 + 7 * n % 5));
        let row = [0, 1, 2].map(|k| f64::from(1 + (n + 2 * k) % 3) + if k == 1 { odd } else { 0.0 });
        r.extend(row.map(|value| value / row.iter().sum::<f64>()));
    }
    (x, f, r)
}

fn options(components: usize, max_iter: usize) -> MixtureOptions {
    let covariance_prior = CovariancePrior::Isotropic(0.1);
    MixtureOptions { components, covariance_prior, tol: None, max_iter, ..MixtureOptions::default() }
}

fn assert_near(got: &[f64], want: &[f64], tolerance: f64) {
    assert_eq!(got.len(), want.len());
    for (got, want) in got.iter().zip(want) {
        assert!((got - want).abs() <= tolerance * want.abs().max(1.0), "{got} is not {want}");
    }
}

#[test]
fn case_m1_has_its_published_figures() {
    let (x, f, r) = case_m1();
    let points = Points { dimensions: 3, values: &x, weights: Some(&f) };
    let run = |rounds| fit(&points, &options(3, rounds), Start::Responsibilities(&r)).unwrap();
    let bound =
        |fit: &Fit, want: f64| assert!((fit.lower_bound() - want).abs() < 1e-10 * want.abs(), "{}", fit.lower_bound());

    let one = run(1);
    assert_near(&one.posterior.weight_concentration, &[18.957_142_857_1, 22.457_142_857_1, 18.885_714_285_7], 1e-9);
    assert_near(&one.posterior.means[..3], &[-0.194_713_363_6, 0.308_919_381_2, -0.051_465_950_6], 1e-9);
    let diagonal = [0, 4, 8].map(|i| one.posterior.scale_inverses[i]);
    assert_near(&diagonal, &[209.987_143_38, 10.167_241_942, 1.160_091_312_0], 1e-9);
    bound(&one, -421.981_913_251_3);

    let five = run(5);
    assert_near(&five.posterior.weight_concentration, &[22.483_765_445_5, 19.742_114_118_9, 18.074_120_435_6], 1e-9);
    bound(&five, -365.883_309_872_7);
    let shares = five.posterior.responsibilities(&points).unwrap();
    assert_near(&shares[..3], &[0.005_228_325_7, 0.341_929_165_0, 0.652_842_509_2], 1e-9);

    let fifty = run(50);
    assert_near(&fifty.posterior.weight_concentration, &[24.805_043_197_1, 15.417_579_141_0, 20.077_377_661_5], 1e-9);
    assert_near(&fifty.posterior.means[..3], &[0.042_957_660_2, 0.146_853_531_8, 0.025_029_856_2], 1e-9);
    bound(&fifty, -336.427_473_676_7);

    let better = fit(&points, &options(3, 100), Start::Seeds).unwrap().lower_bound();
    assert!((-118.0..-106.0).contains(&better), "from k-means++: {better}");
}

/// Points about a few centres, with whole weights.
fn clusters(count: usize, dimensions: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let rng = CounterRng::new(seed);
    let at =
        |n: usize, d: usize| 8.0 * rng.stream(n as u64 % 4).normal(d as u64) + rng.normal((n * dimensions + d) as u64);
    let x = (0..count).flat_map(|n| (0..dimensions).map(move |d| (n, d))).map(|(n, d)| at(n, d)).collect();
    let f = (0..count).map(|n| (rng.bits(n as u64) % 4) as f64).collect();
    (x, f)
}

#[test]
fn frequencies_are_repeated_points() {
    for dimensions in [2, 3, 5, 8] {
        let (x, f) = clusters(300, dimensions, 3);
        let weighted = Points { dimensions, values: &x, weights: Some(&f) };
        let repeated: Vec<f64> = x.chunks(dimensions).zip(&f).flat_map(|(x, f)| x.repeat(*f as usize)).collect();
        let repeated = Points { dimensions, values: &repeated, weights: None };
        for prior in [CovariancePrior::Isotropic(0.1), CovariancePrior::Data] {
            let options = MixtureOptions { covariance_prior: prior, ..options(6, 40) };
            let [a, b] = [&weighted, &repeated].map(|points| fit(points, &options, Start::Seeds).unwrap());
            assert_near(&a.posterior.weight_concentration, &b.posterior.weight_concentration, 1e-10);
            assert_near(&a.posterior.means, &b.posterior.means, 1e-10);
            assert_near(&a.posterior.scale_inverses, &b.posterior.scale_inverses, 1e-9);
            assert_near(&[a.lower_bound()], &[b.lower_bound()], 1e-12);
        }
    }
}

#[test]
fn the_bound_never_falls() {
    for seed in 0..6 {
        let (x, f) = clusters(400, 3, seed);
        let points = Points { dimensions: 3, values: &x, weights: Some(&f) };
        let fit = fit(
            &points,
            &MixtureOptions { random_state: seed, seeding: Seeding::Random, ..options(8, 80) },
            Start::Seeds,
        )
        .unwrap();
        assert_eq!(fit.lower_bounds.len(), 80);
        for pair in fit.lower_bounds.windows(2) {
            assert!(pair[1] >= pair[0] - 1e-11 * pair[0].abs(), "{pair:?}");
        }
    }
}

#[test]
fn order_of_points_threads_and_units_make_no_difference() {
    let (x, f) = clusters(3000, 3, 5);
    let points = Points { dimensions: 3, values: &x, weights: Some(&f) };
    let run = |points: &Points, options: &MixtureOptions| fit(points, options, Start::Seeds).unwrap();
    let usual = run(&points, &options(6, 30));

    for threads in [1, 2, 3] {
        let threads = Threads::new(Some(threads)).unwrap();
        assert_eq!(run(&points, &MixtureOptions { threads, ..options(6, 30) }).posterior, usual.posterior);
    }

    let reversed: Vec<f64> = x.chunks(3).rev().flatten().copied().collect();
    let weights: Vec<f64> = f.iter().rev().copied().collect();
    let other = run(&Points { dimensions: 3, values: &reversed, weights: Some(&weights) }, &options(6, 30));
    assert_near(&other.posterior.means, &usual.posterior.means, 1e-9);

    let scaled: Vec<f64> = x.iter().map(|x| 1000.0 * x + 5e4).collect();
    let covariance_prior = CovariancePrior::Isotropic(0.1e6);
    let other = run(&Points { values: &scaled, ..points }, &MixtureOptions { covariance_prior, ..options(6, 30) });
    let means: Vec<f64> = usual.posterior.means.iter().map(|m| 1000.0 * m + 5e4).collect();
    assert_near(&other.posterior.means, &means, 1e-9);
}

#[test]
fn order_of_components_makes_no_difference() {
    let (x, f, r) = case_m1();
    let points = Points { dimensions: 3, values: &x, weights: Some(&f) };
    let turned: Vec<f64> = r.chunks(3).flat_map(|row| [row[2], row[0], row[1]]).collect();
    let [a, b] = [r, turned].map(|r| fit(&points, &options(3, 20), Start::Responsibilities(&r)).unwrap().posterior);
    // Component k of `a` is component k + 1 of `b`: each row of its values is found one row later.
    let rotated = |values: &[f64], d: usize| [&values[d..], &values[..d]].concat();
    assert_near(&rotated(&b.weight_concentration, 1), &a.weight_concentration, 1e-12);
    assert_near(&rotated(&b.mean_precision, 1), &a.mean_precision, 1e-12);
    assert_near(&rotated(&b.degrees_of_freedom, 1), &a.degrees_of_freedom, 1e-12);
    assert_near(&rotated(&b.means, 3), &a.means, 1e-12);
    assert_near(&rotated(&b.scale_inverses, 9), &a.scale_inverses, 1e-12);
}

#[test]
fn surplus_components_stay_at_the_prior_and_extremes_stay_finite() {
    let check = |x: &[f64], f: Option<&[f64]>, dimensions| -> Result<Fit> {
        let points = Points { dimensions, values: x, weights: f };
        let fit = fit(&points, &options(12, 100), Start::Seeds)?;
        let shares = fit.posterior.responsibilities(&points)?;
        let numbers = fit.posterior.means.iter().chain(&fit.posterior.scale_inverses).chain(&shares);
        assert!(numbers.chain(&fit.lower_bounds).all(|value| value.is_finite()));
        Ok(fit)
    };
    // Fewer points than components; all points equal; points in a plane.
    let few = check(&[0.0, 0.0, 5.0, 5.0, 9.0, 0.0], None, 2).unwrap();
    let empty = few.moments.counts.iter().position(|n| *n == 0.0).expect("some component has no points");
    assert_near(&few.posterior.means[2 * empty..2 * empty + 2], &few.prior.mean, 1e-12);
    check(&[4.0; 60], None, 3).unwrap();
    let plane: Vec<f64> = (0..50).flat_map(|i| [f64::from(i % 7), f64::from(i % 5), 2.0]).collect();
    check(&plane, None, 3).unwrap();
    // Far outliers, tiny and huge weights.
    let (mut x, f) = clusters(200, 3, 1);
    x[0] = 1e6;
    x[7] = -1e6;
    check(&x, Some(&f), 3).unwrap();
    for scale in [1e-8, 1e8] {
        let weights: Vec<f64> = f.iter().map(|f| scale * f).collect();
        check(&x, Some(&weights), 3).unwrap();
    }
}

#[test]
fn units_of_single_axes_make_no_difference() {
    // Variances 1e18 apart are no flat cloud.
    let (x, f) = clusters(300, 2, 5);
    let shares: Vec<f64> = (0..300).flat_map(|n| if (n / 3) % 2 == 0 { [0.7, 0.3] } else { [0.2, 0.8] }).collect();
    let fitted = |unit: f64| {
        let x: Vec<f64> = x.iter().enumerate().map(|(at, x)| if at % 2 == 0 { *x } else { x * unit }).collect();
        let points = Points { dimensions: 2, values: &x, weights: Some(&f) };
        let options = MixtureOptions { components: 2, ..MixtureOptions::default() };
        fit(&points, &options, Start::Responsibilities(&shares)).unwrap().posterior
    };
    let (usual, other) = (fitted(1.0), fitted(1e-9));
    for k in 0..2 {
        assert_near(&other.means[2 * k..=2 * k], &usual.means[2 * k..=2 * k], 1e-9);
        assert_near(&[1e9 * other.means[2 * k + 1]], &[usual.means[2 * k + 1]], 1e-9);
        assert_near(&[1e18 * other.scale_inverses[4 * k + 3]], &[usual.scale_inverses[4 * k + 3]], 1e-6);
    }
}

#[test]
fn equal_points_have_no_spread_however_large() {
    let x = [1e139 / 3.0; 100];
    let options = MixtureOptions { components: 3, seeding: Seeding::Random, ..MixtureOptions::default() };
    let fit = fit(&Points { dimensions: 2, values: &x, weights: None }, &options, Start::Seeds).unwrap();
    assert_eq!(fit.prior.mean, x[..2]);
    assert_near(&fit.prior.scale_inverse, &[1e-6, 0.0, 0.0, 1e-6], 1e-12);
    for pair in fit.lower_bounds.windows(2) {
        assert!(pair[1] >= pair[0] - 1e-11 * pair[0].abs(), "{pair:?}");
    }
}

#[test]
fn precisions_are_inverses_and_exist_where_rounding_leaves_none() {
    let (x, _) = clusters(200, 3, 2);
    let points = Points { dimensions: 3, values: &x, weights: None };
    let posterior = fit(&points, &options(2, 5), Start::Seeds).unwrap().posterior;
    let precisions = posterior.precisions().unwrap();
    for k in 0..2 {
        for (i, j) in [(0, 0), (1, 0), (2, 1), (2, 2)] {
            let row = |m: usize| posterior.scale_inverses[(3 * k + i) * 3 + m] / posterior.degrees_of_freedom[k];
            let product: f64 = (0..3).map(|m| row(m) * precisions[(3 * k + m) * 3 + j]).sum();
            assert_near(&[product], &[f64::from(u8::from(i == j))], 1e-10);
        }
    }
    // On a line, and what the prior adds is lost beside what the line has.
    let line: Vec<f64> = (0..100).flat_map(|n| [1e6 * f64::from(n); 3]).collect();
    let narrow = MixtureOptions { covariance_prior: CovariancePrior::Isotropic(1e-9), ..options(3, 20) };
    let fit = fit(&Points { dimensions: 3, values: &line, weights: None }, &narrow, Start::Seeds).unwrap();
    assert!(fit.posterior.precisions().unwrap().iter().all(|value| value.is_finite()));
}

#[test]
fn components_begin_where_they_are_given() {
    let (x, f) = clusters(500, 3, 8);
    let points = Points { dimensions: 3, values: &x, weights: Some(&f) };
    let all = fit(&points, &options(5, 60), Start::Seeds).unwrap();
    let first = fit(&points, &options(5, 20), Start::Seeds).unwrap();
    let rest = fit(&points, &options(5, 40), Start::Components(&first.posterior)).unwrap();
    assert_near(&rest.posterior.means, &all.posterior.means, 1e-9);
    assert_near(&rest.posterior.scale_inverses, &all.posterior.scale_inverses, 1e-9);
}

#[test]
fn small_components_can_be_left_out() {
    let (x, f) = clusters(500, 2, 9);
    let points = Points { dimensions: 2, values: &x, weights: Some(&f) };
    let pruned = fit(&points, &MixtureOptions { prune_weight: 5.0, ..options(20, 100) }, Start::Seeds).unwrap();
    let components = pruned.posterior.components();
    assert!((4..20).contains(&components), "{components}");
    assert!(pruned.moments.counts.iter().all(|n| *n >= 5.0));
    let all = fit(&points, &MixtureOptions { prune_weight: 1e9, ..options(20, 100) }, Start::Seeds).unwrap();
    assert_eq!(all.posterior.components(), 1);
}

#[test]
fn batches_leave_what_one_fit_to_all_points_does() {
    let (x, f) = clusters(2000, 3, 4);
    let options = MixtureOptions { tol: Some(1e-9), max_iter: 400, ..options(4, 100) };
    let whole = fit(&Points { dimensions: 3, values: &x, weights: Some(&f) }, &options, Start::Seeds).unwrap();
    let mut retained: Option<Retained> = None;
    for batch in 0..10 {
        let points =
            Points { dimensions: 3, values: &x[batch * 600..][..600], weights: Some(&f[batch * 200..][..200]) };
        // The prior of the whole: that of a batch has the batch's mean.
        let options = MixtureOptions { mean_prior: Some(whole.prior.mean.clone()), ..options.clone() };
        let fit = partial_fit(&points, &options, retained.as_ref(), 1.0).unwrap();
        for pair in fit.lower_bounds.windows(2) {
            assert!(pair[1] >= pair[0] - 1e-11 * pair[0].abs(), "{pair:?}");
        }
        retained = Some(Retained::of(&fit));
    }
    let retained = retained.unwrap();
    let sorted = |posterior: &Posterior| {
        let mut rows: Vec<[f64; 4]> = (0..4)
            .map(|k| {
                [
                    posterior.weight_concentration[k],
                    posterior.means[3 * k],
                    posterior.means[3 * k + 1],
                    posterior.means[3 * k + 2],
                ]
            })
            .collect();
        rows.sort_by(|a, b| a[1].total_cmp(&b[1]));
        rows.concat()
    };
    assert_near(&sorted(&retained.posterior), &sorted(&whole.posterior), 1e-6);
    assert_near(&[retained.total()], &[f.iter().sum()], 1e-12);
}

#[test]
fn forgetting_lets_components_follow_what_moves() {
    let batch =
        |at: f64| -> Vec<f64> { (0..300).map(|i| at + 0.01 * f64::from(i % 20) + 40.0 * f64::from(i % 2)).collect() };
    let settled = |forgetting: f64| {
        let mut retained: Option<Retained> = None;
        for step in 0..40 {
            let x = batch(0.25 * f64::from(step));
            let points = Points { dimensions: 1, values: &x, weights: None };
            let fit = partial_fit(&points, &options(2, 50), retained.as_ref(), forgetting).unwrap();
            retained = Some(Retained::of(&fit));
        }
        let retained = retained.unwrap();
        let least = retained.posterior.means.iter().copied().fold(f64::INFINITY, f64::min);
        (least, retained.total())
    };
    let ((following, weight), (average, _)) = (settled(0.5), settled(1.0));
    // The mean lags by one step a batch times f / (1 - f); without forgetting it is that of all batches.
    assert!((following - (39.0 * 0.25 + 0.095 - 0.25)).abs() < 0.02, "{following}");
    assert!((average - (19.5 * 0.25 + 0.095)).abs() < 0.02, "{average}");
    assert!((weight - 600.0).abs() < 1e-6, "{weight}");
}

#[test]
fn what_cannot_be_used_is_named() {
    let x = [0.0, 1.0, 2.0, 3.0];
    let points = Points { dimensions: 2, values: &x, weights: None };
    let told = |points: &Points, options: &MixtureOptions| fit(points, options, Start::Seeds).unwrap_err().to_string();
    let usual = options(2, 5);
    let prior = |prior| MixtureOptions { covariance_prior: prior, ..usual.clone() };
    for (name, options) in [
        ("n_components", MixtureOptions { components: 0, ..usual.clone() }),
        ("n_components", MixtureOptions { components: usize::MAX, ..usual.clone() }),
        ("mean_prior", MixtureOptions { mean_prior: Some(vec![1e300, 0.0]), ..usual.clone() }),
        ("weight_concentration_prior", MixtureOptions { weight_concentration_prior: 0.0, ..usual.clone() }),
        ("weight_concentration_prior", MixtureOptions { weight_concentration_prior: 1e307, ..usual.clone() }),
        ("mean_precision_prior", MixtureOptions { mean_precision_prior: -1.0, ..usual.clone() }),
        ("mean_prior", MixtureOptions { mean_prior: Some(vec![0.0]), ..usual.clone() }),
        ("degrees_of_freedom_prior", MixtureOptions { degrees_of_freedom_prior: Some(1.0), ..usual.clone() }),
        ("covariance_prior", prior(CovariancePrior::Isotropic(0.0))),
        ("covariance_prior", prior(CovariancePrior::Full(vec![1.0, 0.5, 0.2, 1.0]))),
        ("covariance_prior", prior(CovariancePrior::Full(vec![1.0, 2.0, 2.0, 1.0]))),
        ("tol", MixtureOptions { tol: Some(f64::NAN), ..usual.clone() }),
    ] {
        assert!(told(&points, &options).starts_with(&format!("{name}: ")), "{}", told(&points, &options));
    }
    for (name, points) in [
        ("X", Points { values: &[], ..points }),
        ("X", Points { values: &[0.0, f64::NAN], ..points }),
        ("sample_weight", Points { weights: Some(&[1.0]), ..points }),
        ("sample_weight", Points { weights: Some(&[1.0, -1.0]), ..points }),
        ("sample_weight", Points { weights: Some(&[0.0, 0.0]), ..points }),
        ("sample_weight", Points { weights: Some(&[f64::INFINITY, 0.0]), ..points }),
    ] {
        assert!(told(&points, &usual).starts_with(&format!("{name}: ")), "{}", told(&points, &usual));
    }
    for resp in [&[0.5; 3][..], &[0.7; 4], &[2.0, -1.0, 0.0, 1.0]] {
        let error = fit(&points, &usual, Start::Responsibilities(resp)).unwrap_err().to_string();
        assert!(error.starts_with("resp: "), "{error}");
    }
}
