//! The dense flow filter.

mod pass;

use super::kernel::update::{Decorrelation, REPAIRED, RESTARTED};
use super::kernel::{BLOCK, Constants};
use super::measurement::Fit;
use super::options::FlowFilterOptions;
use super::store::Store;
use crate::error::{Error, Result};
use crate::jet::JetStencil;
use crate::parallel::{self, Threads, checkpoint};
use crate::simd::{Level, SimdReal};
use crate::types::{FieldLayout, FlowField, Frame, Interval, MOTION_NAMES, Status};
pub(super) use pass::PAIRS;
use pass::{COVARIANCE, Mark, RESIDUAL, Rows};

/// One Kalman filter a site, fed with frames: WO2010/098160, (44), (54), (55).
///
/// Each frame, the first included, is a prediction and an update. `T` is the working precision: `f32` is
/// stable for a measurement noise of 0.25 grey levels squared and more; with smaller noise, or a process
/// noise far below it, use `f64` (in `f32` such filters keep running, but may need repairs, which are
/// counted).
///
/// ```
/// use jacoflow::temporal::{FlowFilter, FlowFilterOptions};
/// use jacoflow::types::Frame;
/// # fn main() -> jacoflow::Result<()> {
/// let mut filter = FlowFilter::<f64>::new((16, 16), FlowFilterOptions::measured())?;
/// for t in 0..200 {
///     // Waves along both axes, moving by (0.5, -0.25) px/frame.
///     let (dx, dy) = (0.5 * f64::from(t), -0.25 * f64::from(t));
///     let wave = |x: f64| 30.0 * (0.4 * x).sin();
///     let frame = Frame::from_fn(16, 16, |x, y| 128.0 + wave(x as f64 - dx) + wave(y as f64 - dy));
///     let field = filter.push(&frame)?;
///     assert_eq!(field.layout.frame_index, t as usize);
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct FlowFilter<T> {
    pub(super) options: FlowFilterOptions,
    pub(super) frame_size: (usize, usize),
    pub(super) frames: usize,
    pub(super) repairs: u64,
    pub(super) store: Store<T>,
    pub(super) constants: Constants<T>,
    pub(super) decorrelation: Decorrelation<T>,
    pub(super) fit: Fit<T>,
}

impl<T: SimdReal> FlowFilter<T> {
    /// Filters that start, for frames of `frame_size = (width, height)`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option that no filter can run with, or `frame_size` when the sites and
    /// their neighbourhoods have no room at all (frames under 3x3).
    pub fn new(frame_size: (usize, usize), mut options: FlowFilterOptions) -> Result<Self> {
        options.check(frame_size)?;
        options.preprocess.mask.clone_from(&options.mask);
        if frame_size.0 < 3 || frame_size.1 < 3 {
            return Err(Error::argument(
                "frame_size",
                "at least 3 x 3 pixels",
                format!("{} x {}", frame_size.0, frame_size.1),
            ));
        }
        let stencil = JetStencil::new(&options.neighbourhood, (1.0, 1.0))?;
        let constants = Constants::new(&options);
        let store = Store::new(frame_size, &options, stencil.offsets(), stencil.reach(), &constants)?;
        let decorrelation = Decorrelation::new(&stencil.covariance(), options.measurement_noise);
        let fit = Fit::new(&stencil, frame_size.0, options.adaptive.then_some(options.measurement_noise));
        Ok(Self { options, frame_size, frames: 0, repairs: 0, store, constants, decorrelation, fit })
    }

    /// The same filter with other threads and, if given, instruction set: for one saved elsewhere.
    pub fn with_computation(mut self, threads: Threads, simd: Option<Level>) -> Self {
        self.options.threads = threads;
        self.options.simd = simd.or(self.options.simd);
        self
    }

    /// The options.
    pub fn options(&self) -> &FlowFilterOptions {
        &self.options
    }
    /// Size `(width, height)` of the frames.
    pub fn frame_size(&self) -> (usize, usize) {
        self.frame_size
    }
    /// How many frames have been taken in.
    pub fn frames(&self) -> usize {
        self.frames
    }
    /// How often a site's covariance had lost its positive definiteness and was mended.
    pub fn repairs(&self) -> u64 {
        self.repairs
    }
    /// Number of result sites.
    pub fn len(&self) -> usize {
        self.store.fixed.len()
    }
    /// No site at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Mean `q` (12) and covariance (12 x 12) at result site `site` (row by row), in grey levels, px and
    /// frames; `None` where there is no filter (border, mask).
    pub fn state(&self, site: usize) -> Option<([f64; 12], [[f64; 12]; 12])> {
        let index = self.store.sites.binary_search(&site).ok()?;
        Some(self.store.state(index))
    }

