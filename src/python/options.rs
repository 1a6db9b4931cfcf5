//! Options that estimators and the flow filter share, from what Python gives.

use super::arrays;
use crate::error::Error;
use crate::image::{GaussianSmoother, Preprocess, Quantiser};
use crate::jet::Neighbourhood;
use crate::parallel::Threads;
use crate::simd::Level;
use crate::types::{AnyFrame, Mask, Rect, Sample, SamplingGrid};
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// An integer argument. One that 64 bits do not hold becomes the nearest that they do, so that it is refused
/// by name where it is out of range.
#[derive(Debug, Clone, Copy, IntoPyObject, IntoPyObjectRef)]
#[pyo3(transparent)]
pub struct Integer(pub i64);

impl<'py> FromPyObject<'_, 'py> for Integer {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match object.extract::<i64>() {
            Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
                Ok(Self(if object.lt(0)? { i64::MIN } else { i64::MAX }))
            }
            value => Ok(Self(value?)),
        }
    }
}

/// The argument `region`, any sequence (x, y, width, height), px.
#[derive(Debug, Clone, Copy, IntoPyObject, IntoPyObjectRef)]
#[pyo3(transparent)]
pub struct Region((i64, i64, i64, i64));

impl<'py> FromPyObject<'_, 'py> for Region {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let wrong = || PyTypeError::new_err("region: expected four integers (x, y, width, height)");
        let items: Vec<Bound<'_, PyAny>> = object.try_iter().and_then(Iterator::collect).map_err(|_| wrong())?;
        let numbers: Vec<Integer> =
            items.iter().map(PyAnyMethods::extract).collect::<PyResult<_>>().map_err(|_| wrong())?;
        let [Integer(x), Integer(y), Integer(width), Integer(height)] = numbers[..] else { return Err(wrong()) };
        Ok(Self((x, y, width, height)))
    }
}

/// An object that may be absent, as an argument takes it and a pickle keeps it.
pub type Object = Option<Py<PyAny>>;

/// A copy of an array-like option, so that later changes by the user do not reach it.
pub fn keep(py: Python<'_>, object: Object) -> PyResult<Object> {
    let copy = |object: Py<PyAny>| {
        let object = object.into_bound(py);
        let plain = object.is_instance_of::<PyTuple>();
        if plain { Ok(object.unbind()) } else { Ok(py.import("numpy")?.getattr("array")?.call1((object,))?.unbind()) }
    };
    object.map(copy).transpose()
}

/// A count of at least one.
pub fn count(name: &'static str, Integer(value): Integer) -> PyResult<usize> {
    usize::try_from(value)
        .ok()
        .filter(|&n| n > 0)
        .ok_or_else(|| Error::argument(name, "a positive integer", value).into())
}

/// `threads`: a positive number, or all.
pub fn threads(value: Option<Integer>) -> PyResult<Threads> {
    Ok(Threads::new(value.map(|n| count("threads", n)).transpose()?)?)
}

/// `simd`: the name of an instruction set that the processor has.
pub fn simd(name: Option<&str>) -> PyResult<Option<Level>> {
    Ok(name.map(Level::parse).transpose()?)
}

/// `points`, `region`, `stride`.
pub fn sites(
    py: Python<'_>,
    points: &Object,
    region: Option<Region>,
    stride: Option<Integer>,
) -> PyResult<SamplingGrid> {
    let stride = stride.map(|n| count("stride", n)).transpose()?;
    if let Some(points) = points {
        if region.is_some() || stride.is_some() {
            let other = if region.is_some() { "region" } else { "stride" };
            return Err(Error::argument("points", format!("points without {other}"), "both").into());
        }
        let inside = arrays::integer_pairs("points", points.bind(py))?
            .into_iter()
            .map(|(x, y)| Ok((usize::try_from(x).map_err(|_| (x, y))?, usize::try_from(y).map_err(|_| (x, y))?)));
        let pixels = inside.collect::<Result<Vec<_>, _>>();
        return pixels.map(SamplingGrid::Points).map_err(|point: (i64, i64)| {
            Error::argument("points", "pixels (x, y) inside the frame", format!("{point:?}")).into()
        });
    }
    let region = self::region(region)?;
    let SamplingGrid::Grid { stride: default, .. } = SamplingGrid::default() else {
        return Ok(SamplingGrid::default());
    };
    Ok(SamplingGrid::Grid { region, stride: stride.unwrap_or(default) })
}

