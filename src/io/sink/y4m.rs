//! A YUV4MPEG2 stream, grey or in colour, to a file or standard output.

use super::{FrameSink, Kind, Uniform};
use crate::error::{Error, Result};
use crate::io::channels::FrameFormat;
use crate::io::write::{AtomicFile, Output};
use crate::io::ycbcr::Coding;
use crate::types::{AnyColourFrame, AnyFrame, Sample};
use std::io::Write;
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    accepts: |spec| spec == "-" || Path::new(spec).extension().is_some_and(|e| e.eq_ignore_ascii_case("y4m")),
    open: |spec, frame_rate| Ok(Box::new(Y4mSink::open(spec, frame_rate)?)),
    open_colour: |spec, frame_rate| Ok(Box::new(Y4mSink::open(spec, frame_rate)?)),
};

/// Writes frames as `Cmono`, `Cmono16`, in colour `C444`, `C444p16`, full range, by ITU-R BT.601.
#[derive(Debug)]
pub struct Y4mSink {
    output: Output,
    path: PathBuf,
    /// Frames per second as a ratio.
    rate: (u64, u64),
    uniform: Uniform,
}

impl Y4mSink {
    /// Begins a file, which appears under its name when it is finished.
    pub fn create(path: impl AsRef<Path>, frame_rate: f64) -> Result<Self> {
        let path = path.as_ref();
        let rate = ratio(frame_rate)?;
        Ok(Self::new((Output::File(AtomicFile::create(path)?), path.to_path_buf()), rate))
    }

    /// A file, or standard output for `-`.
    fn open(spec: &str, frame_rate: f64) -> Result<Self> {
        let rate = ratio(frame_rate)?;
        Ok(Self::new(Output::open(spec.as_ref())?, rate))
    }

    fn new((output, path): (Output, PathBuf), rate: (u64, u64)) -> Self {
        Self { output, path, rate, uniform: Uniform::default() }
    }

    fn put(&mut self, frame: &impl FrameFormat, layout: &str, planes: &[u8]) -> Result<()> {
        let first = self.uniform.check(frame)?;
        let ((w, h), (a, b)) = (frame.size(), self.rate);
        let header = format!("YUV4MPEG2 W{w} H{h} F{a}:{b} Ip A1:1 C{layout} XCOLORRANGE=FULL\n");
        let parts = [if first { header.as_bytes() } else { &[] }, b"FRAME\n", planes];
        let written = parts.iter().try_for_each(|part| self.output.write_all(part));
        written.map_err(|e| Error::io(&self.path, e))
    }
}

/// As [`planes`], of 8 bits each.
pub(in crate::io) fn eight_bit_planes(pixels: &[[u8; 3]]) -> Vec<u8> {
    planes(pixels, 8).into_iter().map(|code| code as u8).collect()
}

fn little_endian(samples: &[u16]) -> Vec<u8> {
    samples.iter().flat_map(|sample| sample.to_le_bytes()).collect()
}

/// Luma and both planes of chroma, one after the other, of `bits` bits.
fn planes<S: Sample>(pixels: &[[S; 3]], bits: u32) -> Vec<u16> {
    let coding = Coding::new(bits, true);
    let mut planes = vec![0; 3 * pixels.len()];
    for (at, pixel) in pixels.iter().enumerate() {
        let codes = coding.encode(pixel.map(|sample| sample.to_real::<f64>() / S::FULL_SCALE));
        for (plane, code) in codes.into_iter().enumerate() {
            planes[plane * pixels.len() + at] = code;
        }
    }
    planes
}

fn refuse_floats(dtype: &str) -> Error {
    let expected = "uint8 or uint16 samples for Y4M (floats go to .npy)".into();
    Error::Type { argument: "frame", expected, got: dtype.into() }
}

/// Maximum of the numerator and of the denominator of a frame rate: readers take signed integers of 32 bits.
const MAX_TERM: f64 = i32::MAX as f64;

/// Relative error to which a header holds a frame rate.
const RATE_TOLERANCE: f64 = 1e-6;

