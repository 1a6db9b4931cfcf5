//! YUV4MPEG2 (`.y4m`): uncompressed video with a text header, from a file or standard input. The luma plane is the grey image.

use super::{Colour, FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::decode::{check_size, refuse_colour};
use crate::types::{AnyFrame, Frame};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "y4m",
    accepts: |spec| spec == "-" || has_extension(spec, &["y4m"]),
    open: |spec, colour| {
        Ok(match spec {
            "-" => Box::new(Y4mSource::new("standard input", BufReader::new(io::stdin()))?.with_colour(colour)),
            path => Box::new(Y4mSource::open(path)?.with_colour(colour)),
        })
    },
};

/// Longest header line accepted, bytes.
const MAX_LINE: u64 = 4096;

/// Frames of a YUV4MPEG2 stream: `mono`, `420` (all variants), `411`, `422`, `440` and `444` with or without alpha, 8 to 16 bit.
///
/// Colour is refused where [`Y4mSource::with_colour`] says so, else luma is taken. Luma is taken as coded (so `16..=235` for studio range). Eight-bit streams give uint8; deeper ones (`p10`, `p12`, ..., `mono16`) give
/// uint16, shifted left so that the stream's full scale is that of 16 bits.
#[derive(Debug)]
pub struct Y4mSource<R> {
    name: PathBuf,
    input: R,
    width: usize,
    height: usize,
    bits: u32,
    /// Bytes of both chroma planes, after the luma plane of each frame, and of what follows them.
    chroma_bytes: [u64; 2],
    colour: Colour,
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
        let (bits, samples) = parse_layout(layout, width, height)
            .ok_or_else(|| Error::format(&name, format!("unknown YUV4MPEG2 layout C{layout}")))?;
        let chroma_bytes = samples.map(|count| count * if bits > 8 { 2 } else { 1 });
        Ok(Self { name, input, width, height, bits, chroma_bytes, colour: Colour::Luminance, frame_rate, frame: 0 })
    }

    /// What to do with colour; [`Colour::Luminance`] until it is said, which takes the luma plane. Grey in a coloured layout is grey: its chroma is in the middle of the scale.
    pub fn with_colour(self, colour: Colour) -> Self {
        Self { colour, ..self }
    }

    /// Passes the chroma planes of a frame, which must be grey where colour is refused.
    fn pass_chroma(&mut self) -> Result<()> {
        let [chroma, alpha] = self.chroma_bytes;
        if self.colour == Colour::Luminance {
            return self.discard(chroma + alpha);
        }
        let mut planes = Vec::new();
        (&mut self.input).take(chroma).read_to_end(&mut planes).map_err(|e| Error::io(&self.name, e))?;
        if (planes.len() as u64) < chroma {
            return Err(self.cut_off("is cut off"));
        }
        let middle = 1_u16 << (self.bits - 1);
        // Conversion from red, green and blue rounds.
        let is_grey = |sample: u16| sample.abs_diff(middle) <= 1;
        let grey = match self.bits {
            8 => planes.iter().all(|sample| is_grey(u16::from(*sample))),
            _ => planes.chunks_exact(2).all(|b| is_grey(u16::from_le_bytes([b[0], b[1]]))),
        };
        if !grey {
            return Err(refuse_colour(&self.name));
        }
        self.discard(alpha)
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

/// Bits of a sample, and how many samples of chroma and of alpha follow the luma plane.
fn parse_layout(layout: &str, width: usize, height: usize) -> Option<(u32, [u64; 2])> {
    let (w, h) = (width as u64, height as u64);
    if let Some(depth) = layout.strip_prefix("mono") {
        return Some((if depth.is_empty() { 8 } else { parse_bits(depth)? }, [0, 0]));
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
        "" | "jpeg" | "mpeg2" | "paldv" => Some((8, [chroma, 0])),
        "alpha" => Some((8, [chroma, w * h])),
        _ => Some((parse_bits(rest.strip_prefix('p')?)?, [chroma, 0])),
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
        self.pass_chroma()?;
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
            self.discard(self.luma_bytes() as u64 + self.chroma_bytes.iter().sum::<u64>())?;
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
mod tests;
