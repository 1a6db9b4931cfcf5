//! Covariance of the refined motion `(u, v, u_x, v_x, u_y, v_y)`, at nodes every eighth pixel.
//!
//! Errors of several kinds add, each measured in the frames themselves:
//!
//! * Noise ([`noise`]): the noise of the flow that the chosen windows leave, its size read from how much the
//!   flow changes from window to window.
//! * Curvature bias ([`curvature_bias`]): flow that is not affine within the windows is smoothed. The loss by
//!   smoothing once more, a vector of six, gives direction and size of the error.
//! * Extrapolation ([`extrapolation`]): where motion leads out of a frame, or without texture
//!   ([`data_support`]), it is extrapolated from other sites.
//! * Coarse-level error ([`coarse_level_error`]): without texture, or with texture of one direction only
//!   ([`constrained_directions`]), finer levels do not correct coarser ones.
//! * Motion boundaries ([`boundary_error`]): a site near one may have the motion of the other side.
//! * Unresolved motion ([`unresolved_motion`]): sites of a window may have motions of their own.
//! * Remainder ([`DetailBias`](super::detail_bias::DetailBias)): what the frames would still change in narrow
//!   windows, beyond noise.
//! * Peak locking ([`PeakLocking`]): a share of the correction may remain.
//! * Acceleration, three frames only: independent noise, and a share of the acceleration.
//!
//! [`first_frame`] carries a pair's covariance to the first frame, [`map`] interpolates. The constants were
//! fitted on synthetic scenes (three carriers, six motions, noise of 0 to 4 grey levels, two and three
//! frames) and checked on others; `benchmarks/tables/coverage.py` measures the coverage.

mod boundary_error;
mod coarse_level_error;
mod constrained_directions;
mod curvature_bias;
mod data_support;
mod extrapolation;
mod first_frame;
mod map;
mod noise;

use super::{estimate::Estimate, nodes::NodeAxis, peak_locking::PeakLocking, planes::Planes, unresolved_motion};
use crate::ablation::keeps;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::parallel;
use crate::simd::{Level, SimdReal};
use boundary_error::boundary_errors;
use coarse_level_error::{CoarseLevelError, CoarseLevelErrors};
use constrained_directions::ConstrainedDirections;
use data_support::DataSupport;
use extrapolation::Extrapolation;
pub(super) use map::CovarianceMap;
pub(super) use noise::Energy;
use noise::{Noise, RemainingNoise};

/// Variance of the flow over that of white noise of the density seen between windows, for two and for three
/// frames: real noise is not white, and strongest where windows do not remove it.
const FLOW_NOISE_FACTOR: [f64; 2] = [1.15, 1.25];
/// The same for the slopes.
const SLOPE_NOISE_FACTOR: f64 = 0.42;
/// Errors over the loss of curved motion, of the flow and of the slopes; for two and for three frames.
const CURVATURE_SHARES: [curvature_bias::Shares; 2] = [
    curvature_bias::Shares { fixed: [0.36, 0.66], chosen: [0.14, 0.68] },
    curvature_bias::Shares { fixed: [0.36, 0.66], chosen: [0.14, 0.46] },
];
/// Remaining share of the corrected peak locking.
const LOCKING_SHARE: f64 = 0.33;
/// Share of its amplitude that remains in the flow whatever the motion.
const LOCKING_FLOOR: f64 = 0.06;
/// White noise in the difference of two frames over that in half the difference of the outer ones of three.
const NEXT_FRAME_ENERGY: f64 = 4.0;
/// Noise of `w_2 - (w_3 - w_1) / 2` over that of `w_3 - w_2`: the part of the next frame alone.
const CHANGE_NOISE_FACTOR: f64 = 0.55;
/// Share of the acceleration, px/frame^2, that three frames take for motion.
const ACCELERATION_SHARE: f64 = 0.015;
/// Minimum share of textured nodes from which the field's own variation is measured.
const MIN_TEXTURED_SHARE: f64 = 0.02;
/// Share of the noise variance that the next frames' estimates repeat: texture moves on slowly.
const REPEATED_NOISE_SHARE: f64 = 0.3;

/// Variance of the flow and of its slopes, px^-2, over the scatter between frames with and without their
/// finest detail that noise does not explain; and that of noise alone over its variance in the flow.
const DETAIL_SHARES: [f64; 3] = [4.7, 0.0235, 0.0235];
/// Share of these on coarser levels, whose frames are smooth already.
const COARSE_DETAIL_SHARE: f64 = 0.2;
const NOISE_IN_DETAIL: f64 = 0.4;

