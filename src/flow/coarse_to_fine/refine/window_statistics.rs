//! Statistics by which windows were chosen, kept for the covariance.

use super::choose::{Choice, Order, Use};
use super::ladder::{MAX_OCTAVE, difference_variance};
use super::regional_means::Layout;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::simd::SimdReal;

/// Sites from one node of the statistics to the next.
pub(in crate::flow::coarse_to_fine) const SITES_PER_NODE: usize = 1 << MAX_OCTAVE;

/// Regional means and weights of windows at nodes, every fourth site.
#[derive(Debug)]
pub(in crate::flow::coarse_to_fine) struct WindowStatistics<T> {
    means: Planes<T>,
    choice: Planes<T>,
    order: Order,
    /// Sites of the motion along x and y.
    sites: (usize, usize),
    /// Standard deviations of the windows, px.
    pub sigmas: &'static [f64],
    /// Variances of the steps from each window to the next, for noise of unit density.
    step_variances: Vec<f64>,
}

impl<T: SimdReal> WindowStatistics<T> {
    pub(super) fn new(means: Planes<T>, choice: Choice<T>, (sites, sigmas): ((usize, usize), &'static [f64])) -> Self {
        let step_variances = sigmas.windows(2).map(|pair| difference_variance(pair[0], pair[1])).collect();
        Self { means, choice: choice.planes, order: choice.order, sites, sigmas, step_variances }
    }

    pub fn into_planes(self) -> [Planes<T>; 2] {
        [self.means, self.choice]
    }

    /// Nodes along x and y, [`SITES_PER_NODE`] sites apart; the last ones may be nearer.
    pub fn size(&self) -> (usize, usize) {
        (node_count(self.sites.0), node_count(self.sites.1))
    }

    /// Regional information `P_uu, P_uv, P_vv`, grey^2/px^2.
    pub fn information(&self, x: usize, y: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| at(&self.means, k, x, y))
    }

    /// Regional residual energy, grey^2.
    pub fn energy(&self, x: usize, y: usize) -> f64 {
        at(&self.means, Layout::ENERGY, x, y).powi(4)
    }

    /// Weights of the window `l` in flow and slopes; each sums to 1, or less where the field vanishes.
    pub fn weights(&self, l: usize, x: usize, y: usize) -> [f64; 2] {
        [Use::Flow, Use::Slopes].map(|of| at(&self.choice, self.order.weight(of, l), x, y))
    }

    /// Mean standard deviations of the windows of the flow and of the slopes, px.
    pub fn mean_sigmas(&self, x: usize, y: usize) -> [f64; 2] {
        let weights = self.sigmas.iter().enumerate().map(|(l, sigma)| self.weights(l, x, y).map(|w| w * sigma));
        weights.fold([0.0; 2], |sum, w| [sum[0] + w[0], sum[1] + w[1]])
    }

    /// Regional squared change from the window `l` to the next, as a noise density, px^4.
    pub fn change(&self, l: usize, x: usize, y: usize) -> f64 {
        at(&self.means, Layout::change(l), x, y).powi(4) / self.step_variances[l]
    }
}

pub(in crate::flow::coarse_to_fine) fn node_count(sites: usize) -> usize {
    (sites - 1).div_ceil(SITES_PER_NODE) + 1
}

/// Value at a node; beyond the grid of regional means its last value.
fn at<T: SimdReal>(planes: &Planes<T>, k: usize, x: usize, y: usize) -> f64 {
    planes.at(k, x.min(planes.width - 1), y.min(planes.height - 1)).to_f64()
}
