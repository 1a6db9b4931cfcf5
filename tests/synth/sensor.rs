//! What a camera does to a scene: noise, grey levels, saturation.

use jacoflow::synth::{Rounding, Sensor};
use jacoflow::types::Frame;

#[test]
fn noise_has_its_spread_and_differs_between_frames() {
    let sensor = Sensor { noise: 2.0, random_state: 4, ..Sensor::default() };
    let flat = Frame::filled(200, 100, 100.0);
    let (first, second) = (sensor.apply(&flat, 0), sensor.apply(&flat, 1));
    let variance = first.data().iter().map(|v| (v - 100.0).powi(2)).sum::<f64>() / 20_000.0;
    assert!((variance - 4.0).abs() < 0.15);
    assert_ne!(first, second);
    assert_eq!(first, sensor.apply(&flat, 0));
}

#[test]
fn rounding_and_saturation() {
    let frame = Frame::new(4, 1, vec![-3.2, 7.6, 300.0, 254.5]).unwrap();
    let floor = Sensor { rounding: Rounding::Floor, ..Sensor::default() };
    assert_eq!(floor.apply(&frame, 0).data(), [-4.0, 7.0, 300.0, 254.0]);
    assert_eq!(Sensor::eight_bit(0.0, 0).apply(&frame, 0).data(), [0.0, 8.0, 255.0, 255.0]);
    assert_eq!(Sensor::default().apply(&frame, 0), frame);
    assert!(Sensor { noise: -1.0, ..Sensor::default() }.check().unwrap_err().to_string().contains("noise"));
}