/// Variance of the flow over the mean square of the remainder that noise does not explain: one step in
/// windows recovers a part of the error.
const REMAINDER_SHARE: f64 = 1.25;

/// Minimum nodes of a parallel task.
const NODES_PER_TASK: usize = 1024;

/// A covariance: its upper triangle, row by row.
type Entries = [f64; ENTRIES];

/// A covariance and its systematic part, which does not average out over time, if requested.
#[derive(Debug, Default)]
pub(super) struct CovarianceMaps<T> {
    pub whole: CovarianceMap<T>,
    pub systematic: Option<CovarianceMap<T>>,
}

/// Covariance at every node of the statistics; of a pair (`is_pair`) at the pixels of the first frame.
/// `energy`: residual energy of the noise. `with_systematic`: also the systematic part, everything but noise
/// and a share of the noise.
pub(super) fn covariance<T: SimdReal>(
    simd: Level,
    estimate: &Estimate<T>,
    energy: Energy,
    is_pair: bool,
    with_systematic: bool,
) -> CovarianceMaps<T> {
    let Some(statistics) = &estimate.statistics else { return CovarianceMaps::default() };
    let (width, height) = statistics.size();
    let axes = (NodeAxis::of(estimate.motion.width), NodeAxis::of(estimate.motion.height));
    let support = DataSupport::new(&estimate.data, (width, height));
    let data = (&estimate.data, &support);
    let noise = Noise::new(statistics, data, energy, is_pair);
    let constrained = ConstrainedDirections::new(&estimate.data, &estimate.coarser, &noise, (width, height));
    let coarse_densities: Vec<Option<[f64; 3]>> =
        (0..width * height).map(|n| constrained.coarse_density(&noise, n % width, n / width)).collect();
    let textured_support = textured_support(&noise, &estimate.data, (width, height));
    let textured_support = textured_support.as_ref().unwrap_or(&support);
    let extrapolation = Extrapolation::new(&estimate.motion, statistics, textured_support);
    let kind = usize::from(!is_pair);
    // Beside each other: one thread does much of either.
    let (coarse_errors, mut nodes) = parallel::join(
        || {
            CoarseLevelErrors::new(&estimate.motion, &estimate.coarser, constrained, (width, height))
                .at_nodes((width, height))
        },
        || curvature_bias::curvature_bias(simd, &estimate.motion, statistics, CURVATURE_SHARES[kind]),
    );
    let change = estimate.acceleration.as_ref();
    let change = change.map(|statistics| {
        Noise::new(statistics, data, energy.times(NEXT_FRAME_ENERGY), true).at_least_as_noisy_as(&noise)
    });
    let boundary_errors = if keeps("flow.boundary_error") {
        boundary_errors(&estimate.motion, (width, height))
    } else {
        vec![[0.0; 3]; width * height]
    };
    let complete = |(n, node): (usize, &mut Entries)| {
        let at = (n % width, n / width);
        let motion = curvature_bias::motion_at(&estimate.motion, at);
        let mut noise_part = [0.0; ENTRIES];
        let remaining = noise.at(at.0, at.1, coarse_densities[n]);
        add_noise(&mut noise_part, &remaining, [FLOW_NOISE_FACTOR[kind], SLOPE_NOISE_FACTOR]);
        if let Some(change) = &change {
            add_noise(
                &mut noise_part,
                &change.at(at.0, at.1, None),
                [CHANGE_NOISE_FACTOR * FLOW_NOISE_FACTOR[kind], CHANGE_NOISE_FACTOR * SLOPE_NOISE_FACTOR],
            );
        }
        extrapolation.add(node, textured_support.distances(at.0, at.1), statistics.mean_sigmas(at.0, at.1));
        add_coarse_level_error(node, &coarse_errors[n]);
        add_blocks(node, [1.0, boundary_error::SLOPE_SHARE, boundary_error::SLOPE_SHARE], &boundary_errors[n]);
        if let Some(detail) = estimate.detail.as_ref().filter(|_| keeps("flow.detail_scatter")) {
            let [sigma, _] = statistics.mean_sigmas(at.0, at.1);
            let scatter = detail.scatter(n, sigma);
            let [[d_uu, _, d_vv], _] = remaining.densities;
            let noise = FLOW_NOISE_FACTOR[kind] * remaining.flow * (d_uu + d_vv);
            let of_level = if estimate.level == 0 { 1.0 } else { COARSE_DETAIL_SHARE };
            let beyond_noise = of_level * (1.0 - NOISE_IN_DETAIL * noise / (scatter[0] + scatter[2])).max(0.0);
            add_blocks(node, DETAIL_SHARES.map(|share| share * beyond_noise), &scatter);
        }
        if let Some(detail) = estimate.detail.as_ref().filter(|_| keeps("flow.unresolved_motion")) {
            let slopes = unresolved_motion::SLOPE_SHARE;
            add_blocks(node, [1.0, slopes, slopes], &detail.unresolved(n));
        }
        if let Some(detail) = estimate.detail.as_ref().filter(|_| keeps("flow.remainder")) {
            let (square, share) = detail.remainder(n, &remaining.densities[0]);
            add_blocks(node, [REMAINDER_SHARE * share, 0.0, 0.0], &square);
        }
        add_locking(node, &motion, &estimate.locking);
        if !is_pair {
            add_acceleration(node, &motion);
        }
        node.iter_mut().zip(&noise_part).for_each(|(entry, noise)| *entry += noise);
        noise_part
    };
    let tasks = nodes.chunks_mut(NODES_PER_TASK).enumerate();
    let noises = parallel::map(tasks, |(task, nodes)| {
        let completed = (task * NODES_PER_TASK..).zip(nodes).map(complete);
        completed.filter(|_| with_systematic).collect::<Vec<Entries>>()
    });
    let map = |nodes: Vec<Entries>| {
        let carried = if is_pair { first_frame::to_first_frame(&nodes, &estimate.motion, axes) } else { nodes };
        CovarianceMap::new(&carried, axes, estimate.level)
    };
    let systematic = with_systematic.then(|| {
        let without = |(node, noise): (&Entries, &Entries)| {
            std::array::from_fn(|k| node[k] - (1.0 - REPEATED_NOISE_SHARE) * noise[k])
        };
        map(nodes.iter().zip(noises.iter().flatten()).map(without).collect())
    });
    CovarianceMaps { whole: map(nodes), systematic }
}

