//! What windows leave of the noise of the flow.
//!
//! White noise of density `D` (variance times area) leaves in the windows' means and slopes (standard
//! deviation `s`, transfer function `H = 1 - (1 - G)^4`) the covariances
//!
//! `C(u, v) = D integral H^2 / (2 pi)^2 = F D / (4 pi s^2)`, `C(u_x, v_x) = C(u_y, v_y) = D integral w_x^2
//! H^2 / (2 pi)^2 = S D / (8 pi s^4)`,
//!
//! where `H = sum c_n G^n` gives `F = sum c_m c_n 2 / (m + n)` and `S = sum c_m c_n (2 / (m + n))^2`.
//!
//! Its shape is that of `e P^-1`, `P` being the information and `e` the residual energy around a place. Its
//! size is not: errors of brightness go into two orders of derivatives, texture has its own spectrum, and
//! coupling takes away the finest part. So the size is taken from the flow: between two windows that were
//! both accepted the flow changes by noise, over that of white noise of unit density. The geometric mean of
//! this excess over the frame is well determined, a single place's is not.
//!
//! At the frame's edge windows see less: flow continued by reflection at its own noisy edge leaves up to
//! fifteen times the variance, slopes across it twenty-four times. These are the factors of white noise drawn
//! and smoothed, as functions of the distance over the window. Where motion leads out of a frame that edge
//! has been continued with slopes as noisy as those of the data's windows.

use super::data_support::{DataSupport, Edge};
use crate::flow::coarse_to_fine::data_term::{SEEN, UU, UV, VV};
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::refine::{SPACING, TERMS, WindowStatistics};
use crate::simd::SimdReal;
use std::f64::consts::PI;

/// Bounds of the excess: beyond them the flow tells nothing about noise.
const EXCESS_BOUNDS: [f64; 2] = [0.5, 50.0];
/// Of white noise with variance 1, rows 1 to 3 with gradients weighing 4 have the information 52.25 times the
/// variance of the mean frame and the residual energy 8.25 times that of the rate: 1/2 and 2 for pairs, 3/8
/// and 1/2 for triples. A third of that is hidden where motion was fitted to nothing but noise.
const PAIR_NOISE_INFORMATION: f64 = 52.25 / 8.25 * 0.25 * FITTED_NOISE_FACTOR;
const TRIPLE_NOISE_INFORMATION: f64 = 52.25 / 8.25 * 0.75 * FITTED_NOISE_FACTOR;
const FITTED_NOISE_FACTOR: f64 = 1.5;
/// Width of an unseen strip, px, that doubles the variance at its edge of the frame: of means and of slopes.
const STRIP_UNIT: [f64; 2] = [3.5, 4.0];
/// Wider strips are as uncertain as this one, px; what they are continued by tells the rest.
const MAX_STRIP: f64 = 16.0;
/// Windows at whose edge nothing more is felt.
const MAX_EDGE_DISTANCE: f64 = 2.5;
/// Share of the information that is believed in any case.
const MIN_INFORMATION_SHARE: f64 = 1e-3;
/// Least weight of wider windows at a place that counts.
const MIN_WIDE_WEIGHT: f64 = 0.1;
/// Texture is looked for within so many sites of a place.
const TEXTURE_REACH: usize = 2;
/// Greatest density of the noise of the flow where there is texture, px^4: a window of 4 px would leave .2
/// px.
const MAX_TEXTURED_DENSITY: f64 = 10.0;

/// Information beyond that of noise over the residual energy, px^-2, from which on data lead. Bonds are
/// stronger, but pull where the neighbours are led as well.
const MIN_CONSTRAINING_INFORMATION: f64 = 0.5;
/// The same, where motion in the other direction is not led: as strong as the bonds.
const MIN_INFORMATION_OF_ONE_DIRECTION: f64 = 20.0;

/// The matrix `xx, xy, yy` that leaves of motion what data do not lead: zero where they lead all of it, the
/// unit matrix where they lead nothing, and else the projection onto the direction without texture.
pub(super) type UnconstrainedDirections = [f32; 3];
/// Nothing is led.
pub(super) const ALL: UnconstrainedDirections = [1.0, 0.0, 1.0];
/// Everything is.
pub(super) const NONE: UnconstrainedDirections = [0.0; 3];

