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
        Ok(Self::new((Output::File(AtomicFile::create(path)?), path.to_path_buf()), frame_rate))
    }

    /// A file, or standard output for `-`.
    fn open(spec: &str, frame_rate: f64) -> Result<Self> {
        Ok(Self::new(Output::open(spec.as_ref())?, frame_rate))
    }

    fn new((output, path): (Output, PathBuf), frame_rate: f64) -> Self {
        Self { output, path, rate: ratio(frame_rate), uniform: Uniform::default() }
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

/// A frame rate as a ratio: whole, of the family 1000 n / 1001 (29.97, 23.976, ...), or to a millionth.
pub(in crate::io) fn ratio(rate: f64) -> (u64, u64) {
    if rate.fract() == 0.0 {
        return (rate as u64, 1);
    }
    let numerator = (rate * 1.001).round() * 1000.0;
    if (numerator / 1001.0 - rate).abs() < 5e-4 * rate.min(10.0) {
        return (numerator as u64, 1001);
    }
    (((rate * 1e6).round() as u64).max(1), 1_000_000)
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
        assert_eq!([25.0, 29.97, 23.976, 59.94].map(ratio), [(25, 1), (30000, 1001), (24000, 1001), (60000, 1001)]);
        assert_eq!([12.5, 0.1].map(ratio), [(12_500_000, 1_000_000), (100_000, 1_000_000)]);
    }
}
