//! From decoded channels to frames: colour where grey is wanted, grey where colour is wanted, and samples of
//! types that frames do not have.

use crate::error::{Error, Result};
use crate::image::luminance;
use crate::types::{AnyColourFrame, AnyFrame, Frame, LARGEST_EXACT_INTEGER, Sample};
use std::fmt::Debug;
use std::path::Path;

/// What to do with colour pictures where grey frames are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colour {
    /// Refuse them with a message that says how to convert. The default: which grey is right depends on the
    /// scene. Grey stored as RGB (red, green and blue equal in every pixel of an image file) is not colour
    /// and is taken as grey.
    #[default]
    Error,
    /// Convert by [`luminance`].
    Luminance,
}

/// What to do with grey pictures where colour frames are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Grey {
    /// Refuse them: a method that needs colour has none. The default. Grey stored as RGB is taken.
    #[default]
    Error,
    /// Take the grey level for red, green and blue alike.
    Repeat,
}

/// How a source treats the colour that it finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourUse {
    /// Colour is an error.
    Refused,
    /// Only the luma is used.
    Luma,
    /// Red, green and blue are used.
    Kept,
}

/// Size and sample type of a frame, grey or colour.
pub trait FrameFormat: Send + 'static {
    /// `(width, height)`, px.
    fn size(&self) -> (usize, usize);
    /// numpy's name of the sample type.
    fn dtype(&self) -> &'static str;
}

macro_rules! formats {
    ($($frame:ident)*) => {$(
        impl FrameFormat for $frame {
            fn size(&self) -> (usize, usize) {
                Self::size(self)
            }
            fn dtype(&self) -> &'static str {
                Self::dtype(self)
            }
        }
    )*};
}
formats!(AnyFrame AnyColourFrame);

/// Decoded samples of a picture, `[row][col][channel]`, on their way to a frame.
#[derive(Debug)]
pub struct Channels<'a, S> {
    /// The file, for messages.
    pub path: &'a Path,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA).
    pub count: usize,
    /// The samples.
    pub samples: Vec<S>,
}

impl<S: Sample> Channels<'_, S> {
    /// Whether any pixel's red, green and blue differ: grey stored as RGB (as in BMP) is grey.
    fn holds_colour(&self) -> bool {
        self.count > 2
            && self.samples.chunks_exact(self.count).any(|p| {
                let [r, g, b] = [p[0], p[1], p[2]].map(S::to_real::<f64>);
                (r != g || g != b) && !(r.is_nan() && g.is_nan() && b.is_nan())
            })
    }

    /// Red, green and blue of each pixel; grey is repeated.
    fn pixels(&self) -> Vec<[S; 3]> {
        let pixels = self.samples.chunks_exact(self.count);
        if self.count < 3 { pixels.map(|p| [p[0]; 3]).collect() } else { pixels.map(|p| [p[0], p[1], p[2]]).collect() }
    }
}

/// Which frames are read: [`Colour`] reads grey ones, [`Grey`] colour ones.
pub trait ChannelPolicy: Copy + Debug + Send + Sync + 'static {
    /// What is read.
    type Frame: FrameFormat + Debug;

    /// The frame of a picture.
    ///
    /// # Errors
    /// [`Error::Format`] with the path when the policy refuses the picture, or it holds another number of
    /// samples than its size says.
    fn frame<S: Sample>(self, picture: Channels<'_, S>) -> Result<Self::Frame>;

    /// Refuses a layout of `count` channels whose content need not be looked at.
    ///
    /// # Errors
    /// [`Error::Format`] with the path.
    fn check_layout(self, path: &Path, count: usize) -> Result<()>;

    /// What colour is used for.
    fn colour_use(self) -> ColourUse;
}

impl ChannelPolicy for Colour {
    type Frame = AnyFrame;

    fn frame<S: Sample>(self, picture: Channels<'_, S>) -> Result<AnyFrame> {
        if self == Self::Error && picture.holds_colour() {
            return Err(refuse_colour(picture.path));
        }
        let Channels { path, width, height, count, samples } = picture;
        let frame =
            if count == 1 { Frame::new(width, height, samples) } else { luminance(width, height, count, &samples) };
        // A damaged file may decode to another number of samples than its size promises.
        frame.map(S::grey).map_err(|e| Error::format(path, e.to_string()))
    }

    fn check_layout(self, path: &Path, count: usize) -> Result<()> {
        if self == Self::Error && count > 2 { Err(refuse_colour(path)) } else { Ok(()) }
    }

    fn colour_use(self) -> ColourUse {
        if self == Self::Error { ColourUse::Refused } else { ColourUse::Luma }
    }
}

impl ChannelPolicy for Grey {
    type Frame = AnyColourFrame;

    fn frame<S: Sample>(self, picture: Channels<'_, S>) -> Result<AnyColourFrame> {
        self.check_layout(picture.path, picture.count)?;
        let Channels { path, width, height, .. } = picture;
        let frame = Frame::new(width, height, picture.pixels());
        frame.map(S::colour).map_err(|e| Error::format(path, e.to_string()))
    }

    fn check_layout(self, path: &Path, count: usize) -> Result<()> {
        if self == Self::Error && count < 3 { Err(refuse_grey(path)) } else { Ok(()) }
    }

    fn colour_use(self) -> ColourUse {
        ColourUse::Kept
    }
}

pub(crate) fn refuse_colour(path: &Path) -> Error {
    Error::format(
        path,
        "holds colour; expected grey. Ask for luminance (0.299 R + 0.587 G + 0.114 B) by --luminance or colour=\"luminance\", or convert it to grey first",
    )
}

fn refuse_grey(path: &Path) -> Error {
    Error::format(path, "holds grey; colour is needed (red, green and blue)")
}

/// Samples in a wider type.
pub(crate) fn widened<I: Into<S>, S>(samples: Vec<I>) -> Vec<S> {
    samples.into_iter().map(Into::into).collect()
}

/// Integers of 64 bits as float64.
///
/// # Errors
/// [`Error::Format`] with the path for one beyond 2^53.
pub(crate) fn exact_doubles<I: Copy + Into<i128>>(path: &Path, samples: &[I]) -> Result<Vec<f64>> {
    let is_exact = |value: i128| value.unsigned_abs() <= u128::from(LARGEST_EXACT_INTEGER);
    let values: Option<Vec<f64>> =
        samples.iter().map(|&sample| Some(sample.into()).filter(|&value| is_exact(value)).map(|v| v as f64)).collect();
    values.ok_or_else(|| Error::format(path, "samples of 64 bits beyond 2^53, which float64 does not hold exactly"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_up_to_two_to_the_fifty_three_are_exact() {
        let path = Path::new("s.tif");
        assert_eq!(exact_doubles(path, &[-(1_i64 << 53), 3]).unwrap(), [-9_007_199_254_740_992.0, 3.0]);
        assert!(exact_doubles(path, &[(1_u64 << 53) + 1]).is_err());
        assert!(exact_doubles(path, &[i64::MIN]).is_err());
        assert_eq!(widened::<i16, f32>(vec![-7]), [-7.0]);
    }
}
