//! From colour frames to targets followed by particle filters: source, tracker, sinks; one frame at a time,

use jacoflow::error::{Error, Result};
use jacoflow::image::picture::TrackOverlay;
use jacoflow::io::{Colour, ColourSource, Grey, MemorySource, read_image, read_mot};
use jacoflow::parallel::{Progress, Silent};
use jacoflow::pipeline::{
    ForegroundMaps, Numbering, Overlays, ParticleRows, ParticleRun, ParticleSink, TableTarget, TargetStart, TrackFormat,
};
use jacoflow::track::particle::ParticleOptions;
use jacoflow::types::{AnyColourFrame, Frame, TargetBox};
use std::cell::Cell;
use std::path::Path;

const SIZE: (usize, usize) = (96, 64);

/// Sides of both targets, px.
const SIDES: (usize, usize) = (16, 20);

/// Smooth texture that repeats nowhere in the picture, of a tint.
fn texture(x: usize, y: usize, tint: [u8; 3]) -> [u8; 3] {
    let (x, y) = (x as f64, y as f64);
    let value = 2.0 + (0.9 * x + 0.31 * y).sin() + (0.43 * x - 1.1 * y + 0.013 * x * y).sin();
    tint.map(|level| level / 2 + (30.0 * value) as u8)
}

/// Upper left pixel of target `id` (1 or 2) in a frame: one goes right, the other left below it.
fn corner(id: u64, frame: usize) -> (usize, usize) {
    if id == 1 { (10 + 2 * frame, 6) } else { (70 - 2 * frame, 38) }
}

fn bounds(id: u64, frame: usize) -> TargetBox {
    let (x, y) = corner(id, frame);
    TargetBox { x: x as f64 - 0.5, y: y as f64 - 0.5, width: SIDES.0 as f64, height: SIDES.1 as f64 }
}

fn frame(index: usize) -> AnyColourFrame {
    AnyColourFrame::U8(Frame::from_fn(SIZE.0, SIZE.1, |x, y| {
        for (id, tint) in [(1, [250, 60, 40]), (2, [40, 80, 250])] {
            let (left, top) = corner(id, index);
            if (left..left + SIDES.0).contains(&x) && (top..top + SIDES.1).contains(&y) {
                return texture(x - left, y - top, tint);
            }
        }
        texture(x + 200, y + 100, [90, 140, 80])
    }))
}

fn source(frames: usize) -> Box<ColourSource> {
    Box::new(MemorySource::new((0..frames).map(frame).collect()).unwrap())
}

fn options() -> ParticleOptions {
    ParticleOptions { n_particles: 200, n_near: 200, ..ParticleOptions::default() }
}

fn start(id: u64, frame: usize) -> TargetStart {
    TargetStart { frame, id, bounds: bounds(id, frame) }
}

