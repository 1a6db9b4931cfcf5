//! One frame through the kernels, block by block.

use super::FlowFilter;
use crate::error::{Error, Result};
use crate::parallel;
use crate::simd::{Level, SimdReal, dispatch};
use crate::temporal::kernel::predict::{AUGMENTED, EXTENDED, FAST, NON_AUGMENTED, Predict};
use crate::temporal::kernel::transition::{Exact, Rk4, Step};
use crate::temporal::kernel::update::{Decorrelation, MEASURED, PRESENT, SHARE, Update};
use crate::temporal::kernel::{BLOCK, Constants, N, PLANES, packed, places};
use crate::temporal::measurement::{Fit, Measure};
use crate::temporal::options::{FilterForm, Transition};
use crate::types::Frame;
use std::any::Any;
use std::marker::PhantomData;

/// Blocks of one task: fixed, so that results do not depend on the number of threads.
const TASK_BLOCKS: usize = 32;
/// Blocks that pass the three kernels together: few, so that their states stay in the first-level cache.
const PASS_BLOCKS: usize = 2;

/// Relative error of the motion for a fit that describes nothing: fits attenuate derivatives. It falls with
/// the fourth root of the share of the variance that the fit leaves. By `benchmarks/tables/flow_filter.py`.
const ATTENUATION: f64 = 0.27;
/// Error of the Jacobian for such a fit, over the squared motion in units of the neighbourhood: structure
/// that moves in looks like contraction, most of all along the motion. It falls with the share's root.
const CONTRACTION: f64 = 1.2;
/// Contraction across the motion over that along it.
const ACROSS: f64 = 0.25;

/// The kernels are compiled here, for both precisions, and not again in every crate that uses a filter: hence
/// functions that are not generic, with [`Any`] between them.
#[allow(clippy::ptr_arg)] // A slice is no `Any`.
pub(super) fn run<T: SimdReal>(
    filter: &mut FlowFilter<T>,
    frame: &Frame<T>,
    marks: &mut [Mark],
    results: &mut Vec<T>,
) -> Result<()> {
    let (filter, frame, results): (&mut dyn Any, &dyn Any, &mut dyn Any) = (filter, frame, results);
    if let Some(filter) = filter.downcast_mut::<FlowFilter<f32>>() {
        if let (Some(frame), Some(results)) = (frame.downcast_ref(), results.downcast_mut::<Vec<f32>>()) {
            single_precision(filter, frame, marks, results);
            return Ok(());
        }
    } else if let Some(filter) = filter.downcast_mut::<FlowFilter<f64>>()
        && let (Some(frame), Some(results)) = (frame.downcast_ref(), results.downcast_mut::<Vec<f64>>())
    {
        double_precision(filter, frame, marks, results);
        return Ok(());
    }
    Err(Error::Numerical("the flow filter works in single or double precision".into()))
}

#[inline(never)]
fn single_precision(filter: &mut FlowFilter<f32>, frame: &Frame<f32>, marks: &mut [Mark], results: &mut [f32]) {
    every_block(filter, frame, marks, results);
}

#[inline(never)]
fn double_precision(filter: &mut FlowFilter<f64>, frame: &Frame<f64>, marks: &mut [Mark], results: &mut [f64]) {
    every_block(filter, frame, marks, results);
}

/// Every block through its three passes; results are copied out while in the cache.
fn every_block<T: SimdReal>(filter: &mut FlowFilter<T>, frame: &Frame<T>, marks: &mut [Mark], results: &mut [T]) {
    let rows = filter.rows();
    let FlowFilter { options, store, constants, decorrelation, fit, .. } = filter;
    let level = options.simd.unwrap_or_else(Level::detect);
    let pass = Pass {
        frame,
        fit,
        constants,
        decorrelation,
        rows,
        level,
        form: options.form,
        transition: options.transition,
        scale: T::from_f64(255.0 / options.full_scale),
        contraction: T::from_f64(CONTRACTION / options.neighbourhood.spread().powi(2)),
        is_first: filter.frames == 0,
    };
    let states = store.blocks.chunks_mut(PLANES * BLOCK * TASK_BLOCKS);
    let pixels = store.pixels.chunks(BLOCK * TASK_BLOCKS);
    let marks = marks.chunks_mut(TASK_BLOCKS);
    let results = results.chunks_mut(rows.count * BLOCK * TASK_BLOCKS);
    parallel::for_each(states.zip(pixels).zip(marks).zip(results), |(((states, pixels), marks), results)| {
        let states = states.chunks_mut(PLANES * BLOCK * PASS_BLOCKS);
        let pixels = pixels.chunks(BLOCK * PASS_BLOCKS);
        let marks = marks.chunks_mut(PASS_BLOCKS);
        let results = results.chunks_mut(rows.count * BLOCK * PASS_BLOCKS);
        for (((states, pixels), marks), results) in states.zip(pixels).zip(marks).zip(results) {
            pass.run(states, pixels, marks, results);
        }
    });
}

/// Rows of `BLOCK` numbers in a block's results: six of motion, the residual, then any covariance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rows {
    pub covariance: usize,
    pub count: usize,
}

/// Row of the residual.
pub(super) const RESIDUAL: usize = 6;
/// First row of the covariance.
pub(super) const COVARIANCE: usize = 7;

