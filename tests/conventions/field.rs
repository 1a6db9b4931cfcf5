//! The result of an estimator: planes of motion parameters, their covariance and their status.

use jacoflow::types::{FieldLayout, FlowField, Interval, SamplingGrid, Units};

#[test]
fn planes_are_found_by_name_and_missing_parameters_are_zero() {
    let layout = FieldLayout {
        frame_size: (3, 2),
        sites: SamplingGrid::default(),
        model: "translational".into(),
        parameters: vec!["u".into(), "v".into()],
        units: Units::default(),
        interval: Interval::Instant,
        frame_index: 1,
        correlation_length: 0.0,
    };
    let mut field = FlowField::<f32>::empty(layout, true).unwrap();
    assert!(field.affine(0).u.is_nan() && field.plane("u_x").is_none());
    field.motion[6 + 4] = 2.0;
    field.motion[4] = 1.0;
    assert_eq!(field.affine(4).to_array(), [1.0, 2.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(field.plane("v").unwrap()[4], 2.0);
    field.covariance.as_mut().unwrap()[6 + 4] = 0.5;
    assert_eq!(field.covariance_at(4).unwrap()[1][0], 0.5);
    let (planes, matrices) = (field.affine_planes(), field.covariance_matrices().unwrap());
    assert_eq!((planes[4], planes[6 + 4], planes[12 + 4]), (1.0, 2.0, 0.0));
    assert!(planes[12].is_nan());
    assert_eq!(matrices[4 * 36 + 1], 0.5);
    field.covariance.as_mut().unwrap()[2 * 6 + 4] = 9.0;
    assert_eq!(field.standard_deviation("v").unwrap()[4], 3.0);
    assert!(field.standard_deviation("u_x").is_none());
}