    /// A frame after the steps of the options: what [`push`](Self::push) expects.
    pub fn prepare(&self, frame: Frame<T>) -> Frame<T> {
        self.options.threads.install(|| self.options.preprocess.apply(frame))
    }

    /// Takes in the next frame; returns flow and Jacobian with the `Status` of each site.
    ///
    /// Where a neighbourhood holds a NaN the filter only predicts; the result is NaN, `NonFinite`. Where the
    /// frame contradicts the prediction the motion is that of the frames before, `Predicted`.
    ///
    /// The field's covariance is that of [`state`](Self::state) and, where no quadratic describes the
    /// neighbourhood, the systematic error of such fits.
    ///
    /// # Errors
    /// [`Error::Argument`] for a frame of another size; the filter is then unchanged. One whose push was
    /// interrupted is half changed.
    pub fn push(&mut self, frame: &Frame<T>) -> Result<FlowField<T>> {
        if frame.size() != self.frame_size {
            let text = |(w, h): (usize, usize)| format!("{w} x {h}");
            return Err(Error::argument(
                "frame",
                format!("{} pixels, as before", text(self.frame_size)),
                text(frame.size()),
            ));
        }
        let rows = self.rows();
        let filters = self.store.pixels.len();
        let mut marks = vec![Mark::default(); filters / BLOCK];
        let mut results = vec![T::from_f64(0.0); filters * rows.count];
        let threads = self.options.threads;
        threads.install(|| pass::run(self, frame, &mut marks, &mut results))?;
        checkpoint();
        self.frames += 1;
        let live = self.store.sites.len();
        self.repairs += marks.iter().flat_map(|m| m.events).take(live).map(|e| u64::from(e & REPAIRED)).sum::<u64>();
        threads.install(|| self.field(&marks, &results))
    }

    pub(super) fn rows(&self) -> Rows {
        let covariance = if self.options.covariance { 21 } else { 0 };
        Rows { covariance, count: COVARIANCE + covariance }
    }

    fn field(&self, marks: &[Mark], results: &[T]) -> Result<FlowField<T>> {
        let options = &self.options;
        let layout = FieldLayout {
            frame_size: self.frame_size,
            sites: options.sites.clone(),
            model: "affine".into(),
            parameters: MOTION_NAMES.map(String::from).to_vec(),
            units: options.units.clone(),
            interval: Interval::Instant,
            frame_index: self.frames - 1,
            correlation_length: options.neighbourhood.spread(),
        };
        let mut field = FlowField::<T>::empty(layout, options.covariance)?;
        let n = field.len();
        let rows = self.rows();
        let mut residual = vec![T::nan(); n];
        field.status.copy_from_slice(&self.store.fixed);
        let flags = marks.iter().flat_map(|m| m.missing.iter().zip(&m.events));
        for (&site, (&missing, &events)) in self.store.sites.iter().zip(flags) {
            field.status[site] = match (missing, events) {
                (0, 0) => Status::Ok,
                (0, RESTARTED) => Status::Predicted,
                (0, _) => Status::Repaired,
                _ => Status::NonFinite,
            };
        }
        if n == 0 {
            return Ok(field);
        }
        let fill = |plane: &mut [T], row: usize, unit: f64| {
            let unit = T::from_f64(unit);
            let blocks = results.chunks_exact(rows.count * BLOCK);
            for ((block, mark), sites) in blocks.zip(marks).zip(self.store.sites.chunks(BLOCK)) {
                let values = &block[row * BLOCK..(row + 1) * BLOCK];
                for ((&value, &missing), &site) in values.iter().zip(&mark.missing).zip(sites) {
                    plane[site] = if missing == 0 { value * unit } else { T::nan() };
                }
            }
        };
        let units = MOTION_NAMES.map(|name| options.units.scale(name));
        parallel::for_each(field.motion.chunks_exact_mut(n).enumerate(), |(k, plane)| fill(plane, k, units[k]));
        if let Some(covariance) = &mut field.covariance {
            let planes = covariance.chunks_exact_mut(n).zip(&PAIRS).enumerate();
            parallel::for_each(planes, |(k, (plane, &(a, b)))| {
                fill(plane, COVARIANCE + k, units[a] * units[b]);
            });
        }
        fill(&mut residual, RESIDUAL, 1.0);
        field.residual = Some(residual);
        Ok(field)
    }
}
