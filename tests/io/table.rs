//! Tables as CSV, written row by row.

use super::fields::numbered;
use jacoflow::io::{FieldTable, TableWriter, cell};
use jacoflow::types::{SamplingGrid, Status};

#[test]
fn cells_are_quoted_where_needed_and_the_file_appears_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut table = TableWriter::create(&path, &["name", "value"]).unwrap();
    table.row(["a, b", "1"]).unwrap();
    assert!(table.row(["only one"]).unwrap_err().to_string().starts_with("row"));
    table.flush().unwrap();
    assert!(!path.exists());
    table.finish().unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "name,value\n\"a, b\",1\n");
    drop(TableWriter::create(folder.path().join("b.csv"), &["x"]).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn numbers_read_back_exactly() {
    assert_eq!([cell(0.1f32), cell(0.1f64), cell(1e-20f64)].map(|c| c.parse::<f64>().unwrap()), [0.1, 0.1, 1e-20]);
    assert_eq!([cell(f32::NAN), cell(f64::INFINITY), cell(-f32::INFINITY)], ["nan", "inf", "-inf"]);
}

#[test]
fn a_field_gives_a_row_a_site() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let mut field = numbered(SamplingGrid::Points(vec![(6, 4), (1, 2)]));
    field.status[1] = Status::Unobservable;
    field.motion[1] = f32::NAN;
    let mut table = FieldTable::create(&path, &field.layout, true).unwrap();
    table.write(&field, Some(0.125)).unwrap();
    table.write(&field, None).unwrap();
    field.covariance = None;
    assert!(table.write(&field, None).unwrap_err().to_string().starts_with("field"));
    table.finish().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!(lines.len(), 5);
    assert_eq!(lines[0][..7], ["frame", "time_s", "x", "y", "status", "u", "v"]);
    assert_eq!(lines[0][11..13], ["std_u", "std_v"]);
    assert_eq!(lines[1][..7], ["3", "0.125", "6", "4", "ok", "0", "2"]);
    assert_eq!(lines[2][..6], ["3", "0.125", "1", "2", "unobservable", "nan"]);
    assert_eq!(lines[3][..3], ["3", "", "6"]);
    // Variances are planes 0, 6, 11, 15, 18, 20 of the triangle; plane k at site 0 holds k.
    for (column, plane) in [(11, 0.0f64), (12, 6.0), (13, 11.0), (14, 15.0), (15, 18.0), (16, 20.0)] {
        assert!((lines[1][column].parse::<f64>().unwrap() - plane.sqrt()).abs() < 1e-12);
    }
}
