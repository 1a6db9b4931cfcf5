//! A flow field as `.npz`: every plane, and what it means as JSON.

use super::fields::numbered;
use jacoflow::error::Error;
use jacoflow::io::npz::{NpzReader, NpzWriter};
use jacoflow::io::{read_npz_from, write_npz_to};
use jacoflow::types::{FlowField, MOTION_NAMES, Rect, SamplingGrid};
use std::io::Cursor;

fn stored(field: &FlowField<f32>) -> NpzReader<Cursor<Vec<u8>>> {
    let bytes = write_npz_to(Cursor::new(Vec::new()), "x.npz", field, "{\"method\":\"windowed\"}").unwrap();
    NpzReader::new(bytes, "x.npz").unwrap()
}

#[test]
fn every_plane_and_the_layout_come_back() {
    let region = Some(Rect { x: 1, y: 0, width: 5, height: 5 });
    for sites in [
        SamplingGrid::default(),
        SamplingGrid::Grid { region, stride: 2 },
        SamplingGrid::Points(vec![(6, 4), (0, 0), (3, 2)]),
        SamplingGrid::Points(vec![]),
    ] {
        if matches!(&sites, SamplingGrid::Points(p) if p.is_empty()) {
            let field = FlowField::<f32>::empty(numbered(SamplingGrid::default()).layout, false).unwrap();
            let mut layout = field.layout.clone();
            layout.sites = sites;
            let empty = FlowField::<f32>::empty(layout, false).unwrap();
            assert_eq!(read_npz_from::<f32, _>(&mut stored(&empty)).unwrap().field, empty);
            continue;
        }
        let field = numbered(sites);
        let back = read_npz_from::<f32, _>(&mut stored(&field)).unwrap();
        assert_eq!(back.field, field);
        assert!(back.options.contains("windowed") && back.library.starts_with("jacoflow "));
        let wide = read_npz_from::<f64, _>(&mut stored(&field)).unwrap().field;
        assert_eq!(wide.motion[5], 5.0);
    }
}

#[test]
fn a_field_with_flipped_bytes_is_refused_or_the_same() {
    let field = numbered(SamplingGrid::default());
    let good = write_npz_to(Cursor::new(Vec::new()), "x.npz", &field, "").unwrap().into_inner();
    let rng = jacoflow::math::random::CounterRng::new(4);
    let mut refused = 0;
    for case in 0..2000 {
        let mut bytes = good.clone();
        for k in 0..3 {
            let at = (rng.uniform(3 * case + k) * bytes.len() as f64) as usize;
            bytes[at] ^= 0x40;
        }
        let back = NpzReader::new(Cursor::new(bytes), "x.npz").and_then(|mut npz| read_npz_from::<f32, _>(&mut npz));
        match back {
            Ok(back) => assert!(back.field == field, "case {case} is wrong and not noticed"),
            Err(error) => {
                assert!(matches!(error, Error::Format { .. }) && error.to_string().contains("x.npz"), "{error}");
                refused += 1;
            }
        }
    }
    assert!(refused > 1500, "{refused}");
}

#[test]
fn covariance_that_is_none_is_refused_but_not_where_there_is_no_estimate() {
    let damaged = |plane: usize, site: usize, value: f32| {
        let mut field = numbered(SamplingGrid::default());
        let at = plane * field.len() + site;
        field.covariance.as_mut().unwrap()[at] = value;
        read_npz_from::<f32, _>(&mut stored(&field)).map(|_| ()).map_err(|error| error.to_string())
    };
    let last = numbered(SamplingGrid::default()).len() - 1;
    // Planes 0, 6 and 20 hold variances of the first, second and last parameter.
    for (plane, value, what) in [
        (0, -1.0, "a negative variance, at row 1, column 2"),
        (6, -1.0, "a negative variance"),
        (20, -1.0, "a negative variance"),
        (20, f32::NAN, "not finite where the field is valid, at row 1, column 2"),
        (1, f32::INFINITY, "not finite"),
    ] {
        let message = damaged(plane, 9, value).unwrap_err();
        assert!(message.contains("x.npz") && message.contains("'covariance'") && message.contains(what), "{message}");
    }
    assert!(damaged(6, last, -1.0).is_err());
    for (plane, site, value) in [(1, 9, -1.0), (6, last, f32::NAN), (20, last, f32::INFINITY)] {
        assert_eq!(damaged(plane, site, value), Ok(()));
    }
}

#[test]
fn flow_and_jacobian_are_arranged_for_numpy() {
    let mut npz = stored(&numbered(SamplingGrid::default()));
    let n = 35.0;
    assert_eq!(npz.array::<f32>("flow").unwrap().values[2..4], [1.0, n + 1.0]);
    let jacobian = npz.array::<f32>("jacobian").unwrap();
    assert_eq!(jacobian.shape, [5, 7, 2, 2]);
    assert_eq!(jacobian.values[..4], [2.0 * n, 4.0 * n, 3.0 * n, 5.0 * n], "u_x, u_y, v_x, v_y");
    assert!(npz.text("metadata").unwrap().contains("\"min_norm\""));
}

#[test]
fn parameters_that_the_model_lacks_are_zero_but_not_where_there_is_no_estimate() {
    let mut layout = numbered(SamplingGrid::default()).layout;
    layout.model = "translational".into();
    layout.parameters = vec!["u".into(), "v".into()];
    let mut field = FlowField::<f32>::empty(layout, false).unwrap();
    let sites = field.len();
    (field.motion[1], field.motion[sites + 1]) = (2.0, 3.0);
    let jacobian = stored(&field).array::<f32>("jacobian").unwrap().values;
    assert!(jacobian[..4].iter().all(|value| value.is_nan()) && jacobian[4..8] == [0.0; 4]);
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let field = FlowField::<f32>::empty(numbered(SamplingGrid::default()).layout, false).unwrap();
    let metadata = stored(&field).text("metadata").unwrap();
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.text("metadata", &metadata).unwrap();
    let codes: Vec<u8> = field.status.iter().map(|status| *status as u8).collect();
    npz.array("status", &[field.height, field.width], &codes).unwrap();
    npz.array("motion", &[MOTION_NAMES.len(), field.width, field.height], &field.motion).unwrap();
    let mut npz = NpzReader::new(npz.into_inner().unwrap(), "x").unwrap();
    let message = read_npz_from::<f32, _>(&mut npz).unwrap_err().to_string();
    let expected = format!("({}, {}, {})", MOTION_NAMES.len(), field.height, field.width);
    assert!(message.contains("'motion'") && message.contains(&expected), "{message}");
    let mut npz = NpzWriter::new(Cursor::new(Vec::new()), "x");
    npz.text("metadata", "{}").unwrap();
    let mut npz = NpzReader::new(npz.into_inner().unwrap(), "x").unwrap();
    assert!(matches!(read_npz_from::<f32, _>(&mut npz), Err(Error::Format { .. })));
}
