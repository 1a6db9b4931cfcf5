//! Error by the finest detail of the frames, measured by leaving it out.
//!
//! Detail near half a cycle per pixel is recorded with aliases, quantised and noisy, and shows first that
//! texture does not move as affinely as assumed. So the finest level is linearised twice about the result: as
//! it is and with frames smoothed by `[1, 4, 6, 4, 1] / 16`. Both normal equations are summed in windows
//! around the nodes and solved for what remains of the motion. Where they disagree over a wide window, the
//! finest detail is taken for biased, and the motion moves by the difference. Their mean squared difference
//! around a node measures errors that residuals do not show, as the scatter of half samples does (P. C.
//! Mahalanobis's interpenetrating samples, 1946); the covariance includes it.
//!
//! What either leaves of the flow in narrow windows, without smoothness, is the remainder: the step that
//! Lucas and Kanade would take. Where it is longer than chance explains, smoothness holds the flow back
//! (small or curved objects). The flow moves by a share of the smoothed frames' remainder, since the finest
//! detail may be biased; the covariance includes the mean square of the remainder of the frames as they are.

use super::data_term::{DataOptions, DataTerm, MEANS, Sums};
use super::descent::DescentPlan;
use super::nodes::{NodeAxis, NodeSums, Square, binomial_mean, node_sums};
use super::planes::{LEFT, Planes};
use super::pyramid::ComparedFrames;
use super::refine::SITES_PER_NODE;
use super::unresolved_motion::{explained_energy, unresolved_motion};
use super::workspace::Workspace;
use crate::ablation::keeps;
use crate::image::Spline;
use crate::math::median;
use crate::parallel;
use crate::simd::SimdReal;
use std::f64::consts::PI;

/// Binomial means of the sums, so that windows have standard deviations of 3.4, 8.7 and 14.3 px.
const BINOMIAL_MEANS: [usize; 3] = [0, 2, 6];
/// Standard deviations of these windows, px.
const WINDOWS: [f64; 3] = [3.4, 8.7, 14.3];
/// Information, over residual energy, that smoothness adds.
const PRIOR: f64 = 0.5;
/// Maximum difference at a node, px: larger ones are of two motions.
const MAX_DIFFERENCE: f64 = 0.1;
/// Maximum components of a remainder, px.
const MAX_REMAINDER: f64 = 1.0;
/// The same, where the flow moves by it: larger ones are of two motions.
const MAX_STEP: f64 = 0.3;
/// Minimum sides of frames whose flow moves by remainders, standard deviations of the narrow window.
const MIN_SIDE: f64 = 4.0;
/// Mean square of the smoothed frames' remainder, over that of white noise of their residuals (they keep a
/// quarter of its energy) and over the scatter in the narrow window, that is taken for chance.
const NOISE_IN_STEP: f64 = 3.0;
const SCATTER_IN_STEP: f64 = 0.4;
/// Mean square of a remainder, over that of white noise, that is taken for chance: around a node, and after
/// more binomial means, 16 px around it.
const NOISE_IN_REMAINDER: [f64; 2] = [1.5, 1.2];
const REMAINDER_MEANS: usize = 6;
/// Bias, px, of which half is removed and which steps may have by chance; for the former also as a share of
/// the scatter in the narrow window.
const DOUBTFUL_BIAS: f64 = 0.02;
const DOUBTFUL_SHARE: f64 = 0.1;
/// Standard deviation of white noise in a data term's first row after the frames are smoothed, over that
/// before.
const SMOOTHED_NOISE: f64 = 0.48;

/// What the finest detail says differently, at nodes.
#[derive(Debug)]
pub(super) struct DetailBias {
    axes: (NodeAxis, NodeAxis),
    /// What the flow moves by, px: its bias with the opposite sign, and the step.
    correction: Vec<[f64; 2]>,
    /// Mean squared differences around the nodes, px^2, in each of the windows.
    scatter: [Vec<Square>; 3],
    /// Mean squares around the nodes of the remainder of the frames as they are, px^2; and their sums over
    /// both directions in wide surroundings.
    remainder: Vec<Square>,
    wide_remainder: Vec<[f64; 1]>,
    /// Variances of unresolved motion, px^2; without a covariance none.
    unresolved: Vec<Square>,
}

