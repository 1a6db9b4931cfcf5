//! The Kalman update by one number, for small states of fixed size on the stack.

use nalgebra::{RowSVector, SMatrix, SVector};

/// Updates state and covariance by a measurement `(z, r)`, value and variance, of `h x`, in Joseph form.
/// Returns the normalised innovation squared. Independent measurements may follow one another.
pub fn update_by_scalar<const N: usize>(
    x: &mut SVector<f64, N>,
    p: &mut SMatrix<f64, N, N>,
    h: &RowSVector<f64, N>,
    (z, r): (f64, f64),
) -> f64 {
    let innovation = z - (h * *x)[0];
    let s = (h * *p * h.transpose())[0] + r;
    let k = *p * h.transpose() / s;
    *x += k * innovation;
    let rest = SMatrix::<f64, N, N>::identity() - k * h;
    *p = rest * *p * rest.transpose() + k * k.transpose() * r;
    innovation * innovation / s
}
