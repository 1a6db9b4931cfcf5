//! Options of edge disparity.

use jacoflow::stereo::EdgeDisparityOptions;

#[test]
fn bad_options_are_named() {
    let default = EdgeDisparityOptions::default;
    let wrong = [
        ("disparity_range", EdgeDisparityOptions { disparity_range: (5, 4), ..default() }),
        ("row_range", EdgeDisparityOptions { row_range: (-1000, 1000), ..default() }),
        ("row_offset", EdgeDisparityOptions { row_offset: Some(f64::NAN), ..default() }),
        ("blur_sigma", EdgeDisparityOptions { blur_sigma: f64::NAN, ..default() }),
        ("threshold", EdgeDisparityOptions { threshold: 0.0, ..default() }),
        ("classes", EdgeDisparityOptions { classes: 1, ..default() }),
        ("window", EdgeDisparityOptions { window: 16, ..default() }),
        ("min_support", EdgeDisparityOptions { min_support: 1.5, ..default() }),
    ];
    for (name, options) in wrong {
        let message = options.check().unwrap_err().to_string();
        assert!(message.starts_with(&format!("{name}: ")), "{message}");
    }
    default().check().unwrap();
}