/// Every kind of sink in a folder.
fn into(folder: &Path) -> Vec<Box<ParticleSink>> {
    vec![
        Box::new(Overlays::create(folder.join("o"), TrackOverlay::default(), 25.0).unwrap()),
        Box::new(ForegroundMaps::create(folder.join("f"), 25.0).unwrap()),
        Box::new(ParticleRows::create(&TableTarget::File(folder.join("t.txt")), TrackFormat::Mot).unwrap()),
        Box::new(ParticleRows::create(&TableTarget::File(folder.join("t.csv")), TrackFormat::Csv).unwrap()),
    ]
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        folder.read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn targets_start_at_their_frames_and_are_written_by_every_sink() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut run = ParticleRun::new(&[start(7, 0), start(2, 3)].map(as_known), options(), Numbering::default());
    run.run(source(8), Box::new(|| Ok(into(path))), &Silent).unwrap();
    let boxes = read_mot(path.join("t.txt")).unwrap();
    let frames = |id: i64| boxes.iter().filter(|b| b.target == id).map(|b| b.frame).collect::<Vec<_>>();
    assert_eq!((frames(7), frames(2)), ((0..8).collect(), (3..8).collect()));
    for found in &boxes {
        let truth = bounds(if found.target == 7 { 1 } else { 2 }, found.frame);
        assert!(found.bounds.overlap(&truth) > 0.5, "{found:?} {truth:?}");
    }
    let table = std::fs::read_to_string(path.join("t.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + boxes.len());
    assert!(table.lines().next().unwrap().ends_with(",effective_sample_size,similarity,n_tracks,degenerate"));
    assert_eq!((names(&path.join("o")).len(), names(&path.join("f")).len()), (8, 8));
    assert!(read_image(path.join("o/track_000005.png"), Grey::Error).is_ok());
    let map = read_image(path.join("f/foreground_000005.png"), Colour::Error).unwrap();
    assert_eq!((map.size(), map.dtype()), (SIZE, "uint8"));
    let summary = run.summary();
    assert_eq!((summary.frames, summary.files), (8, 18));
    let counts: Vec<_> = summary.targets.iter().map(|t| (t.number, t.counts.iter().sum::<usize>())).collect();
    assert_eq!(counts, [(2, 5), (7, 8)]);
}

/// Target 7 is the first one drawn.
fn as_known(start: TargetStart) -> TargetStart {
    TargetStart { bounds: bounds(if start.id == 7 { 1 } else { start.id }, start.frame), ..start }
}

#[test]
fn a_target_that_starts_later_does_not_change_the_others() {
    let rows = |starts: &[TargetStart]| {
        let folder = tempfile::tempdir().unwrap();
        let mut run = ParticleRun::new(starts, options(), Numbering::default());
        let path = folder.path().join("t.csv");
        let sink = || ParticleRows::create(&TableTarget::File(path.clone()), TrackFormat::Csv);
        run.run(source(7), Box::new(|| Ok(vec![Box::new(sink()?)])), &Silent).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        text.lines().filter(|line| line.starts_with("1,")).map(String::from).collect::<Vec<_>>()
    };
    let alone = rows(&[start(1, 0)]);
    let joined = rows(&[start(1, 0), start(2, 4)]);
    // Numbers differ once they are near each other, which they are not before the second one is there.
    assert_eq!((alone.len(), &alone[..5]), (7, &joined[..5]));
    assert!(joined[4].contains(",tracking,"), "{}", joined[4]);
}

#[test]
fn boxes_that_cannot_be_followed_are_named_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let outside = TargetStart { bounds: TargetBox { x: 500.0, ..bounds(1, 0) }, ..start(5, 0) };
    let mut run = ParticleRun::new(&[outside], options(), Numbering::default());
    let error = run.run(source(3), Box::new(|| Ok(into(folder.path()))), &Silent).unwrap_err().to_string();
    assert!(error.starts_with("bbox: expected") && error.ends_with("(target 5)"), "{error}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
    let one = ParticleRun::new(&[start(1, 0)], options(), Numbering::default()).run(
        source(1),
        Box::new(|| Ok(vec![])),
        &Silent,
    );
    assert!(one.unwrap_err().to_string().starts_with("frames: expected at least 2"));
    let late = ParticleRun::new(&[start(1, 3)], options(), Numbering::default()).run(
        source(3),
        Box::new(|| Ok(vec![])),
        &Silent,
    );
    assert!(late.unwrap_err().to_string().starts_with("boxes: expected a target that starts"));
}

/// Stops a run after so many frames.
struct StopAfter(usize);

impl Progress for StopAfter {
    fn step(&self, done: usize, _total: usize) -> Result<()> {
        if done >= self.0 { Err(Error::Interrupted) } else { Ok(()) }
    }
}

#[test]
fn a_run_that_is_stopped_leaves_no_half_file() {
    let folder = tempfile::tempdir().unwrap();
    let begun = Cell::new(0);
    let begin = || {
        begun.set(begun.get() + 1);
        let sequence = folder.path().join("o.y4m");
        let mut sinks = into(folder.path());
        sinks[0] = Box::new(Overlays::create(sequence, TrackOverlay::default(), 25.0)?);
        Ok(sinks)
    };
    let mut run = ParticleRun::new(&[start(1, 0)], options(), Numbering::default());
    let stopped = run.run(source(9), Box::new(begin), &StopAfter(3));
    assert!(matches!(stopped, Err(Error::Interrupted)) && begun.get() == 1);
    assert_eq!(names(folder.path()), ["f", "o", "o.partial.y4m", "t.partial.csv", "t.partial.txt"]);
    assert_eq!(run.summary().frames, 3);
}
