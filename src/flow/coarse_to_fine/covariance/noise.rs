//! Noise of the flow that the windows leave.
//!
//! White noise of density `D` (variance times area) leaves in the windows' means and slopes (standard
//! deviation `s`, transfer function `H = 1 - (1 - G)^4`) the covariances
//!
//! `C(u, v) = D integral H^2 / (2 pi)^2 = F D / (4 pi s^2)`, `C(u_x, v_x) = C(u_y, v_y) = D integral w_x^2
//! H^2 / (2 pi)^2 = S D / (8 pi s^4)`,
//!
//! where `H = sum c_n G^n` gives `F = sum c_m c_n 2 / (m + n)` and `S = sum c_m c_n (2 / (m + n))^2`.
//!
//! Its shape is that of `e P^-1`, `P` the information and `e` the residual energy around a node. Its size is
//! not: texture has its own spectrum, and regularisation removes the finest noise. So the excess of the
//! flow's change between accepted windows over white noise is averaged (geometric mean over the frame).
//!
//! Truncated windows at the frame's edge have up to fifteen times the variance, their slopes across it
//! twenty-four times. The factors come from simulated white noise. Where motion leads out of a frame, that
//! edge is extrapolated with the noisy slopes of the data windows.

use super::{data_support::DataSupport, data_support::Edge};
use crate::flow::coarse_to_fine::data_term::{SEEN, UU, UV, VV};
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::refine::{SITES_PER_NODE, TERMS, WindowStatistics};
use crate::image::halved_noise;
use crate::simd::SimdReal;
use std::f64::consts::PI;
use std::ops::Range;

/// Bounds of the excess; beyond them it does not measure noise.
const EXCESS_BOUNDS: [f64; 2] = [0.5, 50.0];
/// White noise of variance 1, rows 1 to 3 with gradient weight 4: the information is 52.25 times the variance
/// of the mean frame, the residual energy 8.25 times that of the rate: 1/2 and 2 for pairs, 3/8 and 1/2 for
/// triples. Where motion was fitted to noise alone, a third of the energy is missing.
const PAIR_NOISE_INFORMATION: f64 = 52.25 / 8.25 * 0.25 * FITTED_NOISE_FACTOR;
const TRIPLE_NOISE_INFORMATION: f64 = 52.25 / 8.25 * 0.75 * FITTED_NOISE_FACTOR;
const FITTED_NOISE_FACTOR: f64 = 1.5;
/// Width of a strip without data, px, that doubles the variance at the edge: of means and of slopes.
const STRIP_UNIT: [f64; 2] = [3.5, 4.0];
/// Maximum width of such a strip, px; the extrapolation error covers wider ones.
const MAX_STRIP: f64 = 16.0;
/// Distance, in windows, beyond which an edge has no effect.
const MAX_EDGE_DISTANCE: f64 = 2.5;
/// Minimum share of the information that is kept.
const MIN_INFORMATION_SHARE: f64 = 1e-3;
/// Minimum weight of wider windows at a node, for its excess to count.
const MIN_WIDE_WEIGHT: f64 = 0.1;
/// Reach, sites, of the test for texture around a node.
const TEXTURE_REACH: usize = 2;
/// Maximum noise density of the flow with texture, px^4: a window of 4 px would leave .2 px.
const MAX_TEXTURED_DENSITY: f64 = 10.0;

/// Minimum information beyond that of noise over the residual energy, px^-2, for data to constrain the
/// motion. Smoothness is stronger, but acts where neighbours are constrained as well.
const MIN_CONSTRAINING_INFORMATION: f64 = 0.5;
/// The same, if motion in the other direction is unconstrained: as strong as smoothness.
const MIN_INFORMATION_OF_ONE_DIRECTION: f64 = 20.0;

/// Projection `xx, xy, yy` onto the unconstrained directions: zero without any, the unit matrix if all are.
pub(super) type UnconstrainedDirections = [f32; 3];
pub(super) const ALL: UnconstrainedDirections = [1.0, 0.0, 1.0];
pub(super) const NONE: UnconstrainedDirections = [0.0; 3];

/// Residual energy of the noise, grey^2.
#[derive(Debug, Clone, Copy)]
pub(in crate::flow::coarse_to_fine) enum Energy {
    /// Of known noise.
    Known(f64),
    /// From the residuals, but at least this.
    AtLeast(f64),
}

impl Energy {
    pub fn times(self, factor: f64) -> Self {
        match self {
            Self::Known(energy) => Self::Known(factor * energy),
            Self::AtLeast(energy) => Self::AtLeast(factor * energy),
        }
    }
}

/// `sum c_m c_n (2 / (m + n))^power` of the windows: their noise over that of a Gaussian alone, of the flow
/// and of its slopes for powers 1 and 2.
fn of_white_noise(power: i32) -> f64 {
    let terms = || TERMS.into_iter().zip(1..);
    terms().flat_map(|(c, m)| terms().map(move |(d, n)| c * d * (2.0 / f64::from(m + n)).powi(power))).sum()
}

