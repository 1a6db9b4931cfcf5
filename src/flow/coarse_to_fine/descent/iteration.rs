//! One iteration: a linearisation and the regularised solution that follows.

use super::DescentPlan;
use super::block_matches::block_matches;
use super::comparison::Comparison;
use super::continuation::continue_motion;
use super::weighted_median::{BrightnessStd, sharpen_boundaries};
use crate::ablation::keeps;
use crate::flow::coarse_to_fine::brightness_scale::MIN_RESIDUAL_SHARE;
use crate::flow::coarse_to_fine::data_term::{DataTerm, MOTION, Pool, Sums};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::pyramid::{ComparedFrames, PyramidLevel};
use crate::flow::coarse_to_fine::regularize::{RegularizeScratch, Smoothness, regularize};
use crate::flow::coarse_to_fine::resample::rederive;
use crate::math::robust_std;
use crate::parallel::checkpoint;
use crate::simd::SimdReal;
use std::ops::Range;

/// Minimum standard deviation of the noise, as a share of that of the brightness.
const MIN_NOISE_SHARE: f64 = 1e-3;

/// Distance, px of the level, beyond which a site has not converged.
const MIN_MOVING_DISTANCE: f64 = 0.1;
/// Number of such sites that may be an object too small to change the mean over the frame.
const MIN_OBJECT_SITES: usize = 4;
/// Minimum and maximum width, sites, of a border that is not counted: there motion may drift.
const BORDER_SITES: (usize, usize) = (2, 4);
/// The border is this fraction of the sites, within those bounds.
const BORDER_DIVISOR: usize = 16;

/// Iterations and weak smoothness of the unregularised trial: the usual smoothness holds back small objects.
const TRIAL: (usize, Smoothness) =
    (3, Smoothness { flow: 1.0, jacobian: 100.0, break_strain: 0.1, sweeps: 4, reweight_every: 2 });
/// Minimum distance, px of the level, of the trial's motion from the regularised one.
pub(super) const MIN_MOTION_DIFFERENCE: f64 = 0.5;
/// Minimum change in the first iteration of the trial, px of the level: else no site leaves its motion.
const MIN_TRIAL_CHANGE: f64 = 0.25;
/// Regularised iterations after both motions are combined; after matches, which are whole px.
pub(super) const JOINT_ITERATIONS: usize = 2;
const MATCH_ITERATIONS: usize = 6;

pub(super) struct Iteration<'a, T> {
    pub plan: &'a DescentPlan,
    pub compared: ComparedFrames,
    pub term: DataTerm<'a, T>,
    pub data: &'a mut Planes<T>,
    pub scratch: &'a mut RegularizeScratch<T>,
    /// Standard deviation of the residual of the previous iteration, grey levels.
    pub residual_std: Option<T>,
}

