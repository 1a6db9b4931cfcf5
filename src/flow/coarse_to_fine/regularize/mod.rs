//! Regularisation: minimises the data terms of all sites together with robust smoothness terms.
//!
//! Each site has a data term `m^T N m - 2 m^T r` over the noise there, and each pair of neighbours a
//! smoothness term: their affine models should give the same flow midway between them, and have the same
//! Jacobian. The sum
//!
//! `sum_sites (m^T N m - 2 m^T r) / (s^2 + e) + sum_edges omega (flow |du|^2 + jacobian |dJ|^2)`
//!
//! is minimised by relaxation: each visit solves the 6x6 equations of one site with its neighbours fixed
//! (block Gauss-Seidel in zebra order). Smoothness weights fall with the strain, `omega = 1 / (1 + (flow
//! |du|^2 + jacobian |dJ|^2) / break_strain)` (iteratively reweighted least squares with Cauchy's weights),
//! so that two motions may meet at an edge. Sites without data take the motion of their neighbours.
//!
//! Weights: [`smoothness`]; equations: [`solve`]; a row: [`relaxation`]; order: [`wavefront`].

mod relaxation;
mod smoothness;
mod solve;
mod wavefront;

#[cfg(test)]
mod tests;

use super::{data_term::ERROR, data_term::VALID, planes::LEFT, planes::Planes};
use crate::math::median;
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use smoothness::SmoothnessProblem;

/// Planes of the data term that hold equations: those before the energies.
const EQUATIONS: usize = ERROR;

/// Distance from a site to the middle between it and its neighbour, px.
const HALF_SPACING: f64 = 1.0;

/// Maximum change of a site's flow in one call, px: the data term is a linearisation.
const MAX_FLOW_CHANGE: f64 = 2.0;
/// Rows of one task, where rows do not depend on each other.
const ROWS_PER_TASK: usize = 16;

/// Smoothness terms and sweeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Smoothness {
    /// Weight of the flow term, relative to the data over its noise, px^-2.
    pub flow: f64,
    pub jacobian: f64,
    /// Strain at which a smoothness weight is one half; positive, infinite for weights that never fall.
    pub break_strain: f64,
    pub sweeps: usize,
    /// Smoothness weights are updated at every so many visits; positive.
    pub reweight_every: usize,
}

impl Default for Smoothness {
    /// 20 px^-2, 2000, 0.1 and 6 sweeps, updated at every second: chosen on recorded and synthetic sequences.
    fn default() -> Self {
        Self { flow: 20.0, jacobian: 2000.0, break_strain: 0.1, sweeps: 6, reweight_every: 2 }
    }
}

/// Memory that calls of [`regularize`] share.
#[derive(Debug, Default)]
pub(super) struct RegularizeScratch<T> {
    start: Planes<T>,
    energies: Vec<T>,
    weights: Planes<T>,
    rings: Vec<wavefront::Ring<T>>,
}

/// Regularises the sites' `motion` (planes `u, v, u_x, v_x, u_y, v_y`); returns the root-mean-square change
/// of the flow, px, at most 2 px at a site. `s^2` is the median residual energy of the sites with data, at
/// least `floor` (positive), grey^2. Where neither data nor neighbours determine the motion, it stays.
/// Bit-identical for any number of threads, inside [`Threads::install`](crate::parallel::Threads::install).
pub(super) fn regularize<T: SimdReal>(
    level: Level,
    data: &Planes<T>,
    motion: &mut Planes<T>,
    smoothness: &Smoothness,
    floor: T,
    scratch: &mut RegularizeScratch<T>,
) -> f64 {
    let noise = typical_energy(data, floor, &mut scratch.energies);
    let (width, height) = (motion.width, motion.height);
    if width == 0 || height == 0 || smoothness.sweeps == 0 {
        return 0.0;
    }
    save_flow(motion, &mut scratch.start);
    let problem = SmoothnessProblem { data, noise, smoothness };
    wavefront::sweep(level, &problem, motion, &mut scratch.weights, &mut scratch.rings);
    limit_change(level, motion, &scratch.start)
}

