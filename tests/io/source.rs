//! Where frames come from: one file for each kind of source and one line in [`KINDS`].

use jacoflow::error::Error;
use jacoflow::io::{OpenOptions, kind_of, open};

#[test]
fn specifications_find_their_kind() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    std::fs::write(inside("video.mp4"), b"x").unwrap();
    std::fs::write(inside("odd[1].png"), b"x").unwrap();
    let signatures: [(&str, &[u8]); 4] = [
        ("pages.dat", b"MM\0+"),
        ("stack.tif", b"\x93NUMPY\x01\0"),
        ("video.npz", b"YUV4MPEG2 W2 H2"),
        ("short", b"II*"),
    ];
    for (name, start) in signatures {
        std::fs::write(inside(name), start).unwrap();
    }
    for (spec, kind) in [
        ("-".to_string(), Some("y4m")),
        (inside("a.Y4M"), Some("y4m")),
        (inside("a.npy"), Some("npy")),
        (inside("a.txt"), Some("list")),
        (folder.path().to_string_lossy().into_owned(), Some("files")),
        (inside("a.TIF"), Some("files")),
        (inside("odd[1].png"), Some("files")),
        (inside("*.png"), Some("glob")),
        (inside("video.mp4"), Some("ffmpeg")),
        (inside("nothing.mp4"), None),
        (inside("pages.dat"), Some("tiff")),
        (inside("stack.tif"), Some("npy")),
        (inside("video.npz"), Some("y4m")),
        (inside("short"), Some("ffmpeg")),
    ] {
        assert_eq!(kind_of(&spec), kind, "{spec}");
    }
}

#[test]
fn what_is_not_there_is_an_io_error_with_its_name() {
    for spec in ["/no/such/folder", "/no/such/video.mp4", "/no/such/a.npy", "/no/such/a.y4m", "/no/such/a.png"] {
        let error = open(spec, &OpenOptions::default()).err().unwrap();
        assert!(matches!(error, Error::Io { .. }) && error.to_string().contains(spec), "{error}");
    }
    let zero = OpenOptions { step: 0, ..OpenOptions::default() };
    assert!(open("-", &zero).err().unwrap().to_string().contains("step"));
}
