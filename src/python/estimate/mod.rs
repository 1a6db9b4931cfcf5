//! `estimate`, and in `stream` `FlowEstimator`.

mod arguments;
mod memory;
mod stream;

use super::arrays::{self, Frames};
use super::field::{FlowField, Packed};
use super::keywords::with_common;
use super::options::{Integer, Object, Region};
use super::progress::Reporter;
use crate::error::Error;
use arguments::{Arguments, PAIR, Plan, estimator_options};
use memory::{AnyField, Memory};
use pyo3::prelude::*;

pub use stream::{FlowEstimator, restore_estimator};

impl AnyField {
    fn single(self) -> FlowField {
        match self {
            Self::Single(field) => FlowField::single(field),
            Self::Double(field) => FlowField::single(field),
        }
    }
}

/// Fields of a stack as they come.
enum Growing {
    None,
    Single(Packed<f32>),
    Double(Packed<f64>),
}

impl Growing {
    fn add(&mut self, field: AnyField) -> crate::Result<()> {
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

    fn finish(self) -> PyResult<FlowField> {
        match self {
            Self::Single(packed) => Ok(FlowField::stack(packed)),
            Self::Double(packed) => Ok(FlowField::stack(packed)),
            Self::None => Err(Error::Numerical("no field came of the frames".into()).into()),
        }
    }
}

/// The field or fields of a whole sequence.
fn run(py: Python<'_>, frames: &Frames<'_>, plan: &Plan, progress: &Reporter<'_>) -> PyResult<FlowField> {
    let needed = plan.estimator.frames_needed();
    if frames.count < needed {
        let expected = format!("at least {needed} frames");
        return Err(Error::argument("frames", expected, format!("{} frames", frames.count)).into());
    }
    let (mut memory, mut fields) = (Memory::Empty, Growing::None);
    for index in 0..frames.count {
        let field = memory.push(py, "frames", plan, frames.get(index)?)?;
        progress.step(index + 1, frames.count)?;
        if let Some(field) = field {
            if !frames.is_array && frames.count == needed {
                return Ok(field.single());
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
        /// method : "coarse_to_fine", "windowed", "instantaneous", "lucas_kanade" or "horn_schunck"
        ///     "coarse_to_fine" (default): the transported equations with a pyramid, warping and robust
        ///     coupling of neighbours, for motions of many pixels, edges and untextured areas; its deviations
        ///     hold on made scenes and are too small on many recordings (docs/flow.md). "windowed": least
        ///     squares of the same equations in one Gaussian window, for texture that moves by a pixel or
        ///     two. "instantaneous": per pixel, WO2010/098160 (34), for locally quadratic, nearly noise-free
        ///     images. The others are baselines.
        /// preset : "fast", "balanced" or "accurate"
        ///     Cost against error of "coarse_to_fine"; default "balanced". "fast" finds the motion at half
        ///     the resolution and loses detail of a few px; "accurate" iterates more. `benchmarks/compare.py
        ///     --only flow recordings` measures time and error of each.
        /// levels : int
        ///     Pyramid levels of "coarse_to_fine"; default as many as the frame allows.
        /// model : "affine", "translational" or "accelerating"
        ///     Motion model of "instantaneous".
        /// time_scheme : "forward", "central", "backward" or "pair"
        ///     How time derivatives are taken, and so to which frame the field belongs: the middle one of
        ///     three, the newest of three ("backward", "windowed" and "instantaneous" only), or the first of
        ///     two ("pair", the default for two frames; not "instantaneous"). "forward", the default of
        ///     "coarse_to_fine" and only known there, tells where the middle frame's pixels are in the next
        ///     frame, as a pair does; the frame before helps as far as motion goes on as it was. "central",
        ///     the default of the others, is the mean of the steps before and after: the velocity at the
        ///     middle frame.
        /// neighbourhood : (columns, rows) or array (N, 2) of offsets (x, y), px
        ///     Pixels that the local quadratic is fitted to; default 3 x 3.
        /// neighbourhood_sigma : float, px
        ///     Weighs them by a Gaussian; default equal weights.
        /// window_sigma : float, px
        ///     Standard deviation of the window of "windowed" and "lucas_kanade"; default 4.
        /// rows : "brightness", "gradient", "jet" or "all"
        ///     Equations that "windowed" sums: 1, 3, 6 or 12 at each pixel; default "all", for pairs
        ///     "gradient".
        /// smoothness : float, in units of the root mean square gradient of the frame
        ///     Weight of "horn_schunck", so that the intensity gain does not change the flow; default 1.
        /// iterations : int
        ///     Most iterations of "horn_schunck".
        /// rank_deficient : "nan" or "min_norm"
        ///     What "windowed" and "instantaneous" report where the equations do not determine every unknown.
        /// smooth : float, px
        ///     Standard deviation of a Gaussian that smooths each frame first, 0 for none; default 1.5 for
        ///     "windowed", none for the others.
        /// quantise : float, grey levels
        ///     Rounds samples down to multiples of it before smoothing; default none.
        /// colour : "error" (default) or "luminance"
        ///     What to do with frames (H, W, 3 or 4).
        /// points : array (N, 2) of int, px
        ///     Pixels (x, y) to estimate at, nothing else is computed; arrays of the result are (..., N)
        ///     instead of (..., H, W).
        /// region : (x, y, width, height), px
        ///     Rectangle to estimate in.
        /// stride : int, px
        ///     Estimate at every stride-th column and row.
        /// mask : bool array (H, W)
        ///     True where pixels may be used.
        /// fps, frame_period : float, frames/s or s
        ///     For quantities per second; give one of them.
        /// pixel_pitch : float or (dx, dy), any length unit
        ///     Size of a pixel; flow then comes in that unit per frame.
        /// covariance : bool
        ///     Whether to compute the covariance of the parameters; default yes, where the method has one
        ///     (not "horn_schunck").
        /// diagnostics : bool
        ///     Whether to report residual, rank and condition number, and the windows that "coarse_to_fine"
        ///     chose.
        /// noise : float, grey levels
        ///     Standard deviation of the pixel noise for the covariance; default from the frames.
        /// temporal : "none" or "recursive"
        ///     "recursive" fuses the estimates of all frames so far, for motion that is steady in the picture
        ///     ("windowed", "coarse_to_fine", "instantaneous"): an information filter on (u, v, u_x, v_x,
        ///     u_y, v_y) at each fixed pixel, `P_k^-1 = f P_{k-1}^-1 + C_k^-1`, `x_k = x_{k-1} + P_k C_k^-1
        ///     (m_k - x_{k-1})` with the estimate m_k of each time, its covariance C_k and f = `forgetting`.
        ///     It starts with the first estimate; noise falls with the number of frames, systematic error
        ///     does not, and the covariance says both. Where the motion changes a pixel starts anew
        ///     (normalised innovation squared above 27.86) or shortens its memory. Times without an estimate
        ///     get the prediction and status PREDICTED. Needs the covariance; default "none".
        /// forgetting : float, no unit
        ///     Factor f of "recursive", above 0 and at most 1: the memory is 1 / (1 - f) frames; default
        ///     0.95.
        /// precision : "float32" or "float64"
        ///     Default: that of the frames.
        /// threads : int
        ///     Default: environment variable JACOFLOW_THREADS, else every processor. Results do not depend on
        ///     it.
        /// simd : "scalar", "avx2" or "avx512"
        ///     Default: environment variable JACOFLOW_SIMD, else the best of the processor.
        /// progress : None, True or function (done, total)
        ///     True draws a line on standard error; a function is called after each frame. Ctrl-C stops
        ///     between frames.
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
        ) -> PyResult<FlowField> {
            estimate_sequence(frames, Arguments { $($option: $option.into()),* }, progress)
        }
    };
}
estimator_options!(define_estimate []);

/// What `estimate` does.
fn estimate_sequence(
    frames: &Bound<'_, PyAny>,
    mut arguments: Arguments,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<FlowField> {
    let py = frames.py();
    let colour = arrays::ColourRule::parse(arguments.colour.as_deref())?;
    let frames = Frames::new(frames, colour)?;
    if !frames.is_array && frames.count <= 2 && arguments.time_scheme.is_none() && arguments.takes_pairs() {
        arguments.time_scheme = Some(PAIR.into());
    }
    run(py, &frames, &arguments.plan(py)?, &Reporter::new(py, progress)?)
}
