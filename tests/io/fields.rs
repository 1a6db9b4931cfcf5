//! A field for the writers to write.

use jacoflow::types::{FieldLayout, FlowField, Interval, SamplingGrid, Status, Units};

/// A field with a distinct number everywhere and every optional plane.
pub fn numbered(sites: SamplingGrid) -> FlowField<f32> {
    let layout = FieldLayout {
        frame_size: (7, 5),
        sites,
        model: "affine".into(),
        parameters: jacoflow::types::MOTION_NAMES.map(String::from).to_vec(),
        units: Units::new((1.0, 1.0), None, Some(0.04)),
        interval: Interval::Instant,
        frame_index: 3,
        correlation_length: 0.0,
    };
    let mut field = FlowField::empty(layout, true).unwrap();
    let n = field.len();
    field.motion = (0..6 * n).map(|i| i as f32).collect();
    field.covariance = Some((0..21 * n).map(|i| 0.5 * i as f32).collect());
    field.residual = Some(vec![0.25; n]);
    field.condition = Some(vec![9.0; n]);
    field.rank = Some(vec![6; n]);
    field.status = vec![Status::Ok; n];
    field.status[n - 1] = Status::MinNorm;
    field
}
