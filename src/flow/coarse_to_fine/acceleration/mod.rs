//! Acceleration of three frames: from the mean of both steps to the step after the middle frame.
//!
//! Both steps differ by the acceleration. In steady flow, as in most fluids and for a camera moving through a
//! scene, it follows from the flow alone ([`steady`]); objects in uniform motion have none. One share for the
//! whole frame is fitted to the difference of the next step from the mean step. The remaining difference is
//! refined like motion and accepted where noise does not explain it.

mod steady;

use super::data_term::{MOTION, SEEN};
use super::descent::{DescentPlan, DescentResult};
use super::peak_locking::PeakLocking;
use super::plane_pool::PlanePool;
use super::planes::Planes;
use super::pyramid::ComparedFrames;
use super::refine::{RefineOptions, WindowStatistics, refine};
use super::workspace::Workspace;
use crate::ablation::keeps;
use crate::flow::coarse_to_fine::descent::beside_boundaries;
use crate::flow::coarse_to_fine::descent::comparison::{Comparison, replace};
use crate::math::median;
use crate::simd::SimdReal;

/// Rounds of iterative reweighting.
const REWEIGHTING_ROUNDS: usize = 4;

/// Share from which on the flow counts as steady; below one minus it, as not steady at all.
const STEADY_SHARE: f64 = 0.9;

/// Moves the `motion` of a triple (`regularized` before refinement) to the pixels of the middle frame: to the
/// mean of both steps (`central`) or the step to the next frame. Returns the statistics of its windows.
/// Frames warped by equal and opposite motions do not meet at the middle frame (see [`steady::next_step`]).
pub(super) fn to_middle_frame<T: SimdReal>(
    plan: &DescentPlan,
    workspace: &mut Workspace<T>,
    mut regularized: Planes<T>,
    motion: &mut Planes<T>,
    central: bool,
) -> Option<WindowStatistics<T>> {
    let (simd, finest) = (plan.simd, plan.finest);
    let DescentResult { motion: mut next_step_motion, data, residual_std, .. } =
        plan.next_step(workspace, &regularized);
    let Workspace { pyramid, pool, space, .. } = &*workspace;
    let locking =
        PeakLocking::measure(simd, (&pyramid.levels()[finest], ComparedFrames::Ahead), &next_step_motion, residual_std);
    locking.correct(simd, &mut next_step_motion);
    let mut rest = difference(space, &next_step_motion, &regularized, &data);
    let acceleration = acceleration(space, motion, &rest);
    if let Some(acceleration) = &acceleration {
        for mean in [&mut *motion, &mut regularized] {
            let next = steady::next_step(space, mean, acceleration);
            space.keep(std::mem::replace(mean, next));
        }
        let left = difference(space, &next_step_motion, &regularized, &data);
        space.keep(std::mem::replace(&mut rest, left));
    }
    space.keep(regularized);
    if let Some(acceleration) = acceleration {
        if central {
            add(motion, &acceleration, -1.0);
        }
        space.keep(acceleration);
    }
    let mut statistics = None;
    if !central {
        let (change, chosen) = refine(simd, space, &RefineOptions::for_changes(), &rest, &data);
        add(motion, &change, 1.0);
        for planes in [change, rest] {
            space.keep(planes);
        }
        statistics = chosen;
        // Three frames have twice the occlusions of two, beside motion boundaries, and objects may stop,
        // start or turn back.
        let (own, chosen) = refine(simd, space, &RefineOptions::default(), &next_step_motion, &data);
        chosen.into_iter().flat_map(WindowStatistics::into_planes).for_each(|planes| space.keep(planes));
        let level = &pyramid.levels()[finest];
        let (compared, follows_majority) = (ComparedFrames::Ahead, false);
        let comparison = Comparison { simd, level, compared, residual_std, follows_majority, pool, space };
        let (beside, prefers) = (beside_boundaries(simd, &own), keeps("flow.last_two_frames"));
        let wins = comparison.better_sites(motion, &own, 0.0, |n| beside[n] && prefers);
        replace(motion, &own, &wins);
        space.keep(own);
    }
    for planes in [next_step_motion, data] {
        space.keep(planes);
    }
    statistics
}

/// Difference of the step `ahead` from the `known` step, extrapolated where windows are incomplete.
fn difference<T: SimdReal>(
    space: &PlanePool<T>,
    next_step_motion: &Planes<T>,
    known: &Planes<T>,
    data: &Planes<T>,
) -> Planes<T> {
    let mut out = space.planes(next_step_motion.width, next_step_motion.height, MOTION);
    out.data_mut().copy_from_slice(next_step_motion.data());
    add(&mut out, known, -1.0);
    continue_beyond(space, data, &mut out);
    out
}

