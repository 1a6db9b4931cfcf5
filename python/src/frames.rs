//! `jacoflow.io`: frames in and out, grey or in colour.

use super::arrays::{self, ColourRule};
use super::{
    colour_arrays::colour_frame, colour_arrays::from_any_colour_frame, options, options::Integer, options::named,
};
use crate::errors::{Outcome, Raised};
use crate::image::renamed;
use crate::interrupt::abandonable;
use jacoflow::error::Error;
use jacoflow::io::{
    Colour, ColourSource, FrameSink, FrameSource, Grey, OpenOptions, PixelSize, PlaneSelection, Slices, kind_of, open,
    open_colour, open_colour_sink, open_sink, read_plane,
};
use jacoflow::types::{AnyColourFrame, AnyFrame};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Which frames are read, and what is done with pictures of the other kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reading {
    /// (H, W).
    Grey(ColourRule),
    /// (H, W, 3).
    Rgb(Grey),
}

impl Reading {
    /// `colour=None | "error" | "luminance" | "rgb"`, `grey=None | "error" | "repeat"`.
    fn parse(colour: Option<&str>, grey: Option<&str>) -> Outcome<Self> {
        let refused = |argument, expected: &str, got: String| Err(Error::argument(argument, expected, got).into());
        match (colour, grey) {
            (Some("rgb"), None | Some("error")) => Ok(Self::Rgb(Grey::Error)),
            (Some("rgb"), Some("repeat")) => Ok(Self::Rgb(Grey::Repeat)),
            (Some("rgb"), Some(other)) => refused("grey", "\"error\" or \"repeat\"", format!("{other:?}")),
            (_, Some(other)) => refused("grey", "None unless colour=\"rgb\"", format!("{other:?}")),
            (None | Some("error"), None) => Ok(Self::Grey(ColourRule::Refuse)),
            (Some("luminance"), None) => Ok(Self::Grey(ColourRule::Luminance)),
            (Some(other), None) => refused("colour", "\"error\", \"luminance\" or \"rgb\"", format!("{other:?}")),
        }
    }

    /// The policy for colour of a grey reading.
    fn colour(self) -> Colour {
        if self == Self::Grey(ColourRule::Luminance) { Colour::Luminance } else { Colour::Error }
    }
}

/// Frames of either kind.
enum Source {
    Grey(Box<dyn FrameSource>),
    Rgb(Box<ColourSource>),
}

/// A frame of either kind.
enum AnyKind {
    Grey(AnyFrame),
    Rgb(AnyColourFrame),
}

impl AnyKind {
    fn into_array(self, py: Python<'_>) -> Outcome<Bound<'_, PyAny>> {
        match self {
            Self::Grey(frame) => arrays::from_any_frame(py, frame),
            Self::Rgb(frame) => from_any_colour_frame(py, frame),
        }
    }
}

impl Source {
    fn open(spec: &str, reading: Reading, options: &OpenOptions) -> jacoflow::Result<Self> {
        let mut options = *options;
        Ok(match reading {
            Reading::Grey(_) => {
                options.colour = reading.colour();
                Self::Grey(open(spec, &options)?)
            }
            Reading::Rgb(grey) => {
                options.grey = grey;
                Self::Rgb(open_colour(spec, &options)?)
            }
        })
    }
    fn next_frame(&mut self) -> jacoflow::Result<Option<AnyKind>> {
        match self {
            Self::Grey(source) => Ok(source.next_frame()?.map(AnyKind::Grey)),
            Self::Rgb(source) => Ok(source.next_frame()?.map(AnyKind::Rgb)),
        }
    }
    fn len_hint(&self) -> Option<usize> {
        match self {
            Self::Grey(source) => source.len_hint(),
            Self::Rgb(source) => source.len_hint(),
        }
    }
    fn frame_rate(&self) -> Option<f64> {
        match self {
            Self::Grey(source) => source.frame_rate(),
            Self::Rgb(source) => source.frame_rate(),
        }
    }
    fn time(&self) -> Option<f64> {
        match self {
            Self::Grey(source) => source.time(),
            Self::Rgb(source) => source.time(),
        }
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        match self {
            Self::Grey(source) => source.pixel_size(),
            Self::Rgb(source) => source.pixel_size(),
        }
    }
}

/// Frames (H, W), or (H, W, 3) with colour="rgb", one by one; what `jacoflow.io.FrameReader` wraps.
#[pyclass(module = "jacoflow._jacoflow", name = "_FrameSource", frozen)]
pub struct PyFrameSource {
    source: Arc<Mutex<Source>>,
}

impl PyFrameSource {
    fn ask<T: Send>(&self, py: Python<'_>, question: impl FnOnce(&mut Source) -> T + Send) -> T {
        py.detach(move || question(&mut self.source.lock().unwrap_or_else(PoisonError::into_inner)))
    }
}

#[pymethods]
impl PyFrameSource {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyAny>>> {
        py.check_signals()?;
        let source = Arc::clone(&self.source);
        let frame = abandonable(py, move || source.lock().unwrap_or_else(PoisonError::into_inner).next_frame())?;
        frame.map(|frame| frame.into_array(py)).transpose()
    }

