//! From a frame source to tracks: source, preparation, grey levels, trackers, sinks; one frame at a time, in

use jacoflow::error::{Error, Result};
use jacoflow::image::picture::TrackOverlay;
use jacoflow::image::{GaussianSmoother, Preprocess};
use jacoflow::io::{Colour, FrameSource, MemorySource, read_image, read_mot};
use jacoflow::parallel::Silent;
use jacoflow::pipeline::{
    Begin, Begun, Numbering, Overlays, TableTarget, TextFormat, TrackFormat, TrackRows, TrackRun, TrackSink, peek,
};
use jacoflow::track::Tracker;
use jacoflow::types::{AnyFrame, Frame, TargetBox, TrackState, TrackStatus};
use std::path::Path;

/// Goes one pixel to the right a frame, takes the frame's brightness for its gain, and fails at a frame of
/// one brightness.
struct Walker(TrackState);

impl Walker {
    fn at(x: f64) -> Box<dyn Tracker> {
        Box::new(Self(TrackState::at([x, 8.0], TargetBox::about([x, 8.0], 5.0, 3.0))))
    }
}

impl Tracker for Walker {
    fn update(&mut self, frame: &Frame<f64>) -> Result<TrackState> {
        let brightness = frame.get(0, 0);
        if brightness == 66.0 {
            return Err(Error::argument("frame", "another brightness", brightness));
        }
        self.0.frame += 1;
        self.0.position[0] += 1.0;
        self.0.bounds.x += 1.0;
        self.0.gain = brightness;
        self.0.status = if self.0.frame == 2 { TrackStatus::Lost } else { TrackStatus::Tracking };
        Ok(self.0.clone())
    }
    fn state(&self) -> &TrackState {
        &self.0
    }
}

fn source(levels: &[u16]) -> Box<dyn FrameSource> {
    let frames = levels.iter().map(|&level| AnyFrame::U16(Frame::filled(24, 16, 257 * level))).collect();
    Box::new(MemorySource::new(frames).unwrap())
}

/// Two targets, and these sinks.
fn begin<'a>(sinks: Vec<Box<TrackSink>>) -> Begin<'a> {
    Box::new(|_| Ok(Begun { trackers: vec![Walker::at(6.0), Walker::at(12.0)], sinks }))
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        folder.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Every kind of sink in a folder.
fn into(folder: &Path) -> Vec<Box<TrackSink>> {
    let mut sinks: Vec<Box<TrackSink>> =
        vec![Box::new(Overlays::create(folder.join("o"), TrackOverlay::default(), 25.0).unwrap())];
    for &format in TrackFormat::ALL {
        let target = TableTarget::File(folder.join(format!("t.{}", format.extension())));
        sinks.push(Box::new(TrackRows::create(&target, format).unwrap()));
    }
    sinks
}

#[test]
fn every_target_has_a_row_a_frame_numbered_as_in_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = TrackRun::default().with_numbering(Numbering { start: 5, step: 2, ..Numbering::default() });
    run.run(source(&[10, 20, 30, 40]), begin(into(folder.path())), &Silent).unwrap();
    let summary = run.summary();
    assert_eq!((summary.frames, summary.targets.len(), summary.files), (4, 2, 6));
    assert_eq!(summary.targets[0].counts, [3, 0, 0, 0, 1]);
    assert_eq!(summary.targets[1].last.position, [15.0, 8.0]);
    let text = std::fs::read_to_string(folder.path().join("t.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 8);
    assert_eq!(rows[0][..4], ["1", "5", "nan", "tracking"]);
    assert_eq!(rows[5][..4], ["2", "9", "nan", "lost"]);
    assert_eq!((rows[7][0], rows[7][1], rows[7][6], rows[7][27]), ("2", "11", "15", "40"));
    let boxes = read_mot(folder.path().join("t.txt")).unwrap();
    assert_eq!(boxes.len(), 6, "without the frame where both are lost");
    assert_eq!((boxes[0].frame, boxes[0].bounds.x), (5, 3.5));
    assert_eq!(names(&folder.path().join("o")), [5, 7, 9, 11].map(|k| format!("track_{k:06}.png")));
    read_image(folder.path().join("o/track_000011.png"), Colour::Luminance).unwrap();
}

#[test]
fn a_run_that_fails_leaves_its_rows_under_another_name() {
    let folder = tempfile::tempdir().unwrap();
    let error = TrackRun::default().run(source(&[10, 20, 66, 40]), begin(into(folder.path())), &Silent).unwrap_err();
    assert!(error.to_string().starts_with("frame: "), "{error}");
    assert_eq!(names(folder.path()), ["o", "t.partial.csv", "t.partial.txt"]);
    assert_eq!(std::fs::read_to_string(folder.path().join("t.partial.csv")).unwrap().lines().count(), 1 + 4);
    let refuse: Begin<'_> = Box::new(|_| Err(Error::argument("bbox", "one", "none")));
    assert!(TrackRun::default().run(source(&[10, 20]), refuse, &Silent).is_err());
}

#[test]
fn too_few_frames_and_another_size_are_named() {
    for levels in [&[][..], &[10]] {
        let error = TrackRun::default().run(source(levels), begin(vec![]), &Silent).unwrap_err().to_string();
        assert!(error.starts_with("frames: expected at least 2"), "{error}");
    }
    // A source of one size cannot give another, so one is put together.
    struct Odd(usize);
    impl FrameSource for Odd {
        fn next_frame(&mut self) -> Result<Option<AnyFrame>> {
            self.0 += 1;
            Ok(Some(AnyFrame::U8(Frame::filled(16 + self.0, 16, 0))))
        }
        fn describe(&self) -> String {
            String::new()
        }
    }
    let error = TrackRun::default().run(Box::new(Odd(0)), begin(vec![]), &Silent).unwrap_err().to_string();
    assert!(error.contains("18 x 16 in frame 1"), "{error}");
}

#[test]
fn trackers_see_prepared_grey_levels() {
    let folder = tempfile::tempdir().unwrap();
    let target = TableTarget::File(folder.path().join("t.csv"));
    let sink = TrackRows::create(&target, TrackFormat::Csv).unwrap();
    let preprocess = Preprocess { smooth: Some(GaussianSmoother::new(1.0).unwrap()), ..Preprocess::default() };
    let (_, source) = peek(source(&[10, 33])).unwrap();
    let mut run = TrackRun::default().with_preprocess(preprocess);
    run.run(source, begin(vec![Box::new(sink)]), &Silent).unwrap();
    assert!((run.summary().targets[0].last.gain - 33.0).abs() < 1e-9);
}
