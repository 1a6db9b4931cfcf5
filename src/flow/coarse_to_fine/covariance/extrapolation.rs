//! Extrapolation error: difference of the motion from its affine continuation, at sites without data.
//!
//! Over a distance `d` within the usable area, `e_u(d) = u(p + d) - u(p) - M(p) d` and `e_M(d) = M(p + d) -
//! M(p)` are measured along both axes; their mean squares are the variances of motion extrapolated by `d`.
//! Mean absolute values give them, as for Gaussian errors, so that motion boundaries do not dominate.

use super::{Entries, curvature_bias, data_support::DataSupport};
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::{SITES_PER_NODE, WindowStatistics};
use crate::flow::symmetric::upper;
use crate::simd::SimdReal;
use std::f64::consts::FRAC_PI_2;

/// Measured distances, nodes; each twice the one before.
const STEPS: [usize; 4] = [1, 2, 4, 8];

/// Shift, in standard deviations, of one-sided windows at the edge: their motion is that further in.
const EDGE_SHIFT: f64 = 0.5;
/// Maximum sigma of such a window, px: wider ones are chosen only where nothing is curved.
const MAX_EDGE_SIGMA: f64 = 8.0;
/// Standard deviation of the fixed windows of data term and regularisation, px.
const FIXED_WINDOW_STD: f64 = 2.0;

/// Distance of extrapolation, px, at a signed distance from the edge of the data, for windows of `sigma` px.
fn continued(distance: f64, sigma: f64) -> f64 {
    let reach = sigma.min(MAX_EDGE_SIGMA) + FIXED_WINDOW_STD;
    let inner = distance.max(0.0) / reach;
    (-distance).max(0.0) + EDGE_SHIFT * reach * (-2.0 * inner * inner).exp()
}

pub(super) struct Extrapolation {
    /// Of the flow, px^2, and of the slopes, at each of [`STEPS`].
    variances: [[f64; 2]; STEPS.len()],
}

impl Extrapolation {
    pub fn new<T: SimdReal>(motion: &Planes<T>, statistics: &WindowStatistics<T>, support: &DataSupport) -> Self {
        let (width, height) = statistics.size();
        let nodes: Vec<Option<[f64; 6]>> = (0..width * height)
            .map(|n| (n % width, n / width))
            .map(|(x, y)| (support.continued_distance(x, y) == 0.0).then(|| curvature_bias::motion_at(motion, (x, y))))
            .collect();
        let mut variances = [[0.0; 2]; STEPS.len()];
        for (n, step) in STEPS.into_iter().enumerate() {
            let mut sums = [0.0; 3];
            for (at, here) in nodes.iter().enumerate() {
                let Some(here) = here else { continue };
                let (x, y) = (at % width, at / width);
                // The last nodes are nearer to the ones before.
                let along = (x + step + 1 < width).then(|| (nodes[at + step], 2));
                let across = (y + step + 1 < height).then(|| (nodes[at + step * width], 4));
                for (there, slope) in along.into_iter().chain(across) {
                    let Some(there) = there else { continue };
                    let distance = SITE_SPACING * (SITES_PER_NODE * step) as f64;
                    for k in 0..2 {
                        // Forward and backward, so that neither end is preferred.
                        let turn = there[k] - here[k];
                        sums[0] +=
                            (turn - distance * here[slope + k]).abs() + (turn - distance * there[slope + k]).abs();
                    }
                    sums[1] += (2..6).map(|k| (there[k] - here[k]).abs()).sum::<f64>();
                    sums[2] += 4.0;
                }
            }
            if sums[2] > 0.0 {
                variances[n] = [0, 1].map(|k| FRAC_PI_2 * (sums[k] / sums[2]).powi(2));
            }
            if n > 0 {
                // Variances do not decrease with the distance; small frames have no distant nodes.
                variances[n] = [0, 1].map(|k| variances[n][k].max(variances[n - 1][k]));
            }
        }
        Self { variances }
    }

    /// Adds the variances at a node with the given distances (px, along both axes) from the edge of the data;
    /// `sigmas`: of the windows of flow and slopes there, px.
    pub fn add(&self, node: &mut Entries, distances: [f64; 2], sigmas: [f64; 2]) {
        for (kind, (sigma, entries)) in sigmas.into_iter().zip([0..2, 2..6]).enumerate() {
            let [x, y] = distances.map(|d| continued(d, sigma));
            let variance = self.variance(kind, x.hypot(y));
            entries.for_each(|k| node[upper(k, k)] += variance);
        }
    }

    /// Of the flow (`kind` 0) or the slopes (1): linear in the squared distance below the first measured one
    /// and between them; constant beyond the last.
    fn variance(&self, kind: usize, distance: f64) -> f64 {
        let (mut from, mut below) = (0.0, 0.0);
        for (step, variances) in STEPS.into_iter().zip(&self.variances) {
            let to = SITE_SPACING * (SITES_PER_NODE * step) as f64;
            if distance < to {
                let share = (distance * distance - from * from) / (to * to - from * from);
                return below + share * (variances[kind] - below);
            }
            (from, below) = (to, variances[kind]);
        }
        below
    }
}