    /// Frames left (a count, no unit), where that is known without reading them, else 0.
    fn __length_hint__(&self, py: Python<'_>) -> usize {
        self.ask(py, |source| source.len_hint().unwrap_or(0))
    }

    /// Frames per second, where the source says so, else None.
    #[getter]
    fn frame_rate(&self, py: Python<'_>) -> Option<f64> {
        self.ask(py, |source| source.frame_rate())
    }

    /// Time of the frame read last, s, where the source says so, else None.
    #[getter]
    fn time(&self, py: Python<'_>) -> Option<f64> {
        self.ask(py, |source| source.time())
    }

    /// Width and height of a pixel in `length_unit`, where the source says so, else None.
    #[getter]
    fn pixel_pitch(&self, py: Python<'_>) -> Option<(f64, f64)> {
        self.ask(py, |source| source.pixel_size()).map(|size| size.pitch)
    }

    /// Unit of `pixel_pitch` as the source spells it, else None.
    #[getter]
    fn length_unit(&self, py: Python<'_>) -> Option<String> {
        self.ask(py, |source| source.pixel_size()).map(|size| size.unit)
    }
}

/// `channel=None | N`, `z=None | N | "time"`.
fn plane_selection(channel: Option<Integer>, z: Option<&Bound<'_, PyAny>>) -> Outcome<PlaneSelection> {
    let channel = channel.map(|channel| options::natural("channel", channel)).transpose()?;
    let slices = |z: &Bound<'_, PyAny>| match z.extract::<Integer>() {
        Ok(index) => Ok(Slices::Index(options::natural("z", index)?)),
        Err(_) if z.extract::<String>().is_ok_and(|word| word == "time") => Ok(Slices::AsTime),
        Err(_) => Err(Error::argument("z", "an index from 0 or \"time\"", z.repr().map_err(Raised::from)?).into()),
    };
    let z: Outcome<Option<Slices>> = z.map(slices).transpose();
    Ok(PlaneSelection { channel, z: z? })
}

/// The options of `jacoflow.io.frames`, checked.
fn request(
    colour: Option<&str>,
    grey: Option<&str>,
    channel: Option<Integer>,
    z: Option<&Bound<'_, PyAny>>,
    start: Integer,
    stop: Option<Integer>,
    step: Integer,
) -> Outcome<(Reading, OpenOptions)> {
    let reading = Reading::parse(colour, grey)?;
    let mut options = OpenOptions { planes: plane_selection(channel, z)?, ..OpenOptions::default() };
    options.start = options::natural("start", start)?;
    options.stop = stop.map(|n| options::natural("stop", n)).transpose()?;
    options.step = options::count("step", step)?;
    Ok((reading, options))
}

/// The name of the kind of source that would be opened, None where there is nothing or the name is not UTF-8;
/// checks the options.
#[pyfunction(name = "_kind_of")]
#[pyo3(signature = (source, colour, grey, channel, z, start, stop, step))]
#[expect(clippy::too_many_arguments, reason = "the options of jacoflow.io.frames")]
pub fn source_kind(
    #[pyo3(from_py_with = named::source)] source: PathBuf,
    #[pyo3(from_py_with = named::colour)] colour: Option<&str>,
    #[pyo3(from_py_with = named::grey)] grey: Option<&str>,
    #[pyo3(from_py_with = named::channel)] channel: Option<Integer>,
    z: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = named::start)] start: Integer,
    #[pyo3(from_py_with = named::stop)] stop: Option<Integer>,
    #[pyo3(from_py_with = named::step)] step: Integer,
) -> Outcome<Option<&'static str>> {
    request(colour, grey, channel, z, start, stop, step)?;
    Ok(source.to_str().and_then(kind_of))
}

