//! What the choice of windows rested on, kept for the covariance.

use super::choose::{Choice, Order, Use};
use super::ladder::{MAX_OCTAVE, difference_variance};
use super::region::Layout;
use crate::flow::coarse_to_fine::grid::Planes;
use crate::simd::SimdReal;

/// Sites from one place of the evidence to the next.
pub(in crate::flow::coarse_to_fine) const SPACING: usize = 1 << MAX_OCTAVE;

/// Regional means and weights of windows, at every fourth site.
#[derive(Debug)]
pub(in crate::flow::coarse_to_fine) struct Evidence<T> {
    means: Planes<T>,
    choice: Planes<T>,
    order: Order,
    /// Standard deviations of the windows, px.
    pub sigmas: &'static [f64],
}

impl<T: SimdReal> Evidence<T> {
    pub(super) fn new(means: Planes<T>, choice: Choice<T>, sigmas: &'static [f64]) -> Self {
        Self { means, choice: choice.planes, order: choice.order, sigmas }
    }

    /// The memory.
    pub fn into_planes(self) -> [Planes<T>; 2] {
        [self.means, self.choice]
    }

    /// Places along x and y.
    pub fn size(&self) -> (usize, usize) {
        (self.means.width, self.means.height)
    }

    /// Regional information `P_uu, P_uv, P_vv`, grey^2/px^2.
    pub fn information(&self, x: usize, y: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| self.means.at(k, x, y).to_f64())
    }

    /// Regional residual energy, grey^2.
    pub fn energy(&self, x: usize, y: usize) -> f64 {
        self.means.at(Layout::ENERGY, x, y).to_f64().powi(4)
    }

    /// Weights of the window `l` in the flow and in the slopes; each sums to 1, or less where the field vanishes.
    pub fn weights(&self, l: usize, x: usize, y: usize) -> [f64; 2] {
        [Use::Flow, Use::Slopes].map(|of| self.choice.at(self.order.weight(of, l), x, y).to_f64())
    }

    /// Regional squared change of the flow from the window `l` to the next, over that of white noise of unit density: a density, px^4.
    pub fn change(&self, l: usize, x: usize, y: usize) -> f64 {
        self.means.at(Layout::change(l), x, y).to_f64().powi(4)
            / difference_variance(self.sigmas[l], self.sigmas[l + 1])
    }
}
