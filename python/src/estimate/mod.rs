//! `estimate`, and in `stream` `FlowEstimator`.

mod arguments;
mod stream;

use super::arrays::Frames;
use super::field::{FlowField, Packed};
use super::keywords::with_common;
use super::options::{Integer, Object};
use super::progress::Reporter;
use crate::errors::Outcome;
use crate::interrupt::interruptible;
use arguments::{Arguments, estimator_options};
use jacoflow::error::Error;
use jacoflow::temporal::AnyFlowStream;
use jacoflow::types::AnyField;
use pyo3::prelude::*;

pub use stream::{FlowEstimator, restore_estimator};

/// Fields of a stack as they come.
enum Growing {
    None,
    Single(Packed<f32>),
    Double(Packed<f64>),
}

impl Growing {
    fn add(&mut self, field: AnyField) -> jacoflow::Result<()> {
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

    fn finish(self) -> Outcome<FlowField> {
        match self {
            Self::Single(packed) => Ok(FlowField::stack(packed)),
            Self::Double(packed) => Ok(FlowField::stack(packed)),
            Self::None => Err(Error::Numerical("no field came of the frames".into()).into()),
        }
    }
}

/// The field or fields of a whole sequence.
fn run(py: Python<'_>, frames: &Frames<'_>, stream: &mut AnyFlowStream, progress: &Reporter<'_>) -> Outcome<FlowField> {
    let needed = stream.plan().estimator().frames_needed();
    if frames.count < needed {
        let expected = format!("at least {needed} frames");
        return Err(Error::argument("frames", expected, format!("{} frames", frames.count)).into());
    }
    let mut fields = Growing::None;
    for index in 0..frames.count {
        let frame = frames.get(index)?;
        let field = interruptible(py, || stream.push(frame))?;
        progress.step(index + 1, frames.count)?;
        if let Some(field) = field {
            if !frames.is_array && frames.count == needed {
                return Ok(FlowField::any(field));
            }
            fields.add(field)?;
        }
    }
    fields.finish()
}

/// `estimate` with the options as keywords.
macro_rules! define_estimate {
    ([] $($option:ident: $kept:ty as $taken:ty = $default:tt,)*) => {
        /// Flow, its Jacobian and their covariance, from two or three frames or from a stack.
        ///
        /// A list or tuple of three frames (H, W) gives one FlowField (H, W), one of two frames as well
        /// (every method but "instantaneous"); a longer list gives a stack (T - 2, H, W), and so does an
        /// array (T, H, W) of any length. Frames are uint8, uint16, float32 or float64 in any grey scale: the
        /// intensity gain does not change the flow. float64 is computed in float64, everything else in
        /// float32. Inputs are never modified.
        ///
        /// Parameters
        /// ----------
        /// frames : array (T, H, W), or list, tuple or iterator of arrays (H, W)
        ///     Oldest first, one size, at least 3 x 3 px (`coarse_to_fine` finds nothing in frames less than
        ///     5 px wide or high).
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
        ///     For quantities per second.
        /// pixel_pitch : float or (dx, dy), any length unit
        ///     Size of a pixel; flow then comes in that unit per frame.
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
        #[pyo3(signature = (frames, *, $($option = $default,)* progress = None))]
        pub fn estimate(
            frames: &Bound<'_, PyAny>,
            $($option: $taken,)*
            progress: Option<&Bound<'_, PyAny>>,
        ) -> Outcome<FlowField> {
            estimate_sequence(frames, Arguments { $($option: $option.into()),* }, progress)
        }
    };
}
estimator_options!(define_estimate []);

/// What `estimate` does.
fn estimate_sequence(
    frames: &Bound<'_, PyAny>,
    arguments: Arguments,
    progress: Option<&Bound<'_, PyAny>>,
) -> Outcome<FlowField> {
    let py = frames.py();
    let frames = Frames::new(frames, arguments.colour(py)?)?;
    let is_pair = !frames.is_array && frames.count <= 2;
    run(py, &frames, &mut arguments.stream(py, is_pair)?, &Reporter::new(py, progress)?)
}