/// Support of sites with data and texture, if smaller than that of sites with data but not negligible.
fn textured_support<T: SimdReal>(noise: &Noise<'_, T>, data: &Planes<T>, size: (usize, usize)) -> Option<DataSupport> {
    let is_textured = |n: usize| noise.is_textured(data, n % size.0, n / size.0);
    let textured: Vec<bool> = parallel::map_range(size.0 * size.1, NODES_PER_TASK, is_textured);
    let count = textured.iter().filter(|textured| **textured).count();
    let tells = count < textured.len() && count as f64 >= MIN_TEXTURED_SHARE * textured.len() as f64;
    tells.then(|| DataSupport::textured(data, size, &textured))
}

fn add_noise(node: &mut Entries, noise: &RemainingNoise, [flow, slopes]: [f64; 2]) {
    add_blocks(node, [flow * noise.flow, 0.0, 0.0], &noise.densities[0]);
    add_blocks(node, [0.0, slopes * noise.slopes[0], slopes * noise.slopes[1]], &noise.densities[1]);
}

/// Adds a symmetric matrix `xx, xy, yy` times a factor to the blocks of the flow and its derivatives.
fn add_blocks(node: &mut Entries, factors: [f64; 3], matrix: &[f64; 3]) {
    for (block, factor) in factors.into_iter().enumerate() {
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            node[upper(2 * block + i, 2 * block + j)] += factor * matrix[k];
        }
    }
}

fn add_coarse_level_error(node: &mut Entries, error: &CoarseLevelError) {
    let [flow, slopes] = error.variances;
    add_blocks(node, [flow, slopes, slopes], &error.directions);
}

fn add_locking(node: &mut Entries, motion: &[f64; 6], locking: &PeakLocking) {
    for c in 0..2 {
        let (sine, slope) = locking.phase(motion[c]);
        let square = locking.amplitude[c].powi(2);
        let share = LOCKING_SHARE.powi(2) * square + locking.variance[c];
        node[upper(c, c)] += share * sine * sine + LOCKING_FLOOR.powi(2) * square;
        for k in [2 + c, 4 + c] {
            node[upper(k, k)] += share * (slope * motion[k]).powi(2);
        }
    }
}

/// Adds the effect of curved paths, `M (u, v)` in steady flow, on three frames (equal steps).
fn add_acceleration(node: &mut Entries, &[u, v, u_x, v_x, u_y, v_y]: &[f64; 6]) {
    node[upper(0, 0)] += (ACCELERATION_SHARE * (u_x * u + u_y * v)).powi(2);
    node[upper(1, 1)] += (ACCELERATION_SHARE * (v_x * u + v_y * v)).powi(2);
}
