//! What the stages leave for covariance and output.

use super::brightness_scale::BrightnessScale;
use super::descent::CoarserLevel;
use super::detail_bias::DetailBias;
use super::peak_locking::PeakLocking;
use super::planes::Planes;
use super::refine::WindowStatistics;
use super::workspace::Workspace;
use crate::simd::SimdReal;

/// Motion on the sites of the finest estimated level, and the data behind it.
#[derive(Debug)]
pub(super) struct Estimate<T> {
    /// Level of the pyramid whose pixels are the unit of all lengths.
    pub level: usize,
    /// `u, v, u_x, v_x, u_y, v_y` on every second pixel: of a pair midway in time, of a triple at the middle
    /// frame.
    pub motion: Planes<T>,
    /// Summary of the last data term.
    pub data: Planes<T>,
    pub brightness: BrightnessScale,
    /// Factor of the variance of the noise where frames were equalised.
    pub noise_gain: f64,
    /// Statistics by which windows were chosen; `None` without sites.
    pub statistics: Option<WindowStatistics<T>>,
    /// The same for the difference of a triple's next step from its mean step.
    pub acceleration: Option<WindowStatistics<T>>,
    /// What the finest detail of the frames says differently; `None` if it was not needed.
    pub detail: Option<DetailBias>,
    /// Peak locking before it was removed.
    pub locking: PeakLocking,
    /// The coarser levels, the finest first; empty without covariance.
    pub coarser: Vec<CoarserLevel<T>>,
}

impl<T: SimdReal> Estimate<T> {
    /// Returns all planes.
    pub fn recycle(self, workspace: &Workspace<T>) {
        let statistics = self.statistics.into_iter().chain(self.acceleration).flat_map(WindowStatistics::into_planes);
        statistics.chain([self.motion, self.data]).for_each(|planes| workspace.space.keep(planes));
        self.coarser.into_iter().for_each(|level| level.recycle(&workspace.space));
    }
}
