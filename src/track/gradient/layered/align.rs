//! The gradient step over the whole target: equation (5) of the paper with the unknowns of an affine map.

use super::layers::{Background, Target, is_inside};
use super::patch::{Patch, bounds_about, smooth};
use super::pose::{Increment, Pose};
use crate::track::gradient::local_flow::{MAD, median};
use crate::types::Frame;
use nalgebra::{SMatrix, SVector};

/// Longest step, px.
const STEP_MAX: f64 = 3.0;
/// Steps at a level.
const STEPS: usize = 6;
/// A level is left when a step is shorter, px.
const SETTLED: f64 = 0.01;
/// Least deviation of the residual, share of the range of the model.
const LEAST_SHARE: f64 = 0.03;
/// Limits of the brightness ratio.
const GAIN: (f64, f64) = (0.8, 1.25);
/// Support that the brightness ratio is measured on.
const BRIGHT: f64 = 0.7;
/// Support from which on a point must be the target, unless something covers it.
const SOLID: f64 = 0.3;
/// What the covariance is multiplied by: neighbouring residuals are not independent.
const CORRELATED: f64 = 4.0;

type Matrix = SMatrix<f64, 6, 6>;
type Vector = SVector<f64, 6>;

/// What may change: the columns are unknowns, the rows the six entries of an increment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Freedom {
    /// Two unknowns.
    Translation,
    /// Four: `B = [[s, -r], [r, s]]`.
    Similarity,
    /// Six.
    Affine,
}

impl Freedom {
    fn unknowns(self) -> usize {
        match self {
            Self::Translation => 2,
            Self::Similarity => 4,
            Self::Affine => 6,
        }
    }

    /// Derivatives by the unknowns, from the gradient and the place.
    #[inline(always)]
    fn columns(self, [gx, gy]: [f64; 2], [xi, eta]: [f64; 2]) -> [f64; 6] {
        match self {
            Self::Translation => [gx, gy, 0.0, 0.0, 0.0, 0.0],
            Self::Similarity => [gx, gy, xi * gx + eta * gy, xi * gy - eta * gx, 0.0, 0.0],
            Self::Affine => [gx, gy, xi * gx, eta * gx, xi * gy, eta * gy],
        }
    }

    fn increment(self, delta: &Vector) -> Increment {
        match self {
            Self::Translation => [delta[0], delta[1], 0.0, 0.0, 0.0, 0.0],
            Self::Similarity => [delta[0], delta[1], delta[2], -delta[3], delta[3], delta[2]],
            Self::Affine => std::array::from_fn(|k| delta[k]),
        }
    }
}

/// Which points have no vote.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Silence {
    /// All vote.
    None,
    /// Not those of the target where the known background is what is seen.
    Covered,
    /// Nor those beside it that look like it: a look-alike touches.
    Lookalike,
}

/// A task of alignment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Task<'a> {
    pub frame: &'a Frame<f64>,
    pub target: &'a Target,
    pub background: &'a Background,
    pub noise: f64,
    pub freedom: Freedom,
    pub silence: Silence,
    /// Deviations of the increment beforehand: of d, px, and of B.
    pub prior: [f64; 2],
    /// Deviations of the Gaussians, coarse to fine, px of the picture.
    pub levels: &'a [f64],
}

/// Where the target was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aligned {
    pub pose: Pose,
    /// All steps together, about as one increment of the pose that was begun with.
    pub moved: Increment,
    /// Covariance of the position in the picture, px^2.
    pub covariance: [[f64; 2]; 2],
    /// How much of the rotation was told by the picture, 0 to 1.
    pub rotation_told: f64,
    /// Brightness over that of the template.
    pub gain: f64,
}

/// One level: everything smoothed alike.
struct Level<'a> {
    task: Task<'a>,
    sigma: f64,
    frame: Patch,
    behind: Patch,
    support: Frame<f64>,
    /// Support times brightness.
    bright: Frame<f64>,
}

