//! The logarithm of the gamma function and its derivative.

/// `ln |Gamma(x)|`.
pub fn ln_gamma(x: f64) -> f64 {
    libm::lgamma(x)
}

/// From here on the asymptotic series of [`digamma`] is exact to double precision.
const LARGE: f64 = 10.0;

/// `B_2n / (2 n)` of the Bernoulli numbers, n = 1 to 7.
const SERIES: [f64; 7] =
    [1.0 / 12.0, -1.0 / 120.0, 1.0 / 252.0, -1.0 / 240.0, 1.0 / 132.0, -691.0 / 32760.0, 1.0 / 12.0];

/// The digamma function `psi(x) = d ln Gamma(x) / dx` for positive x, to about 1e-15.
///
/// The recurrence `psi(x) = psi(x + 1) - 1 / x` up to 10, from there `ln x - 1 / (2 x) - sum_n B_2n / (2 n
/// x^2n)` (Abramowitz and Stegun 1964, 6.3.5 and 6.3.18).
pub fn digamma(x: f64) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return f64::NAN;
    }
    let (mut at, mut below) = (x, 0.0);
    while at < LARGE {
        below += 1.0 / at;
        at += 1.0;
    }
    let square = 1.0 / (at * at);
    let series = SERIES.iter().rev().fold(0.0, |sum, term| (sum + term) * square);
    at.ln() - 0.5 / at - series - below
}
