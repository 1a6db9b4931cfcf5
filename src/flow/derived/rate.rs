//! Rates out of displacements: the logarithm of a deformation.
//!
//! Motion that is affine and constant, `x' = L (x - c)`, moves a point within a frame by `(e^L - I) (x - c)`.
//! The Jacobian `D` of a step to the next frame is therefore `e^L - I`, that of the mean of the steps before
//! and after `sinh L`. `L = log(I + D)` or `asinh D` is the rate: its curl is that of the rotation, where `D`
//! is short of it by `sin(a) / a` for a turn by the angle `a`.

use crate::types::Interval;
use nalgebra::Complex;

/// A function of a number with its first three derivatives.
type Series = fn(Complex<f64>) -> [Complex<f64>; 4];

/// Square of the half difference of eigenvalues below which the function is taken from its series.
const CONFLUENT: f64 = 1e-8;

/// The rate `L`, per frame, that makes the Jacobian `(u_x, v_x, u_y, v_y)` of a flow over `interval`, and the
/// rows of its derivative by them. NaN where there is none: area does not turn over or vanish in a step.
pub(super) fn rate(interval: Interval, jacobian: [f64; 4]) -> ([f64; 4], [[f64; 4]; 4]) {
    match interval {
        Interval::Forward => function(logarithm, jacobian),
        Interval::Central => function(inverse_sinh, jacobian),
        Interval::Instant => {
            (jacobian, std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 })))
        }
    }
}

/// `log(1 + z)`.
fn logarithm(z: Complex<f64>) -> [Complex<f64>; 4] {
    let inverse = (z + 1.0).inv();
    [(z + 1.0).ln(), inverse, -inverse * inverse, inverse * inverse * inverse * 2.0]
}

/// `asinh z`.
fn inverse_sinh(z: Complex<f64>) -> [Complex<f64>; 4] {
    let square = z * z + 1.0;
    let first = square.sqrt().inv();
    let cube = first / square;
    [z.asinh(), first, -z * cube, (z * z * 2.0 - 1.0) * cube / square]
}

/// The function of the matrix `D = a I + N` with `N` free of trace, `N^2 = s I` and eigenvalues `a +-
/// sqrt(s)`: `p I + q N`, with `p` the mean of the function over the eigenvalues and `q` its divided
/// difference.
fn function(series: Series, [ux, vx, uy, vy]: [f64; 4]) -> ([f64; 4], [[f64; 4]; 4]) {
    let (a, half) = (0.5 * (ux + vy), 0.5 * (ux - vy));
    let square = half * half + uy * vx;
    let (p, q, p_a, q_a, q_s);
    if square.abs() > CONFLUENT {
        let root = Complex::new(square, 0.0).sqrt();
        let (above, below) = (series(root + a), series(-root + a));
        p = (0.5 * (above[0] + below[0])).re;
        q = (0.5 * (above[0] - below[0]) / root).re;
        p_a = (0.5 * (above[1] + below[1])).re;
        q_a = (0.5 * (above[1] - below[1]) / root).re;
        q_s = 0.5 * (p_a - q) / square;
    } else {
        let [value, first, second, third] =
            series(Complex::new(a, 0.0)).map(|z| if z.im == 0.0 { z.re } else { f64::NAN });
        p = value + 0.5 * second * square;
        q = first + third * square / 6.0;
        (p_a, q_a, q_s) = (first + 0.5 * third * square, second, third / 6.0);
    }
    // Eigenvalues of both signs give a real matrix no real function.
    let is_real =
        square <= 0.0 || [a + square.sqrt(), a - square.sqrt()].iter().all(|&z| series(z.into())[0].im == 0.0);
    if !is_real {
        return ([f64::NAN; 4], [[f64::NAN; 4]; 4]);
    }
    let traceless = [half, vx, uy, -half];
    // Derivatives of a and s by (u_x, v_x, u_y, v_y); that of p by s is q_a / 2.
    let (a_by, s_by) = ([0.5, 0.0, 0.0, 0.5], [half, uy, vx, -half]);
    let identity = [1.0, 0.0, 0.0, 1.0];
    let value = std::array::from_fn(|i| p * identity[i] + q * traceless[i]);
    let rows = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (p_by, q_by) = (p_a * a_by[j] + 0.5 * q_a * s_by[j], q_a * a_by[j] + q_s * s_by[j]);
            let traceless_by = f64::from(i == j) - identity[i] * a_by[j];
            p_by * identity[i] + q_by * traceless[i] + q * traceless_by
        })
    });
    (value, rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    /// Steps that a rate makes, from the exponential series.
    fn steps(rate: Matrix2<f64>) -> (Matrix2<f64>, Matrix2<f64>) {
        let (forward, backward) = (rate.exp(), (-rate).exp());
        (forward - Matrix2::identity(), 0.5 * (forward - backward))
    }

    const RATES: [[f64; 4]; 6] = [
        [0.0, 0.26, -0.26, 0.0],
        [0.18, 0.0, 0.0, 0.18],
        [0.1, 0.2, -0.15, -0.05],
        [0.05, 0.3, 0.2, -0.1],
        [1e-6, 2e-6, -3e-6, 0.0],
        [0.1, 0.0, 0.07, 0.1],
    ];

    #[test]
    fn rates_of_constant_affine_motion_are_found_exactly() {
        for [ux, vx, uy, vy] in RATES {
            let (forward, central) = steps(Matrix2::new(ux, uy, vx, vy));
            for (interval, d) in [(Interval::Forward, forward), (Interval::Central, central)] {
                let found = rate(interval, [d[(0, 0)], d[(1, 0)], d[(0, 1)], d[(1, 1)]]).0;
                for (found, want) in found.iter().zip([ux, vx, uy, vy]) {
                    assert!((found - want).abs() < 1e-12, "{interval:?} {found} {want}");
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        const STEP: f64 = 1e-6;
        for jacobian in RATES {
            for interval in Interval::ALL {
                let rows = rate(interval, jacobian).1;
                for j in 0..4 {
                    let at = |by: f64| {
                        let mut moved = jacobian;
                        moved[j] += by;
                        rate(interval, moved).0
                    };
                    let (above, below) = (at(STEP), at(-STEP));
                    for i in 0..4 {
                        let want = (above[i] - below[i]) / (2.0 * STEP);
                        assert!((rows[i][j] - want).abs() < 1e-7, "{interval:?} {i} {j}: {} {want}", rows[i][j]);
                    }
                }
            }
        }
    }

    #[test]
    fn a_step_that_turns_over_has_no_rate() {
        assert!(rate(Interval::Forward, [-1.5, 0.0, 0.0, 0.1]).0[0].is_nan());
    }
}
