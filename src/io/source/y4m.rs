//! YUV4MPEG2 (`.y4m`): uncompressed video, from a file or standard input; luma is the grey image.

use super::{FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Channels, Colour, ColourUse, refuse_colour};
use crate::io::limits::check_size;
use crate::io::ycbcr::Coding;
use crate::types::Sample;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "y4m",
    accepts: |spec| spec == "-" || has_extension(spec, &["y4m"]),
    signatures: &[b"YUV4MPEG2 "],
    has_planes: false,
    members: super::no_members,
    open: |spec, options| open_stream(spec, options.colour),
    open_colour: |spec, options| open_stream(spec, options.grey),
};

fn open_stream<P: ChannelPolicy>(spec: &str, policy: P) -> Result<Box<dyn FrameSource<P::Frame>>> {
    Ok(match spec {
        "-" => Box::new(Y4mSource::new("standard input", BufReader::new(io::stdin()))?.with_policy(policy)),
        path => Box::new(Y4mSource::open(path)?.with_policy(policy)),
    })
}

/// Longest header line accepted, bytes.
const MAX_LINE: u64 = 4096;

/// Frames of a YUV4MPEG2 stream: `mono`, `420`, `411`, `422`, `440`, `444`, 8 to 16 bit.
///
/// Eight-bit streams give uint8, deeper ones (`p10`, `p12`, ..., `mono16`) uint16. What is read depends on
/// [`Y4mSource::with_policy`]:
///
/// - Grey frames: colour is refused or its luma is taken, as coded (so `16..=235` for limited range). Deeper
///   luma is shifted left so that the stream's full scale is that of 16 bits.
/// - Colour frames: red, green and blue by the matrix of ITU-R BT.601, each pixel with the chroma sample that
///   covers it; full range where the header says `XCOLORRANGE=FULL`, else limited range (16 to 235). `mono`
///   is grey: where that may be repeated the luma is taken as coded.
#[derive(Debug)]
pub struct Y4mSource<R, P = Colour> {
    name: PathBuf,
    input: R,
    width: usize,
    height: usize,
    layout: Layout,
    full_range: bool,
    policy: P,
    frame_rate: Option<f64>,
    frame: usize,
}

/// What follows the luma plane of a frame, and the depth of all samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Layout {
    bits: u32,
    /// Pixels that one sample of chroma covers, across and down; `None`: there is no chroma.
    chroma: Option<[usize; 2]>,
    alpha: bool,
}

impl Layout {
    fn sample_bytes(self) -> usize {
        if self.bits > 8 { 2 } else { 1 }
    }

    /// Columns and rows of a plane of chroma, 0 where there is none.
    fn chroma_size(self, width: usize, height: usize) -> (usize, usize) {
        self.chroma.map_or((0, 0), |[across, down]| (width.div_ceil(across), height.div_ceil(down)))
    }
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
    /// [`Error::Io`] when it cannot be read, [`Error::Format`] when it is no YUV4MPEG2 stream or its frames
    /// are empty or over 65 536 px wide or high.
    pub fn new(name: impl AsRef<Path>, mut input: R) -> Result<Self> {
        let name = name.as_ref().to_path_buf();
        let line = read_line(&mut input, &name)?.unwrap_or_default();
        let Some(parameters) = line.strip_prefix("YUV4MPEG2") else {
            return Err(Error::format(&name, "not a YUV4MPEG2 stream (its signature is missing)"));
        };
        let (mut width, mut height, mut layout, mut frame_rate, mut full_range) = (0, 0, "420", None, false);
        for parameter in parameters.split_ascii_whitespace() {
            let (key, value) = parameter.split_at(parameter.chars().next().map_or(0, char::len_utf8));
            match key {
                "W" => width = parse_length(&name, parameter, value)?,
                "H" => height = parse_length(&name, parameter, value)?,
                "C" => layout = value,
                "F" => frame_rate = parse_rate(value),
                "X" => full_range |= value == "COLORRANGE=FULL",
                _ => {}
            }
        }
        check_size(&name, width, height)?;
        let layout =
            parse_layout(layout).ok_or_else(|| Error::format(&name, format!("unknown YUV4MPEG2 layout C{layout}")))?;
        Ok(Self { name, input, width, height, layout, full_range, policy: Colour::Luminance, frame_rate, frame: 0 })
    }
}

impl<R, P> Y4mSource<R, P> {
    /// The same stream read by another policy: [`Colour`] for grey frames, [`Grey`](crate::io::Grey) for
    /// colour frames. [`Colour::Luminance`] until then.
    ///
    /// Grey in a coloured layout is grey for [`Colour`]: its chroma is in the middle of the scale.
    pub fn with_policy<Q: ChannelPolicy>(self, policy: Q) -> Y4mSource<R, Q> {
        let Self { name, input, width, height, layout, full_range, frame_rate, frame, .. } = self;
        Y4mSource { name, input, width, height, layout, full_range, policy, frame_rate, frame }
    }
}

impl<R: BufRead, P: ChannelPolicy> Y4mSource<R, P> {
    fn chroma_bytes(&self) -> usize {
        let (width, height) = self.layout.chroma_size(self.width, self.height);
        2 * width * height * self.layout.sample_bytes()
    }

    fn luma_bytes(&self) -> usize {
        self.width * self.height * self.layout.sample_bytes()
    }

