//! Rows of CSV tables that grow while a run lasts.

use jacoflow::pipeline::{Ending, Table, TableTarget};
use std::path::Path;

fn names(folder: &Path) -> Vec<String> {
    folder.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn a_table_has_its_name_only_when_whole() {
    let folder = tempfile::tempdir().unwrap();
    let target = TableTarget::File(folder.path().join("t.csv"));
    let mut whole = Table::create(&target, &["a"]).unwrap();
    whole.row(["1".to_string()]).unwrap();
    assert!(!folder.path().join("t.csv").exists());
    whole.finish(Ending::Complete).unwrap();
    assert_eq!(names(folder.path()), ["t.csv"]);

    let mut half = Table::create(&target, &["a"]).unwrap();
    half.row(["3".to_string()]).unwrap();
    half.finish(Ending::Partial).unwrap();
    assert_eq!(std::fs::read_to_string(folder.path().join("t.csv")).unwrap(), "a\n1\n");
    assert_eq!(std::fs::read_to_string(folder.path().join("t.partial.csv")).unwrap(), "a\n3\n");

    std::fs::remove_file(folder.path().join("t.partial.csv")).unwrap();
    Table::create(&target, &["a"]).unwrap().finish(Ending::Partial).unwrap();
    assert_eq!(names(folder.path()), ["t.csv"]);
}