/// Remaining noise at a node: the density matrices `D_uu, D_uv, D_vv` of the flow and of its slopes, px^4,
/// and their shares.
pub(super) struct RemainingNoise {
    pub densities: [[f64; 3]; 2],
    pub flow: f64,
    pub slopes: [f64; 2],
}

/// Variance of a vanished field, as a share of the noise in the widest window.
const VANISHED_NOISE_SHARE: f64 = 0.5;

/// Factors of the noise at an edge: of means and slopes along the edge, and of slopes across it.
fn at_edge(edge: &Edge, sigma: f64) -> [f64; 2] {
    let t = edge.distance / sigma;
    if t > MAX_EDGE_DISTANCE {
        return [1.0; 2];
    }
    let [means, slopes] = STRIP_UNIT.map(|unit| 1.0 + (edge.strip.min(MAX_STRIP) / unit).powi(2));
    [1.0 + 14.0 * means * (-2.1 * t - 3.6 * t * t).exp(), 1.0 + 22.7 * slopes * (-(t / 0.74).powi(2)).exp()]
}

pub(super) struct Noise<'a, T> {
    statistics: &'a WindowStatistics<T>,
    energy: Energy,
    excess: f64,
    /// [`of_white_noise`] of the flow and of its slopes.
    shares: [f64; 2],
    /// Information, in any direction, that white noise contributes, over its residual energy.
    white_information: f64,
    support: &'a DataSupport,
}

