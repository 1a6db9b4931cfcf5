//! One file a frame: names for outputs of streams of any length.

use jacoflow::error::Error;
use jacoflow::io::NumberedFiles;

#[test]
fn names_are_padded_and_the_folder_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let files = NumberedFiles::create(folder.path().join("a/b"), "flow", "flo").unwrap();
    assert_eq!(files.path(123), folder.path().join("a/b/flow_000123.flo"));
    assert_eq!(files.path(12_345_678), folder.path().join("a/b/flow_12345678.flo"));
    std::fs::write(folder.path().join("file"), "").unwrap();
    assert!(matches!(NumberedFiles::create(folder.path().join("file"), "x", "y"), Err(Error::Io { .. })));
}
