//! Weights of particles: normalisation in logarithms and the effective sample size.

/// Normalises log weights by log-sum-exp; returns the logarithm of the sum before.
///
/// NaN counts as `-inf`, a weight of zero. With `w_i L_i` given, `w` normalised, the result is the log
/// evidence `log sum_i w_i L_i`. `None`, and nothing is changed, if no weight is above zero or if one is
/// `+inf`: these cannot be normalised.
pub fn normalise_log_weights(log_weights: &mut [f64]) -> Option<f64> {
    let largest = log_weights.iter().fold(f64::NEG_INFINITY, |most, &value| most.max(value));
    if !largest.is_finite() {
        return None;
    }
    let sum: f64 = log_weights.iter().filter(|value| !value.is_nan()).map(|value| (value - largest).exp()).sum();
    let log_sum = largest + sum.ln();
    for value in log_weights {
        *value = if value.is_nan() { f64::NEG_INFINITY } else { *value - log_sum };
    }
    Some(log_sum)
}

/// `exp` of each log weight, into `out`.
pub fn linear_weights(log_weights: &[f64], out: &mut Vec<f64>) {
    out.clear();
    out.extend(log_weights.iter().map(|value| value.exp()));
}

/// Effective sample size `(sum w)^2 / sum w^2` of linear weights, from 1 to their number.
///
/// Source: A. Kong, J. S. Liu, W. H. Wong, "Sequential imputations and Bayesian missing data problems", 1994.
pub fn effective_sample_size(weights: &[f64]) -> f64 {
    effective(weights.iter().copied())
}

/// [`effective_sample_size`] of normalised log weights.
pub(super) fn effective_sample_size_of_logs(log_weights: &[f64]) -> f64 {
    effective(log_weights.iter().map(|value| value.exp()))
}

fn effective(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = weights.fold((0.0, 0.0), |(sum, squares), w| (sum + w, squares + w * w));
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}
