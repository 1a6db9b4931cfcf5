//! From one step to the next, in either mode.

use super::super::cell_luminance::CellLuminance;
use super::super::clusters::Clusters;
use super::super::graph::Arc;
use super::super::grouping::{GroupMotion, groups};
use super::super::identity::Carried;
use super::super::lucas_kanade::{SmoothedLevels, middle};
use super::super::motion::{
    CellMotion, FineMotion, Guess, NextView, Seen, cell_motions, fine_motions, places, voxel_motion,
};
use super::super::overlap::{Row, moved_overlaps};
use super::super::step::Step;
use super::super::succession::successors;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::{is_left_over, moved};
use super::StereoTracker;
use super::cluster::Clustered;
use super::record::{Arrival, Departure};
use crate::error::Result;
use crate::mixture::{Points, Posterior};
use crate::types::Frame;

/// Overlaps of two steps' clusters, forwards and backwards.
type Overlaps = (Vec<Row>, Vec<Row>);

impl StereoTracker {
    /// The paper's step: a new mixture, matching and overlaps forwards and backwards (sections 2.5 to 2.8).
    pub(super) fn advance_as_printed(
        &mut self,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, Seen, Option<Posterior>)> {
        let Clustered { clusters, posterior, rounds } = self.cluster(points, voxels)?;
        let seen = Seen { clusters, luminance, levels: None };
        let cell = seen.clusters.lattice().cell();
        let velocity =
            |motion: &CellMotion, sign: f64| std::array::from_fn(|i| sign * f64::from(motion.shift[i]) * cell[i]);
        let (forward, backward) = match &self.last {
            Some(last) => (cell_motions(last, &seen, &self.options), cell_motions(&seen, last, &self.options)),
            None => (vec![], vec![]),
        };
        let level = 256.0 / self.options.luminance_levels as f64;
        let arrivals = (0..seen.clusters.components()).map(|k| {
            let motion = backward.get(k).and_then(Option::as_ref);
            Arrival {
                velocity: motion.map(|motion| velocity(motion, -1.0)),
                residual: motion.map(|motion| motion.difference * level),
                ..Arrival::UNKNOWN
            }
        });
        let arrivals: Vec<Arrival> = arrivals.collect();
        let rows = |motions: Vec<Option<CellMotion>>| -> Vec<Row> {
            motions.into_iter().map(|motion| motion.map_or_else(Vec::new, |motion| motion.overlaps)).collect()
        };
        let departures: Vec<_> = forward
            .iter()
            .map(|motion| motion.as_ref().map(|motion| Departure { velocity: velocity(motion, 1.0), affine: None }))
            .collect();
        let arcs = arcs(self.time, &rows(forward), &rows(backward));
        self.name_by_arcs(&seen.clusters, &arcs);
        let grouped: Vec<usize> = (0..seen.clusters.components()).collect();
        let step = self.record(&seen.clusters, posterior.as_ref(), rounds, &arrivals, &grouped);
        self.connect(&departures, arcs)?;
        Ok((step, seen, posterior))
    }

