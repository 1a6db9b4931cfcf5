//! Covariances stay positive definite however small the noise is beside the start.

use super::*;

/// Least eigenvalue of the correlations; variances must be positive.
fn least_correlation(covariance: &[[f64; 12]; 12]) -> f64 {
    let deviation: Vec<f64> = (0..12).map(|k| covariance[k][k].sqrt()).collect();
    assert!(deviation.iter().all(|d| *d > 0.0), "{covariance:?}");
    let correlation = nalgebra::DMatrix::from_fn(12, 12, |a, b| covariance[a][b] / deviation[a] / deviation[b]);
    correlation.symmetric_eigenvalues().min()
}

/// Over some frames of a texture, the least of all sites.
macro_rules! least_of_a_run {
    ($t:ty, $options:expr) => {{
        let mut filter = FlowFilter::<$t>::new((20, 20), $options).unwrap();
        let mut least = f64::INFINITY;
        for t in 0..40 {
            let field = filter.push(&texture(20, 20, t).map(|&v| v as $t)).unwrap();
            assert!(field.status.iter().all(|status| *status != Status::NonFinite));
            for site in 0..filter.len() {
                if let Some((_, covariance)) = filter.state(site) {
                    least = least.min(least_correlation(&covariance));
                }
            }
        }
        least
    }};
}

#[test]
fn correlations_have_no_negative_eigenvalue_beyond_rounding() {
    let patent = FlowFilterOptions::patent;
    let quiet = || FlowFilterOptions { process_noise: [1e-12; 12], measurement_noise: 1e-6, ..patent() };
    for form in FilterForm::ALL {
        for options in [quiet(), FlowFilterOptions { initial_covariance: [1e4; 12], ..quiet() }] {
            let least = least_of_a_run!(f64, FlowFilterOptions { form, ..options });
            assert!(least > -1e-14, "{form:?}: {least}");
        }
        let least = least_of_a_run!(f32, FlowFilterOptions { form, ..patent() });
        assert!(least > -1e-14, "{form:?} in single precision: {least}");
    }
}

#[test]
fn a_start_known_to_nothing_is_no_exception() {
    // Motions of a million pixels a frame are possible at the start, and sigma points lie as far apart.
    let options = FlowFilterOptions { initial_covariance: [1e12; 12], ..FlowFilterOptions::patent() };
    let least = least_of_a_run!(f64, options);
    assert!(least > -1e-14, "{least}");
}