/// The upper median of the energies of sites with data, at least `floor`.
fn typical_energy<T: SimdReal>(data: &Planes<T>, floor: T, energies: &mut Vec<T>) -> T {
    let zero = T::from_f64(0.0);
    energies.clear();
    for y in 0..data.height {
        let (energy, valid) = (data.line(ERROR, y), data.line(VALID, y));
        energies.extend(energy.iter().zip(valid).filter(|(_, valid)| **valid > zero).map(|(energy, _)| *energy));
    }
    median(energies).map_or(floor, |energy| Lanes::max(energy, floor))
}

/// Copies the flow to `start`, and clears the samples beside the sites, where lanes compute too.
fn save_flow<T: SimdReal>(motion: &mut Planes<T>, start: &mut Planes<T>) {
    let (width, height) = (motion.width, motion.height);
    start.reshape(width, height, 2);
    let (stride, rows, kept) = (motion.stride(), motion.row_len(), start.row_len());
    let pairs =
        motion.data_mut().chunks_mut(ROWS_PER_TASK * rows).zip(start.data_mut().chunks_mut(ROWS_PER_TASK * kept));
    parallel::for_each(pairs, |(task_rows, task_kept)| {
        for (row, kept) in task_rows.chunks_mut(rows).zip(task_kept.chunks_mut(kept)) {
            for plane in row.chunks_exact_mut(stride) {
                plane[..LEFT].fill(T::from_f64(0.0));
                plane[LEFT + width..].fill(T::from_f64(0.0));
            }
            let flow = kept.len();
            kept.copy_from_slice(&row[..flow]);
        }
    });
}

/// Limits changes of the flow to [`MAX_FLOW_CHANGE`]; returns their root mean square.
fn limit_change<T: SimdReal>(level: Level, motion: &mut Planes<T>, start: &Planes<T>) -> f64 {
    let (len, stride, sites) = (motion.row_len(), motion.stride(), motion.width * motion.height);
    let row = |(y, row): (usize, &mut [T])| {
        let (u, v) = row[..2 * stride].split_at_mut(stride);
        let (u0, v0) = start.row(y).split_at(stride);
        dispatch(level, LimitChange { now: [u, v], start: [u0, v0] })
    };
    let sums = parallel::map(motion.data_mut().chunks_mut(ROWS_PER_TASK * len).enumerate(), |(task, rows)| {
        (task * ROWS_PER_TASK..).zip(rows.chunks_mut(len)).map(row).collect::<Vec<f64>>()
    });
    // Row by row, so that the sum does not depend on the threads.
    (sums.iter().flatten().sum::<f64>() / sites as f64).sqrt()
}

struct LimitChange<'a, T> {
    now: [&'a mut [T]; 2],
    start: [&'a [T]; 2],
}

impl<T: SimdReal> Kernel<T> for LimitChange<'_, T> {
    type Output = f64;

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) -> f64 {
        let [now_u, now_v] = self.now;
        let start = self.start[0].chunks_exact(V::LANES).zip(self.start[1].chunks_exact(V::LANES));
        let now = now_u.chunks_exact_mut(V::LANES).zip(now_v.chunks_exact_mut(V::LANES));
        let longest = V::constant(MAX_FLOW_CHANGE);
        // Samples beside the sites are zero before and after.
        let mut sums = V::zero();
        for ((u, v), (u0, v0)) in now.zip(start) {
            let (from_u, from_v, to_u, to_v) = (V::load(u0), V::load(v0), V::load(u), V::load(v));
            let (du, dv) = (to_u - from_u, to_v - from_v);
            let square = du.mul_add(du, dv * dv);
            sums = sums + square;
            let length = square.sqrt();
            let far = longest.lt(length);
            let factor = longest / length;
            V::select(far, du.mul_add(factor, from_u), to_u).store(u);
            V::select(far, dv.mul_add(factor, from_v), to_v).store(v);
        }
        let mut lanes = [T::from_f64(0.0); LEFT];
        sums.store(&mut lanes);
        lanes[..V::LANES].iter().map(|sum| sum.to_f64()).sum()
    }
}
