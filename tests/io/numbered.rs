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

#[test]
fn names_without_a_stem_are_cleared_but_for_some_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let files = NumberedFiles::without_stem(folder.path(), "_curl.png");
    let named = |index: usize| folder.path().join(format!("{index:06}_curl.png"));
    assert_eq!((files.path(7), files.index(&named(7))), (named(7), Some(7)));
    assert_eq!(files.clone().moved_to("elsewhere").index(&named(7)), None);
    let other = folder.path().join("000007.png");
    (3..6).map(named).chain([other.clone()]).for_each(|path| std::fs::write(path, "").unwrap());
    files.clear_except(|index| index == 4).unwrap();
    assert!(!named(3).exists() && named(4).exists() && !named(5).exists() && other.exists());
    files.moved_to(folder.path().join("none")).clear().unwrap();
}
