//! The stereo cameras.

use jacoflow::track::stereo::{StereoCamera, StereoMode, StereoTrackerOptions};

#[test]
fn depth_is_that_of_two_cameras() {
    let camera = StereoCamera { focal: 800.0, baseline: 0.075, d_infinity: -44.0 };
    assert_eq!(camera.depth(-4.0), 1.5);
    assert_eq!(camera.place([400.0, 200.0, -4.0], [320.0, 240.0]), [0.15, -0.075, 1.5]);
    assert!(camera.depth(-44.0).is_nan());
}

#[test]
fn each_option_out_of_range_is_named() {
    let with = |change: fn(&mut StereoTrackerOptions)| {
        let mut options = StereoTrackerOptions::default();
        change(&mut options);
        options.check().unwrap_err().to_string()
    };
    assert!(with(|o| o.grid.layers = 0).starts_with("grid: "));
    let message = with(|o| o.grid.layers = 63);
    assert!(message.starts_with("grid: ") && message.contains("-40 to 24, at least 64"), "{message}");
    assert!(with(|o| o.grid.first_disparity = -39).starts_with("grid: "));
    assert!(with(|o| o.disparity_range = [0, 40]).starts_with("grid: "));
    assert!(StereoTrackerOptions::default().with_disparities([3, 3]).check().is_ok());
    for wrong in [0, 4097, 100_000] {
        let options = StereoTrackerOptions { n_components: wrong, ..StereoTrackerOptions::default() };
        let message = options.check().unwrap_err().to_string();
        assert!(message.starts_with("n_components: ") && message.contains("up to 4096"), "{message}");
    }
    assert!(with(|o| o.search = 0).starts_with("search: "));
    assert!(with(|o| o.disparity_range = [5, -5]).starts_with("disparity_range: "));
    for wrong in [0.0, -1.0, 1e-300, 1e300, f64::NAN, f64::INFINITY] {
        let options = StereoTrackerOptions { step_time: wrong, ..StereoTrackerOptions::default() };
        assert!(options.check().unwrap_err().to_string().starts_with("step_time: "));
    }
    let camera = StereoCamera { focal: 0.0, baseline: 0.075, d_infinity: 0.0 };
    let options = StereoTrackerOptions { camera: Some(camera), ..StereoTrackerOptions::default() };
    assert!(options.check().unwrap_err().to_string().starts_with("focal: "));
    assert!(StereoTrackerOptions::new(StereoMode::Paper).check().is_ok());
}
