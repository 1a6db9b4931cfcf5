//! Image files: a folder of them, or one (whose pages are frames when it is a TIFF, under any name).

use super::{FrameSource, Kind, has_extension};
use crate::error::{Error, Result};
use crate::io::channels::{ChannelPolicy, Colour, FrameFormat};
use crate::io::decode::{EXTENSIONS, TIFF_SIGNATURES, is_tiff, read_plane};
use crate::io::pages::Pages;
use crate::io::planes::{PixelSize, PlaneSelection};
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

pub(super) const KIND: Kind = Kind {
    name: "files",
    accepts: |spec| {
        Path::new(spec).is_dir() || (has_extension(spec, EXTENSIONS) && (Path::new(spec).exists() || !is_pattern(spec)))
    },
    signatures: &[],
    has_planes: true,
    members: |spec| images_in(Path::new(spec)).unwrap_or_default(),
    open: |spec, options| open_files(spec, options.colour, options.planes),
    open_colour: |spec, options| open_files(spec, options.grey, options.planes),
};

/// TIFF files, by their content alone; the pages are frames.
pub(super) const TIFF: Kind =
    Kind { name: "tiff", accepts: |_| false, signatures: TIFF_SIGNATURES, members: super::no_members, ..KIND };

/// Whether the text has a pattern's special characters.
pub(super) fn is_pattern(spec: &str) -> bool {
    spec.contains(['*', '?', '['])
}

fn open_files<P: ChannelPolicy>(
    spec: &str,
    policy: P,
    planes: PlaneSelection,
) -> Result<Box<dyn FrameSource<P::Frame>>> {
    let path = Path::new(spec);
    if path.is_dir() {
        return Ok(Box::new(FilesSource::new(images_in(path)?, policy)?.with_planes(planes)));
    }
    if is_tiff(path)? {
        let pages = Pages::open(path, policy, planes)?;
        return Ok(Box::new(PagesSource { path: path.to_path_buf(), pages, uniform: Uniform::default() }));
    }
    Ok(Box::new(FilesSource::new(vec![path.to_path_buf()], policy)?.with_planes(planes)))
}

/// The image files of a folder, not hidden, in natural order (`frame9` before `frame10`).
fn images_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, e))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if !hidden && is_image(&path)? {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(Error::format(folder, format!("holds no images ({})", EXTENSIONS.join(", "))));
    }
    sort_naturally(&mut paths);
    Ok(paths)
}

/// Whether this is an image file, by its name. What has such a name and is neither file nor folder, such as a
/// link to nothing, is an error: left out, it would be a frame lost without a word.
pub(super) fn is_image(path: &Path) -> Result<bool> {
    if !has_extension(path, EXTENSIONS) {
        return Ok(false);
    }
    let kind = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.file_type();
    if kind.is_file() || kind.is_dir() {
        return Ok(kind.is_file());
    }
    Err(Error::format(path, "is no file, expected an image, as its name says"))
}

/// Natural order: runs of digits by their value, all other text by its bytes; names that differ only in the
/// padding of their numbers (`1`, `01`) by length, then by their bytes.
pub(super) fn sort_naturally(paths: &mut [PathBuf]) {
    paths.sort_by(|a, b| {
        let [left, right] = [a, b].map(|path| path.as_os_str().as_encoded_bytes());
        natural_order(left, right).then_with(|| left.len().cmp(&right.len())).then_with(|| left.cmp(right))
    });
}