/// Half the acceleration of the steady share of the `motion`, if its `change` contains any.
fn acceleration<T: SimdReal>(space: &PlanePool<T>, motion: &Planes<T>, change: &Planes<T>) -> Option<Planes<T>> {
    let slow = steady::half_acceleration(space, motion);
    let mut whole = steady::next_step(space, motion, &slow);
    add(&mut whole, motion, -1.0);
    let share = share(change, &whole);
    space.keep(whole);
    if share < 1.0 - STEADY_SHARE {
        space.keep(slow);
        return None;
    }
    let mut acceleration = steady::refine_acceleration(space, motion, slow);
    if share < STEADY_SHARE {
        let share = T::from_f64(share);
        acceleration.data_mut().iter_mut().for_each(|value| *value *= share);
    }
    Some(acceleration)
}

fn add<T: SimdReal>(to: &mut Planes<T>, more: &Planes<T>, factor: f64) {
    let factor = T::from_f64(factor);
    for (y, k) in (0..to.height).flat_map(|y| (0..MOTION).map(move |k| (y, k))) {
        to.line_mut(k, y).iter_mut().zip(more.line(k, y)).for_each(|(to, more)| *to += factor * *more);
    }
}

/// Minimum usable share of a window; below it both estimates, and so their difference, are extrapolated.
const MIN_WINDOW_SHARE: f64 = 0.95;

/// Gives sites with incomplete windows the flow of the nearest complete ones in their row and column,
/// weighted by nearness; in corners without any, that of the nearest in the nearest row.
fn continue_beyond<T: SimdReal>(space: &PlanePool<T>, data: &Planes<T>, flow: &mut Planes<T>) {
    let (width, height) = (data.width, data.height);
    let is_complete = |x: usize, y: usize| data.at(SEEN, x, y).to_f64() >= MIN_WINDOW_SHARE;
    let rows: Vec<Vec<usize>> = (0..height).map(|y| (0..width).filter(|&x| is_complete(x, y)).collect()).collect();
    let columns: Vec<Vec<usize>> = (0..width).map(|x| (0..height).filter(|&y| is_complete(x, y)).collect()).collect();
    let filled: Vec<usize> = (0..height).filter(|&y| !rows[y].is_empty()).collect();
    if filled.is_empty() {
        return;
    }
    let mut known = space.planes(width, height, MOTION);
    known.copy_from(flow);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| !is_complete(x, y)) {
        let beside = (!rows[y].is_empty()).then(|| (nearest(&rows[y], x), y));
        let above = (!columns[x].is_empty()).then(|| (x, nearest(&columns[x], y)));
        let row = nearest(&filled, y);
        let diagonal = (beside.is_none() && above.is_none()).then(|| (nearest(&rows[row], x), row));
        let (mut sum, mut weights) = ([0.0; 2], 0.0);
        for (i, j) in [beside, above, diagonal].into_iter().flatten() {
            let weight = 1.0 / (x.abs_diff(i) + y.abs_diff(j)).max(1) as f64;
            weights += weight;
            (0..2).for_each(|k| sum[k] += weight * known.at(k, i, j).to_f64());
        }
        (0..2).for_each(|k| flow.line_mut(k, y)[x] = T::from_f64(sum[k] / weights));
    }
    space.keep(known);
}

fn nearest(numbers: &[usize], to: usize) -> usize {
    let after = numbers.partition_point(|&n| n < to).min(numbers.len() - 1);
    let (before, after) = (numbers[after.saturating_sub(1)], numbers[after]);
    if to.abs_diff(before) < to.abs_diff(after) { before } else { after }
}

/// Share of the `steady` change in the `change`, 0 to 1: a slope, fitted with Cauchy's weights.
fn share<T: SimdReal>(change: &Planes<T>, steady: &Planes<T>) -> f64 {
    let (mut share, mut typical) = (0.0, f64::INFINITY);
    let mut rests = Vec::with_capacity(change.width * change.height);
    for _ in 0..REWEIGHTING_ROUNDS {
        let (mut product, mut square) = (0.0, 0.0);
        rests.clear();
        for y in 0..change.height {
            let [u, v] = [0, 1].map(|k| (change.line(k, y), steady.line(k, y)));
            for x in 0..change.width {
                let [(d, s), (e, t)] = [u, v].map(|(d, s)| (d[x].to_f64(), s[x].to_f64()));
                let rest = (d - share * s).powi(2) + (e - share * t).powi(2);
                let weight = 1.0 / (1.0 + rest / typical);
                product += weight * (d * s + e * t);
                square += weight * (s * s + t * t);
                rests.push(rest);
            }
        }
        if rests.is_empty() || square <= f64::MIN_POSITIVE {
            return 0.0;
        }
        typical = median(&mut rests).unwrap_or(0.0).max(f64::MIN_POSITIVE);
        share = (product / square).clamp(0.0, 1.0);
    }
    share
}
