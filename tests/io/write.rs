//! Files that appear whole or not at all.

use jacoflow::error::{Error, Result};
use jacoflow::io::write::{AtomicFile, atomic};
use std::fs;
use std::io::Write;
use std::path::Path;

fn names(folder: &Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

fn put(path: &Path, bytes: &[u8]) {
    let mut file = AtomicFile::create(path).unwrap();
    file.write_all(bytes).unwrap();
    file.commit().unwrap();
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

#[cfg(unix)]
#[test]
fn links_and_modes_are_those_of_ordinary_files() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let (real, link, plain) = (folder.path().join("real"), folder.path().join("link"), folder.path().join("plain"));
    fs::write(&real, b"old").unwrap();
    symlink(&real, &link).unwrap();
    put(&link, b"new");
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(fs::read(&real).unwrap(), b"new");
    // A link to what is not there yet, relative and through another link.
    fs::create_dir(folder.path().join("inner")).unwrap();
    let (dangling, second) = (folder.path().join("dangling"), folder.path().join("inner/second"));
    symlink("inner/second", &dangling).unwrap();
    symlink("../later", &second).unwrap();
    put(&dangling, b"new");
    assert!(dangling.is_symlink() && second.is_symlink());
    assert_eq!(fs::read(folder.path().join("later")).unwrap(), b"new");
    let circle = folder.path().join("circle");
    symlink("circle", &circle).unwrap();
    assert!(matches!(AtomicFile::create(&circle), Err(Error::Io { .. })) && circle.is_symlink());
    fs::write(&plain, b"").unwrap();
    let mode = |p: &Path| p.metadata().unwrap().permissions().mode();
    assert_eq!(mode(&real), mode(&plain));
}

#[cfg(unix)]
#[test]
fn a_device_is_written_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let null = Path::new("/dev/null");
    put(null, b"gone");
    assert!(null.metadata().unwrap().file_type().is_char_device());
}