    /// The chroma of a frame where it is used, else nothing; it must be grey where colour is refused.
    fn read_chroma(&mut self) -> Result<Vec<u8>> {
        let mut chroma = Vec::new();
        match self.policy.colour_use() {
            ColourUse::Luma => self.discard(self.chroma_bytes())?,
            ColourUse::Kept => chroma = self.read_bytes(self.chroma_bytes())?,
            ColourUse::Refused => {
                let planes = self.read_bytes(self.chroma_bytes())?;
                let middle = 1_u16 << (self.layout.bits - 1);
                // Conversion from red, green and blue rounds to about a level of 8 bit.
                if self.codes(&planes).any(|code| code.abs_diff(middle) > 1 << (self.layout.bits - 8)) {
                    return Err(refuse_colour(&self.name));
                }
            }
        }
        if self.layout.alpha {
            self.discard(self.luma_bytes())?;
        }
        Ok(chroma)
    }

    fn codes<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = u16> + use<'a, R, P> {
        let size = self.layout.sample_bytes();
        bytes
            .chunks_exact(size)
            .map(move |b| if size == 1 { u16::from(b[0]) } else { u16::from_le_bytes([b[0], b[1]]) })
    }

    /// Red, green and blue of every pixel, interleaved.
    fn rgb<S: Sample>(&self, luma: &[u8], chroma: &[u8], [across, down]: [usize; 2]) -> Vec<S> {
        let coding = Coding::new(self.layout.bits, self.full_range);
        let chroma: Vec<u16> = self.codes(chroma).collect();
        let (blue, red) = chroma.split_at(chroma.len() / 2);
        let columns = self.width.div_ceil(across);
        let pixel = |(at, y): (usize, u16)| {
            let covered = at / self.width / down * columns + at % self.width / across;
            coding.decode([y, blue[covered], red[covered]]).map(|v| S::from_f64_nearest(v * S::FULL_SCALE))
        };
        self.codes(luma).enumerate().flat_map(pixel).collect()
    }

    fn picture<S: Sample>(&self, count: usize, samples: Vec<S>) -> Result<P::Frame> {
        self.policy.frame(Channels { path: &self.name, width: self.width, height: self.height, count, samples })
    }

    /// Passes the line in front of a frame; false at the end of the stream.
    fn begin_frame(&mut self) -> Result<bool> {
        match read_line(&mut self.input, &self.name)? {
            None => Ok(false),
            Some(line) if line == "FRAME" || line.starts_with("FRAME ") => Ok(true),
            Some(_) => Err(self.cut_off("does not begin with FRAME")),
        }
    }

    fn cut_off(&self, what: &str) -> Error {
        Error::format(&self.name, format!("frame {} {what}", self.frame))
    }

    /// Reads `count` bytes, into memory that grows as they come: a header alone allocates little.
    fn read_bytes(&mut self, count: usize) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        (&mut self.input).take(count as u64).read_to_end(&mut bytes).map_err(|e| Error::io(&self.name, e))?;
        if bytes.len() < count { Err(self.cut_off("is cut off")) } else { Ok(bytes) }
    }

    fn discard(&mut self, count: usize) -> Result<()> {
        let passed = io::copy(&mut (&mut self.input).take(count as u64), &mut io::sink());
        match passed.map_err(|e| Error::io(&self.name, e))? {
            n if n == count as u64 => Ok(()),
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

fn parse_layout(layout: &str) -> Option<Layout> {
    if let Some(depth) = layout.strip_prefix("mono") {
        let bits = if depth.is_empty() { 8 } else { parse_bits(depth)? };
        return Some(Layout { bits, chroma: None, alpha: false });
    }
    let digits = layout.find(|c: char| !c.is_ascii_digit()).unwrap_or(layout.len());
    let (sampling, rest) = layout.split_at(digits);
    let chroma = Some(match sampling {
        "420" => [2, 2],
        "411" => [4, 1],
        "422" => [2, 1],
        "440" => [1, 2],
        "444" => [1, 1],
        _ => return None,
    });
    let (bits, alpha) = match rest {
        "" | "jpeg" | "mpeg2" | "paldv" => (8, false),
        "alpha" => (8, true),
        _ => (parse_bits(rest.strip_prefix('p')?)?, false),
    };
    Some(Layout { bits, chroma, alpha })
}

fn parse_bits(text: &str) -> Option<u32> {
    text.parse().ok().filter(|bits| (8..=16).contains(bits))
}

impl<R: BufRead + Send, P: ChannelPolicy> FrameSource<P::Frame> for Y4mSource<R, P> {
    fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        if !self.begin_frame()? {
            return Ok(None);
        }
        let luma = self.read_bytes(self.luma_bytes())?;
        let chroma = self.read_chroma()?;
        self.frame += 1;
        let Layout { bits, chroma: covered, .. } = self.layout;
        let shift = 16 - bits;
        let frame = match covered.filter(|_| !chroma.is_empty()) {
            Some(covered) if bits == 8 => self.picture(3, self.rgb::<u8>(&luma, &chroma, covered)),
            Some(covered) => self.picture(3, self.rgb::<u16>(&luma, &chroma, covered)),
            None if bits == 8 => self.picture(1, luma),
            None => self.picture(1, self.codes(&luma).map(|code| code << shift).collect()),
        };
        frame.map(Some)
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        for done in 0..count {
            if !self.begin_frame()? {
                return Ok(done);
            }
            let alpha = if self.layout.alpha { self.luma_bytes() } else { 0 };
            self.discard(self.luma_bytes() + self.chroma_bytes() + alpha)?;
            self.frame += 1;
        }
        Ok(count)
    }
    fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }
    fn time(&self) -> Option<f64> {
        Some(self.frame.checked_sub(1)? as f64 / self.frame_rate?)
    }
    fn describe(&self) -> String {
        format!("{} (Y4M, {} x {}, {} bit)", self.name.display(), self.width, self.height, self.layout.bits)
    }
}
