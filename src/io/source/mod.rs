//! Where frames come from: one file for each kind of source and one line in [`KINDS`].

mod double_frames;
mod ffmpeg;
mod files;
mod glob;
mod list;
mod memory;
mod npy;
mod select;
mod unreadable;
mod views;
mod y4m;

pub use double_frames::DoubleFrames;
pub use ffmpeg::FfmpegSource;
pub use files::FilesSource;
pub use memory::MemorySource;
pub use npy::NpySource;
pub use select::Selected;
pub use views::{ViewLayout, ViewPairs};
pub use y4m::Y4mSource;

use super::planes::{PixelSize, PlaneSelection};
use super::{channels::Colour, channels::Grey};
use crate::error::{Error, Result};
use crate::types::{AnyColourFrame, AnyFrame};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// How a source is opened: what to do with colour or grey, which planes of a file with channels or slices are
/// frames, and the range of frames, `start`, `start + step`, ... below `stop`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpenOptions {
    /// What [`open`] does with colour pictures; default: refuse.
    pub colour: Colour,
    /// What [`open_colour`] does with grey pictures; default: refuse.
    pub grey: Grey,
    /// Channel and slice of TIFF files that have several; default: such files are refused.
    pub planes: PlaneSelection,
    /// Index of the first frame; default 0.
    pub start: usize,
    /// Index after the last frame; default `None`: all frames.
    pub stop: Option<usize>,
    /// Distance between frames; default 1.
    pub step: usize,
}

impl Default for OpenOptions {
    fn default() -> Self {
        let planes = PlaneSelection::default();
        Self { colour: Colour::Error, grey: Grey::Error, planes, start: 0, stop: None, step: 1 }
    }
}

/// Frames of one size and sample type, one at a time: [`AnyFrame`] or [`AnyColourFrame`].
pub trait FrameSource<F = AnyFrame>: Send {
    /// The next frame; `None` after the last.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Format`] with the path of the file that cannot be read.
    fn next_frame(&mut self) -> Result<Option<F>>;

    /// Passes over up to `count` frames, if possible without decoding; returns how many there were.
    fn skip(&mut self, count: usize) -> Result<usize> {
        for done in 0..count {
            if self.next_frame()?.is_none() {
                return Ok(done);
            }
        }
        Ok(count)
    }

    /// How many frames are left, where that is known without reading them.
    fn len_hint(&self) -> Option<usize> {
        None
    }

    /// Frames per second, where the source says so.
    fn frame_rate(&self) -> Option<f64> {
        None
    }

    /// Time of the frame delivered last, s, where the source has times of frames.
    fn time(&self) -> Option<f64> {
        None
    }

    /// Physical size of a pixel, where the source says so.
    fn pixel_size(&self) -> Option<PixelSize> {
        None
    }

    /// What this is, for messages.
    fn describe(&self) -> String;
}

impl<F, S: FrameSource<F> + ?Sized> FrameSource<F> for Box<S> {
    fn next_frame(&mut self) -> Result<Option<F>> {
        (**self).next_frame()
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        (**self).skip(count)
    }
    fn len_hint(&self) -> Option<usize> {
        (**self).len_hint()
    }
    fn frame_rate(&self) -> Option<f64> {
        (**self).frame_rate()
    }
    fn time(&self) -> Option<f64> {
        (**self).time()
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        (**self).pixel_size()
    }
    fn describe(&self) -> String {
        (**self).describe()
    }
}

/// A source of colour frames.
pub type ColourSource = dyn FrameSource<AnyColourFrame>;

/// A kind of source: what it is called, which specifications it takes, how it is opened.
struct Kind {
    name: &'static str,
    accepts: fn(&str) -> bool,
    /// First bytes by which its files are recognised under any name; empty: by the name alone.
    signatures: &'static [&'static [u8]],
    /// Whether its files may be TIFF, with channels and slices.
    has_planes: bool,
    /// The files in what the specification names, where it is not one file; those that can be listed.
    members: fn(&str) -> Vec<PathBuf>,
    open: fn(&str, &OpenOptions) -> Result<Box<dyn FrameSource>>,
    open_colour: fn(&str, &OpenOptions) -> Result<Box<ColourSource>>,
}

/// Every kind of source; the first whose signature a file has, else the first that accepts the specification,
/// opens it.
const KINDS: &[Kind] =
    &[files::TIFF, y4m::KIND, npy::KIND, list::KIND, files::KIND, glob::KIND, unreadable::KIND, ffmpeg::KIND];

/// Length of the longest signature, bytes.
const SIGNATURE_BYTES: u64 = 10;

