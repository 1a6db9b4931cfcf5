//! Expected and measured motions of the last step's clusters.

use super::super::association::{Carried, Measured, Recognition};
use super::super::cluster_motion::middle;
use super::super::cluster_motion::{ClusterMotion, places};
use super::super::clusters::Clusters;
use super::super::lucas_kanade::SmoothedLevels;
use super::super::measured_motion::{NextView, measure_motions};
use super::super::options::MIN_COMPONENT_PIXELS;
use super::super::overlap::moved_overlaps;
use super::super::voxels::EdgePoints;
use super::StereoTracker;
use crate::mixture::Points;

impl StereoTracker {
    /// Guess of each component's motion, px: that of the component which explains its middle best after
    /// itself. A new cluster has few pixels, often along one edge, which agree with many motions.
    fn guesses(&self, cell: [f64; 3], components: usize) -> Vec<Option<[f64; 2]>> {
        let gap = self.clock.gap;
        let known: Vec<(usize, [f64; 2])> = (0..components)
            .filter_map(|k| {
                let velocity = self.association.live.get(k)?.as_ref()?.velocity?;
                Some((k, std::array::from_fn(|i| gap * velocity[i] * cell[i])))
            })
            .collect();
        let guess = |k| self.beside(k, &known).filter(|_| crate::ablation::keeps("stereo.beside_start"));
        (0..components).map(guess).collect()
    }

    /// Known motion of the component which explains the middle of component `k` best after itself.
    fn beside(&self, k: usize, known: &[(usize, [f64; 2])]) -> Option<[f64; 2]> {
        let posterior = self.posterior.as_ref()?;
        let others: Vec<(usize, [f64; 2])> = known.iter().copied().filter(|(other, _)| *other != k).collect();
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

    /// Motion of each cluster for its overlaps: as measured, or its last motion or none, whichever gives the
    /// larger overlap. A failed measurement does not mean that the object is gone.
    pub(super) fn moves(
        &self,
        before: &Clusters,
        after: &Clusters,
        motions: &[Option<(ClusterMotion, Carried)>],
    ) -> Vec<Option<ClusterMotion>> {
        let (cell, gap) = (before.lattice().cell(), self.clock.gap);
        let assumed = |k: usize| {
            if !crate::ablation::keeps("stereo.assumed_motion")
                || before.pixels[k].is_empty()
                || k >= after.components()
            {
                return None;
            }
            let centre = middle(&places(before, k));
            let last = self.association.live.get(k).and_then(|track| track.as_ref()?.velocity);
            let tried = [Some([0.0; 3]), last].into_iter().flatten().map(|velocity| {
                let motion = ClusterMotion::translation(std::array::from_fn(|i| gap * velocity[i] * cell[i]), centre);
                (moved_overlaps(before, k, after, |i| motion.moved(before.points.at(i)))[k], motion)
            });
            let best = tried.fold(None, |best: Option<(f64, ClusterMotion)>, one| match best {
                Some(best) if best.0 >= one.0 => Some(best),
                _ => Some(one),
            });
            best.filter(|(share, _)| *share > 0.0).map(|(_, motion)| motion)
        };
        motions.iter().enumerate().map(|(k, motion)| motion.map(|(motion, _)| motion).or_else(|| assumed(k))).collect()
    }

    /// Whether a pair equals the last one bit for bit, as in recordings with repeated frames.
    pub(super) fn is_repeated(&self, points: &EdgePoints, levels: &SmoothedLevels) -> bool {
        self.last.as_ref().is_some_and(|last| {
            let before = last.levels.as_ref().map(|levels| levels.sharpest().data());
            !points.is_empty() && last.clusters.points == *points && before == Some(levels.sharpest().data())
        })
    }

    /// All clusters stay; their velocities are kept.
    pub(super) fn stay(&self) -> Vec<Option<(ClusterMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let still = |k: usize| {
            let motion = ClusterMotion::translation([0.0; 3], middle(&places(&last.clusters, k)));
            (motion, Carried { motion: [0.0; 3], coasting: false })
        };
        (0..last.clusters.components()).map(|k| (!last.clusters.pixels[k].is_empty()).then(|| still(k))).collect()
    }

    pub(super) fn carry(&mut self, view: NextView<'_>) -> Vec<Option<(ClusterMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let (cell, gap) = (last.clusters.lattice().cell(), self.clock.gap);
        let looked_for = (self.clock.reach(self.options.search), MIN_COMPONENT_PIXELS);
        let measured = measure_motions(last, view, &self.guesses(cell, last.clusters.components()), looked_for);
        let limits = Recognition::default();
        let mut out = Vec::with_capacity(measured.len());
        for (k, measured) in measured.into_iter().enumerate() {
            if last.clusters.pixels[k].is_empty() {
                out.push(None);
                continue;
            }
            let in_cells = measured.map(|m| Measured {
                motion: std::array::from_fn(|i| m.at_centre()[i] / cell[i] / gap),
                support: m.support,
            });
            let carried = self.association.carry(k, (in_cells, gap), cell, &limits);
            out.push(carried.and_then(|carried| {
                let motion = if carried.coasting {
                    let moved = std::array::from_fn(|i| gap * carried.motion[i] * cell[i]);
                    ClusterMotion::translation(moved, middle(&places(&last.clusters, k)))
                } else {
                    measured?
                };
                Some((motion, carried))
            }));
        }
        out
    }
}
