//! Derivatives of brightness for the baselines, from a pair or from three frames.

use crate::error::Result;
use crate::jet::{JetStencil, Neighbourhood};
use crate::math::Real;
use crate::parallel::Threads;
use crate::simd::Level;
use crate::types::{Frame, choices};

/// Which frames a baseline differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Differences {
    /// Three frames: `It` half the outer difference, gradient from the middle frame. The flow belongs to the
    /// middle frame.
    #[default]
    Central,
    /// Two frames: `It` their difference, gradient the mean of theirs. The flow belongs to the instant
    /// between them and is filed under the first.
    Pair,
}

choices!(Differences, "differences": Central "central", Pair "pair");

impl Differences {
    /// Frames needed.
    pub(super) fn frames(self) -> usize {
        match self {
            Self::Central => 3,
            Self::Pair => 2,
        }
    }

    /// Variance of `It` for pixel noise of variance 1.
    pub(super) fn first_gain(self) -> f64 {
        match self {
            Self::Central => 0.5,
            Self::Pair => 2.0,
        }
    }

    /// The frame that the flow is filed under.
    pub(super) fn frame(self) -> usize {
        match self {
            Self::Central => 1,
            Self::Pair => 0,
        }
    }
}

/// `Ix, Iy, It` of a crop of the frames; NaN on its outermost pixels.
pub(super) struct Gradients {
    pub ix: Frame<f64>,
    pub iy: Frame<f64>,
    pub it: Frame<f64>,
    /// Largest brightness, for the rounding noise.
    pub brightness: f64,
}

/// The power of two just below a positive number: dividing by it brings any gain in intensity near 1, and
/// loses no bit. 1 for what has none.
pub(super) fn magnitude(value: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let power = f64::from_bits(value.to_bits() & EXPONENT);
    if power > 0.0 && power.is_finite() { power } else { 1.0 }
}

/// A rectangle of pixels `x0 .. x1`, `y0 .. y1`.
#[derive(Clone, Copy)]
pub(super) struct Crop {
    pub x0: usize,
    pub y0: usize,
    pub x1: usize,
    pub y1: usize,
}

impl Gradients {
    /// Derivatives by the 3x3 stencil of (32), (33) in space and pixel differences in time, inside `crop`.
    pub fn new<T: Real>(
        frames: &[&Frame<T>],
        differences: Differences,
        crop: Crop,
        threads: Threads,
        level: Level,
    ) -> Result<Self> {
        let cut = |f: &Frame<T>| {
            Frame::from_fn(crop.x1 - crop.x0, crop.y1 - crop.y0, |x, y| f.get(crop.x0 + x, crop.y0 + y).to_f64())
        };
        let frames: Vec<Frame<f64>> = frames.iter().map(|f| cut(f)).collect();
        let sample = |k: usize, x: usize, y: usize| frames[k].get(x, y);
        let (w, h) = frames[0].size();
        let brightness = frames[0].data().iter().filter(|v| v.is_finite()).fold(0.0, |m: f64, v| m.max(v.abs()));
        let (carrier, it) = match differences {
            Differences::Central => {
                let it = Frame::from_fn(w, h, |x, y| {
                    // The middle frame takes part so that a bad sample there is not overlooked.
                    0.5 * (sample(2, x, y) - sample(0, x, y)) + 0.0 * sample(1, x, y)
                });
                (frames[1].clone(), it)
            }
            Differences::Pair => (
                Frame::from_fn(w, h, |x, y| 0.5 * (sample(0, x, y) + sample(1, x, y))),
                Frame::from_fn(w, h, |x, y| sample(1, x, y) - sample(0, x, y)),
            ),
        };
        let stencil = JetStencil::new(&Neighbourhood::default(), (1.0, 1.0))?;
        let [_, ix, iy, ..] = stencil.planes_with(&carrier, threads, level).planes;
        Ok(Self { ix, iy, it, brightness })
    }
}
