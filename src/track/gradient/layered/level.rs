//! One level of the alignment: picture, background and target smoothed alike, and the votes of the nodes.

use super::layers::is_inside;
use super::patch::{Patch, Places, bounds_about, dilated, smooth};
use super::pose::Pose;
use super::task::{Task, Vote, VoteMask};
use crate::math::median;
use crate::types::Frame;

/// Longest step, px.
pub(super) const STEP_MAX: f64 = 3.0;
/// Nodes that vote, about, at most: of larger targets every second, third ... along both axes.
const NODES: f64 = 2048.0;
/// Limits of the brightness ratio.
const GAIN: (f64, f64) = (0.8, 1.25);
/// Support that the brightness ratio is measured on.
const BRIGHT: f64 = 0.7;
/// Support from which on a point must be the target, unless it is occluded.
const SOLID: f64 = 0.3;

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Column and row of the target's grid.
    at: [usize; 2],
    xi: [f64; 2],
    /// Support, and support times brightness; smoothed.
    a: f64,
    bright: f64,
    /// Their derivatives by `xi`.
    slope_of_a: [f64; 2],
    slope_of_bright: [f64; 2],
}

/// What is read at the nodes; memory that steps share.
#[derive(Debug, Clone, Default)]
struct Readings {
    places: Places,
    seen: Vec<f64>,
    behind: Vec<f64>,
}

pub(super) struct Level<'a> {
    task: Task<'a>,
    sigma: f64,
    frame: Patch,
    behind: Patch,
    nodes: Vec<Node>,
    /// Votes of the last [`Level::vote`].
    pub votes: Vec<Vote>,
    readings: Readings,
}

impl<'a> Level<'a> {
    /// Around a pose; `near`: the points of the target that may vote.
    pub fn new(task: Task<'a>, pose: &Pose, sigma: f64, near: &Frame<bool>) -> Self {
        let reach = pose.reach(task.target.half()).map(|r| r + 2.0 * STEP_MAX + 3.0 * sigma + 2.0);
        let bounds = bounds_about(pose.p, reach, task.frame.size());
        let inner = sigma / pose.scale().max(0.1);
        Self {
            task,
            sigma,
            frame: Patch::cut(task.frame, bounds).smoothed(sigma),
            behind: Patch::cut(&task.background.picture, bounds).smoothed(sigma),
            nodes: nodes(&task, near, inner),
            votes: Vec::new(),
            readings: Readings::default(),
        }
    }

    fn read(&mut self, pose: &Pose) {
        let Readings { places, seen, behind } = &mut self.readings;
        places.refill(pose, self.nodes.iter().map(|node| node.xi));
        self.frame.read(places, seen);
        self.behind.read(places, behind);
    }

    /// Votes of the nodes, without the weights for outliers; returns the range of the model among them.
    pub fn vote(&mut self, pose: &Pose, gain: f64, silent: Option<&Frame<bool>>) -> f64 {
        self.read(pose);
        self.votes.clear();
        let Task { frame, background, motion_model, .. } = self.task;
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for (k, node) in self.nodes.iter().enumerate() {
            let place = self.readings.places.get(k);
            if !is_inside(place, frame) {
                continue;
            }
            let (seen, behind) = (self.readings.seen[k], self.readings.behind[k]);
            let model = gain * node.bright + (1.0 - node.a) * behind;
            range = (range.0.min(model), range.1.max(model));
            let weight = if background.is_known(place) { 1.0 } else { node.a.powi(4) };
            if weight > 0.0 && !silent.is_some_and(|silent| silent.get(node.at[0], node.at[1])) {
                let gradient = [0, 1].map(|i| gain * node.slope_of_bright[i] - behind * node.slope_of_a[i]);
                let columns = motion_model.columns(gradient, node.xi);
                self.votes.push(Vote { residual: seen - model, weight, columns });
            }
        }
        (range.1 - range.0).max(0.0)
    }