/// A frame rate as a ratio: of the family 1000 n / 1001 where it is the usual short form of one (29.97,
/// 23.976, ...), else by its continued fraction.
///
/// # Errors
/// [`Error::Argument`] named `frame_rate` for a rate that no ratio of 32-bit numbers holds.
pub(in crate::io) fn ratio(rate: f64) -> Result<(u64, u64)> {
    // The short forms are n (1 - 1e-6) 1000 / 1001; the margin is for rounding.
    let family = (rate * 1.001).round();
    if family <= 1000.0 && (family * 1000.0 / 1001.0 - rate).abs() <= 1.001 * RATE_TOLERANCE * rate {
        return Ok((family as u64 * 1000, 1001));
    }
    let (numerator, denominator) = continued_fraction(rate);
    if (numerator / denominator - rate).abs() <= RATE_TOLERANCE * rate {
        return Ok((numerator as u64, denominator as u64));
    }
    let expected = format!("from 1/{MAX_TERM} to {MAX_TERM} frames per second, which a Y4M header can hold");
    Err(Error::argument("frame_rate", expected, format!("{rate:e}")))
}

/// The first convergent of the continued fraction of `value` that equals it to rounding, or the last one
/// whose terms are at most [`MAX_TERM`].
fn continued_fraction(value: f64) -> (f64, f64) {
    let (mut last, mut here, mut rest) = ((0.0, 1.0), (1.0, 0.0), value);
    loop {
        let whole = rest.floor();
        let next = (whole * here.0 + last.0, whole * here.1 + last.1);
        if !(next.0 <= MAX_TERM && next.1 <= MAX_TERM) {
            return here;
        }
        (last, here, rest) = (here, next, (rest - whole).recip());
        if (here.0 / here.1 - value).abs() <= 1e-14 * value {
            return here;
        }
    }
}

impl FrameSink for Y4mSink {
    fn write(&mut self, frame: &AnyFrame) -> Result<()> {
        match frame {
            AnyFrame::U8(f) => self.put(frame, "mono", f.data()),
            AnyFrame::U16(f) => self.put(frame, "mono16", &little_endian(f.data())),
            AnyFrame::F32(_) | AnyFrame::F64(_) => Err(refuse_floats(frame.dtype())),
        }
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.output.finish()
    }
}

impl FrameSink<AnyColourFrame> for Y4mSink {
    fn write(&mut self, frame: &AnyColourFrame) -> Result<()> {
        match frame {
            AnyColourFrame::U8(f) => self.put(frame, "444", &eight_bit_planes(f.data())),
            AnyColourFrame::U16(f) => self.put(frame, "444p16", &little_endian(&planes(f.data(), 16))),
            AnyColourFrame::F32(_) | AnyColourFrame::F64(_) => Err(refuse_floats(frame.dtype())),
        }
    }
    fn finish(self: Box<Self>) -> Result<()> {
        self.output.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rates_become_ratios() {
        let known = |rate: f64| ratio(rate).unwrap();
        assert_eq!([25.0, 29.97, 23.976, 59.94].map(known), [(25, 1), (30000, 1001), (24000, 1001), (60000, 1001)]);
        assert_eq!([12.5, 0.1, 23.98, 29.971].map(known), [(25, 2), (1, 10), (1199, 50), (29971, 1000)]);
        assert_eq!([30000.0 / 1001.0, 10000.0 / 1001.0].map(known), [(30000, 1001), (10000, 1001)]);
        assert_eq!(
            [1.0 / 3600.0, 1.0 / 86400.0, 1e-9, MAX_TERM].map(known),
            [(1, 3600), (1, 86400), (1, 1_000_000_000), (i32::MAX as u64, 1)]
        );
    }

    #[test]
    fn frame_rates_in_range_are_held_to_a_billionth() {
        for step in 0..2000 {
            let rate = (f64::from(step) * 0.02135 - 21.35).exp();
            let (a, b) = ratio(rate).unwrap();
            assert!((a as f64 / b as f64 / rate - 1.0).abs() < 1e-9, "{rate}: {a}/{b}");
        }
    }

    #[test]
    fn frame_rates_that_no_header_holds_are_refused() {
        for rate in [1e300, 4e9, 1e-10, 5e-324] {
            let message = ratio(rate).unwrap_err().to_string();
            assert!(message.starts_with("frame_rate: expected from 1/2147483647 to 2147483647 "), "{message}");
        }
    }
}