impl DetailBias {
    /// Compares both linearisations about the `motion`; `residual_std` is for the robust weights of the rows.
    pub fn measure<T: SimdReal>(
        plan: &DescentPlan,
        workspace: &mut Workspace<T>,
        motion: &Planes<T>,
        residual_std: Option<T>,
    ) -> Self {
        let Workspace { pyramid, pool, space, .. } = workspace;
        let level = &pyramid.levels()[plan.finest];
        let smoothed: Vec<Spline<T>> =
            level.splines.iter().map(|spline| spline.smoothed(plan.simd, space.samples(spline.values()))).collect();
        let axes = (NodeAxis::of(motion.width), NodeAxis::of(motion.height));
        let size = (axes.0.count, axes.1.count);
        let term = DataTerm::new(plan.simd, DataOptions::default(), pool);
        let mut data = space.planes(motion.width, motion.height, MEANS);
        let smooth_std = residual_std.map(|std| T::from_f64(SMOOTHED_NOISE * std.to_f64()));
        let mut linearise = |splines, std| {
            let views = level.views_of(splines, ComparedFrames::All);
            term.linearise(Sums::Means, (level.size, &views), motion, std, &mut data);
            node_sums(plan.simd, &data, size)
        };
        let smoothed_sums = linearise(&smoothed, smooth_std);
        let mut sums = [linearise(&level.splines, residual_std), smoothed_sums];
        let unresolved = if plan.keeps_levels {
            let mut explained = space.planes(motion.width, motion.height, 1);
            explained_energy(plan.simd, &data, &mut explained);
            let found = unresolved_motion(&sums[0], &node_sums(plan.simd, &explained, size), size);
            space.keep(explained);
            found
        } else {
            Vec::new()
        };
        smoothed.into_iter().map(Spline::into_memory).for_each(|memory| space.keep(Planes::of_samples(memory)));
        space.keep(data);
        let remainder = mean_squares(&remainders(&sums[0]), MAX_REMAINDER, size);
        let mut wide_remainder: Vec<[f64; 1]> = remainder.iter().map(|[xx, _, yy]| [xx + yy]).collect();
        for _ in 0..REMAINDER_MEANS {
            binomial_mean(&mut wide_remainder, size);
        }
        let narrow = sums[1].clone();
        let mut differences = Vec::new();
        let mut done = 0;
        let scatter = BINOMIAL_MEANS.map(|means| {
            for _ in done..means {
                for sums in &mut sums {
                    binomial_mean(sums, size);
                }
            }
            done = means;
            differences = difference(&sums);
            mean_squares(&differences, MAX_DIFFERENCE, size)
        });
        let shrunk = |([u, v], [xx, _, yy]): (&[f64; 2], &Square)| {
            let square = u * u + v * v;
            let kept = square / (square + DOUBTFUL_SHARE * (xx + yy) + 2.0 * DOUBTFUL_BIAS.powi(2));
            [kept * u, kept * v]
        };
        let mut correction: Vec<[f64; 2]> = differences.iter().zip(&scatter[0]).map(shrunk).collect();
        let side = level.size.0.min(level.size.1) as f64;
        let is_wide = side >= MIN_SIDE * WINDOWS[0] || !keeps("flow.step_side");
        if is_wide && keeps("flow.step") {
            let steps = steps(&narrow, &scatter[0], size);
            correction.iter_mut().zip(&steps).for_each(|(flow, step)| (0..2).for_each(|c| flow[c] += step[c]));
        }
        Self { axes, correction, scatter, remainder, wide_remainder, unresolved }
    }

    /// Removes the bias from the motion and takes the step.
    pub fn correct<T: SimdReal>(&self, motion: &mut Planes<T>) {
        let len = motion.row_len();
        let (width, stride) = (motion.width, motion.stride());
        let (along, across) = self.axes;
        let columns: Vec<_> = (0..width).map(|x| along.around(x as f64 / SITES_PER_NODE as f64)).collect();
        parallel::for_each(motion.data_mut().chunks_mut(len.max(1)).enumerate(), |(y, row)| {
            let (above, below, down) = across.around(y as f64 / SITES_PER_NODE as f64);
            for c in 0..2 {
                let line = |j: usize| move |i: usize| self.correction[j * along.count + i][c];
                let (upper, lower) = (line(above), line(below));
                for (x, &(left, right, share)) in columns.iter().enumerate() {
                    let a = upper(left) + (upper(right) - upper(left)) * share;
                    let b = lower(left) + (lower(right) - lower(left)) * share;
                    let at = LEFT + c * stride + x;
                    row[at] += T::from_f64(a + (b - a) * down);
                }
            }
        });
    }

    /// Mean square of the remainder around a node, and the share of it that white noise of a density
    /// `xx, xy, yy`, px^4, does not explain.
    pub fn remainder(&self, node: usize, density: &Square) -> (Square, f64) {
        let [xx, xy, yy] = self.remainder[node];
        let noise = noise_variance(density[0] + density[2]);
        let [near, wide] = NOISE_IN_REMAINDER;
        let explained = near / (xx + yy);
        let explained =
            if keeps("flow.wide_remainder") { explained.min(wide / self.wide_remainder[node][0]) } else { explained };
        ([xx, xy, yy], (1.0 - noise * explained).max(0.0))
    }