    /// Points without a vote, and those so near to them that smoothing mixes them: beside what covers the
    /// target its support ends without the target ending.
    pub fn silent(&self, pose: &Pose, gain: f64) -> Option<Frame<bool>> {
        let Task { frame, target, vote_mask, .. } = self.task;
        if vote_mask == VoteMask::None {
            return None;
        }
        let (width, height) = target.a.size();
        if let VoteMask::Towards([dx, dy]) = vote_mask {
            let lies_there = |xi: [f64; 2]| {
                let [x, y] = pose.turn(xi);
                x * dx + y * dy > 0.0
            };
            return Some(Frame::from_fn(width, height, |i, j| lies_there(target.xi(i, j))));
        }
        let places = target.places(pose);
        let (mut seen, mut behind) = (Vec::new(), Vec::new());
        self.frame.read(&places, &mut seen);
        self.behind.read(&places, &mut behind);
        let silent = Frame::from_fn(width, height, |i, j| {
            let at = j * width + i;
            if !is_inside(places.get(at), frame) {
                return false;
            }
            let nearer_behind = (seen[at] - behind[at]).abs() < (seen[at] - gain * target.t.get(i, j)).abs();
            match vote_mask {
                VoteMask::None | VoteMask::Towards(_) => false,
                VoteMask::Occluded => target.a.get(i, j) > SOLID && nearer_behind,
                VoteMask::LookAlike if target.a.get(i, j) > SOLID => nearer_behind,
                VoteMask::LookAlike => !nearer_behind,
            }
        });
        if !crate::ablation::keeps("gradient.dilated_mask") {
            return Some(silent);
        }
        Some(dilated(&silent, 1 + self.sigma.ceil() as usize))
    }

    /// Ratio of what is seen to the template.
    pub fn gain(&mut self, pose: &Pose, before: f64) -> f64 {
        self.read(pose);
        let Task { frame, target, .. } = self.task;
        let Readings { places, seen, behind } = &self.readings;
        let solid = |node: &Node| target.a.get(node.at[0], node.at[1]) > BRIGHT && node.bright > 1.0;
        let nodes = self.nodes.iter().enumerate();
        let mut ratios: Vec<f64> = nodes
            .filter(|(k, node)| solid(node) && is_inside(places.get(*k), frame))
            .map(|(k, node)| (seen[k] - (1.0 - node.a) * behind[k]) / node.bright)
            .collect();
        median(&mut ratios).map_or(before, |gain| gain.clamp(GAIN.0, GAIN.1))
    }
}

/// The nodes of the target that may vote, with all that does not depend on the pose.
fn nodes(task: &Task<'_>, near: &Frame<bool>, sigma: f64) -> Vec<Node> {
    let target = task.target;
    let (width, height) = target.a.size();
    let product = target.a.data().iter().zip(target.t.data()).map(|(a, t)| a * t).collect();
    let product = Frame::new(width, height, product).unwrap_or_default();
    let (support, bright) = (smooth(&target.a, sigma), smooth(&product, sigma));
    let slope = |plane: &Frame<f64>, [i, j]: [usize; 2]| {
        let (row, above, below) = (plane.row(j), plane.row(j - 1), plane.row(j + 1));
        [0.5 * (row[i + 1] - row[i - 1]), 0.5 * (below[i] - above[i])]
    };
    let count = near.data().iter().filter(|near| **near).count();
    let every = (count as f64 / NODES).sqrt().ceil().max(1.0) as usize;
    let mut nodes = Vec::with_capacity(count / (every * every));
    for j in (1..height.saturating_sub(1)).step_by(every) {
        for i in (1..width.saturating_sub(1)).step_by(every).filter(|i| near.get(*i, j)) {
            let at = [i, j];
            nodes.push(Node {
                at,
                xi: target.xi(i, j),
                a: support.get(i, j),
                bright: bright.get(i, j),
                slope_of_a: slope(&support, at),
                slope_of_bright: slope(&bright, at),
            });
        }
    }
    nodes
}
