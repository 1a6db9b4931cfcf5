//! The steps between a frame source and the frame memory.

use jacoflow::image::{GaussianSmoother, Preprocess, Quantiser};
use jacoflow::types::Frame;

#[test]
fn quantising_comes_before_smoothing() {
    let frame = Frame::from_fn(9, 7, |x, y| 0.3 * x as f64 + 0.7 * y as f64);
    let (quantise, smooth) = (Quantiser::default(), GaussianSmoother::new(1.0).unwrap());
    let both = Preprocess { quantise: Some(quantise), smooth: Some(smooth), mask: None }.apply(frame.clone());
    assert_eq!(both, smooth.apply(&quantise.apply(&frame)));
    assert_ne!(both, quantise.apply(&smooth.apply(&frame)));
    assert_eq!(Preprocess::default().apply(frame.clone()), frame);
}

#[test]
fn what_a_mask_forbids_is_never_smoothed_in() {
    let mask = Some(Frame::from_fn(15, 13, |x, y| (x, y) != (7, 6)));
    let steps = Preprocess { smooth: Some(GaussianSmoother::new(0.5).unwrap()), mask, ..Preprocess::default() };
    let frame = |hidden: f64| Frame::from_fn(15, 13, |x, y| if (x, y) == (7, 6) { hidden } else { x as f64 });
    let (a, b) = (steps.apply(frame(0.0)), steps.apply(frame(1e6)));
    assert!(a.data().iter().zip(b.data()).all(|(a, b)| a.to_bits() == b.to_bits()));
    assert!(a.get(7, 6).is_nan() && a.get(6, 6).is_nan() && a.get(1, 1).is_finite());
}
