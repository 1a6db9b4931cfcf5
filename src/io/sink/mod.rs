//! Where frames go: one file for each kind of sink and one line in [`KINDS`].

mod npy;
mod png;
mod y4m;

pub use npy::NpySink;
pub use png::PngSink;
pub use y4m::Y4mSink;
pub(super) use y4m::{eight_bit_planes, ratio};

use super::channels::FrameFormat;
use crate::error::{Error, Result};
use crate::types::{AnyColourFrame, AnyFrame};

/// Takes frames of one size and sample type, one at a time: [`AnyFrame`] or [`AnyColourFrame`].
pub trait FrameSink<F = AnyFrame>: Send {
    /// Adds a frame.
    ///
    /// # Errors
    /// [`Error::Argument`] or [`Error::Type`] named `frame` for a frame unlike the first or of a type that
    /// the format cannot hold; [`Error::Io`] with the path.
    fn write(&mut self, frame: &F) -> Result<()>;

    /// Ends the sequence; files of several frames get their name only now.
    ///
    /// # Errors
    /// [`Error::Io`] when the rest cannot be written.
    fn finish(self: Box<Self>) -> Result<()>;
}

/// A sink of colour frames.
pub type ColourSink = dyn FrameSink<AnyColourFrame>;

/// A kind of sink: which specifications it takes and how it is opened, with frames per second.
struct Kind {
    accepts: fn(&str) -> bool,
    open: fn(&str, f64) -> Result<Box<dyn FrameSink>>,
    open_colour: fn(&str, f64) -> Result<Box<ColourSink>>,
}

/// Every kind of sink; the first that accepts a specification opens it.
const KINDS: &[Kind] = &[y4m::KIND, npy::KIND, png::KIND];

/// Opens a sink of grey frames: `-` (Y4M on standard output), `*.y4m`, `*.npy`, or a folder for PNG.
///
/// # Errors
/// [`Error::Io`] when it cannot be made; [`Error::Argument`] named `frame_rate` unless that is positive and,
/// for Y4M, a ratio of 32-bit numbers, or `output` for an extension that no sink has.
pub fn open_sink(spec: &str, frame_rate: f64) -> Result<Box<dyn FrameSink>> {
    (kind_at_rate(spec, frame_rate)?.open)(spec, frame_rate)
}

/// Opens a sink of colour frames by its specification, as [`open_sink`].
pub fn open_colour_sink(spec: &str, frame_rate: f64) -> Result<Box<ColourSink>> {
    (kind_at_rate(spec, frame_rate)?.open_colour)(spec, frame_rate)
}

fn kind_at_rate(spec: &str, frame_rate: f64) -> Result<&'static Kind> {
    if !(frame_rate > 0.0 && frame_rate.is_finite()) {
        return Err(Error::argument("frame_rate", "a positive number of frames per second", frame_rate));
    }
    kind_of(spec)
}

/// Whether [`open_sink`] knows what to make of a specification; nothing is made yet.
///
/// # Errors
/// [`Error::Argument`] named `output` for an extension that no sink has.
pub fn check_sink(spec: &str) -> Result<()> {
    kind_of(spec).map(drop)
}

fn kind_of(spec: &str) -> Result<&'static Kind> {
    let wanted = "*.npy, *.y4m, - for Y4M on standard output, or a folder (for PNG files)";
    if spec.is_empty() {
        return Err(Error::argument("output", wanted, "an empty name"));
    }
    KINDS.iter().find(|kind| (kind.accepts)(spec)).ok_or_else(|| {
        Error::argument("output", wanted, format!("{spec}; for a new folder of this name write {spec}/"))
    })
}

/// What every later frame must be like.
#[derive(Debug, Default)]
struct Uniform(Option<((usize, usize), &'static str)>);

impl Uniform {
    fn check(&mut self, frame: &impl FrameFormat) -> Result<bool> {
        let this = (frame.size(), frame.dtype());
        match self.0 {
            None => {
                self.0 = Some(this);
                Ok(true)
            }
            Some(first) if first == this => Ok(false),
            Some(((w, h), dtype)) => {
                let got = format!("{} x {} {}", this.0.0, this.0.1, this.1);
                Err(Error::argument("frame", format!("{w} x {h} {dtype}, as the first"), got))
            }
        }
    }
}
