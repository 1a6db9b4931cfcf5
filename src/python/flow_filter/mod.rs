//! `FlowFilter`: flow filtered in time.

mod arguments;

use super::arrays::{self, ColourRule};
use super::field::FlowField;
use super::keywords::{constructor, with_common};
use super::options::{self, Integer, Object, Precision, Region};
use crate::error::Error;
use crate::image::Preprocess;
use crate::io::npz::NpzReader;
use crate::simd::SimdReal;
use crate::temporal::{FlowFilter as Core, FlowFilterOptions, SavedFilter};
use crate::types::{AnyFrame, Frame, Sample, SamplingGrid};
use arguments::{Arguments, filter_options};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::io::{Cursor, Read, Seek};
use std::path::PathBuf;

/// The filters, once the first frame has told their number and precision.
enum Engine {
    Waiting,
    Single(Core<f32>, &'static str),
    Double(Core<f64>, &'static str),
}

/// Runs `$body` with `$core` bound to the filters of either precision, `$none` before the first frame.
macro_rules! each_engine {
    ($engine:expr, $core:ident => $body:expr, $none:expr) => {
        match $engine {
            Engine::Waiting => $none,
            Engine::Single($core, _) => $body,
            Engine::Double($core, _) => $body,
        }
    };
}

/// Flow and Jacobian filtered in time: one small Kalman filter at each site, WO2010/098160 (44)-(55).
///
/// Frames are pushed one by one; each gives a FlowField in px/frame and 1/frame. States are ordered q = (I,
/// Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y) in 8-bit grey levels, px and frames. `profile` "patent"
/// has the patent's constants, "measured" those for raw 8-bit frames (9 x 9 pixels); the other options
/// replace single constants. Pickles in mid-stream.
///
/// `form` "fast" (13 sigma points) has the numbers of "non_augmented" (25) with `square_root="motion_first"`,
/// not those of its default "brightness_first", which is filterpy's order. With the profile "measured" they
/// follow the patent's ramp equally well (rms error of u within 0.3 %); with "patent" use "augmented" or
/// "non_augmented": the rms error of u is 0.063 px/frame there and 0.30 px/frame with "fast".
#[pyclass(module = "jacoflow")]
pub struct FlowFilter {
    arguments: Arguments,
    options: FlowFilterOptions,
    preprocess: Preprocess,
    colour: ColourRule,
    precision: Precision,
    engine: Engine,
}

filter_options!(constructor [FlowFilter from Arguments]);

#[pymethods]
impl FlowFilter {
    /// Takes in the next frame (H, W) and returns the FlowField after it, px/frame.
    ///
    /// Where a neighbourhood holds NaN the filter only predicts, and the result is NaN with status
    /// NON_FINITE. ValueError for a frame of another size, TypeError for another dtype; the filter is then
    /// unchanged.
    fn push(&mut self, frame: &Bound<'_, PyAny>) -> PyResult<FlowField> {
        let py = frame.py();
        let frame = arrays::frame("frame", frame, self.colour)?;
        if matches!(self.engine, Engine::Waiting) {
            self.engine = self.start(&frame)?;
        }
        self.accept_dtype(&frame)?;
        match &mut self.engine {
            Engine::Waiting => Err(Error::Numerical("the filter has not started".into()).into()),
            Engine::Single(core, dtype) => advance(py, core, dtype, &self.preprocess, &frame).map(FlowField::single),
            Engine::Double(core, dtype) => advance(py, core, dtype, &self.preprocess, &frame).map(FlowField::single),
        }
    }

    /// Forgets every frame (H, W): the next one starts new filters.
    fn reset(&mut self) {
        self.engine = Engine::Waiting;
    }

    /// Means q of the filters, float64 array (H, W, 12) or (N, 12), in 8-bit grey levels, px and frames; NaN
    /// where there is no filter (border, mask).
    ///
    /// None before the first frame.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        each_engine!(&self.engine, core => {
            let values = (0..core.len()).flat_map(|site| core.state(site).map_or([f64::NAN; 12], |(mean, _)| mean));
            Ok(Some(arrays::owned(py, &shape(core, &[12])?, values.collect())?.into_any()))
        }, Ok(None))
    }

    /// Covariances of q, float64 array (H, W, 12, 12) or (N, 12, 12), units of `state` squared; NaN where
    /// there is no filter. None before the first frame.
    #[getter]
    fn state_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        each_engine!(&self.engine, core => {
            let none = [[f64::NAN; 12]; 12];
            let values = (0..core.len()).flat_map(|site| core.state(site).map_or(none, |(_, covariance)| covariance)).flatten();
            Ok(Some(arrays::owned(py, &shape(core, &[12, 12])?, values.collect())?.into_any()))
        }, Ok(None))
    }

    /// How many frames have been taken in (a count, no unit).
    #[getter]
    fn frames_pushed(&self) -> usize {
        each_engine!(&self.engine, core => core.frames(), 0)
    }

    /// How often a site's covariance had lost its positive definiteness and was mended (a count, no unit).
    #[getter]
    fn repairs(&self) -> u64 {
        each_engine!(&self.engine, core => core.repairs(), 0)
    }

    /// The options as a dictionary, in the units of the constructor.
    #[getter]
    fn options<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        (&self.arguments).into_pyobject(py)
    }

    /// Writes the states (one file, .npz) so that `load` goes on bit for bit, in the units of `state`.
    ///
    /// Pickling keeps the options too. ValueError before the first frame, OSError when the file cannot be
    /// written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let early = || Error::argument("path", "a filter that has seen a frame", "one that has not");
        each_engine!(&self.engine, core => Ok(py.detach(|| core.save(&path))?), Err(early().into()))
    }

    /// Takes up the states that `save` wrote, in the units of `state`; the options of this filter must be
    /// those of the saved one.
    ///
    /// FormatError for a damaged file, ValueError for a file of other options or another precision, OSError
    /// when it cannot be read.
    fn load(&mut self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let engine = py.detach(|| {
            if is_double(NpzReader::open(&path)?)? {
                Core::<f64>::load(&path).map(|core| Engine::Double(core, ""))
            } else {
                Core::<f32>::load(&path).map(|core| Engine::Single(core, ""))
            }
        })?;
        self.engine = self.resume(engine)?;
        Ok(())
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>, Option<(Bound<'py, PyBytes>, &'static str)>))> {
        let state = match &self.engine {
            Engine::Waiting => None,
            Engine::Single(core, dtype) => Some((core.to_bytes()?, *dtype)),
            Engine::Double(core, dtype) => Some((core.to_bytes()?, *dtype)),
        };
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_filter")?;
        Ok((restore, (self.options(py)?, state.map(|(bytes, dtype)| (PyBytes::new(py, &bytes), dtype)))))
    }

    fn __repr__(&self) -> String {
        let Arguments { profile, .. } = &self.arguments;
        let form = self.options.form.name();
        format!("FlowFilter(profile={profile:?}, form={form:?}, frames_pushed={})", self.frames_pushed())
    }
}

