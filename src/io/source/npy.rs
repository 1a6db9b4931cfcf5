//! `.npy` stacks, read a few frames at a time.

use super::{FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Channels, Colour, ColourUse, exact_doubles, widened};
use crate::io::limits::check_size;
use crate::io::npy::{Element, ElementType, NpyHeader};
use crate::types::Sample;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "npy",
    accepts: |spec| has_extension(spec, &["npy"]),
    signatures: &[b"\x93NUMPY"],
    has_planes: false,
    members: super::no_members,
    open: |spec, options| Ok(Box::new(NpySource::open(spec, options.colour)?)),
    open_colour: |spec, options| Ok(Box::new(NpySource::open(spec, options.grey)?)),
};

/// Bytes of frames held at once when the first axis varies fastest in the file.
const BATCH_BYTES: usize = 64 << 20;

/// A numpy stack `(T, H, W)`, one frame `(H, W)` or colour `(T, H, W, C)` with C = 1, 3 or 4; uint8, uint16,
/// float32 or float64, or a type that one of these holds exactly (bool as uint8, int8, int16 and float16 as
/// float32, wider integers as float64), either byte order. `(H, W, 3)` and `(H, W, 4)` are one colour frame;
/// where colour is refused such an array is refused as ambiguous, unless its W is at most 4.
///
/// In C order each frame is read when it is needed. In Fortran order the samples of one frame are spread
/// over the whole file, so each pass over the file gathers as many frames as fit 64 MiB (at least one).
#[derive(Debug)]
pub struct NpySource<P: ChannelPolicy = Colour> {
    path: PathBuf,
    policy: P,
    file: BufReader<File>,
    header: NpyHeader,
    data_start: u64,
    frames: usize,
    width: usize,
    height: usize,
    channels: usize,
    next: usize,
    /// Bytes of frames in C order from frame `gathered_from` on, when the first axis varies fastest in the
    /// file.
    gathered: Vec<u8>,
    gathered_from: usize,
}

