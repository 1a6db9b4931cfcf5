//! `estimate` and `flow`, and in `stream` `FlowEstimator`.

mod arguments;
mod stream;

use super::field::{FlowField, Packed};
use super::keywords::with_common;
use super::options::{Integer, Object, named};
use super::progress::Reporter;
use crate::errors::Outcome;
use crate::frame_list::Frames;
use crate::image::renamed;
use crate::interrupt::interruptible;
use arguments::{Arguments, estimator_options};
use jacoflow::error::{Error, check_memory};
use jacoflow::temporal::AnyFlowStream;
use jacoflow::types::{AnyField, FlowField as Field};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

pub use stream::{FlowEstimator, restore_estimator};

/// Fields of a stack as they come.
pub enum Growing {
    /// Of no field yet.
    None,
    /// f32 planes.
    Single(Packed<f32>),
    /// f64 planes.
    Double(Packed<f64>),
}

impl Growing {
    /// Adds the next field.
    pub fn add(&mut self, field: AnyField) -> jacoflow::Result<()> {
        match (&mut *self, field) {
            (Self::Single(packed), AnyField::Single(field)) => packed.append(field),
            (Self::Double(packed), AnyField::Double(field)) => packed.append(field),
            (_, AnyField::Single(field)) => {
                *self = Self::Single(Packed::one(field));
                Ok(())
            }
            (_, AnyField::Double(field)) => {
                *self = Self::Double(Packed::one(field));
                Ok(())
            }
        }
    }

    /// Adds fields without an estimate, like `field`, for the frames up to `frame`.
    fn fill(&mut self, field: &AnyField, frame: usize) -> jacoflow::Result<()> {
        let first = match self {
            Self::None => 0,
            Self::Single(packed) => packed.count,
            Self::Double(packed) => packed.count,
        };
        (first..frame).try_for_each(|index| {
            self.add(match field {
                AnyField::Single(field) => AnyField::Single(field.missing(index)),
                AnyField::Double(field) => AnyField::Double(field.missing(index)),
            })
        })
    }

    /// The stack.
    pub fn finish(self) -> Outcome<FlowField> {
        match self {
            Self::Single(packed) => Ok(FlowField::stack(packed)),
            Self::Double(packed) => Ok(FlowField::stack(packed)),
            Self::None => Err(Error::Numerical("no field came of the frames".into()).into()),
        }
    }
}

/// What a stack has at frames without an estimate.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ends {
    /// NaN.
    Missing,
    /// No field.
    Dropped,
}

impl Ends {
    fn parse(word: &str) -> Outcome<Self> {
        match word {
            "nan" => Ok(Self::Missing),
            "drop" => Ok(Self::Dropped),
            other => Err(Error::argument("ends", "\"nan\" or \"drop\"", format!("{other:?}")).into()),
        }
    }
}

/// Refuses fewer frames than a field needs.
fn check_count(frames: &Frames<'_>, stream: &AnyFlowStream) -> Outcome<()> {
    let needed = stream.plan().estimator().frames_needed();
    if frames.count < needed {
        let got = if frames.count == 1 { "1 frame".into() } else { format!("{} frames", frames.count) };
        return Err(Error::argument("frames", format!("at least {needed} frames"), got).into());
    }
    Ok(())
}

/// What the motion and the covariance of a field take.
fn bytes(field: &AnyField) -> usize {
    fn planes<T>(field: &Field<T>) -> usize {
        size_of_val(&field.motion[..]) + field.covariance.as_ref().map_or(0, |planes| size_of_val(&planes[..]))
    }
    match field {
        AnyField::Single(field) => planes(field),
        AnyField::Double(field) => planes(field),
    }
}

