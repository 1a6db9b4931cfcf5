//! The Kalman update by one number, for small states of fixed size on the stack.

use nalgebra::{RowSVector, SMatrix, SVector};

/// Updates state and covariance by a measurement `(z, r)`, value and variance, of `h x`, in Joseph form.
/// Returns the normalised innovation squared. Independent measurements may follow one another.
pub(crate) fn update_by_scalar<const N: usize>(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::KalmanFilter;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn one_number_updates_as_the_batch_filter_does() {
        let mut filter = KalmanFilter::new(1, 2, 1).unwrap();
        filter.x = vec![1.0, -0.5];
        filter.P = vec![2.0, 0.3, 0.3, 1.0];
        filter.H = vec![0.7, -1.1];
        filter.R = vec![0.4];
        filter.update(&[2.0]).unwrap();
        let (mut x, mut p) = (Vector2::new(1.0, -0.5), Matrix2::new(2.0, 0.3, 0.3, 1.0));
        let square = update_by_scalar(&mut x, &mut p, &RowSVector::<f64, 2>::new(0.7, -1.1), (2.0, 0.4));
        assert!(square > 0.0);
        for i in 0..2 {
            assert!((x[i] - filter.x[i]).abs() < 1e-12);
            for j in 0..2 {
                assert!((p[(i, j)] - filter.P[2 * i + j]).abs() < 1e-12);
            }
        }
    }
}