impl<'a> Level<'a> {
    fn new(task: Task<'a>, pose: &Pose, sigma: f64) -> Self {
        let reach = pose.reach(task.target.half()).map(|r| r + 2.0 * STEP_MAX + 3.0 * sigma + 2.0);
        let bounds = bounds_about(pose.p, reach, task.frame.size());
        let inner = sigma / pose.scale().max(0.1);
        let target = task.target;
        let product = target.a.data().iter().zip(target.t.data()).map(|(a, t)| a * t).collect();
        let product = Frame::new(target.a.width(), target.a.height(), product).unwrap_or_default();
        Self {
            task,
            sigma,
            frame: Patch::cut(task.frame, bounds).smoothed(sigma),
            behind: Patch::cut(&task.background.picture, bounds).smoothed(sigma),
            support: smooth(&target.a, inner),
            bright: smooth(&product, inner),
        }
    }
}

/// A point that votes.
struct Vote {
    residual: f64,
    weight: f64,
    columns: [f64; 6],
}

impl Level<'_> {
    /// Votes of all points near the support, without the weights for outliers; and the range of the model among them.
    fn votes(&self, pose: &Pose, gain: f64, (near, silent): (&Frame<bool>, Option<&Frame<bool>>)) -> (Vec<Vote>, f64) {
        let Task { frame, target, background, .. } = self.task;
        let (width, height) = target.a.size();
        let (mut votes, mut range) = (Vec::with_capacity(width * height), (f64::INFINITY, f64::NEG_INFINITY));
        for j in 1..height.saturating_sub(1) {
            for i in (1..width.saturating_sub(1)).filter(|i| near.get(*i, j)) {
                let xi = target.xi(i, j);
                let place = pose.apply(xi);
                if !is_inside(place, frame) {
                    continue;
                }
                let (seen, behind) = (self.frame.at(place), self.behind.at(place));
                let a = self.support.get(i, j);
                let model = gain * self.bright.get(i, j) + (1.0 - a) * behind;
                range = (range.0.min(model), range.1.max(model));
                let weight = if background.is_known(place) { 1.0 } else { a.powi(4) };
                if weight > 0.0 && !silent.is_some_and(|silent| silent.get(i, j)) {
                    let slope = |plane: &Frame<f64>| {
                        let (row, above, below) = (plane.row(j), plane.row(j - 1), plane.row(j + 1));
                        [0.5 * (row[i + 1] - row[i - 1]), 0.5 * (below[i] - above[i])]
                    };
                    let (of_bright, of_support) = (slope(&self.bright), slope(&self.support));
                    let gradient = [0, 1].map(|k| gain * of_bright[k] - behind * of_support[k]);
                    let columns = self.task.freedom.columns(gradient, xi);
                    votes.push(Vote { residual: seen - model, weight, columns });
                }
            }
        }
        (votes, (range.1 - range.0).max(0.0))
    }

    /// Points without a vote, and those so near to them that smoothing mixes them: beside what covers the target its support ends without the target ending.
    fn silent(&self, pose: &Pose, gain: f64) -> Option<Frame<bool>> {
        let Task { frame, target, silence, .. } = self.task;
        let (width, height) = target.a.size();
        let silent = Frame::from_fn(width, height, |i, j| {
            let place = pose.apply(target.xi(i, j));
            if !is_inside(place, frame) {
                return false;
            }
            let (seen, behind, bright) = (self.frame.at(place), self.behind.at(place), gain * target.t.get(i, j));
            let nearer_behind = (seen - behind).abs() < (seen - bright).abs();
            match silence {
                Silence::None => false,
                Silence::Covered => target.a.get(i, j) > SOLID && nearer_behind,
                Silence::Lookalike if target.a.get(i, j) > SOLID => nearer_behind,
                Silence::Lookalike => !nearer_behind,
            }
        });
        (silence != Silence::None).then(|| dilated(&silent, 1 + self.sigma.ceil() as usize))
    }

    /// Ratio of what is seen to the template.
    fn gain(&self, pose: &Pose, before: f64) -> f64 {
        let target = self.task.target;
        let mut ratios = Vec::new();
        for j in 0..target.a.height() {
            for i in (0..target.a.width()).filter(|i| target.a.get(*i, j) > BRIGHT) {
                let place = pose.apply(target.xi(i, j));
                let (a, bright) = (self.support.get(i, j), self.bright.get(i, j));
                if is_inside(place, self.task.frame) && bright > 1.0 {
                    ratios.push((self.frame.at(place) - (1.0 - a) * self.behind.at(place)) / bright);
                }
            }
        }
        if ratios.is_empty() { before } else { median(&mut ratios).clamp(GAIN.0, GAIN.1) }
    }
}

