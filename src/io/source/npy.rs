//! `.npy` stacks, read a few frames at a time.

use super::{FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Channels, Colour, ColourUse, StoredSample};
use crate::io::decode::check_size;
use crate::io::npy::{Element, ElementType, NpyHeader};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "npy",
    accepts: |spec| has_extension(spec, &["npy"]),
    open: |spec, policy| Ok(Box::new(NpySource::open(spec, policy)?)),
    open_colour: |spec, policy| Ok(Box::new(NpySource::open(spec, policy)?)),
};

/// Bytes of frames held at once when the first axis varies fastest in the file.
const BATCH_BYTES: usize = 64 << 20;

/// A numpy stack `(T, H, W)`, one frame `(H, W)` or colour `(T, H, W, C)` with C = 1, 3 or 4; uint8, uint16, float32 or float64, either byte order.
/// Where colour frames are read `(H, W, 3)` and `(H, W, 4)` are one colour frame.
///
/// In C order each frame is read when it is asked for. In Fortran order the samples of one frame are spread over the whole file, so each
/// pass over the file gathers as many frames as fit 64 MiB (at least one).
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
    gathered: VecDeque<P::Frame>,
}

impl<P: ChannelPolicy> NpySource<P> {
    /// Opens a stack: grey frames with the policy [`Colour`], colour frames with [`Grey`](crate::io::Grey).
    ///
    /// # Errors
    /// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is no such stack, is shorter than its header says, or
    /// `policy` refuses it.
    pub fn open(path: impl AsRef<Path>, policy: P) -> Result<Self> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let available = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut file = BufReader::with_capacity(1 << 18, file);
        let (header, data_start) = NpyHeader::read(&mut file).map_err(|e| file_error(path, e))?;
        if !matches!(header.element, ElementType::U8 | ElementType::U16 | ElementType::F32 | ElementType::F64) {
            let message = format!(
                "element type '{}' is not one of uint8, uint16, float32, float64 (convert with .astype)",
                header.element.descriptor()
            );
            return Err(Error::format(path, message));
        }
        let (frames, height, width, channels) = match header.shape[..] {
            [h, w] => (1, h, w, 1),
            [h, w, c @ (3 | 4)] if policy.colour_use() == ColourUse::Kept => (1, h, w, c),
            [t, h, w] => (t, h, w, 1),
            [t, h, w, c @ (1 | 3 | 4)] => (t, h, w, c),
            _ => {
                let message = format!(
                    "expected a stack (T, H, W), a frame (H, W) or colour (T, H, W, 3), got shape {:?}",
                    header.shape
                );
                return Err(Error::format(path, message));
            }
        };
        check_size(path, width, height)?;
        policy.check_layout(path, channels)?;
        let needed = header.byte_count().map(|n| n as u64 + data_start as u64);
        if needed.is_none_or(|n| n > available) {
            let message = format!("cut off: shape {:?} needs more than the {available} bytes there are", header.shape);
            return Err(Error::format(path, message));
        }
        let (path, data_start) = (path.to_path_buf(), data_start as u64);
        let gathered = VecDeque::new();
        Ok(Self { path, policy, file, header, data_start, frames, width, height, channels, next: 0, gathered })
    }

    fn frame_of<T: Element + StoredSample>(&self, bytes: &[u8]) -> Result<P::Frame> {
        let (path, width, height, count) = (self.path.as_path(), self.width, self.height, self.channels);
        let samples = T::decode(bytes, self.header.big_endian);
        self.policy.frame(Channels { path, width, height, count, samples })
    }

    fn any_frame(&self, bytes: &[u8]) -> Result<P::Frame> {
        match self.header.element {
            ElementType::U8 => self.frame_of::<u8>(bytes),
            ElementType::U16 => self.frame_of::<u16>(bytes),
            ElementType::F32 => self.frame_of::<f32>(bytes),
            _ => self.frame_of::<f64>(bytes),
        }
    }

    fn frame_bytes(&self) -> usize {
        self.width * self.height * self.channels * self.header.element.size()
    }

    /// One frame, stored in one piece.
    fn read_frame(&mut self) -> Result<P::Frame> {
        let length = self.frame_bytes();
        let at = self.data_start + self.next as u64 * length as u64;
        let mut bytes = vec![0; length];
        // Relative, so that frames in a row keep what is already buffered.
        let read = self.file.stream_position().and_then(|now| {
            self.file.seek_relative(at as i64 - now as i64)?;
            self.file.read_exact(&mut bytes)
        });
        read.map_err(|e| file_error(&self.path, e))?;
        self.any_frame(&bytes)
    }

    /// One pass over a file whose first axis varies fastest: frames `next..next + batch`.
    fn gather(&mut self) -> Result<()> {
        let (size, stack) = (self.header.element.size(), self.frames);
        let batch = (BATCH_BYTES / self.frame_bytes().max(1)).clamp(1, stack - self.next);
        let mut frames = vec![vec![0; self.frame_bytes()]; batch];
        let mut line = vec![0; stack * size];
        self.file.seek(SeekFrom::Start(self.data_start)).map_err(|e| Error::io(&self.path, e))?;
        // Rows vary fastest, then columns, then channels.
        let (rows, columns) = (self.height, self.width);
        for at in 0..rows * columns * self.channels {
            let (y, x, channel) = (at % rows, at / rows % columns, at / (rows * columns));
            self.file.read_exact(&mut line).map_err(|e| file_error(&self.path, e))?;
            let to = ((y * columns + x) * self.channels + channel) * size;
            for (frame, sample) in frames.iter_mut().zip(line[self.next * size..].chunks_exact(size)) {
                frame[to..to + size].copy_from_slice(sample);
            }
        }
        for bytes in frames {
            let frame = self.any_frame(&bytes)?;
            self.gathered.push_back(frame);
        }
        Ok(())
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
        let frame = if self.header.fortran_order {
            if self.gathered.is_empty() {
                self.gather()?;
            }
            self.gathered.pop_front()
        } else {
            Some(self.read_frame()?)
        };
        self.next += 1;
        Ok(frame)
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        let passed = count.min(self.frames - self.next);
        self.next += passed;
        self.gathered.drain(..passed.min(self.gathered.len()));
        Ok(passed)
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.frames - self.next)
    }
    fn describe(&self) -> String {
        format!("{} (numpy stack of {} frames, {} x {})", self.path.display(), self.frames, self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::Grey;
    use crate::io::npy::write_values;
    use crate::types::{AnyColourFrame, AnyFrame, Frame};
    use proptest::prelude::*;
    use std::io::Write;

    fn save<T: Element>(folder: &Path, header: &NpyHeader, values: &[T]) -> PathBuf {
        let path = folder.join("stack.npy");
        let mut file = File::create(&path).unwrap();
        header.write(&mut file, 0).unwrap();
        write_values(values, &mut file).unwrap();
        path
    }

    fn all(path: &Path) -> Vec<AnyFrame> {
        let mut source = NpySource::open(path, Colour::Luminance).unwrap();
        std::iter::from_fn(|| source.next_frame().unwrap()).collect()
    }

    #[test]
    fn both_orders_give_the_same_frames() {
        let folder = tempfile::tempdir().unwrap();
        let (t, h, w) = (5, 3, 4);
        let value = |i: usize, y: usize, x: usize| (100 * i + 10 * y + x) as u16;
        let want: Vec<_> = (0..t).map(|i| AnyFrame::U16(Frame::from_fn(w, h, |x, y| value(i, y, x)))).collect();
        let mut c_order = Vec::new();
        for i in 0..t {
            for y in 0..h {
                c_order.extend((0..w).map(|x| value(i, y, x)));
            }
        }
        let mut fortran = Vec::new();
        for x in 0..w {
            for y in 0..h {
                fortran.extend((0..t).map(|i| value(i, y, x)));
            }
        }
        let mut header = NpyHeader::new(ElementType::U16, &[t, h, w]);
        assert_eq!(all(&save(folder.path(), &header, &c_order)), want);
        header.fortran_order = true;
        let path = save(folder.path(), &header, &fortran);
        assert_eq!(all(&path), want);
        let mut source = NpySource::open(&path, Colour::Error).unwrap();
        source.next_frame().unwrap();
        assert_eq!((source.skip(2).unwrap(), source.len_hint()), (2, Some(2)));
        assert_eq!(source.next_frame().unwrap().as_ref(), Some(&want[3]));
    }

    #[test]
    fn single_frames_and_colour_are_understood() {
        let folder = tempfile::tempdir().unwrap();
        let path =
            save(folder.path(), &NpyHeader::new(ElementType::F64, &[2, 3]), &[1.0f64, 2.0, 3.0, 4.0, 5.0, f64::NAN]);
        let frames = all(&path);
        assert!(frames.len() == 1 && frames[0].size() == (3, 2));
        let path = save(folder.path(), &NpyHeader::new(ElementType::U8, &[1, 1, 2, 3]), &[255u8, 0, 0, 9, 9, 9]);
        assert_eq!(all(&path), [AnyFrame::U8(Frame::new(2, 1, vec![76, 9]).unwrap())]);
        let refused = NpySource::open(&path, Colour::Error).unwrap_err().to_string();
        assert!(refused.contains("luminance") && refused.contains("stack.npy"), "{refused}");
    }

    #[test]
    fn colour_frames_come_in_either_order() {
        let folder = tempfile::tempdir().unwrap();
        let (t, h, w) = (3, 2, 4);
        let value = |i: usize, y: usize, x: usize, c: usize| (1000 * i + 100 * y + 10 * x + c) as u16;
        let pixel = |i: usize, y: usize, x: usize| [0, 1, 2].map(|c| value(i, y, x, c));
        let want: Vec<_> = (0..t).map(|i| AnyColourFrame::U16(Frame::from_fn(w, h, |x, y| pixel(i, y, x)))).collect();
        let places = |outer: usize, inner: usize| (0..outer).flat_map(move |a| (0..inner).map(move |b| (a, b)));
        let c_order: Vec<u16> = (0..t).flat_map(|i| places(h, w).flat_map(move |(y, x)| pixel(i, y, x))).collect();
        let fortran: Vec<u16> =
            (0..3).flat_map(|c| places(w, h).flat_map(move |(x, y)| (0..t).map(move |i| value(i, y, x, c)))).collect();
        let mut header = NpyHeader::new(ElementType::U16, &[t, h, w, 3]);
        let read = |path: &Path| {
            let mut source = NpySource::open(path, Grey::Error).unwrap();
            std::iter::from_fn(|| source.next_frame().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(read(&save(folder.path(), &header, &c_order)), want);
        header.fortran_order = true;
        assert_eq!(read(&save(folder.path(), &header, &fortran)), want);
        let one = save(folder.path(), &NpyHeader::new(ElementType::U16, &[h, w, 3]), &c_order[..h * w * 3]);
        assert_eq!(read(&one), want[..1]);
    }

    #[test]
    fn grey_stacks_are_refused_where_colour_is_needed_or_repeated() {
        let folder = tempfile::tempdir().unwrap();
        for shape in [vec![2, 1, 2], vec![2, 1, 2, 1]] {
            let path = save(folder.path(), &NpyHeader::new(ElementType::F32, &shape), &[0.5_f32, 1.0, 2.0, 3.0]);
            let message = NpySource::open(&path, Grey::Error).unwrap_err().to_string();
            assert!(message.contains("colour is needed") && message.contains("stack.npy"), "{message}");
            let first = NpySource::open(&path, Grey::Repeat).unwrap().next_frame().unwrap().unwrap();
            assert_eq!(first, AnyColourFrame::F32(Frame::new(2, 1, vec![[0.5; 3], [1.0; 3]]).unwrap()));
        }
    }

    #[test]
    fn lies_about_the_size_are_found_before_anything_is_allocated() {
        let folder = tempfile::tempdir().unwrap();
        for shape in [
            vec![1 << 40, 3, 4],
            vec![3, 30_000, 30_000],
            vec![usize::MAX, 8, 8],
            vec![2, 3, 5],
            vec![7],
            vec![1, 1, 1, 2],
        ] {
            let path = save(folder.path(), &NpyHeader::new(ElementType::F32, &shape), &[0f32; 24]);
            let error = NpySource::open(&path, Colour::Luminance).unwrap_err();
            assert!(matches!(error, Error::Format { .. }), "{shape:?}: {error}");
        }
        let path = save(folder.path(), &NpyHeader::new(ElementType::I64, &[1, 3, 4]), &[0i64; 12]);
        assert!(NpySource::open(&path, Colour::Error).unwrap_err().to_string().contains("astype"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_file_makes_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), cut in 0usize..200) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("hostile.npy");
            std::fs::write(&path, &bytes).unwrap();
            prop_assert!(NpySource::open(&path, Colour::Luminance).is_err());
            let path = save(folder.path(), &NpyHeader::new(ElementType::U8, &[2, 5, 6]), &[1u8; 60]);
            let whole = std::fs::read(&path).unwrap();
            File::create(&path).unwrap().write_all(&whole[..cut.min(whole.len() - 1)]).unwrap();
            let is_format_error = matches!(NpySource::open(&path, Colour::Error), Err(Error::Format { .. }));
            prop_assert!(is_format_error);
        }
    }
}
