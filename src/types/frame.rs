//! Grey images in memory.

use crate::error::{Error, Result};
use crate::math::Real;

/// A grey image: `height` rows of `width` samples, row-major, `[row, col] = [y, x]`, x right and y down.
#[derive(Debug, Clone, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(try_from = "Unchecked<T>"))]
pub struct Frame<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

/// Largest integer below which float64 holds every integer.
pub const LARGEST_EXACT_INTEGER: u64 = 1 << 53;
/// A frame as it is read: any number of samples.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct Unchecked<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

#[cfg(feature = "serde")]
impl<T> TryFrom<Unchecked<T>> for Frame<T> {
    type Error = Error;

    fn try_from(read: Unchecked<T>) -> Result<Self> {
        Self::new(read.width, read.height, read.data)
    }
}

/// Which pixels may be used: `true` is used.
pub type Mask = Frame<bool>;

impl<T> Frame<T> {
    /// A frame from row-major samples.
    ///
    /// # Errors
    /// [`Error::Argument`] when `data` does not hold `width * height` samples.
    pub fn new(width: usize, height: usize, data: Vec<T>) -> Result<Self> {
        if width.checked_mul(height) != Some(data.len()) {
            return Err(Error::argument(
                "data",
                format!("{width} x {height} samples"),
                format!("{} samples", data.len()),
            ));
        }
        Ok(Self { width, height, data })
    }

    /// A frame whose sample at column `x`, row `y` is `value(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut value: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(width * height);
        for y in 0..height {
            data.extend((0..width).map(|x| value(x, y)));
        }
        Self { width, height, data }
    }

    /// Columns.
    #[inline]
    pub fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    #[inline]
    pub fn height(&self) -> usize {
        self.height
    }
    /// `(width, height)`.
    #[inline]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }
    /// All samples, row-major.
    #[inline]
    pub fn data(&self) -> &[T] {
        &self.data
    }
    /// All samples, row-major, to be changed.
    #[inline]
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }
    /// The samples themselves.
    pub fn into_data(self) -> Vec<T> {
        self.data
    }
    /// Row `y`.
    #[inline]
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..(y + 1) * self.width]
    }
    /// Row `y`, to be changed.
    #[inline]
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.width..(y + 1) * self.width]
    }
    /// Every sample changed by `f`.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Frame<U> {
        Frame { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

impl<T: Copy> Frame<T> {
    /// A frame of one value.
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }
    /// The sample at column `x`, row `y`.
    #[inline]
    pub fn get(&self, x: usize, y: usize) -> T {
        self.data[y * self.width + x]
    }
}

/// A type that image samples come in.
pub trait Sample: Copy + Send + Sync + 'static {
    /// numpy's name of the type.
    const DTYPE: &'static str;
    /// The value of white: 255, 65535, or 1 for floats.
    const FULL_SCALE: f64;
    /// The sample in working precision, unscaled.
    fn to_real<T: Real>(self) -> T;
    /// The nearest sample to `value`; integers are kept in range, and NaN becomes 0.
    fn from_f64_nearest(value: f64) -> Self;
    /// The grey frame with its type as data.
    fn grey(frame: Frame<Self>) -> AnyFrame;
    /// The colour frame with its type as data.
    fn colour(frame: ColourFrame<Self>) -> AnyColourFrame;
}

macro_rules! samples {
    ($($t:ty, $variant:ident, $name:literal, $full:expr, |$value:ident| $nearest:expr;)*) => {$(
        impl Sample for $t {
            const DTYPE: &'static str = $name;
            const FULL_SCALE: f64 = $full;
            #[inline(always)]
            fn to_real<T: Real>(self) -> T {
                T::from_f64(f64::from(self))
            }
            #[inline(always)]
            fn from_f64_nearest($value: f64) -> Self {
                $nearest
            }
            fn grey(frame: Frame<Self>) -> AnyFrame {
                AnyFrame::$variant(frame)
            }
            fn colour(frame: ColourFrame<Self>) -> AnyColourFrame {
                AnyColourFrame::$variant(frame)
            }
        }
    )*};
}
samples! {
    u8, U8, "uint8", 255.0, |value| value.round() as u8;
    u16, U16, "uint16", 65535.0, |value| value.round() as u16;
    f32, F32, "float32", 1.0, |value| value as f32;
    f64, F64, "float64", 1.0, |value| value;
}

/// A colour image: red, green and blue of each pixel, `[row, col] = [y, x]`.
pub type ColourFrame<T> = Frame<[T; 3]>;

/// Runs an expression on the frame of either enum, whatever its sample type `S` is.
macro_rules! each_sample {
    ($self:ident, $frame:ident: $s:ident => $body:expr) => {
        match $self {
            Self::U8($frame) => {
                type $s = u8;
                $body
            }
            Self::U16($frame) => {
                type $s = u16;
                $body
            }
            Self::F32($frame) => {
                type $s = f32;
                $body
            }
            Self::F64($frame) => {
                type $s = f64;
                $body
            }
        }
    };
}

/// Frames as they came from a file or an array, in their own sample type.
macro_rules! any_frame {
    ($(#[$doc:meta] $name:ident($frame:ident))*) => {$(
        #[$doc]
        #[derive(Debug, Clone, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        pub enum $name {
            /// 8-bit samples.
            U8($frame<u8>),
            /// 16-bit samples.
            U16($frame<u16>),
            /// Single precision.
            F32($frame<f32>),
            /// Double precision.
            F64($frame<f64>),
        }

        impl $name {
            /// `(width, height)`.
            pub fn size(&self) -> (usize, usize) {
                each_sample!(self, frame: _S => frame.size())
            }

            /// numpy's name of the sample type.
            pub fn dtype(&self) -> &'static str {
                each_sample!(self, _frame: S => S::DTYPE)
            }
        }
    )*};
}
any_frame! {
    /// A grey frame as it came from a file or an array, in its own sample type.
    AnyFrame(Frame)
    /// A colour frame as it came from a file or an array, in its own sample type.
    AnyColourFrame(ColourFrame)
}

/// Refuses a frame whose samples are of type `dtype`, where those of the first are of another.
///
/// # Errors
/// [`Error::Type`] naming `argument`.
pub fn expect_dtype(argument: &'static str, dtype: &str, first: &str) -> Result<()> {
    if dtype == first {
        return Ok(());
    }
    Err(Error::Type { argument, expected: format!("{first} like the first frame"), got: dtype.into() })
}

impl AnyFrame {
    /// The frame in working precision; values are not rescaled.
    pub fn to_real<T: Real>(&self) -> Frame<T> {
        each_sample!(self, frame: _S => frame.map(|sample| sample.to_real()))
    }
}

impl AnyColourFrame {
    /// Red, green and blue in single precision, every sample multiplied by `gain`.
    pub fn scaled(&self, gain: f64) -> ColourFrame<f32> {
        let gain = gain as f32;
        each_sample!(self, frame: S => frame.map(|pixel| pixel.map(|sample: S| sample.to_real::<f32>() * gain)))
    }
}
