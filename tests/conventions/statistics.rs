//! Medians, quantiles and robust statistics.

use jacoflow::math::{RARE_STDS, central_median, chi2_deviation, median, nearest_quantile, quantile, robust_std};

#[test]
fn medians_differ_in_the_middle_of_an_even_number() {
    assert_eq!((median::<f64>(&mut []), central_median(&mut [])), (None, None));
    assert_eq!(median(&mut [4.0]), Some(4.0));
    assert_eq!(median(&mut [9.0, -1.0, 2.0]), Some(2.0));
    assert_eq!(median(&mut [9.0f32, -1.0, 2.0, 3.0]), Some(3.0));
    assert_eq!(central_median(&mut [9.0, -1.0, 2.0, 3.0]), Some(2.5));
    assert_eq!(median(&mut [f64::NAN, 1.0, f64::INFINITY]), Some(f64::INFINITY));
}

#[test]
fn quantiles_are_values_of_the_sample() {
    let sample = [5.0, 1.0, 4.0, 2.0, 3.0, 6.0];
    let both = |share: f64| (quantile(&mut sample.clone(), share), nearest_quantile(&mut sample.clone(), share));
    assert_eq!(both(0.0), (Some(1.0), Some(1.0)));
    assert_eq!(both(0.5), (Some(4.0), Some(4.0)));
    assert_eq!(both(0.9), (Some(6.0), Some(6.0)));
    assert_eq!(both(0.25), (Some(2.0), Some(2.0)));
    assert_eq!(both(1.0), (Some(6.0), Some(6.0)));
    assert_eq!((quantile::<f64>(&mut [], 0.5), nearest_quantile(&mut [], 0.5)), (None, None));
}

#[test]
fn the_median_absolute_deviation_of_gaussian_noise_gives_its_standard_deviation() {
    let rng = jacoflow::math::random::CounterRng::new(3);
    let mut sizes: Vec<f64> = (0..20_001).map(|k| (2.5 * rng.normal(k)).abs()).collect();
    assert!((robust_std(&mut sizes).unwrap() / 2.5 - 1.0).abs() < 0.03);
}

#[test]
fn deviations_are_those_of_chi_squared() {
    // Upper 0.001 quantiles of chi-squared with 7, 100 and 597 degrees of freedom.
    for (degrees, quantile) in [(7.0, 24.322), (100.0, 149.449), (597.0, 709.5)] {
        assert!((chi2_deviation(quantile, degrees) - RARE_STDS).abs() < 0.05, "{degrees}");
    }
}
