//! Files that appear whole or not at all.

use jacoflow::error::{Error, Result};
use jacoflow::io::write::{AtomicFile, atomic};
use std::fs;
use std::io::Write;
use std::path::Path;

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn a_file_appears_only_when_committed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.bin");
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"abc").unwrap();
    assert!(!path.exists());
    file.commit().unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"abc");
    assert_eq!(names(folder.path()), ["out.bin"]);
}

#[test]
fn an_error_keeps_the_old_file_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.bin");
    fs::write(&path, b"old").unwrap();
    let result: Result<()> = atomic(&path, |file| {
        file.write_all(&vec![0; 100_000]).unwrap();
        Err(Error::Interrupted)
    });
    assert!(matches!(result, Err(Error::Interrupted)));
    drop(AtomicFile::create(&path).unwrap());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["out.bin"]);
}

#[test]
fn a_missing_folder_and_a_folder_as_target_name_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let error = AtomicFile::create(folder.path().join("no/such/x.npz")).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("no/such/x.npz"));
    assert!(matches!(AtomicFile::create(folder.path()), Err(Error::Io { .. })));
}
