//! numpy arrays in, core frames out, and back. Messages name the argument, what it was and what is accepted.

use super::samples::{exact_samples, is_masked, refuse_non_array, sample_type};
use crate::errors::{Outcome, Raised};
use crate::options::shown;
use jacoflow::buffer_pool;
use jacoflow::error::{Error, check_memory, shape_text};
use jacoflow::track::GreyLevels;
use jacoflow::types::{AnyFrame, Frame, Mask, Sample};
use numpy::ndarray::{ArrayView, IntoDimension, ShapeBuilder};
use numpy::{Element, PyArray, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

/// Sample types that frames may have, for messages.
const ACCEPTED: &str = "an array of bool, integers of 8 to 64 bits, float16, float32 or float64";

/// A masked array as doubles, NaN where it is masked; other objects as they are.
pub fn filled_with_nan<'py>(object: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
    if !is_masked(object)? {
        return Ok(object.clone());
    }
    Ok(object.call_method1("astype", ("float64",))?.call_method1("filled", (f64::NAN,))?)
}

/// `object` as a numpy array: itself, or what `numpy.asarray` makes of it. Misaligned memory and that of
/// another byte order is copied.
pub fn as_array<'py>(argument: &str, object: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyUntypedArray>> {
    if is_masked(object)? {
        return Err(PyTypeError::new_err(format!(
            "{argument}: expected a plain array, got a masked one; fill it first: `array.filled(value)`"
        ))
        .into());
    }
    native(argument, object)
}

/// As [`as_array`], of masked arrays too, which stay masked.
pub fn native<'py>(argument: &str, object: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyUntypedArray>> {
    let py = object.py();
    let array = if let Ok(array) = object.cast::<PyUntypedArray>() {
        array.clone()
    } else {
        let ragged = |error: PyErr| {
            let said = || format!("{argument}: expected rows of equal length, got {}", error.value(py));
            if error.is_instance_of::<PyValueError>(py) { PyValueError::new_err(said()) } else { error }
        };
        py.import("numpy")?.getattr("asarray")?.call1((object,)).map_err(ragged)?.cast_into::<PyUntypedArray>()?
    };
    let kind = array.getattr("dtype")?;
    if !kind.getattr("isnative")?.extract::<bool>()? {
        let native = kind.call_method1("newbyteorder", ("=",))?;
        return Ok(array.call_method1("astype", (native,))?.cast_into::<PyUntypedArray>()?);
    }
    if array.getattr("flags")?.getattr("aligned")?.extract::<bool>()? {
        return Ok(array);
    }
    Ok(array.call_method0("copy")?.cast_into::<PyUntypedArray>()?)
}

/// numpy's name of the array's element type.
pub fn dtype_name(array: &Bound<'_, PyUntypedArray>) -> String {
    array.dtype().str().map_or_else(|_| "unknown".into(), |name| name.to_string())
}

/// Refuses an array whose copy in working precision does not fit into memory: a view of one sample may have
/// any shape.
pub fn check_size(argument: &str, array: &Bound<'_, PyUntypedArray>) -> Outcome<()> {
    Ok(check_memory(argument, array.len().checked_mul(size_of::<f64>()))?)
}

/// The elements in row-major order, for any strides.
pub fn elements<T: Element + Copy + 'static>(array: &Bound<'_, PyUntypedArray>) -> Option<Vec<T>> {
    let typed = array.cast::<PyArrayDyn<T>>().ok()?.try_readonly().ok()?;
    if let Ok(slice) = typed.as_slice() {
        // `as_slice` also takes Fortran order; only one-dimensional or row-major data may be taken as it
        // lies.
        if array.is_c_contiguous() {
            return Some(buffer_pool::copy(slice));
        }
    }
    Some(typed.as_array().iter().copied().collect())
}

/// The answer to an array of a type that frames may not have.
pub fn wrong_dtype(argument: &str, array: &Bound<'_, PyUntypedArray>) -> PyErr {
    PyTypeError::new_err(format!("{argument}: expected {ACCEPTED}, got {}", dtype_name(array)))
}

