//! `FlowFilter`: flow filtered in time.

mod arguments;

use super::arrays::{self, ColourRule};
use super::estimate::Growing;
use super::frame_list::Frames;
use super::options::{self, Integer, Object, PreprocessOptions, named};
use super::{field::FlowField, keywords::constructor, keywords::with_common};
use crate::errors::Outcome;
use crate::image::renamed;
use crate::interrupt::{alone, interruptible};
use arguments::{Arguments, filter_options};
use jacoflow::error::{Error, check_memory};
use jacoflow::temporal::AnyFlowFilter;
use jacoflow::types::{SamplingGrid, expect_dtype};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::path::PathBuf;

/// Flow and Jacobian filtered in time: one small Kalman filter at each site, WO2010/098160 (44)-(55).
///
/// Frames are pushed one by one; each gives a FlowField in px/frame and 1/frame. States are ordered q = (I,
/// Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y) in 8-bit grey levels, px and frames. `profile` "patent"
/// has the patent's constants, "measured" those for raw 8-bit frames (9 x 9 pixels); a `FilterProfile`
/// replaces single ones. The noise adapts to frames that are not locally quadratic. The other options are
/// those of `estimate`, but for the default of `precision`: float64 also where `R` is below 0.25, as in both
/// profiles. Pickles in mid-stream.
#[pyclass(module = "jacoflow")]
pub struct FlowFilter {
    arguments: Arguments,
    colour: ColourRule,
    filter: AnyFlowFilter,
}

filter_options!(constructor [FlowFilter from Arguments]);

#[pymethods]
impl FlowFilter {
    /// Takes in the next frame (H, W) and returns the FlowField after it, px/frame.
    ///
    /// Where a neighbourhood holds NaN or a masked pixel the filter only predicts, and the result is NaN with
    /// status NON_FINITE. Where the frame contradicts the prediction (black, flashed, dropped) the motion is
    /// that of the frames before, with status PREDICTED. ValueError for a frame of another size, TypeError
    /// for another dtype; the filter is then unchanged. Ctrl-C stops the work and forgets every frame.
    fn push(slf: &Bound<'_, Self>, frame: &Bound<'_, PyAny>) -> Outcome<FlowField> {
        let (py, mut this) = (slf.py(), alone(slf)?);
        let (frame, dtype) = arrays::typed_frame("frame", frame, this.colour)?;
        let (filter, mut completed) = (&mut this.filter, false);
        let field = interruptible(py, || {
            let field = filter.push(&frame, dtype).map_err(named);
            completed = true;
            field
        });
        if !completed {
            // Stopped by Ctrl-C in the middle of a frame.
            this.filter.reset();
        }
        Ok(FlowField::any(field?))
    }

    /// The fields of all `frames` (T, H, W), a stack of T, each from the frames before and after it.
    ///
    /// A two-filter smoother (Fraser and Potter, 1969): two filters with these options run through the
    /// frames, one of them backwards, and are joined at each frame. Less lag, and at most the variance of the
    /// filter. Where a frame is missing the motion is that of the frames around it, with status PREDICTED.
    /// The filter itself stays as it is. All frames and fields are held in memory. Ctrl-C stops it.
    /// ValueError for frames of different sizes, TypeError for different dtypes.
    fn smooth(slf: &Bound<'_, Self>, frames: &Bound<'_, PyAny>) -> Outcome<FlowField> {
        let (py, this) = (slf.py(), alone(slf)?);
        let frames = Frames::new(frames, this.colour)?;
        if frames.count == 0 {
            return Err(Error::argument("frames", "at least 1 frame", "0 frames").into());
        }
        let (mut taken, mut first) = (Vec::new(), None);
        for index in 0..frames.count {
            py.check_signals()?;
            let (frame, dtype) = frames.get(index)?;
            expect_dtype("frames", dtype, first.get_or_insert(dtype))?;
            if index == 0 {
                // A view of one frame may be of any length.
                let samples = frame.size().0.checked_mul(frame.size().1).and_then(|n| n.checked_mul(frames.count));
                check_memory("frames", samples.and_then(|n| n.checked_mul(size_of::<f32>())))?;
            }
            taken.push(frame);
        }
        let (filter, dtype) = (&this.filter, first.unwrap_or_default());
        let smoothed =
            interruptible(py, || filter.smooth(&taken, dtype).map_err(|error| renamed(error, "frame", "frames")))?;
        let mut fields = Growing::None;
        for field in smoothed {
            fields.add(field)?;
        }
        fields.finish()
    }