/// The upper triangle of the motion's covariance, row by row.
pub(in crate::temporal) const PAIRS: [(usize, usize); 21] = {
    let mut pairs = [(0, 0); 21];
    let (mut k, mut a) = (0, 0);
    while a < 6 {
        let mut b = a;
        while b < 6 {
            pairs[k] = (a, b);
            k += 1;
            b += 1;
        }
        a += 1;
    }
    pairs
};

struct Pass<'a, T> {
    frame: &'a Frame<T>,
    fit: &'a Fit<T>,
    constants: &'a Constants<T>,
    decorrelation: &'a Decorrelation<T>,
    rows: Rows,
    level: Level,
    form: FilterForm,
    transition: Transition,
    scale: T,
    contraction: T,
    is_first: bool,
}

impl<T: SimdReal> Pass<'_, T> {
    fn run(&self, blocks: &mut [T], pixels: &[usize], marks: &mut [Mark], results: &mut [T]) {
        let Self { frame, fit, constants, decorrelation, rows, level, scale, is_first, .. } = *self;
        let zero = T::from_f64(0.0);
        let (mut measured, mut residual) = ([zero; PASS_BLOCKS * MEASURED * BLOCK], [zero; PASS_BLOCKS * BLOCK]);
        let mut events = [0u8; PASS_BLOCKS * BLOCK];
        let places = places(constants.motion_first);
        let measured = &mut measured[..marks.len() * MEASURED * BLOCK];
        let (events, residual) = (&mut events[..pixels.len()], &mut residual[..pixels.len()]);
        dispatch(level, Measure { frame, pixels, fit, scale, measured, residual });
        match self.transition {
            Transition::Rk4 => predict::<T, Rk4>(level, self.form, blocks, constants),
            Transition::Exact => predict::<T, Exact>(level, self.form, blocks, constants),
        }
        dispatch(level, Update { blocks, measured, events, decorrelation, constants, is_first });
        for (b, mark) in marks.iter_mut().enumerate() {
            mark.events.copy_from_slice(&events[b * BLOCK..(b + 1) * BLOCK]);
            let row = |k: usize| &measured[(b * MEASURED + k) * BLOCK..][..BLOCK];
            for (missing, &present) in mark.missing.iter_mut().zip(row(PRESENT)) {
                *missing = u8::from(present == zero);
            }
            let block = &blocks[b * PLANES * BLOCK..];
            let out = &mut results[b * rows.count * BLOCK..(b + 1) * rows.count * BLOCK];
            out[..6 * BLOCK].copy_from_slice(&block[6 * BLOCK..N * BLOCK]);
            out[RESIDUAL * BLOCK..COVARIANCE * BLOCK].copy_from_slice(&residual[b * BLOCK..(b + 1) * BLOCK]);
            let (motion, covariance) = out.split_at_mut(COVARIANCE * BLOCK);
            for (row, &(i, j)) in covariance.chunks_exact_mut(BLOCK).zip(&PAIRS[..rows.covariance]) {
                let (i, j) = (places[6 + i], places[6 + j]);
                row.fill(zero);
                for k in 0..=i.min(j) {
                    let plane = |place: usize| &block[(N + packed(place, k)) * BLOCK..][..BLOCK];
                    for ((sum, &a), &b) in row.iter_mut().zip(plane(i)).zip(plane(j)) {
                        *sum += a * b;
                    }
                }
            }
            let shares = row(SHARE).iter().enumerate().filter(|&(_, &share)| rows.covariance > 0 && share > zero);
            for (k, &share) in shares {
                self.add_systematic(share, std::array::from_fn(|m| motion[m * BLOCK + k]), &mut covariance[k..]);
            }
        }
    }

    /// Adds the systematic error of a fit that leaves `share` of the variance to a pixel's covariance, whose
    /// entries lie `BLOCK` apart.
    fn add_systematic(&self, share: T, motion: [T; 6], covariance: &mut [T]) {
        let root = share.sqrt();
        let [u, v, ..] = motion;
        let attenuated = motion.map(|m| T::from_f64(ATTENUATION) * root.sqrt() * m);
        let (zero, across) = (T::from_f64(0.0), T::from_f64(ACROSS) * (u * u + v * v));
        let contracted = [zero, zero, u * u + across, u * v, u * v, v * v + across];
        let contracted = contracted.map(|m| self.contraction * root * m);
        for (entry, &(a, b)) in covariance.iter_mut().step_by(BLOCK).zip(&PAIRS) {
            let own = if a == b { attenuated[a] * attenuated[a] } else { zero };
            *entry = *entry + own + contracted[a] * contracted[b];
        }
    }
}

/// Events at the pixels of a block.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mark {
    pub events: [u8; BLOCK],
    pub missing: [u8; BLOCK],
}

fn predict<T: SimdReal, S: Step>(level: Level, form: FilterForm, blocks: &mut [T], constants: &Constants<T>) {
    let step = PhantomData::<S>;
    match form {
        FilterForm::Augmented => dispatch(level, Predict::<T, S, AUGMENTED> { blocks, constants, step }),
        FilterForm::NonAugmented => {
            dispatch(level, Predict::<T, S, NON_AUGMENTED> { blocks, constants, step });
        }
        FilterForm::Fast => dispatch(level, Predict::<T, S, FAST> { blocks, constants, step }),
        FilterForm::Extended => dispatch(level, Predict::<T, S, EXTENDED> { blocks, constants, step }),
    }
}
