//! The update by one number against the batch filter.

use jacoflow::filter::{KalmanFilter, update_by_scalar};
use nalgebra::{Matrix2, RowSVector, Vector2};

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