impl<'a, T: SimdReal> Noise<'a, T> {
    pub fn new(
        statistics: &'a WindowStatistics<T>,
        (data, support): (&Planes<T>, &'a DataSupport),
        energy: Energy,
        is_pair: bool,
    ) -> Self {
        Self {
            statistics,
            energy,
            excess: excess(statistics, data),
            shares: [of_white_noise(1), of_white_noise(2)],
            white_information: if is_pair { PAIR_NOISE_INFORMATION } else { TRIPLE_NOISE_INFORMATION },
            support,
        }
    }

    /// With at least the excess of `other`: it is poorly measured where nearly no window is accepted.
    pub fn at_least_as_noisy_as(self, other: &Self) -> Self {
        Self { excess: self.excess.max(other.excess), ..self }
    }

    fn energy(&self, x: usize, y: usize) -> f64 {
        match self.energy {
            Energy::Known(energy) => energy,
            Energy::AtLeast(floor) => self.statistics.energy(x, y).max(floor),
        }
    }

    pub fn is_textured(&self, data: &Planes<T>, x: usize, y: usize) -> bool {
        let around = |node: usize, len: usize| {
            let middle = (SITES_PER_NODE * node).min(len - 1);
            middle.saturating_sub(TEXTURE_REACH)..(middle + TEXTURE_REACH + 1).min(len)
        };
        let information = mean_information(data, around(x, data.width), around(y, data.height));
        let energy = self.energy(x, y);
        let [a, b, c] = inverse_without_noise(information, self.white_information * energy);
        let best = 0.5 * (a + c) - (0.5 * (a - c)).hypot(b);
        self.excess * energy * best <= MAX_TEXTURED_DENSITY
    }

    /// Mean information of the sites near a node with which data constrain the motion.
    pub fn sufficient_information(&self, x: usize, y: usize) -> f64 {
        self.sufficient(self.energy(x, y))
    }

    fn sufficient(&self, energy: f64) -> f64 {
        (self.white_information + MIN_CONSTRAINING_INFORMATION) * energy
    }

    /// The same for a site of a level so many above, from its residual energy.
    pub fn sufficient_on_coarser(&self, level: usize, energy: f64) -> f64 {
        self.sufficient(self.at_least(level, energy))
    }

    /// Density of the noise at a site of a level so many above, px^4 of this one, from its information and
    /// residual energy.
    pub fn density_on_coarser(&self, level: usize, information: [f64; 3], energy: f64) -> [f64; 3] {
        let energy = self.at_least(level, energy);
        let scale = self.excess * energy * 16f64.powi(level as i32);
        inverse_without_noise(information, self.white_information * energy).map(|entry| entry * scale)
    }

    /// The residual energy of a level so many above, but no less than the noise leaves.
    fn at_least(&self, level: usize, energy: f64) -> f64 {
        let (Energy::Known(floor) | Energy::AtLeast(floor)) = self.energy;
        energy.max(floor * halved_noise().powi(level as i32))
    }

    /// Directions in which this mean information of the sites near a node does not constrain the motion.
    pub fn unconstrained(&self, [a, b, c]: [f64; 3], x: usize, y: usize) -> UnconstrainedDirections {
        let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        if middle - radius >= self.sufficient_information(x, y) {
            return NONE;
        }
        let sufficient = (self.white_information + MIN_INFORMATION_OF_ONE_DIRECTION) * self.energy(x, y);
        if middle + radius < sufficient || radius <= 0.0 {
            return ALL;
        }
        // The direction with the least information.
        let (cosine, sine) = (half / radius, b / radius);
        [0.5 * (1.0 - cosine), -0.5 * sine, 0.5 * (1.0 + cosine)].map(|entry| entry as f32)
    }

    /// At a node; of the flow with no greater density than on a `coarse` level whose data determine its
    /// motion.
    pub fn at(&self, x: usize, y: usize, coarse: Option<[f64; 3]>) -> RemainingNoise {
        let energy = self.energy(x, y);
        let inverse = inverse_without_noise(
            positive_definite(self.statistics.information(x, y)),
            self.white_information * energy,
        );
        let scale = self.excess * energy;
        let [flow_share, slope_share] = self.shares;
        let widest = self.statistics.sigmas.len() - 1;
        let windows = 0..=widest;
        let weights: Vec<[f64; 2]> = windows.map(|l| self.statistics.weights(l, x, y)).collect();
        let nothing = [0, 1].map(|k| VANISHED_NOISE_SHARE * (1.0 - weights.iter().map(|w| w[k]).sum::<f64>()).max(0.0));
        let own = inverse.map(|entry| entry * scale);
        let density = coarse.filter(|coarse| coarse[0] + coarse[2] < own[0] + own[2]).unwrap_or(own);
        let mut remaining = RemainingNoise { densities: [density, own], flow: 0.0, slopes: [0.0; 2] };
        for (l, sigma) in self.statistics.sigmas.iter().enumerate() {
            let weight = [0, 1].map(|k| weights[l][k] + if l == widest { nothing[k] } else { 0.0 });
            if weight == [0.0; 2] {
                continue;
            }
            let (flow, slope) = (flow_share / (4.0 * PI * sigma.powi(2)), slope_share / (8.0 * PI * sigma.powi(4)));
            let [[mean_x, across_x], [mean_y, across_y]] = self.support.edges(x, y).map(|edge| at_edge(&edge, *sigma));
            remaining.flow += weight[0] * flow * mean_x * mean_y;
            remaining.slopes[0] += weight[1] * slope * across_x * mean_y;
            remaining.slopes[1] += weight[1] * slope * mean_x * across_y;
        }
        remaining
    }
}

/// Inverse of the information without that of noise, whose gradients carry none about the motion.
fn inverse_without_noise([a, b, c]: [f64; 3], noise: f64) -> [f64; 3] {
    let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = half.hypot(b);
    let inverse = |value: f64| 1.0 / (value - noise).max(MIN_INFORMATION_SHARE * value.max(f64::MIN_POSITIVE));
    let (strong, weak) = (inverse(middle + radius), inverse((middle - radius).max(MIN_INFORMATION_SHARE * middle)));
    let (mean, spread) = (0.5 * (strong + weak), 0.5 * (strong - weak));
    let (cosine, sine) = if radius > 0.0 { (half / radius, b / radius) } else { (1.0, 0.0) };
    [mean + spread * cosine, spread * sine, mean - spread * cosine]
}

/// Mean information `P_uu, P_uv, P_vv` of the sites in some columns and rows, grey^2/px^2.
pub(super) fn mean_information<T: SimdReal>(data: &Planes<T>, columns: Range<usize>, rows: Range<usize>) -> [f64; 3] {
    let count = (columns.len() * rows.len()) as f64;
    [UU, UV, VV].map(|k| {
        let row = |y| data.line(k, y)[columns.clone()].iter().map(|value| value.to_f64()).sum::<f64>();
        rows.clone().map(row).sum::<f64>() / count
    })
}

fn positive_definite([a, b, c]: [f64; 3]) -> [f64; 3] {
    let floor = 1e-6 + 1e-4 * (a + c);
    [a + floor, b, c + floor]
}

/// Geometric mean over the nodes with data: the density of the accepted changes over that of the residuals.
fn excess<T: SimdReal>(statistics: &WindowStatistics<T>, data: &Planes<T>) -> f64 {
    let (width, height) = statistics.size();
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (mut weights, mut changes) = (0.0, 0.0);
        for l in 1..statistics.sigmas.len() {
            let [weight, _] = statistics.weights(l, x, y);
            if weight > 0.0 {
                weights += weight;
                changes += weight * statistics.change(l - 1, x, y);
            }
        }
        let [a, b, c] = positive_definite(statistics.information(x, y));
        let density = statistics.energy(x, y) * (a + c) / (a * c - b * b);
        let valid =
            data.at(SEEN, (SITES_PER_NODE * x).min(data.width - 1), (SITES_PER_NODE * y).min(data.height - 1)).to_f64();
        if valid > 0.5 && weights > MIN_WIDE_WEIGHT && density > 0.0 && changes > 0.0 {
            sum += (changes / (weights * density)).ln();
            count += 1.0;
        }
    }
    if count > 0.0 { (sum / count).exp().clamp(EXCESS_BOUNDS[0], EXCESS_BOUNDS[1]) } else { 1.0 }
}