/// The fields of a whole sequence.
fn run(
    py: Python<'_>,
    (frames, times): (&Frames<'_>, &[f64]),
    (stream, ends): (&mut AnyFlowStream, Ends),
    progress: &Reporter<'_>,
) -> Outcome<FlowField> {
    check_count(frames, stream)?;
    let mut fields = Growing::None;
    let mut last = None;
    for index in 0..frames.count {
        let (frame, dtype) = frames.get(index)?;
        let time = times.get(index).copied();
        let mut field =
            interruptible(py, || stream.push_at(frame, dtype, time).map_err(|error| renamed(error, "time", "frames")))?;
        if ends == Ends::Missing && index == 1 && field.is_none() {
            field = interruptible(py, || stream.first_step())?;
        }
        progress.step(index + 1, frames.count)?;
        let Some(field) = field else { continue };
        if matches!(fields, Growing::None) {
            check_memory("frames", bytes(&field).checked_mul(frames.count))?;
        }
        if ends == Ends::Missing {
            fields.fill(&field, field.frame_index())?;
        }
        if index + 1 == frames.count {
            last = Some(field.clone());
        }
        fields.add(field)?;
    }
    if let Some(field) = last.filter(|_| ends == Ends::Missing) {
        fields.fill(&field, frames.count)?;
    }
    fields.finish()
}

/// `estimate` with the options as keywords.
macro_rules! define_estimate {
    ([] $($option:ident: $kept:ty as $taken:ty = $default:tt,)*) => {
        /// Flow, its Jacobian and their covariance at every frame of a sequence.
        ///
        /// T frames give a FlowField of T fields, (T, H, W), in any container: field t belongs to frame
        /// t. Frames at the ends that lack a neighbour have NaN and the status MISSING_FRAME: with the
        /// default method, which gives the step to the next frame, the last; the first step is estimated
        /// from its two frames. Two frames are estimated as a pair (every method but "instantaneous").
        /// For one field from two or three frames see `flow`. Frames are uint8, uint16, float32 or float64 in
        /// any grey scale: the intensity gain does not change the flow. Other types are converted where that
        /// is exact: bool to uint8, int8, int16 and float16 to float32, wider integers up to 2^53 to float64.
        /// Pixels that a masked array hides are not used. float64 is computed in float64, everything else in
        /// float32. Inputs are never modified.
        ///
        /// Parameters
        /// ----------
        /// frames : array (T, H, W), list, tuple or iterator of arrays (H, W), or `jacoflow.io.frames(...)`
        ///     Oldest first, one size, at least 3 x 3 px (`coarse_to_fine` finds nothing in frames less than
        ///     5 px wide or high). `fps` and `pixel_pitch` are by default those of the file that
        ///     `jacoflow.io.frames` reads, where it notes them; each field of a video is then by the time
        ///     between its own frames.
        /// ends : "nan" (default) or "drop"
        ///     "drop" leaves out the frames at the ends that lack a neighbour: two frames give one field,
        ///     three or more (T - 2, H, W), or (T - 1, H, W) with the time scheme "pair".
        /// pairs : bool
        ///     Frames of double-frame recordings, 0 and 1, 2 and 3, ...: T / 2 fields, none between pairs.
        ///     Frames in two folders or stacks: `jacoflow.flow(a, b)` for each pair.
        /// method : "coarse_to_fine", "windowed", "instantaneous", "lucas_kanade", "horn_schunck", or options
        ///     A name means the method with its defaults; `CoarseToFine` (default), `Windowed`,
        ///     `Instantaneous`, `LucasKanade` and `HornSchunck` hold its options and say what it is for.
        /// initial : array (H, W, 2) of (u, v), px/frame, or `FlowField` of one frame
        ///     Flow from elsewhere (a network, a PIV code, the frame before). "coarse_to_fine" starts from it
        ///     where the frames agree better with it than with their own flow, and refines it. NaN: unknown.
        ///     A stack starts every estimate from it.
        /// temporal : "none" (default), "recursive", or `Recursive`
        ///     "recursive" fuses the estimates of all frames so far, for motion that is steady in the picture
        ///     ("coarse_to_fine", "windowed", "instantaneous").
        /// covariance : bool
        ///     Whether to compute the covariance of the parameters; default yes, where the method has one
        ///     (not "horn_schunck").
        /// noise : float, grey levels
        ///     Standard deviation of the pixel noise for the covariance; default from the frames.
        /// diagnostics : bool
        ///     Whether to report residual, rank and condition number, and the windows that "coarse_to_fine"
        ///     chose.
        /// grid : `SamplingGrid`
        ///     Region and stride, or single points; default every pixel.
        /// mask : bool array (H, W)
        ///     True where pixels may be used.
        /// preprocess : `Preprocess`
        ///     Quantising, smoothing and conversion of colour, before anything else.
        /// fps : float, frames/s
        ///     Times are then in seconds: flow in px/s, the Jacobian in 1/s.
        /// pixel_pitch : float or (dx, dy), in `length_unit`
        ///     Size of a pixel; lengths are then in that unit.
        /// length_unit : str
        ///     Its name, "mm" for example; default "length".
        /// precision : "float32" or "float64"
        ///     Default: that of the frames.
        /// threads : int
        ///     Default: environment variable JACOFLOW_THREADS, else every processor. Results do not depend on
        ///     it.
        /// simd : "scalar", "avx2" or "avx512"
        ///     Default: environment variable JACOFLOW_SIMD, else the best of the processor.
        /// progress : None, True or function (done, total)
        ///     True draws a line on standard error; a function is called after each frame. Ctrl-C stops
        ///     also amid a frame.
        ///
        /// Raises
        /// ------
        /// ValueError
        ///     For fewer frames than the method needs, frames under 3 x 3 px or of different sizes, colour,
        ///     and options out of range; each message names the argument.
        /// TypeError
        ///     For another dtype.
        #[pyfunction]
        #[pyo3(signature = (frames, *more, ends = "nan", pairs = false, $($option = $default,)* progress = None))]
        pub fn estimate(
            frames: &Bound<'_, PyAny>,
            more: &Bound<'_, PyTuple>,
            #[pyo3(from_py_with = named::ends)] ends: &str,
            #[pyo3(from_py_with = named::pairs)] pairs: bool,
            $(#[pyo3(from_py_with = named::$option)] $option: $taken,)*
            progress: Option<&Bound<'_, PyAny>>,
        ) -> Outcome<FlowField> {
            if !more.is_empty() {
                refuse_positional_method(more.iter())?;
                let got = format!("frames: expected one stack or list of frames, got {} arguments; for one field \
                    from two or three frames call jacoflow.flow(a, b) or jacoflow.flow(a, b, c)", more.len() + 1);
                return Err(PyTypeError::new_err(got).into());
            }
            let kind = Kind { ends: Ends::parse(ends)?, is_pairs: pairs };
            estimate_sequence(frames, kind, Arguments { $($option: $option.into()),* }, progress)
        }

        /// One field, flow with its Jacobian and covariance, from two or three frames.
        ///
        /// Two frames give the step from the first to the second, at the pixels of the first (every method
        /// but "instantaneous"). Three give that from the second to the third, at the pixels of the second;
        /// the first helps where motion is steady.
        ///
        /// Parameters
        /// ----------
        /// first, second, third : arrays (H, W)
        ///     Frames, oldest first, as in `estimate`.
        ///
        /// The options, their units and the errors are those of `estimate`.
        ///
        /// >>> import jacoflow
        /// >>> a, b = jacoflow.scenes.Scene("affine", width=96, height=64).frames(2)
        /// >>> jacoflow.flow(a, b).shape
        /// (64, 96)
        #[pyfunction]
        #[pyo3(signature = (first, second = None, third = None, *more, $($option = $default,)*))]
        pub fn flow(
            first: &Bound<'_, PyAny>,
            second: Option<&Bound<'_, PyAny>>,
            third: Option<&Bound<'_, PyAny>>,
            more: &Bound<'_, PyTuple>,
            $(#[pyo3(from_py_with = named::$option)] $option: $taken,)*
        ) -> Outcome<FlowField> {
            refuse_positional_method([second, third].into_iter().flatten().cloned().chain(more.iter()))?;
            if second.is_none() || !more.is_empty() {
                let got = 1 + [second, third].into_iter().flatten().count() + more.len();
                let got = if got == 1 { "one argument".into() } else { format!("{got} arguments") };
                return Err(PyTypeError::new_err(format!("first, second, third: expected two or three frames (H, W), \
                    got {got}; for a stack or a list of frames call jacoflow.estimate(frames)")).into());
            }
            let frames: Vec<_> = [Some(first), second, third].into_iter().flatten().collect();
            estimate_one(&PyList::new(first.py(), frames)?, Arguments { $($option: $option.into()),* })
        }
    };
}
estimator_options!(define_estimate []);

/// Refuses a method among the frames, by the keyword that it needs; names of files are left to the frames.
fn refuse_positional_method<'py>(arguments: impl Iterator<Item = Bound<'py, PyAny>>) -> Outcome<()> {
    for argument in arguments {
        if let Ok(word) = argument.extract::<String>()
            && !word.contains(['.', '/'])
        {
            let got = format!("method: expected as a keyword, method={word:?}, got {word:?} among the frames");
            return Err(PyTypeError::new_err(got).into());
        }
    }
    Ok(())
}

/// Which fields of a sequence are wanted.
struct Kind {
    ends: Ends,
    is_pairs: bool,
}

/// What `estimate` does.
fn estimate_sequence(
    frames: &Bound<'_, PyAny>,
    kind: Kind,
    mut arguments: Arguments,
    progress: Option<&Bound<'_, PyAny>>,
) -> Outcome<FlowField> {
    let py = frames.py();
    let frames = Frames::new(frames, arguments.colour(py)?)?;
    let times = arguments.take_units(py, &frames.noted)?;
    let mut stream = arguments.stream(py, kind.is_pairs || frames.count <= 2)?;
    let mut ends = kind.ends;
    if kind.is_pairs {
        if frames.count % 2 == 1 {
            let got = format!("{} frames", frames.count);
            return Err(Error::argument("frames", "an even number, in pairs", got).into());
        }
        stream = AnyFlowStream::new(stream.plan().clone().of_pairs()?, stream.precision());
        ends = Ends::Dropped;
    }
    run(py, (&frames, times), (&mut stream, ends), &Reporter::new(py, progress)?)
}

/// What `flow` does.
fn estimate_one(frames: &Bound<'_, PyList>, arguments: Arguments) -> Outcome<FlowField> {
    let py = frames.py();
    let frames = Frames::new(frames, arguments.colour(py)?)?.named(&["first", "second", "third"]);
    let mut stream = arguments.stream(py, frames.count == 2)?;
    let needed = stream.plan().estimator().frames_needed();
    if frames.count != needed {
        let got = format!("{} frames", frames.count);
        return Err(Error::argument("frames", format!("{needed} frames for this method"), got).into());
    }
    for index in 0..frames.count {
        let (frame, dtype) = frames.get(index)?;
        let name = frames.name(index);
        let named = |error| renamed(error, "frames", name);
        if let Some(field) = interruptible(py, || stream.push_at(frame, dtype, None).map_err(named))? {
            return Ok(FlowField::any(field));
        }
    }
    Err(Error::Numerical("no field came of the frames".into()).into())
}
