//! Order statistics, the scale of noise that they give among outliers, and chi-squared tests.
//!
//! Functions reorder their values. NaN counts as greater than every number.

use super::Real;

/// Standard deviation over median absolute deviation for Gaussian noise, `1 / Phi^-1(3/4)`.
pub const MAD_TO_STD: f64 = 1.4826;

/// The upper median: the middle one, of an even number the upper of the two in the middle; `None` of none.
pub fn median<T: Real>(values: &mut [T]) -> Option<T> {
    quantile(values, 0.5)
}

/// The usual median: of an even number the mean of the two in the middle; `None` of none.
pub fn central_median(values: &mut [f64]) -> Option<f64> {
    let n = values.len();
    values.sort_by(f64::total_cmp);
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// The value at place `floor(share n)` of `n` sorted values, at most the largest; `None` of none.
pub fn quantile<T: Real>(values: &mut [T], share: f64) -> Option<T> {
    let n = values.len();
    let place = (n as f64 * share) as usize;
    select(values, place.min(n.saturating_sub(1)))
}

/// The value at place `share (n - 1)` of `n` sorted values, rounded to the nearest; `None` of none.
pub fn nearest_quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().saturating_sub(1);
    select(values, (share * last as f64).round() as usize)
}

/// Standard deviation of Gaussian noise from absolute deviations: [`MAD_TO_STD`] times their median.
pub fn robust_std<T: Real>(absolute_deviations: &mut [T]) -> Option<f64> {
    median(absolute_deviations).map(|median| MAD_TO_STD * median.to_f64())
}

/// Residuals that determine [`truncated_std`], in standard deviations; their mean square relative to the
/// variance, for a normal distribution cut there.
const CUT: f64 = 2.5;
const CUT_VARIANCE: f64 = 0.911;

/// The share of the information about a variance that is left to residuals cut at 2.5 standard deviations.
pub const TRUNCATED_INFORMATION: f64 = 0.69;

/// Standard deviation of Gaussian noise among outliers: the fixed point of the root mean square of the
/// residuals below 2.5 standard deviations, divided by that of a normal distribution cut there. Begins at 1;
/// `unknowns` that were fitted take their share away.
pub fn truncated_std(residuals: &[f64], unknowns: usize) -> f64 {
    let mut std = 1.0;
    for _ in 0..50 {
        let near = || residuals.iter().filter(|e| e.abs() < CUT * std);
        let (sum, count) = (near().map(|e| e * e).sum::<f64>(), near().count());
        if count <= unknowns || sum <= 0.0 {
            break;
        }
        let next = (sum / (CUT_VARIANCE * (count - unknowns) as f64)).sqrt();
        let settled = (next - std).abs() < 1e-6 * std;
        std = next;
        if settled {
            break;
        }
    }
    std
}

/// Probability of at least `hits` among `n` draws that hit with probability `p`.
pub fn binomial_tail(hits: usize, n: usize, p: f64) -> f64 {
    let mut term = n as f64 * p.ln();
    let mut sum = 0.0;
    for missed in 0..=n - hits {
        sum += term.exp();
        term += ((n - missed) as f64 / (missed + 1) as f64 * (1.0 - p) / p).ln();
    }
    sum
}

/// Weight of a residual in robust least squares, `1 / (1 + (residual / scale)^2)^2` (S. Geman and D. McClure,
/// 1987).
pub fn geman_mcclure(residual: f64, scale: f64) -> f64 {
    let outlying = 1.0 + (residual / scale).powi(2);
    1.0 / (outlying * outlying)
}

/// The value at a place of the sorted values.
fn select<T: Real>(values: &mut [T], place: usize) -> Option<T> {
    let in_order = |a: &T, b: &T| a.to_f64().total_cmp(&b.to_f64());
    (place < values.len()).then(|| *values.select_nth_unstable_by(place, in_order).1)
}

/// The 0.999 quantile of the standard normal distribution.
pub const RARE_STDS: f64 = 3.0902;

/// How far, in standard deviations, a chi-squared value of `degrees` degrees of freedom lies from its
/// expectation (E. Wilson, M. Hilferty 1931: its cube root is nearly normal).
pub fn chi2_deviation(chi2: f64, degrees: f64) -> f64 {
    let spread = 2.0 / (9.0 * degrees);
    ((chi2 / degrees).cbrt() - (1.0 - spread)) / spread.sqrt()
}

/// Whether chance gives so large a value or a larger one more often than once in a thousand times.
pub fn by_chance(chi2: f64, degrees: f64) -> bool {
    chi2_deviation(chi2, degrees) < RARE_STDS
}
