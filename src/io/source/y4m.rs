//! YUV4MPEG2 (`.y4m`): uncompressed video with a text header, from a file or standard input. The luma plane is the grey image.

use super::{FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::decode::check_size;
use crate::types::{AnyFrame, Frame};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "y4m",
    accepts: |spec| spec == "-" || has_extension(spec, &["y4m"]),
    open: |spec, _| {
        Ok(match spec {
            "-" => Box::new(Y4mSource::new("standard input", BufReader::new(io::stdin()))?),
            path => Box::new(Y4mSource::open(path)?),
        })
    },
};

/// Longest header line accepted, bytes.
const MAX_LINE: u64 = 4096;

/// Frames of a YUV4MPEG2 stream: `mono`, `420` (all variants), `411`, `422`, `440` and `444` with or without alpha, 8 to 16 bit.
///
/// Luma is taken as coded (so `16..=235` for studio range). Eight-bit streams give uint8; deeper ones (`p10`, `p12`, ..., `mono16`) give
/// uint16, shifted left so that the stream's full scale is that of 16 bits.
#[derive(Debug)]
pub struct Y4mSource<R> {
    name: PathBuf,
    input: R,
    width: usize,
    height: usize,
    bits: u32,
    /// Bytes after the luma plane of each frame.
    chroma_bytes: u64,
    frame_rate: Option<f64>,
    frame: usize,
}

impl Y4mSource<BufReader<File>> {
    /// Opens a file.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no YUV4MPEG2 stream.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        Self::new(path, BufReader::with_capacity(1 << 18, file))
    }
}

impl<R: BufRead> Y4mSource<R> {
    /// Reads the header of a stream; `name` stands for it in messages.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no YUV4MPEG2 stream or its frames are empty or over 65 536 px wide or high.
    pub fn new(name: impl AsRef<Path>, mut input: R) -> Result<Self> {
        let name = name.as_ref().to_path_buf();
        let line = read_line(&mut input, &name)?.unwrap_or_default();
        let Some(parameters) = line.strip_prefix("YUV4MPEG2") else {
            return Err(Error::format(&name, "not a YUV4MPEG2 stream (its signature is missing)"));
        };
        let (mut width, mut height, mut layout, mut frame_rate) = (0, 0, "420", None);
        for parameter in parameters.split_ascii_whitespace() {
            let (key, value) = parameter.split_at(parameter.chars().next().map_or(0, char::len_utf8));
            match key {
                "W" => width = parse_length(&name, parameter, value)?,
                "H" => height = parse_length(&name, parameter, value)?,
                "C" => layout = value,
                "F" => frame_rate = parse_rate(value),
                _ => {}
            }
        }
        check_size(&name, width, height)?;
        let (bits, chroma_samples) = parse_layout(layout, width, height)
            .ok_or_else(|| Error::format(&name, format!("unknown YUV4MPEG2 layout C{layout}")))?;
        let chroma_bytes = chroma_samples * if bits > 8 { 2 } else { 1 };
        Ok(Self { name, input, width, height, bits, chroma_bytes, frame_rate, frame: 0 })
    }

    /// Passes the line in front of a frame; false at the end of the stream.
    fn begin_frame(&mut self) -> Result<bool> {
        match read_line(&mut self.input, &self.name)? {
            None => Ok(false),
            Some(line) if line == "FRAME" || line.starts_with("FRAME ") => Ok(true),
            Some(_) => Err(self.cut_off("does not begin with FRAME")),
        }
    }

    fn luma_bytes(&self) -> usize {
        self.width * self.height * if self.bits > 8 { 2 } else { 1 }
    }

    fn cut_off(&self, what: &str) -> Error {
        Error::format(&self.name, format!("frame {} {what}", self.frame))
    }

    /// Reads and forgets `count` bytes.
    fn discard(&mut self, count: u64) -> Result<()> {
        let passed = io::copy(&mut (&mut self.input).take(count), &mut io::sink());
        match passed.map_err(|e| Error::io(&self.name, e))? {
            n if n == count => Ok(()),
            _ => Err(self.cut_off("is cut off")),
        }
    }
}

