use super::*;
use std::io::Cursor;

fn layout(parameters: &[&str]) -> FieldLayout {
    FieldLayout {
        frame_size: (7, 5),
        sites: SamplingGrid::default(),
        model: if parameters.len() == 2 { "translational" } else { "affine" }.into(),
        parameters: parameters.iter().map(ToString::to_string).collect(),
        frame_period: None,
        pixel_pitch: (1.0, 1.0),
        frame_index: 3,
        correlation_length: 0.0,
    }
}

#[test]
fn parameters_that_the_model_lacks_are_zero_but_not_where_there_is_no_estimate() {
    let mut field = FlowField::<f32>::empty(layout(&["u", "v"]), false).unwrap();
    (field.motion[1], field.motion[36]) = (2.0, 3.0);
    let jacobian = interleaved(&field, &["u_x", "u_y"]);
    assert!(jacobian[0].is_nan() && jacobian[2..4] == [0.0, 0.0]);
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let field = FlowField::<f32>::empty(layout(&crate::types::MOTION_NAMES), false).unwrap();
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
