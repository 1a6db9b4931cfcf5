//! Small dense matrices.

use jacoflow::math::dense::{covariance_fault, factor, mend, solve};

#[test]
fn factor_solves_and_mends() {
    let mut a = vec![4.0, 2.0, 2.0, 3.0];
    let mut l = vec![0.0; 4];
    assert_eq!(factor(&mut a, 2, &mut l), Some(false));
    let mut b = vec![8.0, 7.0];
    solve(&l, 2, &mut b);
    assert!((b[0] - 1.25).abs() < 1e-15 && (b[1] - 1.5).abs() < 1e-15);
    let mut indefinite = vec![1.0, 2.0, 2.0, 1.0];
    assert_eq!(factor(&mut indefinite, 2, &mut l), Some(true));
    assert!((indefinite[0] - 1.5).abs() < 1e-9, "the negative eigenvalue -1 became nearly 0");
    assert_eq!(factor(&mut [f64::NAN], 1, &mut [0.0]), None);
}

#[test]
fn faults_are_reported_and_rounding_is_none() {
    for good in [[0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1.0], [1.0, 1.0 + 1e-12, 1.0, 1.0], [4.0, 1.0, 1.0, 1e9]] {
        assert_eq!(covariance_fault(&good, 2), None, "{good:?}");
        assert_eq!(mend(&mut good.clone(), 2), Some(false), "{good:?}");
    }
    for (bad, word) in [
        ([1.0, 2.0, 2.0, 1.0], "eigenvalue -1"),
        ([1.0, 5.0, 0.0, 1.0], "5 at (0, 1)"),
        ([-1.0, 0.0, 0.0, 1.0], "eigenvalue -1"),
        ([1.0, 0.0, 0.0, f64::INFINITY], "inf"),
        ([1.0, f64::NAN, f64::NAN, 1.0], "NaN"),
    ] {
        let fault = covariance_fault(&bad, 2).unwrap();
        assert!(fault.contains(word), "{fault}");
    }
    let mut lost = [1.0, 2.0, 2.0, 1.0];
    assert_eq!(mend(&mut lost, 2), Some(true));
    assert_eq!(covariance_fault(&lost, 2), None);
    assert_eq!(mend(&mut [f64::NAN; 4], 2), None);
}
