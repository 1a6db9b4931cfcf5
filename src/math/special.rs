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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digamma_has_its_known_values() {
        let euler = 0.577_215_664_901_532_9;
        let known = [
            (1.0, -euler),
            (0.5, -euler - 2.0 * std::f64::consts::LN_2),
            (2.0, 1.0 - euler),
            (10.0, 2.251_752_589_066_721),
            (1e6, 13.815_510_057_964_191),
            (0.1, -10.423_754_940_411_076),
        ];
        for (x, psi) in known {
            assert!((digamma(x) - psi).abs() <= 2e-15 * f64::max(1.0, psi.abs()), "{x}: {}", digamma(x));
        }
        assert!(digamma(0.0).is_nan() && digamma(f64::NAN).is_nan());
    }

    #[test]
    fn digamma_is_the_slope_of_ln_gamma() {
        for i in 1..60 {
            let x = 0.07 * f64::from(i * i);
            let h = 1e-4 * x;
            let slope = (ln_gamma(x + h) - ln_gamma(x - h)) / (2.0 * h);
            assert!((slope - digamma(x)).abs() < 1e-6 * f64::max(1.0, digamma(x).abs()), "{x}");
        }
    }
}
