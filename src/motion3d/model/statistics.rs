//! Whether chance explains a sum of squares.

/// Deviations of a standard normal that a share of 0.001 lies beyond.
pub(crate) const RARE: f64 = 3.0902;

/// How far, in standard deviations, a chi-squared value of `degrees` degrees of freedom lies from its
/// expectation (E. Wilson, M. Hilferty 1931: its cube root is nearly normal).
pub(crate) fn chi2_deviation(chi2: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    ((chi2 / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Whether chance gives so large a value or a larger one more often than once in a thousand times.
pub(crate) fn by_chance(chi2: f64, degrees: f64) -> bool {
    chi2_deviation(chi2, degrees) < RARE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_those_of_chi_squared() {
        // Upper 0.001 quantiles of chi-squared with 7, 100 and 597 degrees of freedom.
        for (degrees, quantile) in [(7.0, 24.322), (100.0, 149.449), (597.0, 709.5)] {
            assert!((chi2_deviation(quantile, degrees) - RARE).abs() < 0.05, "{degrees}");
        }
    }
}
