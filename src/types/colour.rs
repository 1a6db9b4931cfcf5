//! Colour images in memory.

use super::frame::{Frame, Sample};

/// A colour image: red, green and blue of each pixel, `[row, col] = [y, x]`.
pub type ColourFrame<T> = Frame<[T; 3]>;

/// A colour frame as it came from a file or an array, in its own sample type.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyColourFrame {
    /// 8-bit samples.
    U8(ColourFrame<u8>),
    /// 16-bit samples.
    U16(ColourFrame<u16>),
    /// Single precision.
    F32(ColourFrame<f32>),
    /// Double precision.
    F64(ColourFrame<f64>),
}

impl AnyColourFrame {
    /// `(width, height)`.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::U8(frame) => frame.size(),
            Self::U16(frame) => frame.size(),
            Self::F32(frame) => frame.size(),
            Self::F64(frame) => frame.size(),
        }
    }

    /// numpy's name of the sample type.
    pub fn dtype(&self) -> &'static str {
        match self {
            Self::U8(_) => u8::DTYPE,
            Self::U16(_) => u16::DTYPE,
            Self::F32(_) => f32::DTYPE,
            Self::F64(_) => f64::DTYPE,
        }
    }

    /// Red, green and blue in single precision, every sample multiplied by `gain`.
    pub fn scaled(&self, gain: f64) -> ColourFrame<f32> {
        fn scale<S: Sample>(frame: &ColourFrame<S>, gain: f64) -> ColourFrame<f32> {
            let gain = gain as f32;
            frame.map(|pixel| pixel.map(|sample| sample.to_real::<f32>() * gain))
        }
        match self {
            Self::U8(frame) => scale(frame, gain),
            Self::U16(frame) => scale(frame, gain),
            Self::F32(frame) => scale(frame, gain),
            Self::F64(frame) => scale(frame, gain),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_scaled_in_single_precision() {
        let frame = AnyColourFrame::U16(Frame::new(1, 1, vec![[0, 257, 65535]]).unwrap());
        assert_eq!((frame.size(), frame.dtype()), ((1, 1), "uint16"));
        assert_eq!(frame.scaled(1.0 / 257.0).data(), [[0.0, 1.0, 255.0]]);
    }
}
