//! Tracks drawn over the frames: which pictures of earlier runs stay.

use jacoflow::image::picture::TrackOverlay;
use jacoflow::pipeline::{Ending, Overlays, TrackSink, TrackStep};
use jacoflow::types::{AnyFrame, Frame, TargetBox, TrackState};
use std::path::{Path, PathBuf};

fn names(folder: &Path) -> Vec<String> {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut names: Vec<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A run over so many frames with one bright column; what the folder holds before it ends, and its files.
fn run(folder: &Path, column: usize, frames: usize, ending: Ending) -> (Vec<String>, (usize, Option<PathBuf>)) {
    let mut overlays: Box<TrackSink> = Box::new(Overlays::create(folder, TrackOverlay::default(), 25.0).unwrap());
    let frame = AnyFrame::U8(Frame::from_fn(16, 16, |x, _| if x == column { 200 } else { 0 }));
    let states = [TrackState::at([6.0, 8.0], TargetBox::about([6.0, 8.0], 5.0, 3.0))];
    for frame_index in 0..frames {
        overlays.accept(&TrackStep { frame_index, time: None, frame: &frame, states: &states }).unwrap();
    }
    let before = names(folder);
    overlays.finish(ending).unwrap();
    let files = overlays.files();
    (before, files)
}

#[test]
fn earlier_pictures_are_replaced_by_those_of_a_complete_run_and_by_no_others() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("p");
    run(&folder, 0, 5, Ending::Complete);
    std::fs::write(folder.join("notes.txt"), "mine").unwrap();
    let first = std::fs::read(folder.join("track_000001.png")).unwrap();
    let (before, _) = run(&folder, 15, 3, Ending::Partial);
    assert!(before.contains(&"track_000004.png".into()), "{before:?}");
    assert_eq!(names(&folder).len(), 6, "the earlier five, and what is the user's");
    assert_eq!(std::fs::read(folder.join("track_000001.png")).unwrap(), first);
    assert_eq!(names(&home.path().join("p.partial")).len(), 3);
    let (_, files) = run(&folder, 15, 2, Ending::Complete);
    assert_eq!(files, (2, Some(folder.join("track_000001.png"))));
    assert_eq!(names(&folder), ["notes.txt", "track_000000.png", "track_000001.png"]);
    assert_ne!(std::fs::read(folder.join("track_000001.png")).unwrap(), first);
}

#[test]
fn a_folder_with_earlier_pictures_and_a_file_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), 0, 4, Ending::Complete);
    assert!(Overlays::check(folder.path()).unwrap_err().to_string().contains("track_00000"));
    assert!(Overlays::check(&folder.path().join("new")).is_ok());
    assert!(Overlays::check(&folder.path().join("track_000003.png")).is_err());
}
