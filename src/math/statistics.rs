//! Order statistics, the scale of noise that they give among outliers, and chi-squared tests.
//!
//! Functions reorder their values. NaN counts as greater than every number.

use super::Real;

/// Standard deviation over median absolute deviation for Gaussian noise, `1 / Phi^-1(3/4)`.
pub(crate) const MAD_TO_STD: f64 = 1.4826;

/// The upper median: the middle one, of an even number the upper of the two in the middle; `None` of none.
pub(crate) fn median<T: Real>(values: &mut [T]) -> Option<T> {
    quantile(values, 0.5)
}

/// The usual median: of an even number the mean of the two in the middle; `None` of none.
pub(crate) fn central_median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    values.sort_by(f64::total_cmp);
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// The value at place `floor(share n)` of `n` sorted values, at most the largest; `None` of none.
pub(crate) fn quantile<T: Real>(values: &mut [T], share: f64) -> Option<T> {
    let n = values.len();
    let place = (n as f64 * share) as usize;
    select(values, place.min(n.saturating_sub(1)))
}

/// The value at place `share (n - 1)` of `n` sorted values, rounded to the nearest; `None` of none.
pub(crate) fn nearest_quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().saturating_sub(1);
    select(values, (share * last as f64).round() as usize)
}

/// Standard deviation of Gaussian noise from absolute deviations: [`MAD_TO_STD`] times their median.
pub(crate) fn robust_std<T: Real>(absolute_deviations: &mut [T]) -> Option<f64> {
    median(absolute_deviations).map(|median| MAD_TO_STD * median.to_f64())
}

/// Weight of a residual in robust least squares, `1 / (1 + (residual / scale)^2)^2` (S. Geman and D. McClure,
/// 1987).
pub(crate) fn geman_mcclure(residual: f64, scale: f64) -> f64 {
    let outlying = 1.0 + (residual / scale).powi(2);
    1.0 / (outlying * outlying)
}

/// The value at a place of the sorted values.
fn select<T: Real>(values: &mut [T], place: usize) -> Option<T> {
    let in_order = |a: &T, b: &T| a.to_f64().total_cmp(&b.to_f64());
    (place < values.len()).then(|| *values.select_nth_unstable_by(place, in_order).1)
}

/// The 0.999 quantile of the standard normal distribution.
pub(crate) const RARE_STDS: f64 = 3.0902;

/// How far, in standard deviations, a chi-squared value of `degrees` degrees of freedom lies from its
/// expectation (E. Wilson, M. Hilferty 1931: its cube root is nearly normal).
pub(crate) fn chi2_deviation(chi2: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    ((chi2 / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Whether chance gives so large a value or a larger one more often than once in a thousand times.
pub(crate) fn by_chance(chi2: f64, degrees: f64) -> bool {
    chi2_deviation(chi2, degrees) < RARE_STDS
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let rng = crate::math::random::CounterRng::new(3);
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
}
