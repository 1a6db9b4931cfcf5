//! Sequences that an external program decodes; a shell script stands in for it.
#![cfg(unix)]

use jacoflow::io::{Colour, FfmpegSource, FrameSource, Grey};
use jacoflow::types::{AnyColourFrame, Frame};
use jacoflow::{Error, Result};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// A stand-in program: a shell script.
fn program(folder: &Path, script: &str) -> PathBuf {
    let path = folder.join("decoder");
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

fn open(script: &str) -> (tempfile::TempDir, Result<FfmpegSource>) {
    let folder = tempfile::tempdir().unwrap();
    let sequence = folder.path().join("-video.mp4");
    std::fs::write(&sequence, b"x").unwrap();
    let source = FfmpegSource::open_with(program(folder.path(), script), &sequence, Colour::Luminance);
    (folder, source)
}

#[test]
fn frames_of_the_program_arrive_and_its_success_ends_them() {
    let (_folder, source) = open(r"printf 'YUV4MPEG2 W2 H1 F50:1 Cmono\nFRAME\nab'; printf 'FRAME\ncd'");
    let mut source = source.unwrap();
    assert_eq!(source.frame_rate(), Some(50.0));
    assert_eq!(source.next_frame().unwrap().unwrap().to_real::<f64>().data(), &[97.0, 98.0]);
    assert_eq!(source.skip(1).unwrap(), 1);
    assert!(source.next_frame().unwrap().is_none());
}

#[test]
fn colour_is_asked_for_in_the_coding_that_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let sequence = folder.path().join("video.mp4");
    std::fs::write(&sequence, b"x").unwrap();
    let script = r#"case "$*" in *out_color_matrix=bt601:out_range=tv,format=yuv444p*) ;; *) exit 1;; esac
        printf 'YUV4MPEG2 W1 H1 F25:1 C444\nFRAME\n\353\200\200'"#;
    let mut source = FfmpegSource::open_with(program(folder.path(), script), &sequence, Grey::Error).unwrap();
    let white = AnyColourFrame::U8(Frame::filled(1, 1, [255; 3]));
    assert_eq!(source.next_frame().unwrap(), Some(white));
    assert!(source.next_frame().unwrap().is_none());
}

#[test]
fn times_are_those_that_the_program_writes() {
    let script = r"printf 'frame:0 pts:0 pts_time:0\nx=1\nframe:1 pts:4 pts_time:0.25\nx=1\n' > times
        printf 'YUV4MPEG2 W1 H1 F50:1 Cmono\nFRAME\na'; printf 'FRAME\nb'";
    let (_folder, source) = open(script);
    let mut source = source.unwrap();
    assert_eq!(source.time(), None);
    source.next_frame().unwrap();
    assert_eq!(source.time(), Some(0.0));
    source.next_frame().unwrap();
    assert_eq!(source.time(), Some(0.25));
    let (_folder, source) = open(r"printf 'YUV4MPEG2 W1 H1 F50:1 Cmono\nFRAME\na'; printf 'FRAME\nb'");
    let mut source = source.unwrap();
    assert_eq!(source.skip(2).unwrap(), 2);
    assert_eq!(source.time(), Some(0.02));
}

#[test]
fn an_older_program_without_times_is_asked_without() {
    let script = r#"case "$*" in *direct=1*) echo "Option 'direct' not found" >&2; exit 1;; esac
        printf 'YUV4MPEG2 W1 H1 Cmono\nFRAME\na'"#;
    let (_folder, source) = open(script);
    assert!(source.unwrap().next_frame().unwrap().is_some());
}

#[test]
fn failures_carry_the_program_s_words() {
    let (_folder, source) = open("echo 'moov atom not found' >&2; exit 1");
    let message = source.unwrap_err().to_string();
    assert!(message.contains("moov atom not found") && message.contains("video.mp4"), "{message}");
    let (_folder, source) = open("echo '[webp @ 0x5591] no image data' >&2; echo 'Conversion failed!' >&2; exit 1");
    let message = source.unwrap_err().to_string();
    assert!(message.contains("ffmpeg cannot decode it: no image data. If another program shows it, "), "{message}");
    let (_folder, source) = open(r"printf 'YUV4MPEG2 W2 H1 Cmono\nFRAME\nab'; echo 'late trouble' >&2; exit 3");
    let mut source = source.unwrap();
    source.next_frame().unwrap();
    assert!(source.next_frame().unwrap_err().to_string().contains("late trouble"));
}

#[test]
fn an_older_program_is_asked_in_its_own_words() {
    let (_folder, source) = open(
        r#"case "$*" in *fps_mode*) echo "Unrecognized option 'fps_mode'" >&2; exit 1;; esac; printf 'YUV4MPEG2 W1 H1 Cmono\nFRAME\na'"#,
    );
    assert!(source.unwrap().next_frame().unwrap().is_some());
}

#[test]
fn a_missing_program_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let sequence = folder.path().join("video.mp4");
    std::fs::write(&sequence, b"x").unwrap();
    let error = FfmpegSource::open_with("/no/such/ffmpeg", &sequence, Colour::Luminance).unwrap_err();
    assert!(matches!(&error, Error::Missing(m) if m.contains("Install ffmpeg") && m.contains("video.mp4")), "{error}");
    assert!(matches!(FfmpegSource::open("/no/such/video.mp4"), Err(Error::Io { .. })));
}

#[test]
fn dropping_the_source_stops_the_program() {
    let (folder, source) =
        open(r#"echo $$ > "$(dirname "$0")/pid"; printf 'YUV4MPEG2 W1 H1 Cmono\nFRAME\na'; exec sleep 1000"#);
    let mut source = source.unwrap();
    source.next_frame().unwrap();
    let pid = std::fs::read_to_string(folder.path().join("pid")).unwrap();
    drop(source);
    assert!(!Path::new("/proc").join(pid.trim()).exists());
}
