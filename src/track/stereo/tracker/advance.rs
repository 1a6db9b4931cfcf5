//! From one step to the next, in either mode.

use super::super::association::{Carried, Recognition};
use super::super::cell_luminance::{CellLuminance, LUMINANCE_LEVELS};
use super::super::cell_motion::{CellMotion, ObservedStep, cell_motions};
use super::super::cluster_motion::middle;
use super::super::cluster_motion::{ClusterMotion, places, voxel_motion};
use super::super::clusters::Clusters;
use super::super::grouping::{GroupMotion, Grouping, groups};
use super::super::lucas_kanade::SmoothedLevels;
use super::super::measured_motion::NextView;
use super::super::overlap::Row;
use super::super::own_pixels::{View, own_middle};
use super::super::step::Step;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::{is_left_over, moved};
use super::{StereoTracker, cluster::Clustered, meeting::arcs, record::Arrival, record::Departure};
use crate::error::Result;
use crate::mixture::Posterior;
use crate::parallel;
use crate::types::Frame;

impl StereoTracker {
    /// The paper's step: a new mixture, matching and overlaps forwards and backwards, (29) to (33).
    pub(super) fn advance_as_printed(
        &mut self,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, ObservedStep, Option<Posterior>)> {
        let Clustered { clusters, posterior, rounds } = self.cluster(points, voxels)?;
        let seen = ObservedStep { clusters, luminance, levels: None };
        let cell = seen.clusters.lattice().cell();
        let reach = self.clock.reach(self.options.search);
        let moved =
            |motion: &CellMotion, sign: f64| std::array::from_fn(|i| sign * f64::from(motion.shift[i]) * cell[i]);
        let (forward, backward) = match &self.last {
            Some(last) => (cell_motions(last, &seen, reach), cell_motions(&seen, last, reach)),
            None => (vec![], vec![]),
        };
        let level = 256.0 / LUMINANCE_LEVELS as f64;
        let arrivals = (0..seen.clusters.components()).map(|k| {
            let motion = backward.get(k).and_then(Option::as_ref);
            Arrival {
                motion: motion.map(|motion| moved(motion, -1.0)),
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
            .map(|motion| motion.as_ref().map(|motion| Departure { motion: moved(motion, 1.0), affine: None }))
            .collect();
        let arcs = arcs(self.time, &rows(forward), &rows(backward));
        self.associate_by_arcs(&seen.clusters, &arcs);
        let grouped: Vec<usize> = (0..seen.clusters.components()).collect();
        let middles: Vec<_> = (0..seen.clusters.components()).map(|k| middle(&places(&seen.clusters, k))).collect();
        let step = self.record(&seen.clusters, posterior.as_ref(), rounds, (&arrivals, &middles), &grouped);
        self.connect(&departures, arcs)?;
        Ok((step, seen, posterior))
    }

    /// The improved step: motion, carried components, iterations of the mixture.
    pub(super) fn advance_carried(
        &mut self,
        left: &Frame<f32>,
        points: EdgePoints,
        voxels: Voxels,
        luminance: CellLuminance,
    ) -> Result<(Step, ObservedStep, Option<Posterior>)> {
        let levels = SmoothedLevels::new(left);
        let mut map = Frame::filled(left.width(), left.height(), f32::NAN);
        for i in 0..points.len() {
            map.row_mut(points.rows[i] as usize)[points.columns[i] as usize] = points.disparities[i];
        }
        let view = NextView { luminance: &luminance, levels: &levels, disparity: &map };
        // A repeated frame is no jump, and no motion is learned from it.
        let motions = if crate::ablation::keeps("stereo.repeated") && self.is_repeated(&points, &levels) {
            self.stay()
        } else {
            self.carry(view)
        };
        let last = self.last.take();
        let carried: Vec<Option<[f64; 3]>> = match &last {
            Some(last) => (0..motions.len()).map(|k| voxel_motion(&last.clusters, k, &motions[k]?.0)).collect(),
            None => vec![],
        };
        let start = self.posterior.as_ref().map(|posterior| moved(posterior, &carried));
        let reappeared = |place, pixels| {
            let shown = |k: usize| last.as_ref().map_or(0, |last| last.clusters.pixels[k].len());
            self.association.reappeared(self.clock.gap, (place, pixels), shown)
        };
        let (clustered, seeded) = self.cluster_carried(points, voxels, start, reappeared)?;
        let (clustered, seeded, (forward, backward)) = match &last {
            Some(last) => self.succeeding(&last.clusters, clustered, seeded, &motions),
            None => (clustered, seeded, (vec![], vec![])),
        };
        let Clustered { clusters, posterior, rounds } = clustered;
        let components = clusters.components();
        // A cluster that gets hidden meets little of its moved self, but its rest lies there; one that
        // reappears, the reverse.
        let share = |rows: &[Row], k: usize| rows.get(k).and_then(|row| row.get(k)).copied().unwrap_or(0.0);
        let overlap = |k: usize| share(&forward, k).max(share(&backward, k));
        // A seed at the predicted place continues the track.
        let least = Recognition::default().least_overlap;
        let newcomer = |k: usize| seeded.get(k).is_some_and(|seeded| *seeded) && overlap(k) <= least;
        let own = |k: usize| motions.get(k).copied().flatten().filter(|_| !newcomer(k));
        // A component of leftovers may be anywhere: it needs no new track.
        let left_over = |k: usize| match (&last, &self.posterior, &posterior) {
            (Some(last), Some(before), Some(now)) if crate::ablation::keeps("stereo.left_over") => {
                left_over_in(&last.clusters, before, k)
                    && left_over_in(&clusters, now, k)
                    && clusters.pixels[k].len() <= 2 * last.clusters.pixels[k].len()
            }
            _ => false,
        };
        let lost: Vec<bool> = (0..components).map(|k| newcomer(k) || overlap(k) < least && !left_over(k)).collect();
        self.associate_components(&clusters, &lost);
        let shown = View { plain: left, smooth: levels.sharpest() };
        let middles: Vec<[f64; 2]> = parallel::map(0..components, |k| own_middle(&clusters, k, shown));
        let arrivals: Vec<Arrival> = (0..components)
            .map(|k| match own(k) {
                Some((motion, Carried { coasting, .. })) => {
                    let affine = motion.affine_after(middles[k]);
                    Arrival {
                        motion: Some([affine[0], affine[1], motion.depth]),
                        affine: Some(affine),
                        residual: Some(motion.plane.residual).filter(|residual| residual.is_finite()),
                        coasting,
                    }
                }
                None => Arrival::UNKNOWN,
            })
            .collect();
        let group_motion = |k: usize| {
            let (motion, _) = own(k)?;
            let (flow, [x, y]) = (motion.plane.flow, motion.plane.centre);
            // The motion refers to the old places of the pixels, the cluster to the new ones.
            Some(GroupMotion { affine: flow.to_array(), centre: [x + flow.u, y + flow.v], depth: motion.depth })
        };
        let group_motions: Vec<_> = (0..components).map(group_motion).collect();
        let grouped = groups(&clusters, &group_motions, &Grouping::default().over(self.clock.gap));
        let step = self.record(&clusters, posterior.as_ref(), rounds, (&arrivals, &middles), &grouped);
        let departures: Vec<_> =
            motions.iter().enumerate().map(|(k, motion)| self.departure(k, motion.as_ref()?.0)).collect();
        let arcs = arcs(self.time, &forward, &backward);
        self.connect(&departures, arcs)?;
        Ok((step, ObservedStep { clusters, luminance, levels: Some(levels) }, posterior))
    }

    fn departure(&self, k: usize, motion: ClusterMotion) -> Option<Departure> {
        let affine = motion.affine_at(self.graph.node(self.time.checked_sub(1)?, k)?.middle);
        Some(Departure { motion: [affine[0], affine[1], motion.depth], affine: Some(affine) })
    }
}

/// Whether component `k` of a step explains too few of its pixels to count.
fn left_over_in(clusters: &Clusters, posterior: &Posterior, k: usize) -> bool {
    let pixels = clusters.pixels.get(k).map_or(0.0, |pixels| pixels.len() as f64);
    k < posterior.components() && is_left_over(posterior, k, (pixels, clusters.points.len() as f64))
}