    /// The improved step: motion first, the components carried along, then the rounds (sections 6.4 to 6.7).
    pub(super) fn advance_carried(
        &mut self,
        left: &Frame<f32>,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, Seen, Option<Posterior>)> {
        let levels = SmoothedLevels::new(left);
        let mut map = Frame::filled(left.width(), left.height(), f32::NAN);
        for i in 0..points.len() {
            map.row_mut(points.rows[i] as usize)[points.columns[i] as usize] = points.disparities[i];
        }
        let view = NextView { luminance: &luminance, levels: &levels, disparity: &map };
        let motions = self.carry(view);
        let last = self.last.take();
        let carried: Vec<Option<[f64; 3]>> = match &last {
            Some(last) => (0..motions.len()).map(|k| voxel_motion(&last.clusters, k, &motions[k]?.0)).collect(),
            None => vec![],
        };
        let start = self.posterior.as_ref().map(|posterior| moved(posterior, &carried));
        let (clustered, seeded) = self.cluster_carried(points, voxels, start)?;
        let (clustered, seeded, (forward, backward)) = match &last {
            Some(last) => self.succeeding(&last.clusters, clustered, seeded, &motions),
            None => (clustered, seeded, (vec![], vec![])),
        };
        let Clustered { clusters, posterior, rounds } = clustered;
        let components = clusters.components();
        // Of what is being hidden little meets its moved self, but what is left of it lies there; of what comes to light it is the other way round.
        let share = |rows: &[Row], k: usize| rows.get(k).and_then(|row| row.get(k)).copied().unwrap_or(0.0);
        let overlap = |k: usize| share(&forward, k).max(share(&backward, k));
        // Who began as a seed where it was going to be anyway goes on.
        let least = self.options.recognition.as_ref().map_or(0.0, |limits| limits.least_overlap);
        let newcomer = |k: usize| seeded.get(k).is_some_and(|seeded| *seeded) && overlap(k) <= least;
        let own = |k: usize| motions.get(k).copied().flatten().filter(|_| !newcomer(k));
        // What is left over of everything else may be anywhere: it needs no new name each time.
        let left_over = |k: usize| match (&last, &self.posterior, &posterior) {
            (Some(last), Some(before), Some(now)) => {
                self.is_left_over(&last.clusters, before, k)
                    && self.is_left_over(&clusters, now, k)
                    && clusters.pixels[k].len() <= 2 * last.clusters.pixels[k].len()
            }
            _ => false,
        };
        let lost: Vec<bool> = (0..components).map(|k| newcomer(k) || overlap(k) < least && !left_over(k)).collect();
        self.name_by_components(&clusters, &lost);
        let arrivals: Vec<Arrival> = (0..components)
            .map(|k| match own(k) {
                Some((motion, Carried { coasting, .. })) => Arrival {
                    velocity: Some(motion.typical),
                    affine: Some(motion.affine_after(middle(&places(&clusters, k)))),
                    residual: Some(motion.plane.residual).filter(|residual| residual.is_finite()),
                    coasting,
                },
                None => Arrival::UNKNOWN,
            })
            .collect();
        let grouped = match &self.options.grouping {
            Some(limits) => {
                let motions: Vec<_> = (0..components)
                    .map(|k| {
                        own(k).map(|(motion, _)| {
                            let (flow, [x, y]) = (motion.plane.flow, motion.plane.centre);
                            // The motion belongs to where the pixels were; the cluster is where they went.
                            GroupMotion {
                                affine: flow.to_array(),
                                centre: [x + flow.u, y + flow.v],
                                depth: motion.depth,
                            }
                        })
                    })
                    .collect();
                groups(&clusters, &motions, limits)
            }
            None => (0..components).collect(),
        };
        let step = self.record(&clusters, posterior.as_ref(), rounds, &arrivals, &grouped);
        let departures: Vec<_> = motions
            .iter()
            .map(|motion| {
                motion.map(|(motion, _)| Departure {
                    velocity: motion.typical,
                    affine: Some(motion.plane.flow.to_array()),
                })
            })
            .collect();
        let arcs = arcs(self.time, &forward, &backward);
        self.connect(&departures, arcs)?;
        Ok((step, Seen { clusters, luminance, levels: Some(levels) }, posterior))
    }

    /// What the motion of each component may be: its last one, or that of the component which explains it best after itself. A cluster that has just been seeded has few pixels, often along one edge,
    /// which agree with many motions; what it probably belongs to is the better guess than a template of a few cells.
    fn guesses(&self, cell: [f64; 3], components: usize) -> Vec<Guess> {
        let known: Vec<(usize, [f64; 3])> = (0..components)
            .filter_map(|k| {
                let velocity = self.identities.live.get(k)?.as_ref()?.velocity?;
                Some((k, std::array::from_fn(|i| velocity[i] * cell[i])))
            })
            .collect();
        (0..components)
            .map(|k| {
                let last = known.iter().find(|(other, _)| *other == k).map(|(_, velocity)| *velocity);
                Guess { last, beside: self.beside(k, &known) }
            })
            .collect()
    }