/// How a frame's dimensions are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourRule {
    /// Colour is refused with advice.
    Refuse,
    /// Colour is turned into luminance.
    Luminance,
}

impl ColourRule {
    /// `colour=None | "error" | "luminance"`.
    pub fn parse(name: Option<&str>) -> Outcome<Self> {
        match name {
            None | Some("error") => Ok(Self::Refuse),
            Some("luminance") => Ok(Self::Luminance),
            Some(other) => Err(Error::argument("colour", "\"error\" or \"luminance\"", format!("{other:?}")).into()),
        }
    }
}

/// One frame `(H, W)`, or `(H, W, 3 or 4)` where colour is allowed.
pub fn frame(argument: &str, object: &Bound<'_, PyAny>, colour: ColourRule) -> Outcome<AnyFrame> {
    refuse_non_array(argument, object)?;
    converted(argument, as_array(argument, object)?, colour)
}

/// As [`frame`], of masked arrays too: their masked pixels are NaN, which no estimate uses.
pub fn frame_with_gaps(argument: &str, object: &Bound<'_, PyAny>, colour: ColourRule) -> Outcome<AnyFrame> {
    refuse_non_array(argument, object)?;
    converted(argument, native(argument, object)?, colour)
}

/// As [`frame_with_gaps`], with the type in which the samples were given: a mask turns integers into floats.
pub fn typed_frame(argument: &str, object: &Bound<'_, PyAny>, colour: ColourRule) -> Outcome<(AnyFrame, &'static str)> {
    let frame = frame_with_gaps(argument, object, colour)?;
    let dtype = sample_type(object, &frame)?;
    Ok((frame, dtype))
}

/// As [`frame_with_gaps`], for trackers, whose thresholds are in grey levels: see [`unmasked`].
pub fn tracked_frame(
    argument: &str,
    object: &Bound<'_, PyAny>,
    colour: ColourRule,
    levels: GreyLevels,
) -> Outcome<AnyFrame> {
    refuse_non_array(argument, object)?;
    converted(argument, unmasked(argument, object, levels)?, colour)
}

/// The array, masked or not; bool, and masked uint8 and uint16, become float32 with the white that `levels`
/// take floats to have.
pub fn unmasked<'py>(
    argument: &str,
    object: &Bound<'py, PyAny>,
    levels: GreyLevels,
) -> Outcome<Bound<'py, PyUntypedArray>> {
    let array = native(argument, object)?;
    let white = match dtype_name(&array).as_str() {
        "bool" => 1.0,
        "uint8" => f32::from(u8::MAX),
        "uint16" => f32::from(u16::MAX),
        _ => return Ok(array),
    };
    if white > 1.0 && !is_masked(&array)? {
        return Ok(array);
    }
    let white_of_floats = f32::from(u8::MAX) / levels.float_gain() as f32;
    // Masked arrays take a divisor for float64.
    let scaled = array.call_method1("astype", ("float32",))?.div(white / white_of_floats)?;
    Ok(scaled.call_method1("astype", ("float32",))?.cast_into::<PyUntypedArray>()?)
}

fn converted(argument: &str, array: Bound<'_, PyUntypedArray>, colour: ColourRule) -> Outcome<AnyFrame> {
    check_size(argument, &array)?;
    let array = exact_samples(argument, array)?;
    let shape = array.shape().to_vec();
    match shape[..] {
        [height, width] => {
            let size = (width, height);
            grey::<u8>(&array, size)
                .or_else(|| grey::<u16>(&array, size))
                .or_else(|| grey::<f32>(&array, size))
                .or_else(|| grey::<f64>(&array, size))
                .unwrap_or_else(|| Err(wrong_dtype(argument, &array).into()))
        }
        [height, width, channels @ (3 | 4)] if colour == ColourRule::Luminance => {
            let size = (width, height);
            luminance::<u8>(&array, size, channels)
                .or_else(|| luminance::<u16>(&array, size, channels))
                .or_else(|| luminance::<f32>(&array, size, channels))
                .or_else(|| luminance::<f64>(&array, size, channels))
                .unwrap_or_else(|| Err(wrong_dtype(argument, &array).into()))
        }
        [_, _, 3 | 4] => Err(PyValueError::new_err(format!(
            "{argument}: expected a grey frame (H, W), got a colour frame {}; \
             convert it with jacoflow.luminance(frame), or pass preprocess=Preprocess(colour=\"luminance\") where there is that option",
            shape_text(&shape)
        ))
        .into()),
        _ => {
            let message = format!("{argument}: expected a frame (H, W), got shape {}", shape_text(&shape));
            Err(PyValueError::new_err(message).into())
        }
    }
}

