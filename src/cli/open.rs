//! From input arguments to a source, and what is known about it before the run.

use super::arguments::{ComputeArguments, InputArguments, MethodArguments, UnitArguments};
use crate::error::{Error, Result};
use crate::flow::InitialFlow;
use crate::image::{GaussianSmoother, Preprocess, Quantiser};
use crate::io::{
    ChannelPolicy, Colour, DoubleFrames, FilesSource, FrameFormat, FrameSource, OpenOptions, PixelSize, Selected,
    kind_of, open, open_colour, read_flo, read_image, read_kitti,
};
use crate::parallel::Threads;
use crate::pipeline::{FirstFrame, Numbering, peek};
use crate::simd::Level;
use crate::types::{AnyColourFrame, AnyFrame, Frame, Mask, Units};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A source that is ready, with its first frame looked at.
pub struct Opened<F = AnyFrame> {
    /// The frames.
    pub source: Box<dyn FrameSource<F>>,
    /// Properties of the first frame.
    pub first: FirstFrame,
    /// Number of frames, where it is known.
    pub frames: Option<usize>,
    /// Which frames of the input these are, and how fast.
    pub numbering: Numbering,
    /// Whether the frame rate is what the file says.
    pub has_own_rate: bool,
    /// Size of a pixel as the file says, while no option replaces it.
    pub pixel_size: Option<PixelSize>,
    /// What the input is, for messages and metadata.
    pub name: String,
}

impl<F> Opened<F> {
    /// The units of fields: the pixel's size is that `given`, else that of the file, else 1 px.
    pub fn units(&mut self, given: &UnitArguments) -> Units {
        let period = self.numbering.period();
        if given.pixel_pitch.is_some() {
            self.pixel_size = None;
        }
        match &self.pixel_size {
            Some(size) => Units::new(size.pitch, Some(&size.unit), period),
            None => given.units(period),
        }
    }
}

/// Opens the input and looks at its first frame.
pub fn open_input(arguments: &InputArguments) -> Result<Opened> {
    looked_at(open_source(&arguments.input, &arguments.selection.options())?, arguments)
}

/// As [`open_input`], of frames for a method: two inputs of pairs give the first and the second frames.
pub fn open_for_method(arguments: &InputArguments, method: &MethodArguments) -> Result<Opened> {
    match &arguments.input[..] {
        [first, second] if method.pairs => {
            let selection = arguments.selection.options();
            if selection.start % 2 == 1 || selection.step != 1 {
                let expected = "an even start and step 1 with two inputs, whose frames alternate";
                let got = format!("start {}, step {}", selection.start, selection.step);
                return Err(Error::argument("start", expected, got));
            }
            let whole = OpenOptions { start: 0, stop: None, step: 1, ..selection };
            let both = DoubleFrames::new(open(first, &whole)?, open(second, &whole)?)?;
            looked_at(Box::new(Selected::new(both, &selection)?), arguments)
        }
        _ => open_input(arguments),
    }
}

/// As [`open_input`], of colour frames.
pub fn open_colour_input(arguments: &InputArguments) -> Result<Opened<AnyColourFrame>> {
    let options = arguments.selection.options();
    let source = match &arguments.input[..] {
        [one] => open_colour(one, &options)?,
        many => open_files(many, options.grey, &options)?,
    };
    looked_at(source, arguments)
}

fn looked_at<F: FrameFormat>(source: Box<dyn FrameSource<F>>, arguments: &InputArguments) -> Result<Opened<F>> {
    let frames = source.len_hint();
    let name = source.describe();
    let (rate, pixel_size) = (source.frame_rate(), source.pixel_size());
    let numbering = arguments.selection.numbering(arguments.fps, rate);
    let has_own_rate = arguments.fps.is_none() && rate.is_some();
    let (first, source) = peek(source)?;
    let first = first.ok_or_else(|| Error::argument("input", "at least one frame", format!("none in {name}")))?;
    Ok(Opened { source, first, frames, numbering, has_own_rate, pixel_size, name })
}

/// One specification, or several image files in the order given.
pub fn open_source(input: &[String], options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    match input {
        [one] => open(one, options),
        many => open_files(many, options.colour, options),
    }
}

/// Several image files in the order given.
fn open_files<P: ChannelPolicy>(
    many: &[String],
    policy: P,
    options: &OpenOptions,
) -> Result<Box<dyn FrameSource<P::Frame>>> {
    let is_sequence = |path: &&String| {
        Path::new(path).is_dir() || matches!(kind_of(path), Some("y4m" | "npy" | "list" | "unreadable"))
    };
    if let Some(sequence) = many.iter().find(is_sequence) {
        let got = format!(
            "{sequence}; flow, measure and egomotion take two others as first and second frames of pairs, with --pairs"
        );
        return Err(Error::argument("input", "image files only, when several inputs are given", got));
    }
    let files = FilesSource::new(many.iter().map(PathBuf::from).collect(), policy)?.with_planes(options.planes);
    Ok(Box::new(Selected::new(files, options)?))
}

/// Quantiser and smoother; smoothing leaves out masked pixels.
pub fn preprocess(arguments: &InputArguments, mask: Option<&Mask>) -> Result<Preprocess> {
    Ok(Preprocess {
        quantise: arguments.quantise.map(Quantiser::new).transpose()?,
        smooth: arguments.smooth.map(GaussianSmoother::new).transpose()?,
        mask: mask.cloned(),
    })
}

/// Number of threads and instruction set.
pub fn compute(arguments: &ComputeArguments) -> Result<(Threads, Option<Level>)> {
    Ok((
        Threads::new(arguments.threads.threads)?,
        Level::check(arguments.simd.as_deref().map(Level::parse).transpose()?)?,
    ))
}

/// The flow that an estimate starts from: KITTI's format for .png, else .flo.
pub fn read_initial(path: &Path) -> Result<Arc<InitialFlow>> {
    let is_png = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    let image = if is_png { read_kitti(path)? } else { read_flo(path)? };
    Ok(Arc::new(InitialFlow::new((image.width(), image.height()), image.u(), image.v())?))
}

/// Reads a mask: pixels that are not black may be used.
pub fn read_mask(path: Option<&Path>, frame_size: (usize, usize)) -> Result<Option<Mask>> {
    let Some(path) = path else { return Ok(None) };
    let mask = match read_image(path, Colour::Luminance)? {
        AnyFrame::U8(frame) => frame.map(|&value| value > 0),
        AnyFrame::U16(frame) => frame.map(|&value| value > 0),
        AnyFrame::F32(frame) => frame.map(|&value| value > 0.0),
        AnyFrame::F64(frame) => frame.map(|&value| value > 0.0),
    };
    if Frame::size(&mask) != frame_size {
        let words = |(width, height): (usize, usize)| format!("{width} x {height}");
        let expected = format!("an image of the frames' size {}", words(frame_size));
        return Err(Error::argument("mask", expected, format!("{} in {}", words(mask.size()), path.display())));
    }
    Ok(Some(mask))
}
