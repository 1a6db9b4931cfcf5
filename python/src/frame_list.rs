//! A sequence of frames as Python gives it: a stack, a list, an iterator, or a reader of a file.

use super::arrays::{ColourRule, native, typed_frame};
use super::samples::refuse_non_array;
use crate::errors::Outcome;
use jacoflow::error::shape_text;
use jacoflow::types::AnyFrame;
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};

/// What came as `frames`: a stack along the first axis, or a list or tuple of separate frames.
pub struct Frames<'py> {
    object: Bound<'py, PyAny>,
    colour: ColourRule,
    /// Number of frames.
    pub count: usize,
    /// What each is called in messages; "frames" where there are no names.
    names: &'static [&'static str],
    /// What the file says, where they come from one.
    pub noted: Noted,
}

/// What a file says of its frames.
#[derive(Default)]
pub struct Noted {
    /// Frames per second; without times.
    pub frame_rate: Option<f64>,
    /// When each frame was taken, s; empty unless it is known of all.
    pub times: Vec<f64>,
    /// Width and height of a pixel, and their unit.
    pub pixel_size: Option<((f64, f64), Option<String>)>,
}

impl Noted {
    /// The frames that are left in a `FrameReader`, and what is noted of them.
    fn read<'py>(reader: &Bound<'py, PyAny>) -> Outcome<(Bound<'py, PyList>, Self)> {
        let frames = PyList::empty(reader.py());
        let mut times: Vec<Option<f64>> = Vec::new();
        for frame in reader.try_iter()? {
            frames.append(frame?)?;
            times.push(reader.getattr("time")?.extract()?);
        }
        let pitch: Option<(f64, f64)> = reader.getattr("pixel_pitch")?.extract()?;
        let unit = reader.getattr("length_unit")?.extract()?;
        let noted = Self {
            frame_rate: reader.getattr("frame_rate")?.extract()?,
            times: times.into_iter().collect::<Option<_>>().unwrap_or_default(),
            pixel_size: pitch.map(|pitch| (pitch, unit)),
        };
        Ok((frames, noted))
    }
}

impl<'py> Frames<'py> {
    /// Checks the outer shape; each frame is converted when it is needed, so that a long stack is never
    /// copied whole.
    pub fn new(object: &Bound<'py, PyAny>, colour: ColourRule) -> Outcome<Self> {
        let is_sequence = object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>();
        if is_sequence {
            return Ok(Self::of(object.clone(), object.len()?, colour));
        }
        refuse_non_array("frames", object)?;
        let reader = object.py().import("jacoflow._readers")?.getattr("FrameReader")?;
        if object.is_instance(&reader)? {
            let (list, noted) = Noted::read(object)?;
            return Ok(Self { noted, ..Self::of(list.as_any().clone(), list.len(), colour) });
        }
        if is_iterable(object)? {
            let list = object.try_iter()?.collect::<PyResult<Vec<_>>>()?;
            let list = PyList::new(object.py(), list)?;
            return Ok(Self::of(list.as_any().clone(), list.len(), colour));
        }
        let array = native("frames", object)?;
        let shape = array.shape().to_vec();
        let wanted = match colour {
            ColourRule::Refuse => "a list of frames (H, W) or a stack (T, H, W)",
            ColourRule::Luminance => "a list of frames or a stack (T, H, W) or (T, H, W, 3 or 4)",
        };
        let refuse = |advice: &str| {
            let shown = shape_text(&shape);
            let message = format!("frames: expected {wanted}, got an array of shape {shown}{advice}");
            Err(PyValueError::new_err(message).into())
        };
        match shape[..] {
            [_, rows, 3 | 4] if rows > 4 => refuse(
                ", which looks like one colour image; pass a list of frames, or a stack (T, H, W, 3) with preprocess=Preprocess(colour=\"luminance\")",
            ),
            [count, _, _] => Ok(Self::of(array.into_any(), count, colour)),
            [count, _, _, 3 | 4] if colour == ColourRule::Luminance => Ok(Self::of(array.into_any(), count, colour)),
            [_, _, _, 3 | 4] => refuse("; for colour frames pass preprocess=Preprocess(colour=\"luminance\")"),
            _ => refuse(""),
        }
    }

    fn of(object: Bound<'py, PyAny>, count: usize, colour: ColourRule) -> Self {
        Self { object, colour, count, names: &[], noted: Noted::default() }
    }

    /// The same, of frames that are arguments of their own.
    pub fn named(self, names: &'static [&'static str]) -> Self {
        Self { names, ..self }
    }

    /// Frame `index`, and the type in which its samples were given.
    pub fn get(&self, index: usize) -> Outcome<(AnyFrame, &'static str)> {
        typed_frame(self.name(index), &self.object.get_item(index)?, self.colour)
    }

    /// What frame `index` is called in messages.
    pub fn name(&self, index: usize) -> &'static str {
        self.names.get(index).copied().unwrap_or("frames")
    }
}

/// Whether an object has items and is no array.
fn is_iterable(object: &Bound<'_, PyAny>) -> Outcome<bool> {
    let is_array = object.hasattr("__array__")? || object.hasattr("__array_interface__")?;
    let is_text = object.is_instance_of::<PyString>() || object.hasattr("__fspath__")?;
    Ok(!is_array && !is_text && object.try_iter().is_ok())
}