/// Everything within `reach` points along both axes.
fn dilated(mask: &Frame<bool>, reach: usize) -> Frame<bool> {
    let (width, height) = mask.size();
    let wide = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let along = Frame::from_fn(width, height, |i, j| mask.row(j)[wide(i, width)].contains(&true));
    Frame::from_fn(width, height, |i, j| wide(j, height).any(|k| along.get(i, k)))
}

/// The residual's deviation, robustly.
fn deviation(votes: &[Vote], noise: f64, range: f64) -> f64 {
    let mut sizes: Vec<f64> = votes.iter().map(|vote| vote.residual.abs()).collect();
    (MAD * median(&mut sizes)).max(noise).max(LEAST_SHARE * range)
}

/// Weighted normal equations `J'WJ` and `J'Wr`; outliers count little (S. Geman and D. McClure).
fn normal_equations(votes: &[Vote], s: f64) -> (Matrix, Vector) {
    let (mut matrix, mut right) = (Matrix::zeros(), Vector::zeros());
    for vote in votes {
        let outlying = 1.0 + (vote.residual / (3.0 * s)).powi(2);
        let weight = vote.weight / (outlying * outlying);
        for i in 0..6 {
            let column = weight * vote.columns[i];
            right[i] += column * vote.residual;
            for j in i..6 {
                matrix[(i, j)] += column * vote.columns[j];
            }
        }
    }
    matrix.fill_lower_triangle_with_upper_triangle();
    (matrix, right)
}

/// Finds the pose from a first guess; `None` when nothing of the target is in the picture.
pub(super) fn align(task: Task<'_>, guess: &Pose, gain: f64) -> Option<Aligned> {
    let near = task.target.near();
    let unknowns = task.freedom.unknowns();
    let (mut pose, mut total, mut gain) = (*guess, Vector::zeros(), gain);
    let mut last = None;
    for &sigma in task.levels {
        let level = Level::new(task, &pose, sigma);
        let silent = level.silent(&pose, gain);
        for _ in 0..STEPS {
            let (votes, range) = level.votes(&pose, gain, (&near, silent.as_ref()));
            if votes.len() < unknowns {
                return None;
            }
            let s = deviation(&votes, task.noise, range);
            let (mut matrix, right) = normal_equations(&votes, s);
            let mut prior = Vector::zeros();
            for k in 0..6 {
                prior[k] = (s / task.prior[usize::from(k >= 2)]).powi(2);
                // Unknowns that there are not.
                matrix[(k, k)] += if k < unknowns { prior[k] } else { 1.0 };
            }
            let inverse = matrix.cholesky()?.inverse();
            let mut delta = -(inverse * (right + prior.component_mul(&total)));
            let length = delta[0].hypot(delta[1]);
            if length > STEP_MAX {
                delta *= STEP_MAX / length;
            }
            pose = pose.moved(&task.freedom.increment(&delta));
            total += delta;
            last = Some((inverse, s));
            if length < SETTLED {
                break;
            }
        }
        gain = level.gain(&pose, gain);
    }
    let (inverse, s) = last?;
    if !pose.p.iter().chain(pose.a.as_flattened()).all(|value| value.is_finite()) {
        return None;
    }
    let d = pose.a;
    let inner = |i: usize, j: usize| CORRELATED * s * s * inverse[(i, j)];
    let covariance = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            (0..2).map(|k| (0..2).map(|l| d[i][k] * inner(k, l) * d[j][l]).sum::<f64>()).sum::<f64>()
        })
    });
    let rotation_told = match task.freedom {
        Freedom::Similarity => 1.0 - s * s * inverse[(3, 3)] / task.prior[1].powi(2),
        _ => 1.0,
    };
    Some(Aligned { pose, moved: task.freedom.increment(&total), covariance, rotation_told, gain })
}
