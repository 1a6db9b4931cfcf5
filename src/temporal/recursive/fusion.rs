//! The fusion of whole fields.

use super::kernel::{B, BLOCK, INPUT, OUTPUT, P, PRESENT, RATIO, ROWS, SHARE, Step};
use super::options::RecursiveOptions;
use crate::error::{Error, Result};
use crate::flow::Estimator;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::parallel::{self, Threads};
use crate::simd::{Level, SimdReal, dispatch, same_mut};
use crate::types::{FlowField, Status};
use std::ops::Range;

/// Blocks of one task: fixed, so that results do not depend on the number of threads.
const TASK_BLOCKS: usize = 64;

/// One information filter a site, fed with fields. See [the module](super) for what it computes.
///
/// The state is 56 planes of the field's size, whatever the number of frames. Motion in px/frame and 1/frame
/// (or units of the pixel pitch), covariances in their squares.
///
/// ```
/// use jacoflow::flow::{EstimatorOptions, Estimator, Method};
/// use jacoflow::temporal::{RecursiveFusion, RecursiveOptions};
/// use jacoflow::types::Frame;
/// # fn main() -> jacoflow::Result<()> {
/// let common = EstimatorOptions { covariance: true, systematic: true, ..EstimatorOptions::default() };
/// let estimator = Estimator::new(Method::parse("windowed")?, common)?;
/// let mut fusion = RecursiveFusion::<f64>::new(&estimator, RecursiveOptions::default())?;
/// let frames: Vec<Frame<f64>> = (0..6)
///     .map(|t| {
///         let wave = |x: f64, y: f64| (0.7 * x).sin() * 50.0 + (0.6 * y).cos() * 40.0;
///         Frame::from_fn(40, 40, |x, y| wave(x as f64 - 0.3 * t as f64, y as f64))
///     })
///     .collect();
/// for (first, triple) in frames.windows(3).enumerate() {
///     let mut field = estimator.estimate(&[&triple[0], &triple[1], &triple[2]], first)?;
///     fusion.fuse(&mut field)?;
///     assert!((field.plane("u").unwrap()[20 * 40 + 20] - 0.3).abs() < 0.05);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct RecursiveFusion<T> {
    options: RecursiveOptions,
    threads: Threads,
    level: Level,
    sites: usize,
    /// Blocks of `ROWS * BLOCK` numbers; none before the first field.
    blocks: Vec<T>,
}

/// Values that a block of sites reads and writes in the field.
struct Task<'a, T> {
    state: &'a mut [T],
    motion: Vec<&'a mut [T]>,
    covariance: Vec<&'a mut [T]>,
    systematic: Vec<&'a [T]>,
    status: &'a mut [Status],
}

impl<T: SimdReal> RecursiveFusion<T> {
    /// A fusion without memory yet, for the fields of `estimator`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `forgetting`; `method` where the model is not affine; `covariance` where
    /// the estimator computes none.
    pub fn new(estimator: &Estimator, options: RecursiveOptions) -> Result<Self> {
        options.check()?;
        let model = estimator.model().name();
        if model != "affine" {
            let method = estimator.method().name();
            let expected = "one of affine flow, for what is recursive (windowed, coarse_to_fine or instantaneous)";
            return Err(Error::argument("method", expected, format!("{method}, whose model is {model}")));
        }
        let common = estimator.options();
        if !common.covariance {
            return Err(Error::argument("covariance", "a covariance, by which estimates are weighed", "none"));
        }
        Ok(Self { options, threads: common.threads, level: common.level(), sites: 0, blocks: Vec::new() })
    }

    /// Number of sites, 0 before the first field, and the states of all, for [`restore`](Self::restore).
    pub fn state(&self) -> (usize, &[T]) {
        (self.sites, &self.blocks)
    }

    /// Continues from a state that [`state`](Self::state) returned.
    ///
    /// # Errors [`Error::Argument`] naming `state` for a wrong number of values.
    pub fn restore(&mut self, sites: usize, blocks: Vec<T>) -> Result<()> {
        let needed = sites.div_ceil(BLOCK).checked_mul(ROWS * BLOCK);
        if needed != Some(blocks.len()) {
            let expected = format!("the numbers of {sites} sites");
            return Err(Error::argument("state", expected, format!("{} numbers", blocks.len())));
        }
        (self.sites, self.blocks) = (sites, blocks);
        Ok(())
    }

    /// Fuses the next field and replaces its motion and covariance by the fused ones. Sites without an
    /// estimate get the prediction, once there is one.
    ///
    /// # Errors [`Error::Argument`] naming `field` when it is of another size than the first, not affine or
    /// without covariance.
    pub fn fuse(&mut self, field: &mut FlowField<T>) -> Result<()> {
        let n = field.len();
        let known = field.covariance.as_ref().map(Vec::len);
        if field.motion.len() != 6 * n || known != Some(ENTRIES * n) {
            return Err(Error::argument("field", "affine motion with its covariance", "less"));
        }
        if self.blocks.is_empty() {
            self.sites = n;
            self.blocks = vec![T::default(); n.div_ceil(BLOCK) * ROWS * BLOCK];
        }
        if self.sites != n {
            return Err(Error::argument("field", format!("{} sites as before", self.sites), n));
        }
        // Both precisions are compiled here, once, and not again in every crate that fuses.
        if let Some(fusion) = same_mut::<_, RecursiveFusion<f32>>(self) {
            if let Some(field) = same_mut(field) {
                single_precision(fusion, field);
            }
        } else if let Some(fusion) = same_mut::<_, RecursiveFusion<f64>>(self)
            && let Some(field) = same_mut(field)
        {
            double_precision(fusion, field);
        }
        Ok(())
    }

