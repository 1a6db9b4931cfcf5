//! The graph of clusters over time: nodes (step, cluster), arcs scored by equation (33) of the stereo paper.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// A cluster of one step. Lengths in px, times in steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Step, from 0.
    pub time: usize,
    /// Component.
    pub index: usize,
    /// Track that it is part of.
    pub track_id: u64,
    /// Group of clusters that move as one.
    pub group: u64,
    /// Edge pixels.
    pub n_pixels: usize,
    /// Weight of the component, 0 to 1.
    pub weight: f64,
    /// Mean `(x, y, d)`: px, px, disparity.
    pub mean: [f64; 3],
    /// Covariance of `(x, y, d)`, px^2.
    pub covariance: [[f64; 3]; 3],
    /// Motion `(u, v, w)` since the last step, at `middle`, px/step and disparity/step; none if not measured.
    pub velocity: Option<[f64; 3]>,
    /// Motion `(u, v, w)` to the next step, known one step later.
    pub next_velocity: Option<[f64; 3]>,
    /// Medians of its pixels along x and y, px; in improved mode of those on its own surface.
    pub middle: [f64; 2],
    /// Motion in the picture to here as `(u, v, u_x, v_x, u_y, v_y)` at the middle.
    pub affine: Option<[f64; 6]>,
    /// Motion in the picture to the next step, in the same way, as soon as that is known.
    pub next_affine: Option<[f64; 6]>,
    /// Truncated mean absolute difference of brightness that this motion leaves, grey levels.
    pub residual: Option<f64>,
    /// Whether the motion is an extrapolation.
    pub coasting: bool,
    /// Depth, in units of the baseline, where the cameras are known.
    pub depth: Option<f64>,
    /// Velocity `(X, Y, Z)` since the last step in units of the baseline, where the cameras are known.
    pub metric_velocity: Option<[f64; 3]>,
}

/// An arc between clusters of successive steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// Step of the earlier cluster.
    pub time: usize,
    /// Component at that step.
    pub from: usize,
    /// Component at the next one.
    pub to: usize,
    /// `e(k -> k')`, 0 to 1: share of the earlier one's voxels that meet the later one.
    pub forward: f64,
    /// `e(k <- k')`, 0 to 1: share of the later one's voxels that meet the earlier one.
    pub backward: f64,
}

impl Arc {
    /// `e(k, k')` of (33), 0 to 2.
    pub fn score(&self) -> f64 {
        self.forward + self.backward
    }
}

/// Clusters of all steps and how they are connected.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct TrackGraph {
    nodes: BTreeMap<(usize, usize), Node>,
    /// Arcs by (time, from, to).
    arcs: BTreeMap<(usize, usize, usize), Arc>,
}

#[derive(Serialize, Deserialize)]
struct Written {
    format: String,
    nodes: Vec<Node>,
    arcs: Vec<Arc>,
}

const FORMAT: &str = "jacoflow track graph 1";

impl TrackGraph {
    /// Inserts a node, replacing one with the same time and index.
    pub fn insert(&mut self, node: Node) {
        self.nodes.insert((node.time, node.index), node);
    }

    /// Inserts an arc between existing nodes.
    ///
    /// # Errors
    /// [`Error::Argument`] named `arc` if a node is missing or a share is not between 0 and 1.
    pub fn connect(&mut self, arc: Arc) -> Result<()> {
        for node in [(arc.time, arc.from), (arc.time + 1, arc.to)] {
            if !self.nodes.contains_key(&node) {
                return Err(Error::argument("arc", "two clusters of the graph", format!("no cluster {node:?}")));
            }
        }
        if [arc.forward, arc.backward].iter().any(|share| !(0.0..=1.0).contains(share)) {
            let got = format!("{} and {}", arc.forward, arc.backward);
            return Err(Error::argument("arc", "shares of 0 to 1", got));
        }
        self.arcs.insert((arc.time, arc.from, arc.to), arc);
        Ok(())
    }

