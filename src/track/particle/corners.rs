//! Corners followed from frame to frame.

use crate::error::Result;
use crate::flow::points::{PointFlowOptions, PointPyramid, track_points};
use crate::image::{CORNER_WINDOW, CornerOptions, corner_score, select_corners};
use crate::types::Frame;
use std::collections::HashSet;

/// Most corners in a picture of 480 rows; in proportion to its rows in others.
const MAX_CORNERS: f64 = 1600.0;
/// Score of the weakest corner over that of the best.
const QUALITY: f64 = 0.005;
/// Distance between corners in a picture of 480 rows, px.
const CORNER_DISTANCE: f64 = 6.0;
/// Smallest distance between corners in any picture, px.
const MIN_CORNER_DISTANCE: f64 = 3.0;
/// Largest side of the window of the point flow, px.
const MAX_WINDOW: usize = 255;
/// Levels of the pyramid of the point flow.
const LEVELS: usize = 3;
/// Greatest distance between a corner and where its flow leads forward and back, px.
const FORWARD_BACKWARD: f64 = 0.7;
/// The scene was cut if more than this share of the tracks is lost at once.
const CUT_SHARE: f64 = 0.8;
/// Number of tracks that deciding on a cut needs.
const CUT_TRACKS: usize = 12;

#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Track {
    pub id: u64,
    /// Where it is, px.
    pub position: [f64; 2],
    /// Its motion since the frame before, px.
    pub flow: [f64; 2],
    /// Motion relative to the background, px/frame, now and in the frame before; `None` before it was
    /// followed.
    pub residual: Option<[f64; 2]>,
    pub last_residual: Option<[f64; 2]>,
    /// Probability of not being background.
    pub foreground: f64,
    /// The target that it belongs to.
    pub owner: Option<u64>,
}

impl Track {
    /// Where it was in the frame before, px.
    pub fn previous(&self) -> [f64; 2] {
        [self.position[0] - self.flow[0], self.position[1] - self.flow[1]]
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Corners {
    /// In ascending order of their ids: the older ones first.
    pub tracks: Vec<Track>,
    pub next_id: u64,
    selection: CornerOptions,
    flow: PointFlowOptions,
}

impl Corners {
    /// None yet, for pictures at a length scale.
    pub fn new(scale: f64) -> Self {
        let selection = CornerOptions {
            max_count: (MAX_CORNERS * scale).round().max(1.0) as usize,
            quality: QUALITY,
            min_distance: MIN_CORNER_DISTANCE.max(CORNER_DISTANCE * scale),
            ..CornerOptions::default()
        };
        let window = (2 * (8.0 * scale).ceil() as usize + 3).min(MAX_WINDOW);
        let flow = PointFlowOptions {
            levels: LEVELS,
            window,
            forward_backward: FORWARD_BACKWARD,
            ..PointFlowOptions::default()
        };
        Self { tracks: Vec::new(), next_id: 0, selection, flow }
    }

    /// The pyramid that corners are followed on.
    pub fn pyramid(grey: Frame<f32>) -> PointPyramid {
        PointPyramid::new(grey, LEVELS)
    }

    /// Follows every corner into the next frame and drops lost ones. Returns whether the scene was cut.
    pub fn follow(&mut self, before: &PointPyramid, after: &PointPyramid) -> Result<bool> {
        let points: Vec<[f64; 2]> = self.tracks.iter().map(|track| track.position).collect();
        let found = track_points(before, after, &points, None, &self.flow)?;
        let had = self.tracks.len();
        let mut taken = HashSet::with_capacity(had);
        let mut at = 0;
        let mut lost = 0;
        self.tracks.retain_mut(|track| {
            let flow = found[at];
            at += 1;
            if !flow.ok {
                lost += 1;
                return false;
            }
            track.flow = flow.flow;
            track.position = [0, 1].map(|i| points[at - 1][i] + flow.flow[i]);
            track.last_residual = track.residual;
            // Of tracks that fall into one pixel the older one stays.
            taken.insert(track.position.map(|value| value.round() as i64))
        });
        Ok(had >= CUT_TRACKS && lost as f64 > CUT_SHARE * had as f64)
    }

    /// Adds corners where there are none yet.
    pub fn top_up(&mut self, grey: &Frame<f32>) -> Result<()> {
        let existing: Vec<[f64; 2]> = self.tracks.iter().map(|track| track.position).collect();
        let score = corner_score(grey, CORNER_WINDOW)?;
        let room = self.selection.max_count.saturating_sub(existing.len());
        let selection = CornerOptions { max_count: room, ..self.selection };
        for position in select_corners(&score, &existing, &selection) {
            self.tracks.push(Track {
                id: self.next_id,
                position,
                flow: [0.0; 2],
                residual: None,
                last_residual: None,
                foreground: 0.0,
                owner: None,
            });
            self.next_id += 1;
        }
        Ok(())
    }
}