/// A line without its end; `None` at the end of the input.
fn read_line(input: &mut impl BufRead, name: &Path) -> Result<Option<String>> {
    let mut line = Vec::new();
    input.take(MAX_LINE).read_until(b'\n', &mut line).map_err(|e| Error::io(name, e))?;
    if line.is_empty() {
        return Ok(None);
    }
    if line.pop() != Some(b'\n') {
        return Err(Error::format(name, "a YUV4MPEG2 header line is cut off or too long"));
    }
    Ok(Some(String::from_utf8_lossy(&line).into_owned()))
}

fn parse_length(name: &Path, parameter: &str, value: &str) -> Result<usize> {
    value.parse().map_err(|_| Error::format(name, format!("'{parameter}' in the YUV4MPEG2 header is no size")))
}

/// Frames per second from `numerator:denominator`; `None` where it is unknown (`0:0`) or malformed.
fn parse_rate(value: &str) -> Option<f64> {
    let (a, b) = value.split_once(':')?;
    let rate = a.parse::<u32>().ok().map(f64::from)? / b.parse::<u32>().ok().map(f64::from)?;
    (rate > 0.0 && rate.is_finite()).then_some(rate)
}

/// Bits of a sample and number of samples after the luma plane.
fn parse_layout(layout: &str, width: usize, height: usize) -> Option<(u32, u64)> {
    let (w, h) = (width as u64, height as u64);
    if let Some(depth) = layout.strip_prefix("mono") {
        return Some((if depth.is_empty() { 8 } else { parse_bits(depth)? }, 0));
    }
    let digits = layout.find(|c: char| !c.is_ascii_digit()).unwrap_or(layout.len());
    let (sampling, rest) = layout.split_at(digits);
    let chroma = 2 * match sampling {
        "420" => w.div_ceil(2) * h.div_ceil(2),
        "411" => w.div_ceil(4) * h,
        "422" => w.div_ceil(2) * h,
        "440" => w * h.div_ceil(2),
        "444" => w * h,
        _ => return None,
    };
    match rest {
        "" | "jpeg" | "mpeg2" | "paldv" => Some((8, chroma)),
        "alpha" => Some((8, chroma + w * h)),
        _ => Some((parse_bits(rest.strip_prefix('p')?)?, chroma)),
    }
}

fn parse_bits(text: &str) -> Option<u32> {
    text.parse().ok().filter(|bits| (8..=16).contains(bits))
}

