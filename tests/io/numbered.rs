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

#[test]
fn clearing_removes_our_own_numbers_only() {
    let folder = tempfile::tempdir().unwrap();
    let files = NumberedFiles::create(folder.path(), "flow", "flo").unwrap();
    let kept = ["flow_00012.flo", "flow_000012.png", "flow_00x012.flo", "xflow_000012.flo", "flow_000012.flo.bak"];
    for name in kept.into_iter().chain(["flow_000012.flo", "flow_1000000.flo"]) {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    std::fs::create_dir(folder.path().join("flow_000099.flo")).unwrap();
    files.clear().unwrap();
    assert!(kept.iter().all(|name| folder.path().join(name).exists()));
    assert!(!files.path(12).exists() && !files.path(1_000_000).exists() && files.path(99).is_dir());
}