/// Opens a source of grey frames by its specification. Files of TIFF, Y4M and numpy (`.npy`) are recognised
/// by their first bytes under any name, all others by the name.
///
/// | specification | source |
/// |---|---|
/// | `-` | Y4M on standard input |
/// | `*.y4m` | Y4M file; its luma plane, where the others are grey or luminance is requested |
/// | `*.npy` | stack `(T, H, W)` or one frame `(H, W)` of numbers; colour `(T, H, W, 3)` or `(H, W, 3)` |
/// | `*.txt`, `*.lst` | list of image files, one a line |
/// | a folder | its PNG, TIFF, BMP, PGM and JPEG files in natural order |
/// | an image file | its picture, or the pages of a TIFF (along time, see [`PlaneSelection`]) |
/// | `*`, `?`, `[` in it | the image files it matches, in natural order |
/// | `*.npz`, `*.h5`, `*.mat`, `*.raw`, `*.mraw`, `*.cih`, `*.cine` | refused, with what can be done |
/// | another file | compressed video, through an `ffmpeg` on the `PATH`; likewise |
///
/// # Errors
/// [`Error::Io`] when there is nothing of that name, [`Error::Format`] when it is not what it seems or
/// is read by no part of the package, [`Error::Argument`] for a `step` of 0 or a plane that it does not have,
/// [`Error::Missing`] for video without `ffmpeg` and for files that only the Python package reads.
pub fn open(spec: &str, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    let source = (kind_for(spec, options)?.open)(spec, options)?;
    Ok(Box::new(Selected::new(source, options)?))
}

/// Opens a source of colour frames by its specification: as [`open`], with red, green and blue of each pixel.
///
/// Y4M is converted by ITU-R BT.601 (see [`Y4mSource`]); compressed video has 8 bit. A `*.npy` stack of
/// colour is `(T, H, W, 3)` or `(T, H, W, 4)`, one frame `(H, W, 3)` or `(H, W, 4)`. Alpha is left out. Grey
/// pictures are an [`Error::Format`] that says that colour is needed, unless `options.grey` is
/// [`Grey::Repeat`].
pub fn open_colour(spec: &str, options: &OpenOptions) -> Result<Box<ColourSource>> {
    let source = (kind_for(spec, options)?.open_colour)(spec, options)?;
    Ok(Box::new(Selected::new(source, options)?))
}

fn kind_for(spec: &str, options: &OpenOptions) -> Result<&'static Kind> {
    if options.step == 0 {
        return Err(Error::argument("step", "a positive integer", 0));
    }
    let kind = kind_accepting(spec).ok_or_else(|| nothing_there(spec))?;
    match options.planes.given() {
        Some(option) if !kind.has_planes => {
            Err(Error::argument(option, "none, as only TIFF files name such an axis", spec))
        }
        _ => Ok(kind),
    }
}

/// The kind of source that opens `spec`: by the first bytes of a file, else by its name.
fn kind_accepting(spec: &str) -> Option<&'static Kind> {
    let start = first_bytes(spec);
    let has_signature = |kind: &&Kind| kind.signatures.iter().any(|signature| start.starts_with(signature));
    KINDS.iter().find(has_signature).or_else(|| KINDS.iter().find(|kind| (kind.accepts)(spec)))
}

/// The first bytes of a regular file; none of others (a pipe would lose them) and of standard input. A file
/// that cannot be read is reported by the source that opens it.
fn first_bytes(spec: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    if spec != "-"
        && Path::new(spec).is_file()
        && let Ok(file) = File::open(spec)
        && file.take(SIGNATURE_BYTES).read_to_end(&mut bytes).is_err()
    {
        bytes.clear();
    }
    bytes
}

/// The name of the kind of source that `spec` would be opened as.
pub fn kind_of(spec: &str) -> Option<&'static str> {
    kind_accepting(spec).map(|kind| kind.name)
}

/// The files that a source of this specification reads: the one named, and those in a folder or a list or
/// matched by a pattern. What cannot be listed is left out, as opening the source reports it.
pub fn files_read(spec: &str) -> Vec<PathBuf> {
    let kind = kind_accepting(spec);
    let members = kind.map(|kind| (kind.members)(spec)).unwrap_or_default();
    std::iter::once(PathBuf::from(spec)).chain(members).collect()
}

/// The members of what is one file.
fn no_members(_: &str) -> Vec<PathBuf> {
    Vec::new()
}

fn nothing_there(spec: &str) -> Error {
    if Path::new(spec).exists() {
        return Error::format(
            spec,
            "neither a file nor a folder; expected one of these, or - for Y4M on standard input",
        );
    }
    Error::io(spec, std::io::Error::new(std::io::ErrorKind::NotFound, "no such file or folder"))
}

/// Whether the name ends in one of these extensions, in any case.
pub(super) fn has_extension(path: impl AsRef<Path>, extensions: &[&str]) -> bool {
    let extension = path.as_ref().extension().and_then(|e| e.to_str());
    extension.is_some_and(|e| extensions.iter().any(|known| known.eq_ignore_ascii_case(e)))
}