    /// All nodes, by time and index.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes.values()
    }

    /// All arcs, by time and indices.
    pub fn arcs(&self) -> impl Iterator<Item = &Arc> {
        self.arcs.values()
    }

    /// The cluster `index` of a step.
    pub fn node(&self, time: usize, index: usize) -> Option<&Node> {
        self.nodes.get(&(time, index))
    }

    pub(super) fn node_mut(&mut self, time: usize, index: usize) -> Option<&mut Node> {
        self.nodes.get_mut(&(time, index))
    }

    /// Arcs that leave a cluster.
    pub fn leaving(&self, time: usize, index: usize) -> impl Iterator<Item = &Arc> {
        self.arcs.range((time, index, 0)..=(time, index, usize::MAX)).map(|(_, arc)| arc)
    }

    /// Arcs that enter a cluster.
    pub fn entering(&self, time: usize, index: usize) -> impl Iterator<Item = &Arc> {
        let before = time.checked_sub(1);
        let arcs = before.map(|time| self.arcs.range((time, 0, 0)..=(time, usize::MAX, usize::MAX)));
        arcs.into_iter().flatten().map(|(_, arc)| arc).filter(move |arc| arc.to == index)
    }

    /// A track: the clusters `(time, index)` reached from one along arcs whose score is at least `threshold`,
    /// forwards in time or backwards; itself among them.
    ///
    /// # Errors
    /// [`Error::Argument`] named `node` where there is no such cluster, `threshold` for one that no score can
    /// be.
    pub fn follow(&self, time: usize, index: usize, threshold: f64, backward: bool) -> Result<Vec<(usize, usize)>> {
        if !(0.0..=2.0).contains(&threshold) {
            return Err(Error::argument("threshold", "a score, 0 to 2", threshold));
        }
        if self.node(time, index).is_none() {
            return Err(Error::argument("node", "a cluster of the graph", format!("({time}, {index})")));
        }
        let mut reached = BTreeSet::from([(time, index)]);
        let mut front = vec![(time, index)];
        while let Some((time, index)) = front.pop() {
            let mut visit = |arc: &Arc, next: (usize, usize)| {
                if arc.score() >= threshold && reached.insert(next) {
                    front.push(next);
                }
            };
            if backward {
                self.entering(time, index).for_each(|arc| visit(arc, (arc.time, arc.from)));
            } else {
                self.leaving(time, index).for_each(|arc| visit(arc, (arc.time + 1, arc.to)));
            }
        }
        Ok(reached.into_iter().collect())
    }

    /// As JSON text; what was not measured is `null`.
    ///
    /// # Errors
    /// [`Error::Numerical`] where it cannot be written.
    pub fn to_json(&self) -> Result<String> {
        let written = Written {
            format: FORMAT.into(),
            nodes: self.nodes().cloned().collect(),
            arcs: self.arcs().copied().collect(),
        };
        serde_json::to_string(&written).map_err(|error| Error::Numerical(format!("track graph: {error}")))
    }

    /// Reads [`TrackGraph::to_json`], number for number.
    ///
    /// # Errors
    /// [`Error::Argument`] named `json` for other text or a repeated cluster or arc, `arc` for arcs between
    /// missing clusters.
    pub fn from_json(json: &str) -> Result<Self> {
        let refuse = |got: String| Error::argument("json", "a graph as to_json writes it", got);
        let written: Written = serde_json::from_str(json).map_err(|error| refuse(error.to_string()))?;
        if written.format != FORMAT {
            return Err(refuse(format!("format {:?}", written.format)));
        }
        let mut graph = Self::default();
        for node in written.nodes {
            let at = (node.time, node.index);
            if graph.nodes.insert(at, node).is_some() {
                return Err(refuse(format!("cluster {at:?} twice")));
            }
        }
        for arc in written.arcs {
            if graph.arcs.contains_key(&(arc.time, arc.from, arc.to)) {
                return Err(refuse(format!("arc {:?} twice", (arc.time, arc.from, arc.to))));
            }
            graph.connect(arc)?;
        }
        Ok(graph)
    }
}