impl FlowFilter {
    fn from_arguments(py: Python<'_>, arguments: Arguments) -> PyResult<Self> {
        let arguments = arguments.keep(py)?;
        let options = arguments.options(py)?;
        Ok(Self {
            preprocess: options::preprocess(arguments.smooth, arguments.quantise, options.mask.as_ref())?,
            options,
            colour: ColourRule::parse(arguments.colour.as_deref())?,
            precision: Precision::parse(arguments.precision.as_deref())?,
            engine: Engine::Waiting,
            arguments,
        })
    }

    /// The sample value of 255 grey levels for frames like this one.
    fn full_scale(&self, frame: &AnyFrame) -> f64 {
        match (self.arguments.full_scale, frame) {
            (None, AnyFrame::U8(_)) => u8::FULL_SCALE,
            (None, AnyFrame::U16(_)) => u16::FULL_SCALE,
            _ => self.options.full_scale,
        }
    }

    /// After loading a state the first frame tells the sample type; it must have the scale that the state was
    /// made with.
    fn accept_dtype(&mut self, frame: &AnyFrame) -> PyResult<()> {
        let expected = self.full_scale(frame);
        let (scale, dtype) = match &mut self.engine {
            Engine::Waiting => return Ok(()),
            Engine::Single(core, dtype) => (core.options().full_scale, dtype),
            Engine::Double(core, dtype) => (core.options().full_scale, dtype),
        };
        if dtype.is_empty() {
            if scale != expected {
                let wanted = format!("frames of full scale {scale}, as those of the saved filter");
                return Err(Error::argument("frame", wanted, format!("{} ({expected})", frame.dtype())).into());
            }
            *dtype = frame.dtype();
        }
        Ok(())
    }