    /// The motion of that component, of those whose motion is known, which explains the middle of component `k` best after itself.
    fn beside(&self, k: usize, known: &[(usize, [f64; 3])]) -> Option<[f64; 3]> {
        let posterior = self.posterior.as_ref()?;
        let others: Vec<(usize, [f64; 3])> = known.iter().copied().filter(|(other, _)| *other != k).collect();
        if others.is_empty() {
            return None;
        }
        let kept: Vec<bool> =
            (0..posterior.components()).map(|j| others.iter().any(|(other, _)| *other == j)).collect();
        let mut rest = posterior.clone();
        rest.retain(&kept);
        let middle = Points { dimensions: 3, values: posterior.means.get(3 * k..3 * k + 3)?, weights: None };
        let nearest = rest.labels(&middle).ok()?[0];
        Some(others[nearest as usize].1)
    }

    /// What clustering gave, its components called after those that they continue, which of them began as seeds (who took over what was there before is no newcomer), and the overlaps of both steps.
    fn succeeding(
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
        if names.iter().enumerate().all(|(k, name)| k == *name) {
            return (clustered, seeded, (forward, backward));
        }
        let newcomers =
            (0..names.len()).map(|k| names[k] == k && seeded.get(k).is_some_and(|seeded| *seeded)).collect();
        let clustered = clustered.renamed(&names);
        let moves = self.moves(before, &clustered.clusters, motions);
        let overlaps = both_ways(before, &clustered.clusters, &moves);
        (clustered, newcomers, overlaps)
    }

    fn is_left_over(&self, clusters: &Clusters, posterior: &Posterior, k: usize) -> bool {
        let pixels = clusters.pixels.get(k).map_or(0.0, |pixels| pixels.len() as f64);
        k < posterior.components() && is_left_over(posterior, k, (pixels, clusters.points.len() as f64), &self.options)
    }

    /// How each cluster of the last step moves for its overlaps: as measured, and where nothing could be, as it did last or not at all, whichever leads to more of its own component. That it could not be measured
    /// does not say that it is gone.
    fn moves(
        &self,
        before: &Clusters,
        after: &Clusters,
        motions: &[Option<(FineMotion, Carried)>],
    ) -> Vec<Option<FineMotion>> {
        let cell = before.lattice().cell();
        let assumed = |k: usize| {
            if before.pixels[k].is_empty() || k >= after.components() {
                return None;
            }
            let centre = middle(&places(before, k));
            let last = self.identities.live.get(k).and_then(|identity| identity.as_ref()?.velocity);
            let tried = [Some([0.0; 3]), last].into_iter().flatten().map(|velocity| {
                let motion = FineMotion::translation(std::array::from_fn(|i| velocity[i] * cell[i]), centre);
                (moved_overlaps(before, k, after, |i| motion.moved(before.points.at(i)))[k], motion)
            });
            let best = tried.fold(None, |best: Option<(f64, FineMotion)>, one| match best {
                Some(best) if best.0 >= one.0 => Some(best),
                _ => Some(one),
            });
            best.filter(|(share, _)| *share > 0.0).map(|(_, motion)| motion)
        };
        motions.iter().enumerate().map(|(k, motion)| motion.map(|(motion, _)| motion).or_else(|| assumed(k))).collect()
    }

    /// How each cluster of the last step gets to the next view.
    fn carry(&mut self, view: NextView<'_>) -> Vec<Option<(FineMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let cell = last.clusters.lattice().cell();
        let measured = fine_motions(last, view, &self.guesses(cell, last.clusters.components()), &self.options);
        let limits = self.options.recognition.as_ref();
        let mut out = Vec::with_capacity(measured.len());
        for (k, measured) in measured.into_iter().enumerate() {
            if last.clusters.pixels[k].is_empty() {
                out.push(None);
                continue;
            }
            let in_cells = measured.map(|m| std::array::from_fn(|i| m.velocity()[i] / cell[i]));
            let carried = self.identities.carry(k, in_cells, cell, limits);
            out.push(carried.and_then(|carried| {
                let motion = if carried.coasting {
                    let velocity = std::array::from_fn(|i| carried.motion[i] * cell[i]);
                    FineMotion::translation(velocity, middle(&places(&last.clusters, k)))
                } else {
                    measured?
                };
                Some((motion, carried))
            }));
        }
        out
    }
}

/// Overlaps of moved clusters forwards, and backwards by the same motions: a cluster's own or, where that leads back to nothing of its own, that of the cluster which covers it most.
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
            if own.get(k).is_some_and(|share| *share > 0.0) {
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
fn arcs(time: usize, forward: &[Row], backward: &[Row]) -> Vec<Arc> {
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
