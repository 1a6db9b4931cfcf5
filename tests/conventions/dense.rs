//! Small dense matrices.

use jacoflow::math::dense::{covariance_fault, covariance_root, factor, solve};

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
}

/// Checks that `l l^T` is `a` to `tolerance` standard deviations.
fn check_root(a: &[f64], n: usize, l: &[f64], tolerance: f64) {
    for i in 0..n {
        for j in 0..n {
            let product: f64 = (0..n).map(|k| l[i * n + k] * l[j * n + k]).sum();
            let scale = (a[i * n + i] * a[j * n + j]).sqrt();
            assert!((product - a[i * n + j]).abs() <= tolerance * scale, "{a:?} {l:?}");
        }
    }
}

#[test]
fn a_covariance_has_a_root_whatever_its_scales() {
    let mut l = [0.0; 4];
    // Definite, singular, without any variance, singular over 24 orders of magnitude, lost to rounding.
    for covariance in [
        [4.0, 2.0, 2.0, 3.0],
        [1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0, 2.0],
        [1e12, 1.0, 1.0, 1e-12],
        [1.0, 1.0, 1.0, 1.0 - 1e-16],
    ] {
        let mut a = covariance;
        assert_eq!(covariance_root(&mut a, 2, &mut l), Some(false), "{covariance:?}");
        assert_eq!(a, covariance);
        check_root(&a, 2, &l, 1e-14);
    }
    // Indefinite: the small variance keeps its size.
    for lost in [[1.0, 2.0, 2.0, 1.0], [1e12, 2.0, 2.0, 1e-12], [1.0, 0.1, 0.1, -1e-3]] {
        let mut a = lost;
        assert_eq!(covariance_root(&mut a, 2, &mut l), Some(true));
        assert_eq!(covariance_fault(&a, 2), None);
        assert!((1.0..3.0).contains(&(a[3] / lost[3].abs())), "{a:?}");
        check_root(&a, 2, &l, 1e-12);
    }
    assert_eq!(covariance_root(&mut [f64::NAN; 4], 2, &mut l), None);
}