    /// Forgets every frame (H, W): the next one starts new filters.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        alone(slf)?.filter.reset();
        Ok(())
    }

    /// Means q of the filters, float64 array (H, W, 12) or (N, 12), in 8-bit grey levels, px and frames; NaN
    /// where there is no filter (border, mask).
    ///
    /// None before the first frame.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyAny>>> {
        self.per_site(py, self.filter.means()?, &[12])
    }

    /// Covariances of q, float64 array (H, W, 12, 12) or (N, 12, 12), units of `state` squared; NaN where
    /// there is no filter. None before the first frame. The fields' covariance adds the systematic error of
    /// neighbourhoods that no quadratic describes.
    #[getter]
    fn state_covariance<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyAny>>> {
        self.per_site(py, self.filter.covariances()?, &[12, 12])
    }

    /// How many frames have been taken in (a count, no unit).
    #[getter]
    fn frames_pushed(&self) -> usize {
        self.filter.frames()
    }

    /// How often a site's covariance had lost its positive definiteness and was repaired (a count, no unit).
    #[getter]
    fn repairs(&self) -> u64 {
        self.filter.repairs()
    }

    /// The options as a dictionary, in the units of the constructor.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        Ok((&self.arguments).into_pyobject(py)?)
    }

    /// Writes the states (one file, .npz) so that `load` goes on bit for bit, in the units of `state`.
    ///
    /// Pickling keeps the options too. ValueError before the first frame, OSError when the file cannot be
    /// written.
    fn save(&self, py: Python<'_>, #[pyo3(from_py_with = named::path)] path: PathBuf) -> Outcome<()> {
        Ok(py.detach(|| self.filter.save(&path))?)
    }

    /// Takes up the states that `save` wrote, in the units of `state`; the options of this filter must be
    /// those of the saved one.
    ///
    /// FormatError for a damaged file, ValueError for a file of other options or another precision, OSError
    /// when it cannot be read.
    fn load(&mut self, py: Python<'_>, #[pyo3(from_py_with = named::path)] path: PathBuf) -> Outcome<()> {
        Ok(py.detach(|| self.filter.load(&path))?)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>, Option<(Bound<'py, PyBytes>, &'static str)>))> {
        let state = self.filter.to_bytes()?;
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_filter")?;
        Ok((restore, (self.options(py)?, state.map(|(bytes, dtype)| (PyBytes::new(py, &bytes), dtype)))))
    }

    fn __repr__(&self) -> String {
        let form = self.filter.options().form.name();
        format!("FlowFilter(form={form:?}, frames_pushed={})", self.frames_pushed())
    }
}

impl FlowFilter {
    fn from_arguments(py: Python<'_>, arguments: Arguments) -> Outcome<Self> {
        let arguments = arguments.keep(py)?;
        let mut options = arguments.options(py)?;
        let full_scale = arguments.profile(py)?.1.get("full_scale")?;
        let preprocess = PreprocessOptions::new(py, &arguments.preprocess)?;
        options.preprocess = preprocess.steps(options.mask.as_ref())?;
        let precision = options::precision(arguments.precision.as_deref())?;
        let filter = AnyFlowFilter::new(options, full_scale, precision);
        Ok(Self { colour: preprocess.colour, filter, arguments })
    }

    /// Numbers of each site as an array with the trailing axes `tail`.
    fn per_site<'py>(
        &self,
        py: Python<'py>,
        values: Option<((usize, usize), Vec<f64>)>,
        tail: &[usize],
    ) -> Outcome<Option<Bound<'py, PyAny>>> {
        let Some(((width, height), values)) = values else { return Ok(None) };
        let is_points = matches!(self.filter.options().sites, SamplingGrid::Points(_));
        let sites = if is_points { vec![width] } else { vec![height, width] };
        Ok(Some(arrays::owned(py, &[&sites[..], tail].concat(), values)?))
    }
}

/// The core's complaint in the words of this class.
fn named(error: Error) -> Error {
    let names = [
        ("process_noise", "Q"),
        ("measurement_noise", "R"),
        ("initial_mean", "x0"),
        ("initial_covariance", "P0"),
        ("frame_size", "frame"),
    ];
    names.into_iter().fold(error, |error, (core, here)| super::image::renamed(error, core, here))
}

/// The inverse of `FlowFilter.__reduce__`.
#[pyfunction(name = "_restore_filter")]
pub fn restore_filter(py: Python<'_>, options: Arguments, state: Option<(Vec<u8>, String)>) -> Outcome<FlowFilter> {
    let mut filter = FlowFilter::from_arguments(py, options)?;
    if let Some((bytes, name)) = state {
        let dtype = if name.is_empty() { None } else { Some(options::known_dtype(&name)?) };
        py.detach(|| filter.filter.restore(&bytes, dtype))?;
    }
    Ok(filter)
}