/// A path as the text that names sources and sinks; refused where it is not UTF-8, as a replaced character
/// would name another file.
fn in_utf8(argument: &'static str, path: &Path) -> Outcome<String> {
    let expected = "a name in UTF-8 (rename the file, or pass the folder that holds it)";
    match path.to_str() {
        Some(text) => Ok(text.into()),
        None => Err(Error::argument(argument, expected, path.display()).into()),
    }
}

/// Opens a frame source.
#[pyfunction(name = "_open_frames")]
#[pyo3(signature = (source, colour, grey, channel, z, start, stop, step))]
#[expect(clippy::too_many_arguments, reason = "the options of jacoflow.io.frames")]
pub fn open_frames(
    py: Python<'_>,
    #[pyo3(from_py_with = named::source)] source: PathBuf,
    #[pyo3(from_py_with = named::colour)] colour: Option<&str>,
    #[pyo3(from_py_with = named::grey)] grey: Option<&str>,
    #[pyo3(from_py_with = named::channel)] channel: Option<Integer>,
    z: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = named::start)] start: Integer,
    #[pyo3(from_py_with = named::stop)] stop: Option<Integer>,
    #[pyo3(from_py_with = named::step)] step: Integer,
) -> Outcome<PyFrameSource> {
    let (reading, options) = request(colour, grey, channel, z, start, stop, step)?;
    let spec = in_utf8("source", &source)?;
    let source = abandonable(py, move || Source::open(&spec, reading, &options))?;
    Ok(PyFrameSource { source: Arc::new(Mutex::new(source)) })
}

/// Writes frames to a sink: the first one says whether they are grey or in colour.
#[pyfunction(name = "_write_frames")]
pub fn write_frames(
    py: Python<'_>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    frames: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = named::frame_rate)] frame_rate: f64,
) -> Outcome<usize> {
    let spec = in_utf8("path", &path)?;
    let mut items = frames.try_iter()?;
    let first = items.next().ok_or_else(|| Error::argument("frames", "at least one frame (H, W)", "none"))??;
    let is_colour = arrays::as_array("frames", &first)?.ndim() == 3;
    let items = std::iter::once(Ok(first)).chain(items);
    let named = |error: Error| renamed(error, "output", "path");
    if is_colour {
        write_all(py, items, open_colour_sink(&spec, frame_rate).map_err(named)?, |item| colour_frame("frames", item))
    } else {
        write_all(py, items, open_sink(&spec, frame_rate).map_err(named)?, |item| {
            arrays::frame("frames", item, ColourRule::Refuse)
        })
    }
}

fn write_all<'py, F: Send + Sync>(
    py: Python<'py>,
    items: impl Iterator<Item = PyResult<Bound<'py, PyAny>>>,
    mut sink: Box<dyn FrameSink<F>>,
    frame: impl Fn(&Bound<'py, PyAny>) -> Outcome<F>,
) -> Outcome<usize> {
    let mut count = 0;
    for item in items {
        py.check_signals()?;
        let frame = frame(&item?)?;
        py.detach(|| sink.write(&frame))?;
        count += 1;
    }
    py.detach(|| sink.finish())?;
    Ok(count)
}

/// Reads an image file.
#[pyfunction(name = "_read_image")]
#[pyo3(signature = (path, colour, grey, channel, z))]
pub fn read_one_image<'py>(
    py: Python<'py>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    #[pyo3(from_py_with = named::colour)] colour: Option<&str>,
    #[pyo3(from_py_with = named::grey)] grey: Option<&str>,
    #[pyo3(from_py_with = named::channel)] channel: Option<Integer>,
    z: Option<&Bound<'py, PyAny>>,
) -> Outcome<Bound<'py, PyAny>> {
    let reading = Reading::parse(colour, grey)?;
    let planes = plane_selection(channel, z)?;
    let frame = abandonable(py, move || match reading {
        Reading::Grey(_) => read_plane(&path, reading.colour(), planes).map(AnyKind::Grey),
        Reading::Rgb(grey) => read_plane(&path, grey, planes).map(AnyKind::Rgb),
    })?;
    frame.into_array(py)
}
