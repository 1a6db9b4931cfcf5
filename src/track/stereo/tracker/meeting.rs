//! Which clusters of two steps meet once they are moved: overlaps, arcs, and who goes on as whom.

use super::super::clusters::Clusters;
use super::super::fine_motion::FineMotion;
use super::super::graph::Arc;
use super::super::identity::Carried;
use super::super::overlap::{Row, moved_overlaps};
use super::super::succession::successors;
use super::StereoTracker;
use super::cluster::Clustered;

/// Overlaps of two steps' clusters, forwards and backwards.
type Overlaps = (Vec<Row>, Vec<Row>);

impl StereoTracker {
    /// What clustering gave, its components called after those that they continue, which of them began as
    /// seeds (who took over what was there before is no newcomer), and the overlaps of both steps.
    pub(super) fn succeeding(
        &self,
        before: &Clusters,
        clustered: Clustered,
        seeded: Vec<bool>,
        motions: &[Option<(FineMotion, Carried)>],
    ) -> (Clustered, Vec<bool>, Overlaps) {
        let moves = self.moves(before, &clustered.clusters, motions);
        let (forward, backward) = both_ways(before, &clustered.clusters, &moves);
        let sizes = [before, &clustered.clusters].map(|all| all.members.iter().map(Vec::len).collect::<Vec<_>>());
        let names = successors(&forward, &backward, [&sizes[0], &sizes[1]], self.options.arc_threshold);
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

/// Overlaps of moved clusters forwards, and backwards by the same motions: a cluster's own or, where that
/// leads back to nothing of its own, that of the cluster which covers it most.
fn both_ways(before: &Clusters, after: &Clusters, motions: &[Option<FineMotion>]) -> Overlaps {
    let nobody = vec![0.0; before.components()];
    let forward: Vec<Row> = (0..before.components())
        .map(|k| match motions[k] {
            Some(motion) => moved_overlaps(before, k, after, |i| motion.moved(before.points.at(i))),
            None => vec![0.0; after.components()],
        })
        .collect();
    let back = |k: usize, motion: &Option<FineMotion>| match motion {
        Some(motion) => moved_overlaps(after, k, before, |i| motion.moved_back(after.points.at(i))),
        None => nobody.clone(),
    };
    let backward = (0..after.components())
        .map(|k| {
            let own = back(k, motions.get(k).unwrap_or(&None));
            if !crate::ablation::keeps("stereo.back_by_covering") || own.get(k).is_some_and(|share| *share > 0.0) {
                return own;
            }
            let covering = (0..before.components())
                .filter(|&j| forward[j][k] > 0.0)
                .max_by(|&i, &j| forward[i][k].total_cmp(&forward[j][k]).then(j.cmp(&i)));
            covering.map_or(own, |j| back(k, &motions[j]))
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
