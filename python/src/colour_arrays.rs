//! Colour frames (H, W, 3) out of numpy arrays, and back.

use super::samples::exact_samples;
use super::{
    arrays::as_array, arrays::check_size, arrays::dtype_name, arrays::elements, arrays::owned, arrays::unmasked,
    arrays::wrong_dtype,
};
use crate::errors::{Outcome, Raised};
use jacoflow::error::shape_text;
use jacoflow::track::GreyLevels;
use jacoflow::types::{AnyColourFrame, ColourFrame, Frame, Sample};
use numpy::{Element, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// One frame `(H, W, 3)` of red, green and blue, in a type that holds its samples exactly.
pub fn colour_frame(argument: &str, object: &Bound<'_, PyAny>) -> Outcome<AnyColourFrame> {
    converted(argument, as_array(argument, object)?)
}

/// As [`colour_frame`], of masked arrays too, for trackers: see [`unmasked`].
pub fn tracked_colour_frame(argument: &str, object: &Bound<'_, PyAny>, levels: GreyLevels) -> Outcome<AnyColourFrame> {
    converted(argument, unmasked(argument, object, levels)?)
}

fn converted(argument: &str, array: Bound<'_, PyUntypedArray>) -> Outcome<AnyColourFrame> {
    check_size(argument, &array)?;
    let array = exact_samples(argument, array)?;
    match array.shape() {
        &[height, width, 3] => {
            let size = (width, height);
            pixels::<u8>(&array, size)
                .or_else(|| pixels::<u16>(&array, size))
                .or_else(|| pixels::<f32>(&array, size))
                .or_else(|| pixels::<f64>(&array, size))
                .unwrap_or_else(|| Err(wrong_dtype(argument, &array).into()))
        }
        [height, width] => Err(PyValueError::new_err(format!(
            "{argument}: expected a colour frame (H, W, 3), got a grey frame ({height}, {width}); colour is needed"
        ))
        .into()),
        shape => Err(PyValueError::new_err(format!(
            "{argument}: expected a colour frame (H, W, 3), got shape {} of {}",
            shape_text(shape),
            dtype_name(&array)
        ))
        .into()),
    }
}

/// A frame of pixels of type `T`; `None` if the array holds another type.
fn pixels<T: Element + Sample>(
    array: &Bound<'_, PyUntypedArray>,
    (width, height): (usize, usize),
) -> Option<Outcome<AnyColourFrame>> {
    let samples = elements::<T>(array)?;
    Some(Frame::new(width, height, samples.as_chunks::<3>().0.to_vec()).map(T::colour).map_err(Raised::from))
}

/// A frame of any sample type as a new array `(H, W, 3)`.
pub fn from_any_colour_frame(py: Python<'_>, frame: AnyColourFrame) -> Outcome<Bound<'_, PyAny>> {
    fn array<T: Element>(py: Python<'_>, frame: ColourFrame<T>) -> Outcome<Bound<'_, PyAny>> {
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