/// A frame of samples `T`; `None` where the array holds another type.
fn grey<T: Element + Sample>(
    array: &Bound<'_, PyUntypedArray>,
    (width, height): (usize, usize),
) -> Option<Outcome<AnyFrame>> {
    Some(Frame::new(width, height, elements::<T>(array)?).map(T::grey).map_err(Raised::from))
}

/// An interleaved colour frame as luminance.
fn luminance<T: Sample + Element>(
    array: &Bound<'_, PyUntypedArray>,
    (width, height): (usize, usize),
    channels: usize,
) -> Option<Outcome<AnyFrame>> {
    let grey = jacoflow::image::luminance(width, height, channels, &elements::<T>(array)?);
    Some(grey.map(T::grey).map_err(Raised::from))
}

/// `mask`: a boolean array `(H, W)`, true where pixels may be used.
pub fn mask(object: &Bound<'_, PyAny>) -> Outcome<Mask> {
    boolean("mask", object)
}

/// A boolean array `(H, W)`.
pub fn boolean(argument: &str, object: &Bound<'_, PyAny>) -> Outcome<Mask> {
    let array = as_array(argument, object)?;
    check_size(argument, &array)?;
    let [height, width] = array.shape()[..] else {
        let got = shape_text(array.shape());
        let moving = "for a mask that moves give the frames as masked arrays, numpy.ma.array(frames, mask=hidden)";
        let advice = if argument == "mask" && array.shape().len() == 3 { format!("; {moving}") } else { String::new() };
        return Err(PyValueError::new_err(format!("{argument}: expected shape (H, W), got {got}{advice}")).into());
    };
    let Some(values) = elements::<bool>(&array) else {
        return Err(PyTypeError::new_err(format!(
            "{argument}: expected a boolean array, true where pixels may be used, got {}",
            dtype_name(&array)
        ))
        .into());
    };
    Ok(Frame::new(width, height, values)?)
}

/// Whether `object` is an array of booleans.
pub fn is_boolean(object: &Bound<'_, PyAny>) -> Outcome<bool> {
    let Ok(array) = object.cast::<PyUntypedArray>() else { return Ok(false) };
    Ok(array.dtype().getattr("kind")?.extract::<String>()? == "b")
}

/// An `(N, 2)` array of integers.
pub fn integer_pairs(argument: &'static str, object: &Bound<'_, PyAny>) -> Outcome<Vec<(i64, i64)>> {
    let array = as_array(argument, object)?;
    check_size(argument, &array)?;
    let kind: String = array.dtype().getattr("kind")?.extract()?;
    if array.shape() == [0] {
        return Ok(Vec::new());
    }
    if !matches!(array.shape(), [_, 2]) {
        return Err(Error::argument(argument, "shape (N, 2), columns x and y", shape_text(array.shape())).into());
    }
    if !matches!(kind.as_str(), "i" | "u") {
        return Err(PyTypeError::new_err(format!("{argument}: expected integers, got {}", dtype_name(&array))).into());
    }
    let wide = array.call_method1("astype", ("int64",))?.cast_into::<PyUntypedArray>()?;
    let values = elements::<i64>(&wide).unwrap_or_default();
    Ok(values.as_chunks::<2>().0.iter().map(|&[x, y]| (x, y)).collect())
}

