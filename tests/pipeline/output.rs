//! Outputs named by their file endings.

use jacoflow::error::Result;
use jacoflow::io::FieldFormat;
use jacoflow::pipeline::{OutputPlan, OutputWish, PictureKind, PictureRanges, TableTarget};
use std::path::Path;

fn decide(path: &Path, formats: &[&str], pictures: &[&str], fields: Option<usize>) -> Result<OutputPlan> {
    let words = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
    let (formats, pictures) = (words(formats), words(pictures));
    let wish = OutputWish { path: Some(path), formats: &formats, pictures: &pictures, replace: false, fields };
    OutputPlan::decide(&wish)
}

#[test]
fn folders_get_numbered_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let plan = decide(&out, &["npz", "kitti", "csv"], &["curl"], None).unwrap();
    assert_eq!(plan.field_path(12, FieldFormat::Kitti), Some(out.join("000012.png")));
    assert_eq!(plan.picture_path(12, PictureKind::Curl), Some(out.join("000012_curl.png")));
    assert_eq!(plan.table, Some(TableTarget::File(out.join("points.csv"))));
    assert!(!out.exists());
    let sinks = plan.sinks::<f32>(String::new(), PictureRanges::default()).unwrap();
    assert_eq!((sinks.len(), out.read_dir().unwrap().count()), (3, 0));
}

#[test]
fn a_file_takes_one_field_and_a_table_takes_many() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("v1.2.npz");
    let plan = decide(&file, &[], &["color"], Some(1)).unwrap();
    assert_eq!(plan.field_path(0, FieldFormat::Npz), Some(file.clone()));
    assert_eq!(plan.picture_path(0, PictureKind::Colour), Some(folder.path().join("v1.2_colour.png")));
    assert!(decide(&file, &[], &[], Some(2)).unwrap_err().to_string().starts_with("output"));
    assert!(decide(&folder.path().join("a.csv"), &[], &[], Some(9)).is_ok());
}

#[test]
fn what_would_fail_later_fails_first() {
    let folder = tempfile::tempdir().unwrap();
    let wrong = |path: &str, formats: &[&str], pictures: &[&str]| {
        decide(&folder.path().join(path), formats, pictures, None).unwrap_err().to_string()
    };
    assert!(wrong("a.xyz", &[], &[]).starts_with("output"));
    assert!(wrong("a.npz", &["flo"], &[]).starts_with("output"));
    assert!(wrong("a", &["mp4"], &[]).starts_with("format"));
    assert!(wrong("a", &[], &["heat"]).starts_with("picture"));
    assert!(wrong("no/such/a.npz", &[], &[]).contains("no/such"));
    assert!(decide(Path::new("-"), &["npz"], &[], None).is_err());
}

#[test]
fn earlier_results_are_not_mixed_with_new_ones() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("000003.flo"), b"").unwrap();
    assert!(decide(folder.path(), &["npz"], &[], None).is_ok());
    assert!(decide(folder.path(), &["flo"], &[], None).unwrap_err().to_string().contains("000003.flo"));
    std::fs::write(folder.path().join("000003_curl.png"), b"").unwrap();
    assert!(decide(folder.path(), &["npz"], &["curl"], None).is_err());
}