impl<R: BufRead + Send> FrameSource for Y4mSource<R> {
    fn next_frame(&mut self) -> Result<Option<AnyFrame>> {
        if !self.begin_frame()? {
            return Ok(None);
        }
        // Grown as the bytes come: a header alone cannot make a large allocation.
        let (length, mut luma) = (self.luma_bytes(), Vec::new());
        (&mut self.input).take(length as u64).read_to_end(&mut luma).map_err(|e| Error::io(&self.name, e))?;
        if luma.len() < length {
            return Err(self.cut_off("is cut off"));
        }
        self.discard(self.chroma_bytes)?;
        self.frame += 1;
        if self.bits == 8 {
            return Frame::new(self.width, self.height, luma).map(|f| Some(AnyFrame::U8(f)));
        }
        let shift = 16 - self.bits;
        let samples = luma.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]) << shift).collect();
        Frame::new(self.width, self.height, samples).map(|f| Some(AnyFrame::U16(f)))
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        for done in 0..count {
            if !self.begin_frame()? {
                return Ok(done);
            }
            self.discard(self.luma_bytes() as u64 + self.chroma_bytes)?;
            self.frame += 1;
        }
        Ok(count)
    }
    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }
    fn describe(&self) -> String {
        format!("{} (Y4M, {} x {}, {} bit)", self.name.display(), self.width, self.height, self.bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(bytes: &[u8]) -> Result<Vec<AnyFrame>> {
        let mut source = Y4mSource::new("test.y4m", bytes)?;
        let mut frames = Vec::new();
        while let Some(frame) = source.next_frame()? {
            frames.push(frame);
        }
        Ok(frames)
    }

    /// Two frames of 3 x 2 pixels, luma 0..6 and 10..16, followed by `chroma` bytes each.
    fn stream(layout: &str, chroma: usize) -> Vec<u8> {
        let mut bytes = format!("YUV4MPEG2 W3 H2 F30000:1001 Ip A1:1 {layout} XCOLORRANGE=FULL\n").into_bytes();
        for start in [0u8, 10] {
            bytes.extend(if start == 0 { &b"FRAME\n"[..] } else { &b"FRAME Ip\n"[..] });
            bytes.extend(start..start + 6);
            bytes.extend(std::iter::repeat_n(99, chroma));
        }
        bytes
    }

    #[test]
    fn luma_is_taken_from_every_layout() {
        for (layout, chroma) in [
            ("Cmono", 0),
            ("", 4),
            ("C420", 4),
            ("C420jpeg", 4),
            ("C420mpeg2", 4),
            ("C420paldv", 4),
            ("C411", 4),
            ("C422", 8),
            ("C440", 6),
            ("C444", 12),
            ("C444alpha", 18),
        ] {
            let frames = read(&stream(layout, chroma)).unwrap();
            let want = |start| AnyFrame::U8(Frame::new(3, 2, (start..start + 6).collect()).unwrap());
            assert_eq!(frames, [want(0), want(10)], "{layout}");
        }
        let bytes = stream("Cmono", 0);
        let source = Y4mSource::new("x", &bytes[..]).unwrap();
        assert!((source.frame_rate().unwrap() - 29.97).abs() < 0.001);
    }

    #[test]
    fn deep_samples_are_scaled_to_sixteen_bits() {
        let mut bytes = b"YUV4MPEG2 W2 H1 F25:1 C420p10\nFRAME\n".to_vec();
        bytes.extend([0xff, 0x03, 0x01, 0x00, 0, 2, 0, 2]);
        assert_eq!(read(&bytes).unwrap(), [AnyFrame::U16(Frame::new(2, 1, vec![1023 << 6, 1 << 6]).unwrap())]);
        let bytes = b"YUV4MPEG2 W1 H1 Cmono16\nFRAME\n\x34\x12";
        assert_eq!(read(bytes).unwrap(), [AnyFrame::U16(Frame::new(1, 1, vec![0x1234]).unwrap())]);
    }

    #[test]
    fn frames_can_be_passed_over() {
        let bytes = stream("C420", 4);
        let mut source = Y4mSource::new("x", &bytes[..]).unwrap();
        assert_eq!(source.skip(1).unwrap(), 1);
        assert_eq!(source.next_frame().unwrap().unwrap().to_real::<f64>().get(0, 0), 10.0);
        assert_eq!(source.skip(3).unwrap(), 0);
    }

    #[test]
    fn broken_streams_are_format_errors_that_name_the_stream() {
        let whole = stream("C420", 4);
        for cut in [0, 5, 30, whole.len() - 1, whole.len() - 5, whole.len() - 14] {
            let error = read(&whole[..cut]).unwrap_err();
            assert!(
                matches!(error, Error::Format { .. }) && error.to_string().starts_with("test.y4m"),
                "{cut}: {error}"
            );
        }
        for header in [
            "YUV4MPEG2 W0 H2\n",
            "YUV4MPEG2 W-1 H2\n",
            "YUV4MPEG2 W99999999999999999999 H2\n",
            "YUV4MPEG2 W70000 H2\n",
            "YUV4MPEG2 W2 H2 C999\n",
            "YUV4MPEG2 W2 H2 Cmono99\n",
            "YUV4MPEG2 W2 H2 C420é\n",
            "YUV4MPEG2 é\n",
            "RIFF\n",
        ] {
            assert!(matches!(read(header.as_bytes()), Err(Error::Format { .. })), "{header}");
        }
        assert!(
            read(b"YUV4MPEG2 W65536 H65536 C444p16\nFRAME\nxx").is_err(),
            "no memory is taken for what is not there"
        );
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), at in 0usize..90, value: u8) {
            let _ = read(&bytes);
            let mut damaged = stream("C420p10", 8);
            let at = at.min(damaged.len() - 1);
            damaged[at] = value;
            let _ = read(&damaged);
            let _ = read(&[&b"YUV4MPEG2 "[..], &bytes].concat());
        }
    }
}
