use super::*;
use std::io::Cursor;

/// A field with a distinct number everywhere and every optional plane.
pub(in crate::io) fn numbered(sites: SamplingGrid) -> FlowField<f32> {
    let layout = FieldLayout {
        frame_size: (7, 5),
        sites,
        model: "affine".into(),
        parameters: crate::types::MOTION_NAMES.map(String::from).to_vec(),
        frame_period: Some(0.04),
        pixel_pitch: (1.0, 1.0),
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

#[test]
fn parameters_that_the_model_lacks_are_zero_but_not_where_there_is_no_estimate() {
    let mut layout = numbered(SamplingGrid::default()).layout;
    (layout.model, layout.parameters) = ("translational".into(), vec!["u".into(), "v".into()]);
    let mut field = FlowField::<f32>::empty(layout, false).unwrap();
    (field.motion[1], field.motion[36]) = (2.0, 3.0);
    let jacobian = interleaved(&field, &["u_x", "u_y"]);
    assert!(jacobian[0].is_nan() && jacobian[2..4] == [0.0, 0.0]);
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let field = numbered(SamplingGrid::default());
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.text("metadata", &Metadata::new(&field.layout, "").to_json(Path::new("x")).unwrap()).unwrap();
    npz.array("status", &[5, 7], &[0u8; 35]).unwrap();
    npz.array("motion", &[6, 7, 5], &field.motion).unwrap();
    let mut npz = NpzReader::new(npz.into_inner().unwrap(), "x").unwrap();
    let message = read_npz_from::<f32, _>(&mut npz).unwrap_err().to_string();
    assert!(message.contains("'motion'") && message.contains("[6, 5, 7]"), "{message}");
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.text("metadata", "{}").unwrap();
    let mut npz = NpzReader::new(npz.into_inner().unwrap(), "x").unwrap();
    assert!(matches!(read_npz_from::<f32, _>(&mut npz), Err(Error::Format { .. })));
}