fn natural_order(mut left: &[u8], mut right: &[u8]) -> Ordering {
    loop {
        let order = match (left.first(), right.first()) {
            (Some(a), Some(b)) if a.is_ascii_digit() && b.is_ascii_digit() => {
                let (number, other) = (take_number(&mut left), take_number(&mut right));
                number.len().cmp(&other.len()).then_with(|| number.cmp(other))
            }
            (Some(a), Some(b)) => {
                (left, right) = (&left[1..], &right[1..]);
                a.cmp(b)
            }
            (a, b) => return a.is_some().cmp(&b.is_some()),
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// Takes the digits at the front of `text`; returns them without leading zeros, so that the longer number is
/// the larger one.
fn take_number<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|byte| !byte.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    *text = rest;
    let zeros = digits.iter().take_while(|&&digit| digit == b'0').count();
    &digits[zeros..]
}

/// What every later frame must be like.
#[derive(Debug, Default)]
struct Uniform(Option<(PathBuf, (usize, usize), &'static str)>);

impl Uniform {
    fn check(&mut self, path: &Path, frame: &impl FrameFormat) -> Result<()> {
        let (size, dtype) = (frame.size(), frame.dtype());
        match &self.0 {
            None => self.0 = Some((path.to_path_buf(), size, dtype)),
            Some((first, wanted, kind)) if size != *wanted || dtype != *kind => {
                let message = format!(
                    "{} x {} px {dtype}; expected {} x {} px {kind}, as the first frame ({})",
                    size.0,
                    size.1,
                    wanted.0,
                    wanted.1,
                    first.display()
                );
                return Err(Error::format(path, message));
            }
            Some(_) => {}
        }
        Ok(())
    }
}

/// One frame a file, in the order given, by the policies [`Colour`] and [`Grey`](crate::io::Grey). A TIFF
/// file of several pages is an [`Error::Format`], unless a channel and slice are selected of which it has
/// one.
#[derive(Debug)]
pub struct FilesSource<P = Colour> {
    paths: Vec<PathBuf>,
    next: usize,
    policy: P,
    planes: PlaneSelection,
    uniform: Uniform,
}

impl<P: ChannelPolicy> FilesSource<P> {
    /// A source of these image files, each opened when its frame is read.
    ///
    /// # Errors
    /// [`Error::Argument`] named `frames` for an empty list.
    pub fn new(paths: Vec<PathBuf>, policy: P) -> Result<Self> {
        if paths.is_empty() {
            return Err(Error::argument("frames", "at least one image file", "none"));
        }
        Ok(Self { paths, next: 0, policy, planes: PlaneSelection::default(), uniform: Uniform::default() })
    }

    /// The same with the plane to take of each file, for TIFF files with several channels or slices.
    pub fn with_planes(self, planes: PlaneSelection) -> Self {
        Self { planes, ..self }
    }
}

impl<P: ChannelPolicy> FrameSource<P::Frame> for FilesSource<P> {
    fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        let Some(path) = self.paths.get(self.next) else { return Ok(None) };
        let frame = read_plane(path, self.policy, self.planes)?;
        self.uniform.check(path, &frame)?;
        self.next += 1;
        Ok(Some(frame))
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        let passed = count.min(self.paths.len() - self.next);
        self.next += passed;
        Ok(passed)
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.paths.len() - self.next)
    }
    fn describe(&self) -> String {
        match &self.paths[..] {
            [one] => one.display().to_string(),
            [first, .., last] => format!("{} images, {} to {}", self.paths.len(), first.display(), last.display()),
            [] => "no images".into(),
        }
    }
}

/// The pages of one TIFF file.
#[derive(Debug)]
struct PagesSource<P> {
    path: PathBuf,
    pages: Pages<P>,
    uniform: Uniform,
}

impl<P: ChannelPolicy> FrameSource<P::Frame> for PagesSource<P> {
    fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        let frame = self.pages.next_frame()?;
        if let Some(frame) = &frame {
            self.uniform.check(&self.path, frame)?;
        }
        Ok(frame)
    }
    fn skip(&mut self, count: usize) -> Result<usize> {
        Ok(self.pages.skip(count))
    }
    fn len_hint(&self) -> Option<usize> {
        Some(self.pages.left())
    }
    fn frame_rate(&self) -> Option<f64> {
        self.pages.frame_rate()
    }
    fn time(&self) -> Option<f64> {
        self.pages.time()
    }
    fn pixel_size(&self) -> Option<PixelSize> {
        self.pages.pixel_size().cloned()
    }
    fn describe(&self) -> String {
        format!("{} (TIFF)", self.path.display())
    }
}