impl<T: SimdReal> Iteration<'_, T> {
    /// Iterates once; `old` becomes the previous motion. Returns the root-mean-square change of the flow, px.
    pub fn advance(
        &mut self,
        level: &PyramidLevel<T>,
        smoothness: &Smoothness,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
    ) -> f64 {
        std::mem::swap(motion, old);
        rederive(old, motion);
        self.iterate(level, smoothness, (motion, old))
    }

    fn repeat(
        &mut self,
        count: usize,
        level: &PyramidLevel<T>,
        smoothness: &Smoothness,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
    ) {
        for _ in 0..count {
            self.advance(level, smoothness, (motion, old));
        }
    }

    /// Unregularised trial: estimates sites without their neighbours, so that small objects are found.
    pub fn try_unregularized(
        &mut self,
        level: &PyramidLevel<T>,
        smoothness: &Smoothness,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
        (pool, space): (&Pool<T>, &PlanePool<T>),
    ) {
        let mut trial = copy(space, motion);
        self.advance(level, &TRIAL.1, (&mut trial, old));
        if moving((motion, &trial), MIN_TRIAL_CHANGE, (0..motion.width, 0..motion.height)) > 0 {
            self.repeat(TRIAL.0 - 1, level, &TRIAL.1, (&mut trial, old));
            let DescentPlan { simd, .. } = *self.plan;
            let (compared, residual_std) = (self.compared, self.residual_std);
            let comparison = Comparison { simd, level, compared, residual_std, follows_majority: false, pool, space };
            if comparison.replace_where_better(motion, &trial, MIN_MOTION_DIFFERENCE) {
                self.repeat(JOINT_ITERATIONS, level, smoothness, (motion, old));
            }
        }
        space.keep(trial);
    }

    /// Sharpens the flow at motion boundaries.
    pub fn sharpen(&self, level: &PyramidLevel<T>, motion: &mut Planes<T>, space: &PlanePool<T>) {
        if let Some(residual) = self.residual_std.filter(|_| keeps("flow.weighted_median")) {
            let std = BrightnessStd { picture: self.plan.brightness.contrast, residual: residual.to_f64() };
            sharpen_boundaries(self.plan.simd, space, &level.views(self.compared), std, motion);
        }
    }

    /// Takes over matches of blocks where they leave less residual energy.
    pub fn try_block_matches(
        &mut self,
        level: &PyramidLevel<T>,
        smoothness: &Smoothness,
        (motion, old): (&mut Planes<T>, &mut Planes<T>),
        (pool, space): (&Pool<T>, &PlanePool<T>),
    ) {
        if !keeps("flow.block_matches") {
            return;
        }
        let (simd, compared, residual_std) = (self.plan.simd, self.compared, self.residual_std);
        let mut matches = copy(space, motion);
        let comparison = Comparison { simd, level, compared, residual_std, follows_majority: false, pool, space };
        if block_matches(simd, &level.views(compared), motion, &mut matches)
            && comparison.replace_where_better(motion, &matches, MIN_MOTION_DIFFERENCE)
        {
            self.repeat(MATCH_ITERATIONS, level, smoothness, (motion, old));
        }
        space.keep(matches);
    }

    /// Linearises about `motion` and updates it. Returns the root-mean-square change from `old`, px.
    fn iterate(
        &mut self,
        level: &PyramidLevel<T>,
        smoothness: &Smoothness,
        (motion, old): (&mut Planes<T>, &Planes<T>),
    ) -> f64 {
        checkpoint();
        let views = level.views(self.compared);
        let residuals = self.term.linearise(Sums::Moments, (level.size, &views), motion, self.residual_std, self.data);
        self.residual_std = self.residual_std(residuals);
        // On recordings the motion beyond the frame's edge is no better for it.
        let has_holes = views.iter().any(|view| view.usable.is_some());
        let continued = has_holes && keeps("flow.continuation") && continue_motion(self.data, motion);
        let contrast = self.plan.brightness.contrast;
        let floor = T::from_f64((MIN_NOISE_SHARE * contrast).powi(2).max(f64::from(f32::MIN_POSITIVE)));
        let change = regularize(self.plan.simd, self.data, motion, smoothness, floor, self.scratch);
        if continued { flow_change(old, motion) } else { change }
    }

    /// Robust standard deviation from the absolute values of residuals.
    fn residual_std(&self, mut residuals: Vec<T>) -> Option<T> {
        let std = robust_std(&mut residuals)?;
        let floor = (MIN_RESIDUAL_SHARE * self.plan.brightness.contrast).max(f64::from(f32::MIN_POSITIVE));
        Some(T::from_f64(std + floor))
    }
}

/// Root-mean-square change of the flow, px.
fn flow_change<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> f64 {
    let lines = (0..2).flat_map(|k| (0..to.height).map(move |y| (k, y)));
    let pairs = lines.flat_map(|(k, y)| to.line(k, y).iter().zip(from.line(k, y)));
    let squares: f64 = pairs.map(|(to, from)| (*to - *from).to_f64().powi(2)).sum();
    (squares / (to.width * to.height) as f64).sqrt()
}

/// Whether no object is still moving between two iterations. Sites of the border do not count.
pub(super) fn has_settled<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> bool {
    moving_inside(from, to) < MIN_OBJECT_SITES
}

fn moving_inside<T: SimdReal>(from: &Planes<T>, to: &Planes<T>) -> usize {
    let without_border = |len: usize| {
        let border = (len / BORDER_DIVISOR).clamp(BORDER_SITES.0, BORDER_SITES.1).min(len);
        border..len.saturating_sub(border).max(border)
    };
    moving((from, to), MIN_MOVING_DISTANCE, (without_border(to.width), without_border(to.height)))
}

/// Number of sites in some columns and rows that moved by more than `distance` px.
fn moving<T: SimdReal>(
    (from, to): (&Planes<T>, &Planes<T>),
    distance: f64,
    (columns, rows): (Range<usize>, Range<usize>),
) -> usize {
    let distance = T::from_f64(distance * distance);
    let in_row = |y: usize| {
        let [u, v, u0, v0] = [to.line(0, y), to.line(1, y), from.line(0, y), from.line(1, y)];
        let is_far = |&x: &usize| (u[x] - u0[x]) * (u[x] - u0[x]) + (v[x] - v0[x]) * (v[x] - v0[x]) > distance;
        columns.clone().filter(is_far).count()
    };
    rows.map(in_row).sum()
}

/// A copy of the motion; its source may have more planes.
pub(super) fn copy<T: SimdReal>(space: &PlanePool<T>, motion: &Planes<T>) -> Planes<T> {
    let mut out = space.planes(motion.width, motion.height, MOTION);
    for (k, y) in (0..MOTION).flat_map(|k| (0..motion.height).map(move |y| (k, y))) {
        out.line_mut(k, y).copy_from_slice(motion.line(k, y));
    }
    out
}
