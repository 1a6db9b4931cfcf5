//! Tracks as CSV: one row a target and frame.

use jacoflow::io::{TrackTable, cell};
use jacoflow::types::{TargetBox, TrackState, TrackStatus};

/// A state whose numbers are all different.
fn numbered() -> TrackState {
    let axis = |first: f64| {
        let [pp, pv, pa, vv, va, aa] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|k| first + k);
        [[pp, pv, pa], [pv, vv, va], [pa, va, aa]]
    };
    TrackState {
        frame: 4,
        status: TrackStatus::Occluded,
        reason: "something, in front".into(),
        reacquired: true,
        position: [1.5, 2.5],
        velocity: [3.5, 4.5],
        acceleration: [5.5, 6.5],
        scene_velocity: [7.5, 8.5],
        camera_motion: [9.5, 10.5],
        displacement: [f64::NAN, 12.5],
        bounds: TargetBox { x: 13.5, y: 14.5, width: 15.5, height: 16.5 },
        scale: 17.5,
        rotation: 0.1,
        rotation_observable: false,
        visibility: 0.2,
        innovation: 0.3,
        gain: 0.4,
        covariance: [axis(100.0), axis(200.0)],
    }
}

#[test]
fn every_number_stands_under_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let mut table = TrackTable::create(&path, &[]).unwrap();
    table.write(2, (31, Some(1.24)), &numbered(), &[]).unwrap();
    table.flush().unwrap();
    assert!(!path.exists());
    table.finish().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines = csv::ReaderBuilder::new().from_reader(text.as_bytes());
    let names: Vec<String> = lines.headers().unwrap().iter().map(String::from).collect();
    assert_eq!((names.len(), &names), (40, &TrackTable::columns()));
    let row = lines.records().next().unwrap().unwrap();
    let cell = |name: &str| &row[names.iter().position(|known| known == name).unwrap()];
    for (name, value) in [
        ("target", "2"),
        ("frame", "31"),
        ("time", "1.24"),
        ("status", "occluded"),
        ("reason", "something, in front"),
        ("reacquired", "true"),
        ("x", "1.5"),
        ("velocity_y", "4.5"),
        ("acceleration_x", "5.5"),
        ("scene_velocity_y", "8.5"),
        ("camera_motion_x", "9.5"),
        ("displacement_x", "nan"),
        ("displacement_y", "12.5"),
        ("box_x", "13.5"),
        ("box_height", "16.5"),
        ("scale", "17.5"),
        ("rotation", "0.1"),
        ("rotation_observable", "false"),
        ("visibility", "0.2"),
        ("innovation", "0.3"),
        ("gain", "0.4"),
        ("cov_x_pp", "100"),
        ("cov_x_pa", "102"),
        ("cov_x_va", "104"),
        ("cov_y_pv", "201"),
        ("cov_y_vv", "203"),
        ("cov_y_aa", "205"),
    ] {
        assert_eq!(cell(name), value, "{name}");
    }
}

#[test]
fn further_columns_come_last() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let mut table = TrackTable::create(&path, &["similarity"]).unwrap();
    table.write(1, (0, None), &numbered(), &[cell(0.25)]).unwrap();
    table.finish().unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].ends_with(",cov_y_aa,similarity") && lines[1].ends_with(",205,0.25"), "{text}");
}

#[test]
fn rows_of_a_run_that_was_stopped_have_another_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut table = TrackTable::create(folder.path().join("t.csv"), &[]).unwrap();
    table.write(1, (0, None), &numbered(), &[]).unwrap();
    table.finish_as(folder.path().join("part.csv")).unwrap();
    drop(TrackTable::create(folder.path().join("u.csv"), &[]).unwrap());
    let names: Vec<_> = folder.path().read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["part.csv"]);
}
