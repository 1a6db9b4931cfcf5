//! The stereo tracker, step by step.
//!
//! `advance` has a step of either mode. It calls `expected` (motions of the last clusters), `cluster` (the
//! mixture), `meeting` (overlaps, arcs, renumbering) and `record` (tracks, graph, result).

mod advance;
mod cluster;
mod expected;
mod meeting;
mod record;

use super::association::TrackAssociation;
use super::cell_luminance::CellLuminance;
use super::cell_motion::ObservedStep;
use super::clock::{Clock, GAP_RANGE};
use super::graph::TrackGraph;
use super::options::{StereoMode, StereoTrackerOptions};
use super::step::{Step, Track};
use super::voxels::{EdgePoints, Lattice, Voxels};
use crate::error::{Error, Result};
use crate::mixture::Posterior;
use crate::stereo::{EdgeDisparity, SequenceRows};
use crate::track::persist::Kind;
use crate::types::Frame;
use std::collections::BTreeMap;

/// Mark and layout of the tracker as bytes.
const BYTES: Kind = Kind { mark: *b"JFST", layout: 2, what: "stereo tracker" };

/// Tracks all moving objects before a pair of cameras, which may move.
///
/// Deterministic: the same steps give the same result, bit for bit, on any number of threads. Only the graph
/// grows with time.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct StereoTracker {
    options: StereoTrackerOptions,
    lattice: Option<Lattice>,
    time: usize,
    /// Time of the current or last step.
    clock: Clock,
    /// Given time from the last step to the next.
    waited: Option<f64>,
    /// Offset of the right view's rows.
    rows: SequenceRows,
    last: Option<ObservedStep>,
    posterior: Option<Posterior>,
    association: TrackAssociation,
    graph: TrackGraph,
    tracks: BTreeMap<u64, Track>,
}

impl StereoTracker {
    /// A tracker before its first step.
    ///
    /// # Errors
    /// [`Error::Argument`] naming an option out of range.
    pub fn new(options: StereoTrackerOptions) -> Result<Self> {
        options.check()?;
        Ok(Self {
            rows: SequenceRows::new(options.row_offset),
            clock: Clock { now: 0.0, gap: 1.0, step_time: options.step_time },
            waited: None,
            options,
            lattice: None,
            time: 0,
            last: None,
            posterior: None,
            association: TrackAssociation::default(),
            graph: TrackGraph::default(),
            tracks: BTreeMap::new(),
        })
    }

    /// The options.
    pub fn options(&self) -> &StereoTrackerOptions {
        &self.options
    }

    /// Row offset of the right view, px, if given or estimated and still valid.
    pub fn row_offset(&self) -> Option<f64> {
        self.rows.known()
    }

    /// Steps taken.
    pub fn steps(&self) -> usize {
        self.time
    }

    /// Clusters of all steps and their arcs.
    pub fn graph(&self) -> &TrackGraph {
        &self.graph
    }

    /// Tracks by their ids.
    pub fn tracks(&self) -> &BTreeMap<u64, Track> {
        &self.tracks
    }

    /// Sets the time from the last step to the next one, in the unit of [`StereoTrackerOptions::step_time`]:
    /// 2 where a frame is missing; default: an ordinary step. Predictions and limits in steps refer to the
    /// elapsed time. No effect on the first step.
    ///
    /// # Errors
    /// [`Error::Argument`] named `dt` unless it is from a millionth to a million of an ordinary step.
    pub fn after(&mut self, dt: f64) -> Result<&mut Self> {
        if !GAP_RANGE.contains(&(dt / self.options.step_time)) {
            return Err(Error::argument("dt", "a time above 0, from a millionth to a million of step_time", dt));
        }
        self.waited = Some(dt);
        Ok(self)
    }