/// The residual energy that noise leaves, grey^2.
#[derive(Debug, Clone, Copy)]
pub(in crate::flow::coarse_to_fine) enum Energy {
    /// That of noise which is known.
    Known(f64),
    /// As the residuals tell, but no less.
    AtLeast(f64),
}

impl Energy {
    /// So many times as much, where it is known; residuals tell by themselves.
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

/// What is left at a place: the density's matrix `D_uu, D_uv, D_vv`, px^4, and the shares that go into the
/// flow and into the derivatives along x and y.
pub(super) struct RemainingNoise {
    pub density: [f64; 3],
    pub flow: f64,
    pub slopes: [f64; 2],
}

/// What was taken for nothing may be as large as noise in the widest window: this share of its variance.
const VANISHED_NOISE_SHARE: f64 = 0.5;

/// What an edge of the frame adds to the noise that a window leaves: the factor of means and of slopes along
/// the edge, and that of slopes across it.
fn at_edge(edge: &Edge, sigma: f64) -> [f64; 2] {
    let t = edge.distance / sigma;
    if t > MAX_EDGE_DISTANCE {
        return [1.0; 2];
    }
    let [means, slopes] = STRIP_UNIT.map(|unit| 1.0 + (edge.strip.min(MAX_STRIP) / unit).powi(2));
    [1.0 + 14.0 * means * (-2.1 * t - 3.6 * t * t).exp(), 1.0 + 22.7 * slopes * (-(t / 0.74).powi(2)).exp()]
}

/// The noise of one estimate.
pub(super) struct Noise<'a, T> {
    statistics: &'a WindowStatistics<T>,
    energy: Energy,
    excess: f64,
    /// Information, in any direction, that white noise seems to have, over the residual energy it leaves.
    noise_information: f64,
    support: &'a DataSupport,
}

impl<'a, T: SimdReal> Noise<'a, T> {
    /// For the estimate's last data term.
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
            noise_information: if is_pair { PAIR_NOISE_INFORMATION } else { TRIPLE_NOISE_INFORMATION },
            support,
        }
    }

    /// With an excess that is no less than that of the `other`, from the same frames: where nearly nothing is
    /// accepted, little is seen of it.
    pub fn at_least_as_noisy_as(self, other: &Self) -> Self {
        Self { excess: self.excess.max(other.excess), ..self }
    }

    /// The residual energy of the noise at a place.
    fn energy(&self, x: usize, y: usize) -> f64 {
        match self.energy {
            Energy::Known(energy) => energy,
            Energy::AtLeast(floor) => self.statistics.energy(x, y).max(floor),
        }
    }

    /// Whether there is texture within [`NEAR`] sites of a place, that is whether motion in any direction is
    /// known from there alone.
    pub fn is_textured(&self, data: &Planes<T>, x: usize, y: usize) -> bool {
        let around = |place: usize, len: usize| {
            let middle = (SPACING * place).min(len - 1);
            middle.saturating_sub(TEXTURE_REACH)..(middle + TEXTURE_REACH + 1).min(len)
        };
        let (columns, rows) = (around(x, data.width), around(y, data.height));
        let count = (columns.len() * rows.len()) as f64;
        let mean = |k| {
            let row = |y| data.line(k, y)[columns.clone()].iter().map(|value| value.to_f64()).sum::<f64>();
            rows.clone().map(row).sum::<f64>() / count
        };
        let energy = self.energy(x, y);
        let [a, b, c] = inverse_without_noise([UU, UV, VV].map(mean), self.noise_information * energy);
        let best = 0.5 * (a + c) - (0.5 * (a - c)).hypot(b);
        self.excess * energy * best <= MAX_TEXTURED_DENSITY
    }

    /// In which directions the data of sites near a place, whose mean information this is, do not lead their
    /// motion, so that the first visits do not correct it.
    pub fn unconstrained(&self, [a, b, c]: [f64; 3], x: usize, y: usize) -> UnconstrainedDirections {
        let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        let beyond = |share: f64| (self.noise_information + share) * self.energy(x, y);
        if middle - radius >= beyond(MIN_CONSTRAINING_INFORMATION) {
            return NONE;
        }
        if middle + radius < beyond(MIN_INFORMATION_OF_ONE_DIRECTION) || radius <= 0.0 {
            return ALL;
        }
        // The direction with the least information.
        let (cosine, sine) = (half / radius, b / radius);
        [0.5 * (1.0 - cosine), -0.5 * sine, 0.5 * (1.0 + cosine)].map(|entry| entry as f32)
    }

    /// What is left at a place.
    pub fn at(&self, x: usize, y: usize) -> RemainingNoise {
        let energy = self.energy(x, y);
        let inverse = inverse_without_noise(
            positive_definite(self.statistics.information(x, y)),
            self.noise_information * energy,
        );
        let scale = self.excess * energy;
        let (flow_share, slope_share) = (of_white_noise(1), of_white_noise(2));
        let widest = self.statistics.sigmas.len() - 1;
        let windows = 0..=widest;
        let weights: Vec<[f64; 2]> = windows.map(|l| self.statistics.weights(l, x, y)).collect();
        let nothing = [0, 1].map(|k| VANISHED_NOISE_SHARE * (1.0 - weights.iter().map(|w| w[k]).sum::<f64>()).max(0.0));
        let mut remaining = RemainingNoise { density: inverse.map(|entry| entry * scale), flow: 0.0, slopes: [0.0; 2] };
        for (l, sigma) in self.statistics.sigmas.iter().enumerate() {
            let weight = [0, 1].map(|k| weights[l][k] + if l == widest { nothing[k] } else { 0.0 });
            let (flow, slope) = (flow_share / (4.0 * PI * sigma.powi(2)), slope_share / (8.0 * PI * sigma.powi(4)));
            let [[mean_x, across_x], [mean_y, across_y]] = self.support.edges(x, y).map(|edge| at_edge(&edge, *sigma));
            remaining.flow += weight[0] * flow * mean_x * mean_y;
            remaining.slopes[0] += weight[1] * slope * across_x * mean_y;
            remaining.slopes[1] += weight[1] * slope * mean_x * across_y;
        }
        remaining
    }
}

