//! A flow filter whose precision and sample type are those of its first frame.

use super::smoother::{bytes, smooth};
use super::{FlowFilter, FlowFilterOptions, SavedFilter};
use crate::error::{Error, Result, check_memory};
use crate::io::Element;
use crate::io::npz::NpzReader;
use crate::simd::SimdReal;
use crate::types::{AnyField, AnyFrame, FlowField, Precision, Sample, expect_dtype};
use std::io::Cursor;
use std::path::Path;

/// Width and height of a field, and the values of its sites one after the other.
pub type SiteValues = ((usize, usize), Vec<f64>);

/// Filters frames of any sample type, prepared first.
#[derive(Debug)]
pub struct AnyFlowFilter {
    options: FlowFilterOptions,
    /// Whether `options.full_scale` holds for frames of every sample type.
    full_scale_given: bool,
    precision: Precision,
    /// Sample type of the first frame; unknown after a state has been loaded from a file.
    dtype: Option<&'static str>,
    filter: Filter,
}

/// The filter in the precision that the first frame has decided.
#[derive(Debug)]
enum Filter {
    /// Before the first frame.
    Empty,
    Single(Box<FlowFilter<f32>>),
    Double(Box<FlowFilter<f64>>),
}

/// Runs `$body` with `$filter` bound to the filter of either precision, `$empty` before the first frame.
macro_rules! each {
    ($any:expr, $filter:ident => $body:expr, $empty:expr) => {
        match $any {
            Filter::Empty => $empty,
            Filter::Single($filter) => $body,
            Filter::Double($filter) => $body,
        }
    };
}

impl AnyFlowFilter {
    /// A filter that starts with the first frame. Without `full_scale` that of the options holds for floating
    /// point frames, and integer frames have the largest value of their type.
    pub fn new(options: FlowFilterOptions, full_scale: Option<f64>, precision: Precision) -> Self {
        let full_scale_given = full_scale.is_some();
        let options = FlowFilterOptions { full_scale: full_scale.unwrap_or(options.full_scale), ..options };
        Self { options, full_scale_given, precision, dtype: None, filter: Filter::Empty }
    }

    /// The field after the next frame. `dtype` is the type that the samples were given in, which is not that
    /// of the frame where a mask turned integers into floats.
    ///
    /// # Errors
    /// Those of [`FlowFilter::new`] and [`FlowFilter::push`]; [`Error::Type`] naming `frame` for another
    /// `dtype` than that of the first frame; [`Error::Argument`] naming `frame` for frames of another
    /// scale than those of a loaded state. The filter is then unchanged.
    pub fn push(&mut self, frame: &AnyFrame, dtype: &'static str) -> Result<AnyField> {
        let full_scale = self.full_scale(dtype);
        if matches!(self.filter, Filter::Empty) {
            let options = FlowFilterOptions { full_scale, ..self.options.clone() };
            self.filter = if self.options.is_double(self.precision, dtype) {
                Filter::Double(Box::new(FlowFilter::new(frame.size(), options)?))
            } else {
                Filter::Single(Box::new(FlowFilter::new(frame.size(), options)?))
            };
        }
        if let Some(first) = self.dtype {
            expect_dtype("frame", dtype, first)?;
        } else {
            let scale = each!(&self.filter, filter => filter.options().full_scale, full_scale);
            if scale != full_scale {
                let wanted = format!("frames of full scale {scale}, as those of the saved filter");
                return Err(Error::argument("frame", wanted, format!("{dtype} ({full_scale})")));
            }
            self.dtype = Some(dtype);
        }
        match &mut self.filter {
            Filter::Empty => Err(Error::Numerical("the filter has not started".into())),
            Filter::Single(filter) => advance(filter, frame).map(AnyField::Single),
            Filter::Double(filter) => advance(filter, frame).map(AnyField::Double),
        }
    }

    /// The field of each of some frames, whose samples were given in the type `dtype`, from the frames before
    /// and after it, by a two-filter smoother (D. C. Fraser, J. E. Potter, 1969) with the options of this
    /// filter, which stays as it is.
    ///
    /// # Errors
    /// Those of [`FlowFilter::new`] and [`FlowFilter::push`].
    pub fn smooth(&self, frames: &[AnyFrame], dtype: &str) -> Result<Vec<AnyField>> {
        if frames.is_empty() {
            return Ok(Vec::new());
        }
        let options = FlowFilterOptions { full_scale: self.full_scale(dtype), ..self.options.clone() };
        Ok(if self.options.is_double(self.precision, dtype) {
            smoothed::<f64>(options, frames)?.into_iter().map(AnyField::Double).collect()
        } else {
            smoothed::<f32>(options, frames)?.into_iter().map(AnyField::Single).collect()
        })
    }

    /// Forgets every frame.
    pub fn reset(&mut self) {
        (self.dtype, self.filter) = (None, Filter::Empty);
    }

    /// The options.
    pub fn options(&self) -> &FlowFilterOptions {
        &self.options
    }

