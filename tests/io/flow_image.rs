//! Flow as a dense pair of planes in px/frame: what the exchange formats hold.

use jacoflow::io::FlowImage;
use jacoflow::types::{FieldLayout, FlowField, Interval, SamplingGrid, Status, Units};

fn field(sites: SamplingGrid) -> FlowField<f64> {
    let layout = FieldLayout {
        frame_size: (2, 1),
        sites,
        model: "affine".into(),
        parameters: jacoflow::types::MOTION_NAMES.map(String::from).to_vec(),
        units: Units::new((0.5, 0.25), None, None),
        interval: Interval::Forward,
        frame_index: 0,
        correlation_length: 0.0,
    };
    FlowField::empty(layout, false).unwrap()
}

#[test]
fn physical_units_become_pixels_again() {
    let mut field = field(SamplingGrid::default());
    (field.motion[0], field.motion[2]) = (1.0, 1.0);
    let image = FlowImage::from_field(&field).unwrap();
    assert_eq!((image.u()[0], image.v()[0]), (2.0, 4.0));
    assert!(image.u()[1].is_nan() && image.valid_share() == 0.5);
}

#[test]
fn an_image_becomes_a_field_and_comes_back() {
    let image = FlowImage::new(2, 1, vec![1.0, f32::NAN], vec![2.0, f32::NAN]).unwrap();
    let field = image.to_field().unwrap();
    assert_eq!(field.status, [Status::Ok, Status::Unobservable]);
    let back = FlowImage::from_field(&field).unwrap();
    assert_eq!((back.u()[0], back.v()[0], back.u()[1].is_nan()), (1.0, 2.0, true));
}

#[test]
fn points_and_wrong_sizes_are_refused() {
    let error = FlowImage::from_field(&field(SamplingGrid::Points(vec![(0, 0)]))).unwrap_err();
    assert!(error.to_string().starts_with("sites"));
    assert!(FlowImage::new(2, 2, vec![0.0; 4], vec![0.0; 3]).unwrap_err().to_string().starts_with("v:"));
}
