//! Flow as colour: direction is hue, speed is saturation.

use jacoflow::image::picture::FlowColours;

#[test]
fn unknown_flow_is_marked_and_does_not_set_the_range() {
    let u = [1.0f32, f32::NAN, f32::INFINITY, 0.0];
    let colours = FlowColours::default();
    assert_eq!(colours.range(&u, &[0.0; 4]), 1.0);
    let picture = colours.picture(&u, &[0.0; 4], 4, 1).unwrap();
    assert_eq!([0, 1, 2, 3].map(|x| picture.pixel(x, 0)), [[255, 0, 0], [0; 3], [0; 3], [255; 3]]);
}

#[test]
fn too_fast_is_darker_and_rest_everywhere_is_white() {
    let picture = FlowColours::new(Some(1.0)).picture(&[2.0f64], &[0.0], 1, 1).unwrap();
    assert_eq!(picture.pixel(0, 0), [191, 0, 0]);
    let still = FlowColours::default().picture(&[0.0f64; 4], &[0.0; 4], 2, 2).unwrap();
    assert!(still.data().iter().all(|&b| b == 255));
    assert!(FlowColours::default().picture(&[0.0f64; 3], &[0.0; 4], 2, 2).is_err());
}