    fn every_block(&mut self, field: &mut FlowField<T>) {
        let n = field.len();
        if n == 0 {
            return;
        }
        let size = TASK_BLOCKS * BLOCK;
        let mut tasks: Vec<Task<'_, T>> = self
            .blocks
            .chunks_mut(TASK_BLOCKS * ROWS * BLOCK)
            .zip(field.status.chunks_mut(size))
            .map(|(state, status)| Task { state, motion: vec![], covariance: vec![], systematic: vec![], status })
            .collect();
        for plane in field.motion.chunks_mut(n) {
            tasks.iter_mut().zip(plane.chunks_mut(size)).for_each(|(task, part)| task.motion.push(part));
        }
        for plane in field.covariance.iter_mut().flat_map(|planes| planes.chunks_mut(n)) {
            tasks.iter_mut().zip(plane.chunks_mut(size)).for_each(|(task, part)| task.covariance.push(part));
        }
        for plane in field.systematic.iter().flat_map(|planes| planes.chunks(n)) {
            tasks.iter_mut().zip(plane.chunks(size)).for_each(|(task, part)| task.systematic.push(part));
        }
        let (level, forgetting) = (self.level, self.options.forgetting);
        self.threads.install(|| parallel::for_each(&mut tasks, |task| task.run(level, forgetting)));
    }
}

#[inline(never)]
fn single_precision(fusion: &mut RecursiveFusion<f32>, field: &mut FlowField<f32>) {
    fusion.every_block(field);
}

#[inline(never)]
fn double_precision(fusion: &mut RecursiveFusion<f64>, field: &mut FlowField<f64>) {
    fusion.every_block(field);
}

impl<T: SimdReal> Task<'_, T> {
    fn run(&mut self, level: Level, forgetting: f64) {
        let mut input = vec![T::default(); INPUT * BLOCK];
        let mut output = vec![T::default(); OUTPUT * BLOCK];
        let mut state = std::mem::take(&mut self.state).chunks_mut(ROWS * BLOCK);
        for first in (0..self.status.len()).step_by(BLOCK) {
            let Some(state) = state.next() else { return };
            let sites = first..(first + BLOCK).min(self.status.len());
            self.read(sites.clone(), &mut input);
            dispatch(level, Step { state, input: &input, output: &mut output, forgetting });
            self.write(sites, (&input, &output), state);
        }
    }

    /// Copies a block of sites; a harmless estimate where there is no usable one.
    fn read(&self, sites: Range<usize>, input: &mut [T]) {
        let mut usable = [false; BLOCK];
        usable.iter_mut().zip(&self.status[sites.clone()]).for_each(|(usable, status)| *usable = status.has_estimate());
        let (given, present) = input.split_at_mut(PRESENT * BLOCK);
        let (estimate, systematic) = given.split_at_mut((6 + ENTRIES) * BLOCK);
        let motion = self.motion.iter().chain(&self.covariance).map(|plane| &plane[sites.clone()]);
        for (row, plane) in estimate.chunks_exact_mut(BLOCK).zip(motion) {
            row[..plane.len()].copy_from_slice(plane);
            usable.iter_mut().zip(plane).for_each(|(usable, value)| *usable &= value.finite());
        }
        for i in 0..6 {
            let variance = &estimate[(6 + upper(i, i)) * BLOCK..][..BLOCK];
            usable.iter_mut().zip(variance).for_each(|(usable, value)| *usable &= value.to_f64() > 0.0);
        }
        if self.systematic.is_empty() {
            let share = T::from_f64(SHARE);
            systematic.iter_mut().zip(&estimate[6 * BLOCK..]).for_each(|(part, whole)| *part = share * *whole);
        } else {
            for (row, plane) in systematic.chunks_exact_mut(BLOCK).zip(&self.systematic) {
                row[..sites.len()].copy_from_slice(&plane[sites.clone()]);
                usable.iter_mut().zip(&*row).for_each(|(usable, value)| *usable &= value.finite());
            }
        }
        for (c, usable) in usable.into_iter().enumerate() {
            present[c] = T::from_f64(f64::from(u8::from(usable)));
            if !usable {
                given.iter_mut().skip(c).step_by(BLOCK).for_each(|value| *value = T::default());
                (0..6).for_each(|i| given[(6 + upper(i, i)) * BLOCK + c] = T::from_f64(1.0));
            }
        }
    }

    /// Copies a block back; sites that have never been estimated stay unchanged.
    fn write(&mut self, sites: Range<usize>, (input, output): (&[T], &[T]), state: &[T]) {
        let known = |row: &[T], c: usize| row[c] != T::default();
        let (started, present) = (&state[RATIO * BLOCK..][..BLOCK], &input[PRESENT * BLOCK..][..BLOCK]);
        let all = (0..sites.len()).all(|c| known(started, c));
        for (plane, row) in self.motion.iter_mut().chain(&mut self.covariance).zip(output.chunks_exact(BLOCK)) {
            let target = &mut plane[sites.clone()];
            if all {
                target.copy_from_slice(&row[..sites.len()]);
                continue;
            }
            for (c, (to, from)) in target.iter_mut().zip(row).enumerate() {
                if known(started, c) {
                    *to = *from;
                }
            }
        }
        for (c, status) in self.status[sites].iter_mut().enumerate() {
            if known(started, c) && !known(present, c) {
                *status = Status::Predicted;
            }
        }
    }
}

const _: () = assert!(P + ENTRIES == B);
