//! Overlaps of the clusters of two steps, arcs, and renumbering.

use super::super::association::Carried;
use super::super::cluster_motion::ClusterMotion;
use super::super::clusters::Clusters;
use super::super::graph::Arc;
use super::super::options::ARC_THRESHOLD;
use super::super::overlap::{Row, moved_overlaps};
use super::super::succession::successors;
use super::{StereoTracker, cluster::Clustered};

/// Overlaps of two steps' clusters, forwards and backwards.
type Overlaps = (Vec<Row>, Vec<Row>);

impl StereoTracker {
    /// Renumbers the components by succession. Returns the clusters, which of them are new seeds (not those
    /// that took over an existing object), and the overlaps.
    pub(super) fn succeeding(
        &self,
        before: &Clusters,
        clustered: Clustered,
        seeded: Vec<bool>,
        motions: &[Option<(ClusterMotion, Carried)>],
    ) -> (Clustered, Vec<bool>, Overlaps) {
        let moves = self.moves(before, &clustered.clusters, motions);
        let (forward, backward) = both_ways(before, &clustered.clusters, &moves);
        let sizes = [before, &clustered.clusters].map(|all| all.members.iter().map(Vec::len).collect::<Vec<_>>());
        let names = successors(&forward, &backward, [&sizes[0], &sizes[1]], ARC_THRESHOLD);
        if !crate::ablation::keeps("stereo.successors") || names.iter().enumerate().all(|(k, name)| k == *name) {
            return (clustered, seeded, (forward, backward));
        }
        let newcomers =
            (0..names.len()).map(|k| names[k] == k && seeded.get(k).is_some_and(|seeded| *seeded)).collect();
        let clustered = clustered.renamed(&names);
        let moves = self.moves(before, &clustered.clusters, motions);
        let overlaps = both_ways(before, &clustered.clusters, &moves);
        (clustered, newcomers, overlaps)
    }
}

/// Overlaps of moved clusters forwards, and backwards by the same motions.
fn both_ways(before: &Clusters, after: &Clusters, motions: &[Option<ClusterMotion>]) -> Overlaps {
    let forward = (0..before.components())
        .map(|k| match motions[k] {
            Some(motion) => moved_overlaps(before, k, after, |i| motion.moved(before.points.at(i))),
            None => vec![0.0; after.components()],
        })
        .collect();
    let backward = (0..after.components())
        .map(|k| match motions.get(k).copied().flatten() {
            Some(motion) => moved_overlaps(after, k, before, |i| motion.moved_back(after.points.at(i))),
            None => vec![0.0; before.components()],
        })
        .collect();
    (forward, backward)
}

/// Arcs (33) from the rows of overlaps in both directions, those that touch at all.
pub(super) fn arcs(time: usize, forward: &[Row], backward: &[Row]) -> Vec<Arc> {
    let share = |rows: &[Row], i: usize, j: usize| rows[i].get(j).copied().unwrap_or(0.0);
    let mut out = Vec::new();
    for from in 0..forward.len() {
        for to in 0..backward.len() {
            let (forward, backward) = (share(forward, from, to), share(backward, to, from));
            if forward + backward > 0.0 {
                out.push(Arc { time: time - 1, from, to, forward, backward });
            }
        }
    }
    out
}