/// `length` or any number of doubles out of anything numpy can read as numbers.
pub fn doubles(argument: &'static str, object: &Bound<'_, PyAny>) -> Outcome<(Vec<usize>, Vec<f64>)> {
    let array = as_array(argument, object)?;
    check_size(argument, &array)?;
    let kind: String = array.dtype().getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "f" | "i" | "u") {
        return Err(not_real(argument, &array)?.into());
    }
    let wide = array.call_method1("astype", ("float64",))?.cast_into::<PyUntypedArray>()?;
    Ok((array.shape().to_vec(), elements::<f64>(&wide).unwrap_or_default()))
}

/// The answer to an array without numbers. Python's own integers can be too large for numpy, whose array of
/// objects says nothing about them.
fn not_real(argument: &str, array: &Bound<'_, PyUntypedArray>) -> Outcome<PyErr> {
    let refuse = |got: String| PyTypeError::new_err(format!("{argument}: expected real numbers, got {got}"));
    if dtype_name(array) != "object" {
        return Ok(refuse(dtype_name(array)));
    }
    for item in array.getattr("flat")?.try_iter()? {
        let item = item?;
        match item.extract::<f64>() {
            Ok(_) => {}
            Err(error) if error.is_instance_of::<PyOverflowError>(array.py()) => {
                let message = format!("{argument}: expected numbers up to 1.8e308, got {}", shown(&item));
                return Ok(PyValueError::new_err(message));
            }
            Err(_) => return Ok(refuse(kind_of(&item))),
        }
    }
    Ok(refuse("an array of objects".into()))
}

/// Two numbers, out of anything numpy can read as such.
pub fn pair(argument: &'static str, expected: &str, object: &Bound<'_, PyAny>) -> Outcome<(f64, f64)> {
    let (shape, values) = doubles(argument, object)?;
    match values[..] {
        [x, y] if shape == [2] => Ok((x, y)),
        _ => Err(Error::argument(argument, expected, format!("shape {}", shape_text(&shape))).into()),
    }
}

/// The name of an object's type, for messages.
pub fn kind_of(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "another object".into(), |name| name.to_string())
}

/// A new array that owns `values`, of the given shape, row-major.
pub fn owned<'py, T: Element>(py: Python<'py>, shape: &[usize], values: Vec<T>) -> Outcome<Bound<'py, PyAny>> {
    Ok(numpy::PyArray1::from_vec(py, values).reshape(shape)?.into_any())
}

/// A frame as a new array `(H, W)`.
pub fn from_frame<T: Element>(py: Python<'_>, frame: Frame<T>) -> Outcome<Bound<'_, PyAny>> {
    let (width, height) = frame.size();
    owned(py, &[height, width], frame.into_data())
}

/// A frame of any sample type as a new array `(H, W)`.
pub fn from_any_frame(py: Python<'_>, frame: AnyFrame) -> Outcome<Bound<'_, PyAny>> {
    match frame {
        AnyFrame::U8(frame) => from_frame(py, frame),
        AnyFrame::U16(frame) => from_frame(py, frame),
        AnyFrame::F32(frame) => from_frame(py, frame),
        AnyFrame::F64(frame) => from_frame(py, frame),
    }
}

/// A read-only view of `data` with the given shape and strides (in elements), kept alive by `owner`.
pub fn view<'py, T: Element>(
    owner: &Bound<'py, PyAny>,
    data: &[T],
    shape: &[usize],
    strides: &[usize],
) -> Outcome<Bound<'py, PyAny>> {
    if shape.contains(&0) {
        return Ok(PyArray::<T, _>::zeros(owner.py(), shape.into_dimension(), false).into_any());
    }
    let layout = shape.into_dimension().strides(strides.into_dimension());
    let array = ArrayView::from_shape(layout, data).map_err(|e| PyValueError::new_err(e.to_string()))?;
    // SAFETY: callers pass memory owned by the frozen Python object `owner`, which never reallocates or frees
    // it while it lives; `owner` becomes the base of the new array. The array is made read-only before anyone
    // sees it, and stays so, because its base offers no writable buffer.
    let array = unsafe { PyArrayDyn::borrow_from_array(&array, owner.clone()) };
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array.into_any())
}