/// `neighbourhood`: (columns, rows) or an (N, 2) array of offsets; `sigma` weighs it.
pub fn neighbourhood(
    py: Python<'_>,
    value: &Object,
    sigma: Option<f64>,
    default: &Neighbourhood,
) -> PyResult<Neighbourhood> {
    let Some(value) = value else {
        return Ok(match (default.clone(), sigma) {
            (Neighbourhood::Rectangle { width, height, .. }, Some(_)) => {
                Neighbourhood::Rectangle { width, height, sigma }
            }
            (Neighbourhood::Points { offsets, .. }, Some(_)) => Neighbourhood::Points { offsets, sigma },
            (default, None) => default,
        });
    };
    let value = value.bind(py);
    if let Ok((columns, rows)) = value.extract::<(Integer, Integer)>() {
        let (width, height) = (count("neighbourhood", columns)?, count("neighbourhood", rows)?);
        return Ok(Neighbourhood::Rectangle { width, height, sigma });
    }
    let array = arrays::as_array("neighbourhood", value)?;
    if let Ok([columns, rows]) = array.extract::<[Integer; 2]>() {
        let (width, height) = (count("neighbourhood", columns)?, count("neighbourhood", rows)?);
        return Ok(Neighbourhood::Rectangle { width, height, sigma });
    }
    let offsets = arrays::integer_pairs("neighbourhood", array.as_any())?;
    let narrow = offsets.into_iter().map(|(x, y)| Ok((i32::try_from(x)?, i32::try_from(y)?)));
    let offsets = narrow
        .collect::<Result<Vec<_>, std::num::TryFromIntError>>()
        .map_err(|_| Error::argument("neighbourhood", "offsets of a few px", "one far outside"))?;
    Ok(Neighbourhood::Points { offsets, sigma })
}

/// `fps` or `frame_period`, seconds between frames.
pub fn frame_period(fps: Option<f64>, frame_period: Option<f64>) -> PyResult<Option<f64>> {
    match (fps, frame_period) {
        (Some(_), Some(_)) => Err(Error::argument("fps", "fps or frame_period", "both").into()),
        (Some(fps), None) if !(fps.is_finite() && fps > 0.0) => {
            Err(Error::argument("fps", "a positive number of frames per second", fps).into())
        }
        (Some(fps), None) => Ok(Some(1.0 / fps)),
        (None, period) => Ok(period),
    }
}

/// `smooth` and `quantise`, and the mask that smoothing heeds.
pub fn preprocess(smooth: Option<f64>, quantise: Option<f64>, mask: Option<&Mask>) -> PyResult<Preprocess> {
    Ok(Preprocess {
        quantise: quantise.map(Quantiser::new).transpose()?,
        smooth: smooth.map(GaussianSmoother::new).transpose()?,
        mask: mask.cloned(),
    })
}

/// `pixel_pitch`: one length for both axes or (dx, dy).
pub fn pixel_pitch(py: Python<'_>, value: &Object) -> PyResult<Option<(f64, f64)>> {
    let Some(value) = value else { return Ok(None) };
    let value = value.bind(py);
    if let Ok(pair) = value.extract::<(f64, f64)>() {
        return Ok(Some(pair));
    }
    match value.extract::<f64>() {
        Ok(side) => Ok(Some((side, side))),
        Err(_) => {
            Err(PyTypeError::new_err(format!("pixel_pitch: expected a length or (dx, dy), got {}", value.get_type())))
        }
    }
}

/// Which precision a computation runs in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// That of the frames: float64 for float64, else float32.
    Auto,
    /// float32.
    Single,
    /// float64.
    Double,
}

impl Precision {
    /// `precision=None | "float32" | "float64"`.
    pub fn parse(name: Option<&str>) -> PyResult<Self> {
        match name {
            None => Ok(Self::Auto),
            Some("float32") => Ok(Self::Single),
            Some("float64") => Ok(Self::Double),
            Some(other) => {
                Err(Error::argument("precision", "\"float32\", \"float64\" or None", format!("{other:?}")).into())
            }
        }
    }

    /// Whether a sequence that begins with `frame` is computed in double precision.
    pub fn is_double(self, frame: &AnyFrame) -> bool {
        match self {
            Self::Auto => matches!(frame, AnyFrame::F64(_)),
            Self::Single => false,
            Self::Double => true,
        }
    }
}

/// Refuses a frame that does not continue the sequence.
pub fn check_dtype(argument: &str, first: &str, frame: &AnyFrame) -> PyResult<()> {
    if frame.dtype() == first {
        return Ok(());
    }
    Err(PyTypeError::new_err(format!("{argument}: expected {first} like the first frame, got {}", frame.dtype())))
}

/// `region`: (x, y, width, height), px.
pub fn region(region: Option<Region>) -> PyResult<Option<Rect>> {
    let Some(Region((x, y, width, height))) = region else { return Ok(None) };
    let side = |value: i64| usize::try_from(value).ok();
    let rect = || Some(Rect { x: side(x)?, y: side(y)?, width: side(width)?, height: side(height)? });
    let got = format!("({x}, {y}, {width}, {height})");
    rect().map(Some).ok_or_else(|| Error::argument("region", "(x, y, width, height), none negative", got).into())
}

/// The static name of a sample type.
pub fn known_dtype(name: &str) -> PyResult<&'static str> {
    let known = [u8::DTYPE, u16::DTYPE, f32::DTYPE, f64::DTYPE].into_iter().find(|known| *known == name);
    known.ok_or_else(|| Error::argument("state", "a sample type that frames have", format!("{name:?}")).into())
}