    /// Number of frames filtered.
    pub fn frames(&self) -> usize {
        each!(&self.filter, filter => filter.frames(), 0)
    }

    /// How often a covariance that had lost its positive definiteness was repaired.
    pub fn repairs(&self) -> u64 {
        each!(&self.filter, filter => filter.repairs(), 0)
    }

    /// Width and height of the field, and the means (12 numbers) of its sites; NaN where there is no filter.
    /// `None` before the first frame.
    pub fn means(&self) -> Result<Option<SiteValues>> {
        each!(&self.filter, filter => {
            let values = (0..filter.len()).flat_map(|site| filter.state(site).map_or([f64::NAN; 12], |(mean, _)| mean));
            Ok(Some((filter.options().sites.shape(filter.frame_size())?, values.collect())))
        }, Ok(None))
    }

    /// As [`means`](Self::means): the covariances (12 x 12 numbers) of the sites.
    pub fn covariances(&self) -> Result<Option<SiteValues>> {
        each!(&self.filter, filter => {
            let none = [[f64::NAN; 12]; 12];
            let sites = (0..filter.len()).flat_map(|site| filter.state(site).map_or(none, |(_, covariance)| covariance));
            Ok(Some((filter.options().sites.shape(filter.frame_size())?, sites.flatten().collect())))
        }, Ok(None))
    }

    /// Writes the state into an `.npz` file.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `path` before the first frame; [`Error::Io`].
    pub fn save(&self, path: &Path) -> Result<()> {
        let early = || Error::argument("path", "a filter that has seen a frame", "one that has not");
        each!(&self.filter, filter => filter.save(path), Err(early()))
    }

    /// Replaces the state by that of a file; the next frame decides the sample type.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] for a damaged file; [`Error::Argument`] naming `path` for a state
    /// that was saved with other options.
    pub fn load(&mut self, path: &Path) -> Result<()> {
        let filter = if SavedFilter::is_double(&mut NpzReader::open(path)?)? {
            Filter::Double(Box::new(FlowFilter::load(path)?))
        } else {
            Filter::Single(Box::new(FlowFilter::load(path)?))
        };
        self.resume(filter, None)
    }

    /// The state as bytes, and the sample type of its frames (or empty); `None` before the first frame.
    pub fn to_bytes(&self) -> Result<Option<(Vec<u8>, &'static str)>> {
        each!(&self.filter, filter => Ok(Some((filter.to_bytes()?, self.dtype.unwrap_or_default()))), Ok(None))
    }

    /// Replaces the state by that of [`to_bytes`](Self::to_bytes).
    pub fn restore(&mut self, bytes: &[u8], dtype: Option<&'static str>) -> Result<()> {
        let filter = if SavedFilter::is_double(&mut NpzReader::new(Cursor::new(bytes), "filter state")?)? {
            Filter::Double(Box::new(FlowFilter::from_bytes(bytes)?))
        } else {
            Filter::Single(Box::new(FlowFilter::from_bytes(bytes)?))
        };
        self.resume(filter, dtype)
    }

    /// The sample value of 255 grey levels for frames of this type.
    fn full_scale(&self, dtype: &str) -> f64 {
        match dtype {
            u8::DTYPE if !self.full_scale_given => u8::FULL_SCALE,
            u16::DTYPE if !self.full_scale_given => u16::FULL_SCALE,
            _ => self.options.full_scale,
        }
    }

    /// Continues a saved filter if it has these options; the full scale is compared with the next frame.
    fn resume(&mut self, filter: Filter, dtype: Option<&'static str>) -> Result<()> {
        let same = |saved: &FlowFilterOptions| {
            let mut mine = self.options.clone();
            (mine.threads, mine.simd, mine.full_scale) = (saved.threads, saved.simd, saved.full_scale);
            mine == *saved
        };
        if !each!(&filter, filter => same(filter.options()), true) {
            return Err(Error::argument("path", "a state of a filter with the same options", "other options"));
        }
        let threads = self.options.threads;
        self.filter = match filter {
            Filter::Empty => Filter::Empty,
            Filter::Single(filter) => Filter::Single(Box::new(filter.with_computation(threads, None))),
            Filter::Double(filter) => Filter::Double(Box::new(filter.with_computation(threads, None))),
        };
        self.dtype = dtype;
        Ok(())
    }
}

fn smoothed<T: SimdReal>(options: FlowFilterOptions, frames: &[AnyFrame]) -> Result<Vec<FlowField<T>>> {
    let filter = FlowFilter::<T>::new(frames[0].size(), options)?;
    check_memory("frames", bytes(&filter, frames.len()))?;
    let prepared: Vec<_> = frames.iter().map(|frame| filter.prepare(frame.to_real())).collect();
    smooth(&filter, &prepared)
}

fn advance<T: SimdReal + Element>(filter: &mut FlowFilter<T>, frame: &AnyFrame) -> Result<FlowField<T>> {
    filter.push(&filter.prepare(frame.to_real()))
}
