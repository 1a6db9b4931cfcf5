//! From pairs of views to tracks of everything that moves: views, preparation, grey levels, the stereo

use jacoflow::error::{Error, Result};
use jacoflow::image::Preprocess;
use jacoflow::io::{MemorySource, ViewPairs};
use jacoflow::parallel::{Silent, Threads};
use jacoflow::pipeline::{
    BeginSinks, ClusterRows, Ending, GraphChart, GraphFile, GreyPairs, Numbering, StereoOverlays, StereoPicture,
    StereoRun, StereoSink, StereoStep, StereoSummary, TableTarget,
};
use jacoflow::track::StereoTracker;
use jacoflow::track::stereo::{StereoMode, StereoTrackerOptions, TrackGraph};
use jacoflow::types::{AnyFrame, Frame};
use std::path::{Path, PathBuf};

const SIZE: (usize, usize) = (96, 64);

/// Cells of 8 px that move 2 px/step, seen at a disparity of 3 px.
fn views(steps: usize) -> ViewPairs {
    let rng = jacoflow::math::random::CounterRng::new(3);
    let level = |x: usize, y: usize| (20.0 + 200.0 * rng.uniform((1000 * (y / 8) + x / 8) as u64)) as u8;
    let source = |shift: usize| {
        let frame =
            |t: usize| AnyFrame::U8(Frame::from_fn(SIZE.0, SIZE.1, |x, y| level(x + shift + 2 * (steps - t), y)));
        Box::new(MemorySource::new((0..steps).map(frame).collect()).unwrap())
    };
    ViewPairs::separate(source(40), source(43))
}

fn run(steps: usize, begin: BeginSinks<'_>, threads: usize) -> (StereoSummary, Result<()>) {
    let threads = Threads::new(Some(threads)).unwrap();
    let mut options = StereoTrackerOptions::new(StereoMode::Improved).with_disparities([-8, 8]);
    (options.n_components, options.threads, options.row_offset) = (4, threads, Some(0.0));
    let numbering = Numbering { start: 3, step: 2, rate: Some(10.0), ..Numbering::default() };
    let mut run = StereoRun::new(StereoTracker::new(options).unwrap(), numbering);
    let pairs = GreyPairs::start(views(steps), Preprocess::default(), threads).unwrap();
    let ended = run.run(pairs, begin, &Silent);
    (run.summary(), ended)
}

/// Every kind of sink in a folder.
fn into(folder: &Path) -> Result<Vec<Box<dyn StereoSink>>> {
    let file = |name: &str| TableTarget::File(folder.join(name));
    Ok(vec![
        Box::new(StereoOverlays::create(&folder.join("p"), StereoPicture::Clusters, 2, 25.0)?),
        Box::new(StereoOverlays::create(&folder.join("p"), StereoPicture::Disparities(-8.0, 8.0), 1, 25.0)?),
        Box::new(GraphChart::new(folder.join("g.png"), 0.4)),
        Box::new(ClusterRows::create(&file("t.csv"))?),
        Box::new(GraphFile::new(file("t.json"))),
    ])
}

#[test]
fn clusters_become_rows_a_graph_and_pictures_numbered_as_in_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let (summary, ended) = run(4, Box::new(|| into(folder.path())), 2);
    ended.unwrap();
    assert_eq!((summary.pairs, summary.files, summary.row_offset), (4, 11, Some(0.0)));
    let graph = TrackGraph::from_json(&std::fs::read_to_string(folder.path().join("t.json")).unwrap()).unwrap();
    assert_eq!((graph.nodes().count(), summary.clusters), (summary.clusters, graph.nodes().count()));
    let text = std::fs::read_to_string(folder.path().join("t.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    assert_eq!(rows.len(), summary.clusters + 1);
    let last = &rows[rows.len() - 1];
    assert_eq!((last[column("step")], last[column("frame")], last[column("time")]), ("3", "9", "0.9"));
    for row in &rows[1..] {
        let node = graph.node(row[0].parse().unwrap(), row[column("cluster")].parse().unwrap()).unwrap();
        assert_eq!(row[column("pixels")], node.n_pixels.to_string());
        assert_eq!(row[column("disparity")].parse::<f64>().unwrap().to_bits(), node.mean[2].to_bits());
        assert_eq!(row[column("u")] == "nan", node.velocity.is_none());
        assert_eq!(row[column("cov_dd")].parse::<f64>().unwrap(), node.covariance[2][2]);
    }
    for index in [3, 5, 7, 9] {
        assert!(folder.path().join(format!("p/track_{index:06}.png")).exists());
        assert!(folder.path().join(format!("p/stereo_{index:06}.png")).exists());
    }
    assert!(folder.path().join("g.png").exists());
}

#[test]
fn threads_make_no_difference() {
    let texts = [1, 2].map(|threads| {
        let folder = tempfile::tempdir().unwrap();
        run(3, Box::new(|| into(folder.path())), threads).1.unwrap();
        ["t.csv", "t.json", "g.png", "p/track_000005.png"].map(|name| std::fs::read(folder.path().join(name)).unwrap())
    });
    assert_eq!(texts[0], texts[1]);
}

/// Fails at its third pair.
struct Failing(usize);

impl StereoSink for Failing {
    fn accept(&mut self, _: &StereoStep<'_>) -> Result<()> {
        self.0 += 1;
        if self.0 < 3 { Ok(()) } else { Err(Error::argument("disk", "room", "none")) }
    }

    fn finish(&mut self, _: Ending, _: &TrackGraph) -> Result<()> {
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (0, None)
    }
}

#[test]
fn a_run_that_fails_keeps_what_there_is_under_other_names() {
    let folder = tempfile::tempdir().unwrap();
    let begin = || {
        let mut sinks = into(folder.path())?;
        sinks.push(Box::new(Failing(0)));
        Ok(sinks)
    };
    let (summary, ended) = run(4, Box::new(begin), 1);
    assert!(ended.unwrap_err().to_string().starts_with("disk: "));
    let mut names: Vec<_> =
        folder.path().read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["g.partial.png", "p", "t.partial.csv", "t.partial.json"]);
    assert_eq!(summary.pairs, 2);
}

#[test]
fn of_fewer_than_two_pairs_nothing_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let (summary, ended) = run(1, Box::new(|| into(folder.path())), 1);
    let message = ended.unwrap_err().to_string();
    assert!(
        message.starts_with("frames: ") && message.contains("at least 2 pairs") && message.contains('1'),
        "{message}"
    );
    assert_eq!((summary.pairs, summary.files, folder.path().read_dir().unwrap().count()), (0, 0, 0));
}
