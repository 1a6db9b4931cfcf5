//! Truncation errors of the equations, present even without noise.
//!
//! The equations hold for quadratic brightness and small steps in time. On texture the stencils see higher
//! derivatives too, `L_j = sum_ab M_j(a, b) d_x^a d_y^b` with `M_j(a, b) = sum_o L_j(o) o_x^a o_y^b / (a!
//! b!)`; a difference over frames is `d_t + c2 d_t^2 + c3 d_t^3`; and smoothing does not commute with strain.
//! Brightness carried along gives `d_t = -(u d_x + v d_y)`, so the residual r that the true motion leaves in
//! `i' + P(i) m` is known from the image itself, to leading order: second to fourth derivatives times
//! [`Truncation::rows`], linear in m, and third powers of the flow from the difference in time. For rows 7-12
//! the same holds with i' for i. Windows sum it as `sum w T^T P^T r`; `N^-1` of that is minus the bias of the
//! estimate.

use super::combine::Combination;
use super::jet_matrix::basis;
use crate::jet::{JetStencil, TimeScheme};
use crate::simd::Lanes;

/// The derivatives that residuals are made of, as powers of d_x and d_y: third, fourth, second.
const POWERS: [(usize, usize); 12] =
    [(3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4), (2, 0), (1, 1), (0, 2)];
/// Which component of the jet each of them is taken from, and the axis (0: x, 1: y) of the difference, first
/// for third and second for fourth derivatives.
pub(super) const DIFFERENCED: [(usize, usize); 12] =
    [(3, 0), (3, 1), (5, 0), (5, 1), (3, 0), (4, 0), (3, 1), (4, 1), (5, 1), (3, 0), (4, 0), (5, 0)];
/// The derivative (2, 2), the mean of the two ways to take it: neither axis comes first.
pub(super) const MIXED: usize = 6;
/// How many derivatives there are.
pub(super) const DERIVATIVES: usize = POWERS.len();

/// Coefficients of the leading truncation errors.
#[derive(Debug, Clone)]
pub(super) struct Truncation {
    /// `rows[k][a][d]`: derivative d of the image in the residual of row k, per unit of unknown a.
    pub rows: [[[f64; DERIVATIVES]; 6]; 6],
    /// The same without zeros: for each row (d, a, coefficient).
    terms: [Vec<(usize, usize, f64)>; 6],
    /// Errors of the differences in time for rows 1-6 and 7-12: of the second and of the third derivative.
    time: [[f64; 2]; 2],
    /// Variance of the smoothing, px^2.
    pub smoothing: f64,
}

impl Truncation {
    /// For this stencil, these differences in time, and frames smoothed by `smooth` px.
    pub fn new(stencil: &JetStencil, combination: Combination, smooth: Option<f64>) -> Self {
        let mut rows = [[[0.0; DERIVATIVES]; 6]; 6];
        let basis = basis(6);
        for (k, row) in rows.iter_mut().enumerate() {
            for (a, row) in row.iter_mut().enumerate() {
                for (d, entry) in row.iter_mut().enumerate().take(if a < 2 { 9 } else { 4 }) {
                    let kept: f64 = (0..6).map(|j| basis[j][a][k] * moment(stencil, j, POWERS[d])).sum();
                    *entry = kept - carried(stencil, k, a, POWERS[d]);
                }
            }
        }
        let smoothing = smooth.map_or(0.0, |s| s * s);
        smoothed(smoothing, &mut rows);
        let terms = std::array::from_fn(|k| {
            let every = (0..DERIVATIVES).flat_map(|d| (0..6).map(move |a| (d, a)));
            every.map(|(d, a)| (d, a, rows[k][a][d])).filter(|t| t.2.abs() > 1e-12).collect()
        });
        // The mean of a pair, of which its coefficients are made, is off by 1/8 of the second derivative.
        let time = match combination {
            Combination::Pair => [[0.0, 1.0 / 24.0 - 1.0 / 8.0]; 2],
            Combination::Triple(TimeScheme::Central) => [[0.0, 1.0 / 6.0], [0.0, 1.0 / 12.0 - 1.0 / 6.0]],
            Combination::Triple(TimeScheme::Backward) => [[-0.5, 1.0 / 6.0], [-0.5, 7.0 / 12.0 - 1.0 / 6.0]],
        };
        Self { rows, terms, time, smoothing }
    }

    /// Offsets and weights with which derivative d is taken from the image.
    pub fn derivative(stencil: &JetStencil, d: usize) -> Vec<((i32, i32), f64)> {
        if d == MIXED {
            let [one, other] = [(3, 1), (5, 0)].map(|from| Self::difference(stencil, d, from));
            return one.into_iter().chain(other).map(|(at, weight)| (at, 0.5 * weight)).collect();
        }
        Self::difference(stencil, d, DIFFERENCED[d])
    }

