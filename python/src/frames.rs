//! `jacoflow.io`: frames in and out, grey or in colour.

use super::arrays::{self, ColourRule};
use super::{
    colour_arrays::colour_frame, colour_arrays::from_any_colour_frame, options, options::Integer, options::named,
};
use crate::errors::Outcome;
use crate::image::renamed;
use crate::interrupt::abandonable;
use jacoflow::error::Error;
use jacoflow::io::{
    Colour, ColourSource, FrameSink, FrameSource, Grey, OpenOptions, open, open_colour, open_colour_sink, open_sink,
    read_image,
};
use jacoflow::types::{AnyColourFrame, AnyFrame};
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

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

    /// The words that [`Reading::parse`] reads.
    fn words(self) -> (Option<&'static str>, Option<&'static str>) {
        match self {
            Self::Grey(ColourRule::Refuse) => (None, None),
            Self::Grey(ColourRule::Luminance) => (Some("luminance"), None),
            Self::Rgb(Grey::Error) => (Some("rgb"), None),
            Self::Rgb(Grey::Repeat) => (Some("rgb"), Some("repeat")),
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
}

/// Reads frames (H, W), or (H, W, 3) with colour="rgb", one by one from the source of
/// `jacoflow.io.frames`; memory stays bounded. Samples keep the file's dtype and grey levels.
#[pyclass(module = "jacoflow.io", frozen)]
pub struct FrameReader {
    spec: String,
    reading: Reading,
    options: OpenOptions,
    place: Arc<Mutex<Place>>,
}

struct Place {
    source: Source,
    delivered: usize,
}

impl FrameReader {
    /// The place, once no other thread reads.
    fn lock(&self) -> MutexGuard<'_, Place> {
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl FrameReader {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyAny>>> {
        py.check_signals()?;
        let place = Arc::clone(&self.place);
        let frame = abandonable(py, move || {
            let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
            let frame = place.source.next_frame()?;
            place.delivered += usize::from(frame.is_some());
            Ok(frame)
        })?;
        frame.map(|frame| frame.into_array(py)).transpose()
    }

    /// Frames left (a count, no unit), where that is known without reading them, else 0.
    fn __length_hint__(&self, py: Python<'_>) -> usize {
        py.detach(|| self.lock().source.len_hint().unwrap_or(0))
    }

    /// Frames per second, where the source says so, else None.
    #[getter]
    fn frame_rate(&self, py: Python<'_>) -> Option<f64> {
        py.detach(|| self.lock().source.frame_rate())
    }

    fn __repr__(&self) -> String {
        format!("FrameReader({:?})", self.spec)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> Outcome<(Bound<'py, PyAny>, (String, Option<&str>, Option<&str>, usize, Option<usize>, usize))> {
        if self.spec == "-" {
            return Err(PyTypeError::new_err("standard input cannot be pickled").into());
        }
        let delivered = py.detach(|| self.lock().delivered);
        let OpenOptions { start, stop, step, .. } = self.options;
        let (colour, grey) = self.reading.words();
        let reopen = py.import("jacoflow._jacoflow")?.getattr("_open_frames")?;
        Ok((reopen, (self.spec.clone(), colour, grey, start + delivered * step, stop, step)))
    }
}

/// Opens a frame source.
#[pyfunction(name = "_open_frames")]
#[pyo3(signature = (spec, colour, grey, start, stop, step))]
pub fn open_frames(
    py: Python<'_>,
    spec: PathBuf,
    colour: Option<&str>,
    grey: Option<&str>,
    start: Integer,
    stop: Option<Integer>,
    step: Integer,
) -> Outcome<FrameReader> {
    let reading = Reading::parse(colour, grey)?;
    let mut options = OpenOptions::default();
    options.start = options::natural("start", start)?;
    options.stop = stop.map(|n| options::natural("stop", n)).transpose()?;
    options.step = options::count("step", step)?;
    let spec = spec.to_string_lossy().into_owned();
    let opened = spec.clone();
    let source = abandonable(py, move || Source::open(&opened, reading, &options))?;
    Ok(FrameReader { spec, reading, options, place: Arc::new(Mutex::new(Place { source, delivered: 0 })) })
}

/// Writes frames to a sink: the first one says whether they are grey or in colour.
#[pyfunction(name = "_write_frames")]
pub fn write_frames(
    py: Python<'_>,
    path: PathBuf,
    frames: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = named::frame_rate)] frame_rate: f64,
) -> Outcome<usize> {
    let spec = path.to_string_lossy().into_owned();
    let mut items = frames.try_iter()?;
    let first = items.next().transpose()?;
    let is_colour = match &first {
        Some(first) => arrays::as_array("frames", first)?.ndim() == 3,
        None => false,
    };
    let items = first.into_iter().map(Ok).chain(items);
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
#[pyo3(signature = (path, colour, grey))]
pub fn read_one_image<'py>(
    py: Python<'py>,
    path: PathBuf,
    colour: Option<&str>,
    grey: Option<&str>,
) -> Outcome<Bound<'py, PyAny>> {
    let reading = Reading::parse(colour, grey)?;
    let frame = abandonable(py, move || match reading {
        Reading::Grey(_) => read_image(&path, reading.colour()).map(AnyKind::Grey),
        Reading::Rgb(grey) => read_image(&path, grey).map(AnyKind::Rgb),
    })?;
    frame.into_array(py)
}