impl<P: ChannelPolicy> NpySource<P> {
    /// Opens a stack: grey frames with the policy [`Colour`], colour frames with [`Grey`](crate::io::Grey).
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is no such stack, is shorter
    /// than its header says, or `policy` refuses it.
    pub fn open(path: impl AsRef<Path>, policy: P) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let available = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut file = BufReader::with_capacity(1 << 18, file);
        let (header, data_start) = NpyHeader::read(&mut file).map_err(|e| file_error(path, e))?;
        if matches!(header.element, ElementType::Text(_)) {
            return Err(Error::format(path, "expected an array of numbers, got text"));
        }
        let (frames, height, width, channels) = match header.shape[..] {
            [h, w] => (1, h, w, 1),
            [h, w, c @ (3 | 4)] if policy.colour_use() != ColourUse::Refused => (1, h, w, c),
            [_, rows, columns @ (3 | 4)] if rows > 4 => {
                let message = format!(
                    "expected a stack (T, H, W), got shape {}: one colour picture, or frames {columns} px wide; for a \
                     picture ask for luminance by --luminance or colour=\"luminance\" (or \"rgb\"), or \
                     transpose a stack to (T, H, W)",
                    header.shown()
                );
                return Err(Error::format(path, message));
            }
            [t, h, w] => (t, h, w, 1),
            [t, h, w, c @ (1 | 3 | 4)] => (t, h, w, c),
            _ => {
                let message = format!(
                    "expected a stack (T, H, W), a frame (H, W) or colour (T, H, W, 3), got shape {}",
                    header.shown()
                );
                return Err(Error::format(path, message));
            }
        };
        check_size(path, width, height)?;
        policy.check_layout(path, channels)?;
        let needed = header.byte_count().and_then(|n| (n as u64).checked_add(data_start as u64));
        if needed.is_none_or(|n| n > available) {
            let message = format!("cut off: shape {} needs more than the {available} bytes there are", header.shown());
            return Err(Error::format(path, message));
        }
        let (path, data_start) = (path.to_path_buf(), data_start as u64);
        let (next, gathered, gathered_from) = (0, Vec::new(), 0);
        Ok(Self {
            path,
            policy,
            file,
            header,
            data_start,
            frames,
            width,
            height,
            channels,
            next,
            gathered,
            gathered_from,
        })
    }

    fn frame_of<S: Sample>(&self, samples: Vec<S>) -> Result<P::Frame> {
        let (path, width, height, count) = (self.path.as_path(), self.width, self.height, self.channels);
        self.policy.frame(Channels { path, width, height, count, samples })
    }

    fn any_frame(&self, bytes: &[u8]) -> Result<P::Frame> {
        fn decoded<T: Element + Into<S>, S>(bytes: &[u8], big_endian: bool) -> Vec<S> {
            widened(T::decode(bytes, big_endian))
        }
        let order = self.header.big_endian;
        match self.header.element {
            ElementType::Bool | ElementType::U8 => self.frame_of(u8::decode(bytes, order)),
            ElementType::U16 => self.frame_of(u16::decode(bytes, order)),
            ElementType::F32 => self.frame_of(f32::decode(bytes, order)),
            ElementType::F64 => self.frame_of(f64::decode(bytes, order)),
            ElementType::I8 => self.frame_of::<f32>(decoded::<i8, _>(bytes, order)),
            ElementType::I16 => self.frame_of::<f32>(decoded::<i16, _>(bytes, order)),
            ElementType::F16 => self.frame_of::<f32>(decoded::<half::f16, _>(bytes, order)),
            ElementType::I32 => self.frame_of::<f64>(decoded::<i32, _>(bytes, order)),
            ElementType::U32 => self.frame_of::<f64>(decoded::<u32, _>(bytes, order)),
            ElementType::I64 => self.frame_of(exact_doubles(&self.path, &i64::decode(bytes, order))?),
            ElementType::U64 => self.frame_of(exact_doubles(&self.path, &u64::decode(bytes, order))?),
            ElementType::Text(_) => Err(Error::format(&self.path, "expected an array of numbers, got text")),
        }
    }

    fn frame_bytes(&self) -> usize {
        self.width * self.height * self.channels * self.header.element.size()
    }

    fn read_frame(&mut self) -> Result<P::Frame> {
        let mut bytes = vec![0; self.frame_bytes()];
        self.read_at(self.next * bytes.len(), &mut bytes)?;
        self.any_frame(&bytes)
    }

    /// Frame `next` of a file whose first axis varies fastest.
    fn gathered_frame(&mut self) -> Result<P::Frame> {
        let length = self.frame_bytes();
        let held = self.gathered_from..self.gathered_from + self.gathered.len() / length;
        if !held.contains(&self.next) {
            self.gather()?;
        }
        let start = (self.next - self.gathered_from) * length;
        self.any_frame(&self.gathered[start..start + length])
    }

    /// One pass over a file whose first axis varies fastest: frames `next..next + batch`.
    fn gather(&mut self) -> Result<()> {
        let (size, stack, length) = (self.header.element.size(), self.frames, self.frame_bytes());
        let batch = (BATCH_BYTES / length).clamp(1, stack - self.next);
        let mut line = vec![0; batch * size];
        self.gathered.clear();
        self.gathered.resize(batch * length, 0);
        self.gathered_from = self.next;
        // Rows vary fastest, then columns, then channels.
        let (rows, columns) = (self.height, self.width);
        for at in 0..rows * columns * self.channels {
            let (y, x, channel) = (at % rows, at / rows % columns, at / (rows * columns));
            self.read_at((at * stack + self.next) * size, &mut line)?;
            let to = ((y * columns + x) * self.channels + channel) * size;
            for (frame, sample) in self.gathered.chunks_exact_mut(length).zip(line.chunks_exact(size)) {
                frame[to..to + size].copy_from_slice(sample);
            }
        }
        Ok(())
    }

    /// Fills `bytes` from byte `at` of the data on.
    fn read_at(&mut self, at: usize, bytes: &mut [u8]) -> Result<()> {
        let at = self.data_start + at as u64;
        // Relative, so that what is already buffered is kept.
        let read = self.file.stream_position().and_then(|now| {
            self.file.seek_relative(at as i64 - now as i64)?;
            self.file.read_exact(bytes)
        });
        read.map_err(|e| file_error(&self.path, e))
    }
}

/// A cut-off file is a matter of its format, other failures of the system.
fn file_error(path: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::InvalidData => Error::format(path, error.to_string()),
        ErrorKind::UnexpectedEof => Error::format(path, "cut off in the middle of a frame"),
        _ => Error::io(path, error),
    }
}

impl<P: ChannelPolicy> FrameSource<P::Frame> for NpySource<P> {
    fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        if self.next >= self.frames {
            return Ok(None);
        }
        let frame = if self.header.fortran_order { self.gathered_frame()? } else { self.read_frame()? };
        self.next += 1;
        Ok(Some(frame))
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        let passed = count.min(self.frames - self.next);
        self.next += passed;
        Ok(passed)
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.frames - self.next)
    }
    fn describe(&self) -> String {
        format!("{} (numpy stack of {} frames, {} x {})", self.path.display(), self.frames, self.width, self.height)
    }
}