    fn difference(stencil: &JetStencil, d: usize, (component, axis): (usize, usize)) -> Vec<((i32, i32), f64)> {
        let steps: &[(i32, f64)] = match d {
            0..4 => &[(-1, -0.5), (1, 0.5)],
            4..9 => &[(-1, 1.0), (0, -2.0), (1, 1.0)],
            _ => &[(0, 1.0)],
        };
        let mut kernel = Vec::new();
        for (o, w) in stencil.offsets().iter().zip(stencil.weights()) {
            for (step, weight) in steps {
                let shifted = if axis == 0 { (o.0 + step, o.1) } else { (o.0, o.1 + step) };
                kernel.push((shifted, weight * w[component]));
            }
        }
        kernel
    }
}

/// `M_j(a, b)`.
fn moment(stencil: &JetStencil, j: usize, (a, b): (usize, usize)) -> f64 {
    let factorial = |n: usize| (1..=n).product::<usize>() as f64;
    let terms = stencil.offsets().iter().zip(stencil.weights());
    let sum: f64 = terms.map(|(o, w)| w[j] * f64::from(o.0).powi(a as i32) * f64::from(o.1).powi(b as i32)).sum();
    sum / (factorial(a) * factorial(b))
}

/// What stencil k makes of `x_j d_i` of the image, for unknown a = the derivative along j of the flow's
/// component i (or that component itself): the coefficient of the derivative of these powers.
fn carried(stencil: &JetStencil, k: usize, a: usize, (mut x, mut y): (usize, usize)) -> f64 {
    let power = if a.is_multiple_of(2) { &mut x } else { &mut y };
    if *power == 0 {
        return 0.0;
    }
    *power -= 1;
    match a / 2 {
        0 => moment(stencil, k, (x, y)),
        1 => (x + 1) as f64 * moment(stencil, k, (x + 1, y)),
        _ => (y + 1) as f64 * moment(stencil, k, (x, y + 1)),
    }
}

/// Adds what smoothing of this variance does: the smoothed image moves like the image only where nothing is
/// strained. For an affine flow `G * (u . grad I) = u . grad (G * I) + s^2 (u_x d_x^2 + (v_x + u_y) d_x d_y +
/// v_y d_y^2) (G * I)`, and so on for its derivatives.
fn smoothed(variance: f64, rows: &mut [[[f64; DERIVATIVES]; 6]; 6]) {
    for (k, row) in rows.iter_mut().enumerate() {
        let first = [9, 0, 1, 4, 5, 6][k];
        for (a, step) in [(2, 0), (3, 1), (4, 1), (5, 2)] {
            row[a][first + step] -= variance;
        }
    }
}

