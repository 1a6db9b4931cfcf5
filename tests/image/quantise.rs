//! The quantiser in front of the smoother (WO2010/098160, figure 1).

use jacoflow::image::Quantiser;
use jacoflow::types::Frame;

#[test]
fn values_go_down_to_the_level_below() {
    let frame = Frame::new(4, 1, vec![1.9f32, -0.1, 3.0, f32::NAN]).unwrap();
    let out = Quantiser::default().apply(&frame);
    assert_eq!(&out.data()[..3], &[1.0, -1.0, 3.0]);
    assert!(out.data()[3].is_nan());
    let coarse = Quantiser::new(0.5).unwrap().apply(&frame);
    assert_eq!(&coarse.data()[..3], &[1.5, -0.5, 3.0]);
    // More levels than a number counts: each value is one.
    assert_eq!(&Quantiser::new(1e-310).unwrap().apply(&frame).data()[..3], &frame.data()[..3]);
}

#[test]
fn a_useless_step_is_refused_by_name() {
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Quantiser::new(step).unwrap_err().to_string().starts_with("quantise"));
    }
}
