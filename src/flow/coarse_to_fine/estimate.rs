//! What the stages leave for covariance and output.

use super::brightness_scale::BrightnessScale;
use super::peak_locking::PeakLocking;
use super::planes::Planes;
use super::refine::WindowStatistics;
use super::workspace::Workspace;
use crate::simd::SimdReal;

/// The motion on the sites of the finest level worked on, and what it rests on.
#[derive(Debug)]
pub(super) struct Estimate<T> {
    /// The level of the pyramid that all lengths are in pixels of.
    pub level: usize,
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel: of a pair midway in time, of a triple at the middle
    /// frame.
    pub motion: Planes<T>,
    /// The summary of the last data term.
    pub data: Planes<T>,
    /// How brightness was scaled.
    pub brightness: BrightnessScale,
    /// What the windows were chosen by; `None` without sites.
    pub statistics: Option<WindowStatistics<T>>,
    /// The same for a triple's change from step to step.
    pub acceleration: Option<WindowStatistics<T>>,
    /// How the motion was drawn before it was corrected.
    pub locking: PeakLocking,
    /// The motion as it was on each coarser level, the finest of them first; none without covariance.
    pub coarser_motions: Vec<Planes<T>>,
}

impl<T: SimdReal> Estimate<T> {
    /// All its planes.
    pub fn planes_mut(&mut self) -> impl Iterator<Item = &mut Planes<T>> {
        let statistics =
            self.statistics.iter_mut().chain(&mut self.acceleration).flat_map(WindowStatistics::planes_mut);
        statistics.chain(&mut self.coarser_motions).chain([&mut self.motion, &mut self.data])
    }

    /// Gives back what only covariance and diagnostics rest on.
    pub fn release_statistics(&mut self, workspace: &Workspace<T>) {
        let statistics = self.statistics.take().into_iter().chain(self.acceleration.take());
        let coarser_motions = std::mem::take(&mut self.coarser_motions);
        statistics
            .flat_map(WindowStatistics::into_planes)
            .chain(coarser_motions)
            .for_each(|planes| workspace.space.keep(planes));
    }

    /// Gives its memory back.
    pub fn recycle(mut self, workspace: &Workspace<T>) {
        self.release_statistics(workspace);
        for planes in [self.motion, self.data] {
            workspace.space.keep(planes);
        }
    }
}
