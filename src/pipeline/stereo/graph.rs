//! The graph of all clusters, as text and as a picture.

use super::StereoSink;
use crate::error::{Error, Result};
use crate::image::{picture::ChartArc, picture::ChartNode, picture::chart_picture};
use crate::io::write::atomic;
use crate::io::write_picture;
use crate::pipeline::sink::{Ending, TableTarget, end_table};
use crate::track::stereo::TrackGraph;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Width of an arc of score 1, px.
const ARC_WIDTH: f64 = 1.5;

/// Writes the graph as JSON when the run ends; that of a run that was stopped goes to `name.partial.json`.
#[derive(Debug)]
pub struct GraphFile {
    target: TableTarget,
    kept: Option<PathBuf>,
}

impl GraphFile {
    /// To a file or to standard output.
    pub fn new(target: TableTarget) -> Self {
        Self { target, kept: None }
    }
}

/// Writes text to a file that appears whole.
fn write_text(path: &Path, text: &str) -> Result<()> {
    atomic(path, |file| file.write_all(text.as_bytes()).map_err(|source| Error::io(path, source)))
}

impl StereoSink for GraphFile {
    fn finish(&mut self, ending: Ending, graph: &TrackGraph) -> Result<()> {
        let text = graph.to_json()? + "\n";
        let any = graph.nodes().next().is_some();
        self.kept = end_table(&self.target, ending, any, |partial| match (&self.target, partial) {
            (TableTarget::StandardOutput, _) => {
                let mut out = std::io::stdout().lock();
                let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
                written.map_err(|source| Error::io("standard output", source))
            }
            (TableTarget::File(path), None) => write_text(path, &text),
            (TableTarget::File(_), Some(partial)) => write_text(partial, &text),
        })?;
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}

/// Draws the graph as a PNG when the run ends: steps to the right, a lane for each component, nodes in the
/// colours of their tracks and as large as their number of pixels, arcs that tracks follow as wide as their
/// scores. That of a run that was stopped goes to `name.partial.png`.
#[derive(Debug)]
pub struct GraphChart {
    path: PathBuf,
    threshold: f64,
    kept: Option<PathBuf>,
}

impl GraphChart {
    /// To a file; arcs with a score of less than `threshold`, 0 to 2, are left out.
    pub fn new(path: PathBuf, threshold: f64) -> Self {
        Self { path, threshold, kept: None }
    }
}

impl StereoSink for GraphChart {
    fn finish(&mut self, ending: Ending, graph: &TrackGraph) -> Result<()> {
        let (mut nodes, mut places) = (Vec::new(), BTreeMap::new());
        for node in graph.nodes() {
            places.insert((node.time, node.index), nodes.len());
            let (step, lane, size) = (node.time, node.index, node.n_pixels as f64);
            nodes.push(ChartNode { step, lane, size, number: node.track_id });
        }
        let strong = graph.arcs().filter(|arc| arc.score() >= self.threshold);
        let arcs: Vec<ChartArc> = strong
            .filter_map(|arc| {
                let (from, to) = (*places.get(&(arc.time, arc.from))?, *places.get(&(arc.time + 1, arc.to))?);
                Some(ChartArc { from, to, width: ARC_WIDTH * arc.score() })
            })
            .collect();
        let target = TableTarget::File(self.path.clone());
        self.kept = end_table(&target, ending, !nodes.is_empty(), |partial| {
            write_picture(partial.unwrap_or(&self.path), &chart_picture(&nodes, &arcs))
        })?;
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}