    /// The next step from both views, grey levels 0 to 255.
    ///
    /// # Errors
    /// [`Error::Argument`] for views of different size, of less than 17 px or of another size than before
    /// (`left`, with both shapes), and for options of the matching out of range.
    pub fn update(&mut self, left: &Frame<f32>, right: &Frame<f32>) -> Result<Step> {
        self.check(left, &EdgePoints::default())?;
        let found = self.rows.match_next(left, right, &self.options.matching_options(None))?;
        let EdgeDisparity { rows, columns, values: disparities, row_offset, rows_doubtful, .. } = found;
        let step = self.update_edges(left, EdgePoints { columns, rows, disparities })?;
        Ok(Step { row_offset: Some(row_offset), rows_doubtful, ..step })
    }

    /// The next step from the left view (grey levels, 0 to 255) and the disparities of its edge pixels. No
    /// edge pixels give a step without clusters; those more than 1.5 px beyond the disparities that the grid
    /// has layers for are left out, and counted.
    ///
    /// # Errors
    /// [`Error::Argument`] named `left` for a view of another size than before, `points` for pixels outside
    /// of it, disparities that are not finite or lists of different length.
    pub fn update_edges(&mut self, left: &Frame<f32>, points: EdgePoints) -> Result<Step> {
        let lattice = self.check(left, &points)?;
        self.options.threads.check()?.install(|| self.advance(left, points, lattice))
    }

    fn check(&self, left: &Frame<f32>, points: &EdgePoints) -> Result<Lattice> {
        let shape = |(width, height): (usize, usize)| format!("({height}, {width})");
        let lattice = Lattice { grid: self.options.grid, size: left.size() };
        if let Some(known) = self.lattice.filter(|known| known.size != lattice.size) {
            let expected = format!("a view as large as before, {}", shape(known.size));
            return Err(Error::argument("left", expected, shape(lattice.size)));
        }
        if left.data().is_empty() {
            return Err(Error::argument("left", "a view (H, W) with pixels", shape(lattice.size)));
        }
        let count = points.len();
        if points.rows.len() != count || points.columns.len() != count {
            let got = format!("{} rows, {} columns, {count}", points.rows.len(), points.columns.len());
            return Err(Error::argument("points", "as many rows and columns as disparities", got));
        }
        let usable = |i: &usize| {
            points.disparities[*i].is_finite()
                && (points.columns[*i] as usize) < left.width()
                && (points.rows[*i] as usize) < left.height()
        };
        match (0..count).find(|i| !usable(i)) {
            Some(i) => {
                let expected = format!("pixels of the view {} with a finite disparity", shape(lattice.size));
                Err(Error::argument("points", expected, format!("{:?}", points.at(i))))
            }
            None => Ok(lattice),
        }
    }

    fn advance(&mut self, left: &Frame<f32>, points: EdgePoints, lattice: Lattice) -> Result<Step> {
        let Clock { now, step_time, .. } = self.clock;
        let gap = self.waited.map_or(1.0, |dt| dt / step_time);
        self.clock = Clock { now: if self.time == 0 { 0.0 } else { now + gap }, gap, step_time };
        let (points, left_out) = points.within(&lattice);
        let voxels = Voxels::count(&points, lattice);
        let luminance = CellLuminance::new(left, &lattice);
        let (mut step, seen, posterior) = match self.options.mode {
            StereoMode::Paper => self.advance_as_printed(points, voxels, luminance)?,
            StereoMode::Improved => self.advance_carried(left, points, voxels, luminance)?,
        };
        step.left_out = left_out;
        self.lattice = Some(lattice);
        self.last = Some(seen);
        self.posterior = posterior;
        self.time += 1;
        self.waited = None;
        Ok(step)
    }

    /// Everything, as bytes: what they give back goes on as this one would, bit for bit.
    pub fn to_bytes(&self) -> Vec<u8> {
        BYTES.sealed(self)
    }

    /// A tracker from the bytes that [`StereoTracker::to_bytes`] gave.
    ///
    /// # Errors
    /// [`Error::Argument`] named `state` for bytes of another kind or layout, and for damaged ones.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        BYTES.opened(bytes)
    }
}