    /// Variances of the unresolved motion at a node, px^2.
    pub fn unresolved(&self, node: usize) -> Square {
        self.unresolved.get(node).copied().unwrap_or_default()
    }

    /// Mean squared difference around a node in a window of `sigma` px.
    pub fn scatter(&self, node: usize, sigma: f64) -> Square {
        let last = WINDOWS.len() - 2;
        let k = (0..last).find(|&k| sigma < WINDOWS[k + 1]).unwrap_or(last);
        let share = ((sigma / WINDOWS[k]).ln() / (WINDOWS[k + 1] / WINDOWS[k]).ln()).clamp(0.0, 1.0);
        let (narrow, wide) = (self.scatter[k][node], self.scatter[k + 1][node]);
        std::array::from_fn(|i| narrow[i] + share * (wide[i] - narrow[i]))
    }
}

/// Mean squares of vectors whose components are at most `most` px, with a standard deviation of 8 px around
/// the nodes.
fn mean_squares(vectors: &[[f64; 2]], most: f64, size: (usize, usize)) -> Vec<Square> {
    let bounded = vectors.iter().map(|vector| vector.map(|d| d.clamp(-most, most)));
    let mut squares: Vec<Square> = bounded.map(|[u, v]| [u * u, u * v, v * v]).collect();
    for _ in 0..2 {
        binomial_mean(&mut squares, size);
    }
    squares
}

/// What the sums leave of the flow, px, where smoothness adds `prior` to their information.
fn solve(&[a, b, c, u, v, _]: &NodeSums, prior: f64) -> [f64; 2] {
    let (a, c) = (a + prior, c + prior);
    let determinant = a * c - b * b;
    if determinant > 0.0 { [(c * u - b * v) / determinant, (a * v - b * u) / determinant] } else { [0.0; 2] }
}

/// Median residual energy of the nodes.
fn typical_energy(sums: &[NodeSums]) -> f64 {
    let mut energies: Vec<f64> = sums.iter().map(|sum| sum[5]).collect();
    median(&mut energies).unwrap_or(0.0)
}

/// Remainders of the flow, px. A node's own residual energy is not part of the prior: it is large where much
/// is left.
fn remainders(sums: &[NodeSums]) -> Vec<[f64; 2]> {
    let prior = 2.0 * PRIOR * typical_energy(sums);
    sums.iter().map(|sum| solve(sum, prior)).collect()
}

/// Steps by which the flow moves, px: shares, beyond chance, of the remainders of the smoothed frames, whose
/// `sums` have a part of the `scatter` by the finest detail.
fn steps(sums: &[NodeSums], scatter: &[Square], size: (usize, usize)) -> Vec<[f64; 2]> {
    let mut steps = remainders(sums);
    let squares = mean_squares(&steps, MAX_STEP, size);
    let scattered = if keeps("flow.step_scatter") { SCATTER_IN_STEP } else { 0.0 };
    for (n, step) in steps.iter_mut().enumerate() {
        let [a, b, c, _, _, energy] = sums[n];
        let determinant = a * c - b * b;
        let density = if determinant > 0.0 { energy * (a + c) / determinant } else { f64::INFINITY };
        let chance = NOISE_IN_STEP * noise_variance(density)
            + scattered * (scatter[n][0] + scatter[n][2])
            + 2.0 * DOUBTFUL_BIAS.powi(2);
        let share = (1.0 - chance / (squares[n][0] + squares[n][2])).max(0.0);
        *step = step.map(|d| share * d.clamp(-MAX_STEP, MAX_STEP));
    }
    steps
}

/// Variance, px^2, that white noise of a density, px^4, leaves in the narrow window.
fn noise_variance(density: f64) -> f64 {
    density / (4.0 * PI * WINDOWS[0].powi(2))
}

/// What the second sums say of the flow beyond the first, px.
fn difference(sums: &[Vec<NodeSums>; 2]) -> Vec<[f64; 2]> {
    let typical = sums.each_ref().map(|sums| typical_energy(sums));
    let node = |(fine, smooth): (&NodeSums, &NodeSums)| {
        let (fine, smooth) =
            (solve(fine, PRIOR * (fine[5] + typical[0])), solve(smooth, PRIOR * (smooth[5] + typical[1])));
        [smooth[0] - fine[0], smooth[1] - fine[1]]
    };
    sums[0].iter().zip(&sums[1]).map(node).collect()
}
