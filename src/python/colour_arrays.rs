//! Colour frames (H, W, 3) out of numpy arrays, and back.

use super::{arrays::as_array, arrays::dtype_name, arrays::elements, arrays::owned, arrays::wrong_dtype};
use crate::types::{AnyColourFrame, ColourFrame, Frame};
use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// One frame `(H, W, 3)` of red, green and blue.
pub fn colour_frame(argument: &str, object: &Bound<'_, PyAny>) -> PyResult<AnyColourFrame> {
    let array = as_array(argument, object)?;
    match array.shape() {
        &[height, width, 3] => {
            let size = (width, height);
            let of_any_type = || {
                pixels::<u8>(&array, size)
                    .map(|frame| frame.map(AnyColourFrame::U8))
                    .or_else(|| Some(pixels::<u16>(&array, size)?.map(AnyColourFrame::U16)))
                    .or_else(|| Some(pixels::<f32>(&array, size)?.map(AnyColourFrame::F32)))
                    .or_else(|| Some(pixels::<f64>(&array, size)?.map(AnyColourFrame::F64)))
            };
            of_any_type().unwrap_or_else(|| Err(wrong_dtype(argument, &array)))
        }
        [height, width] => Err(PyValueError::new_err(format!(
            "{argument}: expected a colour frame (H, W, 3), got a grey frame ({height}, {width}); colour is needed"
        ))),
        shape => Err(PyValueError::new_err(format!(
            "{argument}: expected a colour frame (H, W, 3), got shape {shape:?} of {}",
            dtype_name(&array)
        ))),
    }
}

/// A frame of pixels of type `T`; `None` if the array holds another type.
fn pixels<T: Element + Copy + 'static>(
    array: &Bound<'_, PyUntypedArray>,
    (width, height): (usize, usize),
) -> Option<PyResult<ColourFrame<T>>> {
    let samples = elements::<T>(array)?;
    Some(Frame::new(width, height, samples.as_chunks::<3>().0.to_vec()).map_err(PyErr::from))
}

/// A frame of any sample type as a new array `(H, W, 3)`.
pub fn from_any_colour_frame(py: Python<'_>, frame: AnyColourFrame) -> PyResult<Bound<'_, PyAny>> {
    fn array<T: Element>(py: Python<'_>, frame: ColourFrame<T>) -> PyResult<Bound<'_, PyAny>> {
        let (width, height) = frame.size();
        owned(py, &[height, width, 3], frame.into_data().into_flattened())
    }
    match frame {
        AnyColourFrame::U8(frame) => array(py, frame),
        AnyColourFrame::U16(frame) => array(py, frame),
        AnyColourFrame::F32(frame) => array(py, frame),
        AnyColourFrame::F64(frame) => array(py, frame),
    }
}
