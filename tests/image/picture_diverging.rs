//! Signed quantities (divergence, curl) as a diverging map: blue below zero, white at zero, red above.

use jacoflow::image::picture::{SignedMap, symmetric_range};

#[test]
fn outliers_do_not_set_the_range() {
    let mut plane = vec![0.01f32; 1000];
    plane[3] = 1e6;
    plane[4] = f32::NAN;
    assert!((symmetric_range(&plane, 98.0) - 0.01).abs() < 1e-6);
    assert_eq!(symmetric_range(&[0.0f32; 3], 98.0), 1.0);
    assert_eq!(symmetric_range(&[f64::NAN; 3], 98.0), 1.0);
    assert!(SignedMap::default().picture(&plane, 3, 3).is_err());
}
