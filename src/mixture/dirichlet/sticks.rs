//! Proportions by stick breaking: `pi_k = v_k prod_(j<k) (1 - v_j)`, `v_k ~ Beta(1, alpha)`.
//!
//! J. Sethuraman, "A constructive definition of Dirichlet priors" (1994). Components are in the order of
//! decreasing weight; `T_k = sum_(j>k) N_j` is the weight behind component k.

use super::options::Inference;
use crate::math::{special::digamma, special::ln_gamma};

/// `T_k` (K). Summed from the last: behind the last component with points it is 0 exactly.
fn behind(counts: &[f64]) -> Vec<f64> {
    let mut behind = vec![0.0; counts.len()];
    for k in (1..counts.len()).rev() {
        behind[k - 1] = behind[k] + counts[k];
    }
    behind
}

/// `ln pi_k` (K) by the mode of the posterior or, with [`Inference::Vb`], `E ln pi_k`.
pub(super) fn log_proportions(counts: &[f64], alpha: f64, inference: Inference) -> Vec<f64> {
    let last = counts.len() - 1;
    let mut left = 0.0;
    let mut out = Vec::with_capacity(counts.len());
    for (k, (n, t)) in counts.iter().zip(behind(counts)).enumerate() {
        let (taken, rest) = match inference {
            // The last stick is all that is left.
            Inference::Map if k == last => (0.0, f64::NEG_INFINITY),
            Inference::Map => mode(*n, t + alpha - 1.0),
            Inference::Vb => {
                let both = digamma(1.0 + n + alpha + t);
                (digamma(1.0 + n) - both, digamma(alpha + t) - both)
            }
        };
        out.push(left + taken);
        left += rest;
    }
    out
}

/// `ln v` and `ln (1 - v)` at the mode of Beta(1 + n, 1 + rest); where it has none, v is 0 or 1.
fn mode(n: f64, rest: f64) -> (f64, f64) {
    let rest = rest.max(0.0);
    match (n > 0.0, rest > 0.0) {
        (true, true) => ((n / (n + rest)).ln(), (rest / (n + rest)).ln()),
        (true, false) => (0.0, f64::NEG_INFINITY),
        (false, _) => (f64::NEG_INFINITY, 0.0),
    }
}

/// `pi_k` (K), which sum to 1: at the mode, or the expectations of [`Inference::Vb`] over their sum.
pub(super) fn proportions(counts: &[f64], alpha: f64, inference: Inference) -> Vec<f64> {
    if inference == Inference::Map {
        return log_proportions(counts, alpha, inference).iter().map(|log| log.exp()).collect();
    }
    let mut left = 1.0;
    let sticks = counts.iter().zip(behind(counts)).map(|(n, t)| {
        let both = 1.0 + n + alpha + t;
        let taken = left * (1.0 + n) / both;
        left *= (alpha + t) / both;
        taken
    });
    let expected: Vec<f64> = sticks.collect();
    let sum: f64 = expected.iter().sum();
    expected.iter().map(|value| value / sum).collect()
}

/// Log evidence of the division of the weight among the sticks before the last:
/// `sum_(k<K) ln B(1 + N_k, alpha + T_k) - ln B(1, alpha)`.
pub(super) fn log_evidence(counts: &[f64], alpha: f64) -> f64 {
    let behind = behind(counts);
    // `B(1, alpha) = 1 / alpha`.
    let stick =
        |(n, t): (&f64, &f64)| ln_gamma(1.0 + n) + ln_gamma(alpha + t) - ln_gamma(1.0 + n + alpha + t) + alpha.ln();
    let used = counts.iter().zip(&behind).take(counts.len() - 1).filter(|(n, t)| **n > 0.0 || **t > 0.0);
    used.map(stick).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_evidence_is_the_integral_over_the_stick() {
        // K = 2: one stick, `int alpha (1 - v)^(alpha - 1) v^n (1 - v)^t dv` by the midpoint rule.
        let (n, t, alpha, steps) = (3.0, 2.0, 1.7, 200_000);
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(steps);
        let sum: f64 = (0..steps).map(at).map(|v| alpha * v.powf(n) * (1.0 - v).powf(t + alpha - 1.0)).sum();
        assert!((log_evidence(&[n, t], alpha) - (sum / f64::from(steps)).ln()).abs() < 1e-8);
    }
}