/// What the motion m leaves in rows 1 to `BLOCK` of a block whose matrix is made of this jet.
#[inline(always)]
pub(super) fn residual<V: Lanes, const BLOCK: usize>(
    truncation: &Truncation,
    block: usize,
    m: &[V; 6],
    jet: &[V; 6],
    d: &[V; DERIVATIVES],
) -> [V; BLOCK] {
    let mut r = [V::zero(); BLOCK];
    for (r, terms) in r.iter_mut().zip(&truncation.terms) {
        for &(derivative, unknown, coefficient) in terms {
            *r = (d[derivative] * m[unknown]).mul_add(V::constant(coefficient), *r);
        }
    }
    let [u, v, u_x, v_x, u_y, v_y] = *m;
    let [c2, c3] = truncation.time[block];
    // (u d_x + v d_y)^2 and -(u d_x + v d_y)^3 of what derivatives from here on belong to.
    let squared = |xx: V, xy: V, yy: V| (u * xx).mul_add(u, (u * v * xy).mul_add(V::constant(2.0), v * v * yy));
    let cubed = |t: &[V]| {
        let mixed = (u * t[1]).mul_add(u * v, u * v * v * t[2]);
        V::zero() - mixed.mul_add(V::constant(3.0), (u * u * u).mul_add(t[0], v * v * v * t[3]))
    };
    let starts = [0, 4, 5];
    for (r, start) in r.iter_mut().zip(starts) {
        *r = cubed(&d[start..start + 4]).mul_add(V::constant(c3), *r);
    }
    if c2 != 0.0 {
        let turned = (u_x * u + u_y * v).mul_add(jet[1], (v_x * u + v_y * v) * jet[2]);
        for (k, (r, start)) in r.iter_mut().zip([9, 0, 1, 4, 5, 6]).enumerate() {
            let mut second = squared(d[start], d[start + 1], d[start + 2]);
            if k == 0 {
                second = second + turned;
            }
            *r = second.mul_add(V::constant(c2), *r);
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use super::super::jet_matrix::columns;
    use super::*;
    use crate::image::GaussianSmoother;
    use crate::jet::Neighbourhood;
    use crate::types::Frame;

    /// A cubic with all derivatives, about the pixel (10, 10).
    fn cubic(x: f64, y: f64) -> f64 {
        let (x, y) = (x - 10.0, y - 10.0);
        7.0 + 2.0 * x - 3.0 * y + 0.8 * x * x - 1.1 * x * y + 0.4 * y * y + 0.3 * x * x * x - 0.5 * x * x * y
            + 0.2 * x * y * y
            + 0.4 * y * y * y
    }

    /// The largest difference between the residual that motion m leaves in rows 1-6 and what is expected of
    /// it, and the largest residual.
    fn compare(m: [f64; 6], scheme: TimeScheme, neighbourhood: &Neighbourhood, smooth: Option<f64>) -> (f64, f64) {
        let stencil = JetStencil::new(neighbourhood, (1.0, 1.0)).unwrap();
        let combination = Combination::Triple(scheme);
        let field = crate::synth::motion::AffineField::new(m, (10.0, 10.0));
        let now = if scheme == TimeScheme::Central { 1.0 } else { 2.0 };
        let frames: Vec<Frame<f64>> = (0..3)
            .map(|k| {
                let back = crate::synth::motion::Motion::path_map(&field, f64::from(k) - now, 0.0);
                let frame = Frame::from_fn(21, 21, |x, y| {
                    let (x, y) = back(x as f64, y as f64);
                    cubic(x, y)
                });
                smooth.map_or(frame.clone(), |s| GaussianSmoother::new(s).unwrap().apply(&frame))
            })
            .collect();
        let w = combination.weights();
        let mix = |k: usize, x: usize, y: usize| -> [f64; 6] {
            let jets: Vec<[f64; 6]> = frames.iter().map(|f| stencil.at(f, x, y)).collect();
            std::array::from_fn(|j| jets.iter().zip(w[k]).map(|(jet, w)| w * jet[j]).sum())
        };
        let (jet, first) = (mix(0, 10, 10), mix(1, 10, 10));
        let p = columns::<f64, 6>(&jet);
        let derivatives: [f64; DERIVATIVES] = std::array::from_fn(|d| {
            let (k, axis) = DIFFERENCED[d];
            let (x, y) = if axis == 0 { (1, 0) } else { (0, 1) };
            let (before, after) = (mix(0, 10 - x, 10 - y)[k], mix(0, 10 + x, 10 + y)[k]);
            if d == MIXED {
                let second =
                    |k: usize, x: usize, y: usize| mix(0, 10 - x, 10 - y)[k] + mix(0, 10 + x, 10 + y)[k] - 2.0 * jet[k];
                0.5 * (second(3, 0, 1) + second(5, 1, 0))
            } else if d >= 9 {
                jet[k]
            } else if d < 4 {
                0.5 * (after - before)
            } else {
                after + before - 2.0 * jet[k]
            }
        });
        let expected = residual::<f64, 6>(&Truncation::new(&stencil, combination, smooth), 0, &m, &jet, &derivatives);
        let (mut off, mut size) = (0.0f64, 0.0f64);
        for k in 0..6 {
            let r = first[k] + (0..6).map(|a| p[a][k] * m[a]).sum::<f64>();
            (off, size) = (off.max((r - expected[k]).abs()), size.max(r.abs()));
        }
        (off, size)
    }

    #[test]
    fn cubics_leave_what_is_expected() {
        let five = Neighbourhood::square(5);
        for neighbourhood in [&Neighbourhood::default(), &five] {
            // Exact for a translation.
            let (off, size) = compare([0.3, -0.2, 0.0, 0.0, 0.0, 0.0], TimeScheme::Central, neighbourhood, None);
            assert!(off < 1e-12 && size > 0.1, "{off} {size}");
            // To first order in the Jacobian, with smoothing too.
            for smooth in [None, Some(1.5)] {
                let m = [0.003, -0.002, 2e-4, -1e-4, 3e-4, 1e-4];
                let (off, size) = compare(m, TimeScheme::Central, neighbourhood, smooth);
                assert!(off < 2e-3 * size, "{smooth:?} {off} {size}");
            }
            // Backward differences err in their second order, whose own Jacobian terms are left out beyond
            // row 1.
            let (off, size) = compare([0.03, -0.02, 0.0, 0.0, 0.0, 0.0], TimeScheme::Backward, neighbourhood, None);
            assert!(off < 1e-2 * size, "backward {off} {size}");
        }
    }
}
