//! Where the clusters of the last step are expected, and where they are found to have gone.

use super::super::clusters::Clusters;
use super::super::fine_motion::{FineMotion, places};
use super::super::identity::{Carried, Measured};
use super::super::lucas_kanade::{SmoothedLevels, middle};
use super::super::measured_motion::{Guess, NextView, fine_motions};
use super::super::overlap::moved_overlaps;
use super::super::voxels::EdgePoints;
use super::StereoTracker;
use crate::mixture::Points;

impl StereoTracker {
    /// What the motion of each component over the gap may be: its last one, or that of the component which
    /// explains it best after itself. A cluster that has just been seeded has few pixels, often along one
    /// edge, which agree with many motions; what it probably belongs to is the better guess than a template
    /// of a few cells.
    fn guesses(&self, cell: [f64; 3], components: usize) -> Vec<Guess> {
        let gap = self.moment.gap;
        let known: Vec<(usize, [f64; 3])> = (0..components)
            .filter_map(|k| {
                let velocity = self.identities.live.get(k)?.as_ref()?.velocity?;
                Some((k, std::array::from_fn(|i| gap * velocity[i] * cell[i])))
            })
            .collect();
        (0..components)
            .map(|k| {
                let last = known.iter().find(|(other, _)| *other == k).map(|(_, velocity)| *velocity);
                Guess {
                    last: last.filter(|_| crate::ablation::keeps("stereo.last_start")),
                    beside: self.beside(k, &known).filter(|_| crate::ablation::keeps("stereo.beside_start")),
                }
            })
            .collect()
    }

    /// The motion of that component, of those whose motion is known, which explains the middle of component
    /// `k` best after itself.
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

    /// How each cluster of the last step moves for its overlaps: as measured, and where nothing could be, as
    /// it did last or not at all, whichever leads to more of its own component. That it could not be measured
    /// does not say that it is gone.
    pub(super) fn moves(
        &self,
        before: &Clusters,
        after: &Clusters,
        motions: &[Option<(FineMotion, Carried)>],
    ) -> Vec<Option<FineMotion>> {
        let (cell, gap) = (before.lattice().cell(), self.moment.gap);
        let assumed = |k: usize| {
            if !crate::ablation::keeps("stereo.assumed_motion")
                || before.pixels[k].is_empty()
                || k >= after.components()
            {
                return None;
            }
            let centre = middle(&places(before, k));
            let last = self.identities.live.get(k).and_then(|identity| identity.as_ref()?.velocity);
            let tried = [Some([0.0; 3]), last].into_iter().flatten().map(|velocity| {
                let motion = FineMotion::translation(std::array::from_fn(|i| gap * velocity[i] * cell[i]), centre);
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

    /// Whether a pair is the last one again, to the bit, as recordings repeat frames.
    pub(super) fn is_repeated(&self, points: &EdgePoints, levels: &SmoothedLevels) -> bool {
        self.last.as_ref().is_some_and(|last| {
            let before = last.levels.as_ref().map(|levels| levels.sharpest().data());
            !points.is_empty() && last.clusters.points == *points && before == Some(levels.sharpest().data())
        })
    }

    /// Every cluster stays where it is. What is known of its way is kept: after a frame that was repeated it
    /// goes on as before.
    pub(super) fn stay(&self) -> Vec<Option<(FineMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let still = |k: usize| {
            let motion = FineMotion::translation([0.0; 3], middle(&places(&last.clusters, k)));
            (motion, Carried { motion: [0.0; 3], coasting: false })
        };
        (0..last.clusters.components()).map(|k| (!last.clusters.pixels[k].is_empty()).then(|| still(k))).collect()
    }

    /// How each cluster of the last step gets to the next view.
    pub(super) fn carry(&mut self, view: NextView<'_>) -> Vec<Option<(FineMotion, Carried)>> {
        let Some(last) = &self.last else { return vec![] };
        let (cell, gap) = (last.clusters.lattice().cell(), self.moment.gap);
        let looked_for = (self.moment.reach(self.options.search), self.options.reseed_below);
        let measured = fine_motions(last, view, &self.guesses(cell, last.clusters.components()), looked_for);
        let limits = self.options.recognition.as_ref();
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
            let carried = self.identities.carry(k, (in_cells, gap), cell, limits);
            out.push(carried.and_then(|carried| {
                let motion = if carried.coasting {
                    let moved = std::array::from_fn(|i| gap * carried.motion[i] * cell[i]);
                    FineMotion::translation(moved, middle(&places(&last.clusters, k)))
                } else {
                    measured?
                };
                Some((motion, carried))
            }));
        }
        out
    }
}
