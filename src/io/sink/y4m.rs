//! A grey YUV4MPEG2 stream, to a file or standard output.

use super::{FrameSink, Kind, Uniform};
use crate::error::{Error, Result};
use crate::io::write::AtomicFile;
use crate::types::AnyFrame;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    accepts: |spec| spec == "-" || Path::new(spec).extension().is_some_and(|e| e.eq_ignore_ascii_case("y4m")),
    open: |spec, frame_rate| {
        Ok(match spec {
            "-" => Box::new(Y4mSink::new(
                Output::Stream(BufWriter::new(io::stdout())),
                "standard output".into(),
                frame_rate,
            )),
            path => Box::new(Y4mSink::create(path, frame_rate)?),
        })
    },
};

/// Writes uint8 frames as `Cmono`, uint16 frames as `Cmono16`.
#[derive(Debug)]
pub struct Y4mSink {
    output: Output,
    path: PathBuf,
    /// Frames per second as a ratio.
    rate: (u64, u64),
    uniform: Uniform,
}

#[derive(Debug)]
enum Output {
    File(AtomicFile),
    Stream(BufWriter<io::Stdout>),
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stream(stream) => stream.write(bytes),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Stream(stream) => stream.flush(),
        }
    }
}

impl Y4mSink {
    /// Begins a file, which appears under its name when it is finished.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: impl AsRef<Path>, frame_rate: f64) -> Result<Self> {
        let path = path.as_ref();
        Ok(Self::new(Output::File(AtomicFile::create(path)?), path.to_path_buf(), frame_rate))
    }

    fn new(output: Output, path: PathBuf, frame_rate: f64) -> Self {
        Self { output, path, rate: ratio(frame_rate), uniform: Uniform::default() }
    }

    fn put(&mut self, frame: &AnyFrame, first: bool) -> io::Result<()> {
        if first {
            let ((w, h), (a, b)) = (frame.size(), self.rate);
            let layout = if matches!(frame, AnyFrame::U8(_)) { "mono" } else { "mono16" };
            writeln!(self.output, "YUV4MPEG2 W{w} H{h} F{a}:{b} Ip A1:1 C{layout} XCOLORRANGE=FULL")?;
        }
        self.output.write_all(b"FRAME\n")?;
        match frame {
            AnyFrame::U8(f) => self.output.write_all(f.data()),
            AnyFrame::U16(f) => {
                let bytes: Vec<u8> = f.data().iter().flat_map(|s| s.to_le_bytes()).collect();
                self.output.write_all(&bytes)
            }
            AnyFrame::F32(_) | AnyFrame::F64(_) => Ok(()),
        }
    }
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
        if matches!(frame, AnyFrame::F32(_) | AnyFrame::F64(_)) {
            let expected = "uint8 or uint16 samples for Y4M (floats go to .npy)".into();
            return Err(Error::Type { argument: "frame", expected, got: frame.dtype().into() });
        }
        let first = self.uniform.check(frame)?;
        self.put(frame, first).map_err(|e| Error::io(&self.path, e))
    }
    fn finish(self: Box<Self>) -> Result<()> {
        match self.output {
            Output::File(file) => file.commit(),
            Output::Stream(mut stream) => stream.flush().map_err(|e| Error::io(&self.path, e)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Frame;

    #[test]
    fn frame_rates_become_ratios() {
        assert_eq!([25.0, 29.97, 23.976, 59.94].map(ratio), [(25, 1), (30000, 1001), (24000, 1001), (60000, 1001)]);
        assert_eq!([12.5, 0.1].map(ratio), [(12_500_000, 1_000_000), (100_000, 1_000_000)]);
    }

    #[test]
    fn floats_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut sink = Y4mSink::create(folder.path().join("a.y4m"), 25.0).unwrap();
        assert!(matches!(
            sink.write(&AnyFrame::F32(Frame::filled(1, 1, 0.0))),
            Err(Error::Type { argument: "frame", .. })
        ));
    }
}