/// The inverse of the information without what noise seems to add to it in every direction: `N` in the frames
/// has gradients of its own, and where there is nothing else, nothing is known. A share of [`LEAST_LEFT`] is
/// left in any case.
fn inverse_without_noise([a, b, c]: [f64; 3], noise: f64) -> [f64; 3] {
    let (middle, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = half.hypot(b);
    let inverse = |value: f64| 1.0 / (value - noise).max(MIN_INFORMATION_SHARE * value.max(f64::MIN_POSITIVE));
    let (strong, weak) = (inverse(middle + radius), inverse((middle - radius).max(MIN_INFORMATION_SHARE * middle)));
    let (mean, spread) = (0.5 * (strong + weak), 0.5 * (strong - weak));
    let (cosine, sine) = if radius > 0.0 { (half / radius, b / radius) } else { (1.0, 0.0) };
    [mean + spread * cosine, spread * sine, mean - spread * cosine]
}

/// Information that is positive definite.
fn positive_definite([a, b, c]: [f64; 3]) -> [f64; 3] {
    let floor = 1e-6 + 1e-4 * (a + c);
    [a + floor, b, c + floor]
}

/// Geometric mean over the places with data: the density that the accepted changes show over that of the
/// residuals.
fn excess<T: SimdReal>(statistics: &WindowStatistics<T>, data: &Planes<T>) -> f64 {
    let (width, height) = statistics.size();
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (mut weights, mut changes) = (0.0, 0.0);
        for l in 1..statistics.sigmas.len() {
            let [weight, _] = statistics.weights(l, x, y);
            weights += weight;
            changes += weight * statistics.change(l - 1, x, y);
        }
        let [a, b, c] = positive_definite(statistics.information(x, y));
        let density = statistics.energy(x, y) * (a + c) / (a * c - b * b);
        let valid = data.at(SEEN, (SPACING * x).min(data.width - 1), (SPACING * y).min(data.height - 1)).to_f64();
        if valid > 0.5 && weights > MIN_WIDE_WEIGHT && density > 0.0 && changes > 0.0 {
            sum += (changes / (weights * density)).ln();
            count += 1.0;
        }
    }
    if count > 0.0 { (sum / count).exp().clamp(EXCESS_BOUNDS[0], EXCESS_BOUNDS[1]) } else { 1.0 }
}
