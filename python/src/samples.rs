//! Arrays of any sample type as arrays of the types that the core has, where these hold the samples exactly.

use crate::errors::Outcome;
use jacoflow::types::{AnyFrame, LARGEST_EXACT_INTEGER, Sample};
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};

/// Whether the object is a numpy array with a mask of its own.
pub fn is_masked(object: &Bound<'_, PyAny>) -> Outcome<bool> {
    Ok(object.is_instance_of::<PyUntypedArray>() && object.hasattr("mask")?)
}

/// A grey or colour frame's samples in a type of the core's, where that holds them exactly: bool as uint8,
/// int8, int16 and float16 as float32, wider integers as float64. Masked samples become NaN, those of masked
/// uint8 and uint16 arrays in float32. Arrays of other types stay as they are.
/// ValueError for an integer beyond 2^53.
pub fn exact_samples<'py>(argument: &str, array: Bound<'py, PyUntypedArray>) -> Outcome<Bound<'py, PyUntypedArray>> {
    let masked = is_masked(&array)?;
    let (kind, size) = (array.dtype().kind(), array.dtype().itemsize());
    let wanted = match (kind, size) {
        (b'b', _) if !masked => "uint8",
        (b'i', 1 | 2) | (b'f', 2) => "float32",
        (b'i' | b'u', 4 | 8) => "float64",
        (b'b' | b'u', 1 | 2) | (b'f', 4) if masked => "float32",
        (b'f', 8) if masked => "float64",
        _ => return Ok(array),
    };
    if matches!(kind, b'i' | b'u') && size == 8 {
        expect_exact(argument, &array, masked)?;
    }
    let converted = array.call_method1("astype", (wanted,))?;
    let converted = if masked { converted.call_method1("filled", (f64::NAN,))? } else { converted };
    Ok(converted.cast_into::<PyUntypedArray>()?)
}

/// The type in which the samples of a frame were given: integers of a masked array are floats in the frame.
pub fn sample_type(object: &Bound<'_, PyAny>, frame: &AnyFrame) -> Outcome<&'static str> {
    if !is_masked(object)? {
        return Ok(frame.dtype());
    }
    let dtype = object.cast::<PyUntypedArray>()?.dtype();
    Ok(match (dtype.kind(), dtype.itemsize()) {
        (b'b', _) | (b'u', 1) => u8::DTYPE,
        (b'u', 2) => u16::DTYPE,
        _ => frame.dtype(),
    })
}

/// Refuses integers that float64 does not hold.
fn expect_exact(argument: &str, array: &Bound<'_, PyUntypedArray>, masked: bool) -> Outcome<()> {
    let numbers = if masked { array.call_method0("compressed")? } else { array.clone().into_any() };
    if numbers.getattr("size")?.extract::<usize>()? == 0 {
        return Ok(());
    }
    for extreme in ["min", "max"] {
        let value: i128 = numbers.call_method0(extreme)?.extract()?;
        if value.unsigned_abs() > u128::from(LARGEST_EXACT_INTEGER) {
            return Err(PyValueError::new_err(format!(
                "{argument}: expected integers of at most 2^53, which float64 holds exactly, got {value} ({})",
                array.dtype()
            ))
            .into());
        }
    }
    Ok(())
}

/// Refuses what is no array: the name of a file, None, a dictionary, an object without values.
pub fn refuse_non_array(argument: &str, object: &Bound<'_, PyAny>) -> Outcome<()> {
    if object.is_instance_of::<PyString>() || object.hasattr("__fspath__")? {
        return Err(PyTypeError::new_err(format!(
            "{argument}: expected an array, got the name of a file ({}); open it with jacoflow.io.frames(path)",
            object.str()?
        ))
        .into());
    }
    let has_values = ["__array__", "__array_interface__", "__len__", "__iter__", "__float__"];
    let holds_none = || has_values.iter().all(|name| !object.hasattr(*name).unwrap_or(true));
    if object.is_none() || object.is_instance_of::<PyDict>() || holds_none() {
        let got = if object.is_none() { "None".into() } else { object.get_type().name()?.to_string() };
        return Err(PyTypeError::new_err(format!("{argument}: expected an array, got {got}")).into());
    }
    Ok(())
}