    /// Takes up a saved state, if it was made with these options. Full scale depends on the frames and is
    /// looked at with them.
    fn resume(&self, engine: Engine) -> crate::Result<Engine> {
        let same = |saved: &FlowFilterOptions| {
            let mut mine = self.options.clone();
            (mine.threads, mine.simd, mine.full_scale) = (saved.threads, saved.simd, saved.full_scale);
            mine == *saved
        };
        let fits = each_engine!(&engine, core => same(core.options()), true);
        if fits {
            let threads = self.options.threads;
            Ok(match engine {
                Engine::Waiting => Engine::Waiting,
                Engine::Single(core, dtype) => Engine::Single(core.with_threads(threads), dtype),
                Engine::Double(core, dtype) => Engine::Double(core.with_threads(threads), dtype),
            })
        } else {
            Err(Error::argument("path", "a state of a filter with the same options", "other options"))
        }
    }

    /// The filters for a sequence that begins with `frame`.
    fn start(&self, frame: &AnyFrame) -> PyResult<Engine> {
        let options = FlowFilterOptions { full_scale: self.full_scale(frame), ..self.options.clone() };
        let (size, dtype) = (frame.size(), frame.dtype());
        let engine = if self.precision.is_double(frame) {
            Core::new(size, options).map(|core| Engine::Double(core, dtype))
        } else {
            Core::new(size, options).map(|core| Engine::Single(core, dtype))
        };
        Ok(engine.map_err(named)?)
    }
}

/// Whether a saved filter works in double precision.
fn is_double<R: Read + Seek>(mut reader: NpzReader<R>) -> crate::Result<bool> {
    let saved = SavedFilter::describe(&mut reader)?;
    Ok(saved.is_some_and(|saved| saved.precision == "float64"))
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

fn shape<T: SimdReal>(core: &Core<T>, tail: &[usize]) -> PyResult<Vec<usize>> {
    let (width, height) = core.options().sites.shape(core.frame_size())?;
    let sites = if matches!(core.options().sites, SamplingGrid::Points(_)) { vec![width] } else { vec![height, width] };
    Ok(sites.into_iter().chain(tail.iter().copied()).collect())
}

fn advance<T: SimdReal>(
    py: Python<'_>,
    core: &mut Core<T>,
    dtype: &str,
    preprocess: &Preprocess,
    frame: &AnyFrame,
) -> PyResult<crate::types::FlowField<T>> {
    options::check_dtype("frame", dtype, frame)?;
    let field = py.detach(|| {
        let prepared: Frame<T> = core.options().threads.install(|| preprocess.apply(frame.to_real()));
        core.push(&prepared)
    });
    Ok(field?)
}

/// The inverse of `FlowFilter.__reduce__`.
#[pyfunction(name = "_restore_filter")]
pub fn restore_filter(py: Python<'_>, options: Arguments, state: Option<(Vec<u8>, String)>) -> PyResult<FlowFilter> {
    let mut filter = FlowFilter::from_arguments(py, options)?;
    if let Some((bytes, name)) = state {
        let dtype = options::known_dtype(&name)?;
        let engine = py.detach(|| {
            if is_double(NpzReader::new(Cursor::new(&bytes), "filter state")?)? {
                Core::<f64>::from_bytes(&bytes).map(|core| Engine::Double(core, dtype))
            } else {
                Core::<f32>::from_bytes(&bytes).map(|core| Engine::Single(core, dtype))
            }
        })?;
        filter.engine = filter.resume(engine)?;
    }
    Ok(filter)
}
