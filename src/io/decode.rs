//! Image files to grey or colour frames.

use super::{channels::ChannelPolicy, channels::Channels, jpeg};
use crate::error::{Error, Result};
use crate::types::Sample;
use ::image::{DynamicImage, ImageError, ImageFormat, ImageReader};
use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};

/// Extensions of the image files that sources look for.
pub(crate) const EXTENSIONS: &[&str] = &["png", "tif", "tiff", "bmp", "pgm", "pnm", "ppm", "jpg", "jpeg"];

/// Largest width and height accepted from a file, px.
pub(crate) const MAX_SIDE: usize = 65_536;
/// Most memory one decoded picture may take, bytes.
const MAX_BYTES: u64 = 2 << 30;
/// Bytes of picture that one byte of file can stand for at most (long runs in LZW).
const MAX_EXPANSION: u64 = 4096;
/// Memory that any file may ask for: decoders keep buffers of their own.
const FREE_BYTES: u64 = 16 << 20;

/// Memory that decoding `file` may take: what its own length can justify.
fn memory_limit(file: &File) -> std::io::Result<u64> {
    Ok(file.metadata()?.len().saturating_mul(MAX_EXPANSION).saturating_add(FREE_BYTES).min(MAX_BYTES))
}

/// Refuses sizes that no frame has, before memory is taken for them.
pub(crate) fn check_size(path: &Path, width: usize, height: usize) -> Result<()> {
    if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) {
        return Ok(());
    }
    Err(Error::format(path, format!("a frame of {width} x {height} px (expected 1 to {MAX_SIDE} px each way)")))
}

/// Reads the picture in an image file by its content, not its extension: a grey frame with a policy of type
/// [`Colour`](super::Colour), a colour frame with one of type [`Grey`](super::Grey).
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is damaged, of an unknown format or
/// too large, has several pages, or `policy` refuses it.
pub fn read_image<P: ChannelPolicy>(path: impl AsRef<Path>, policy: P) -> Result<P::Frame> {
    let path = path.as_ref();
    if is_tiff(path)? {
        let mut pages = TiffPages::open(path, policy)?;
        let first = pages.next_page()?.ok_or_else(|| Error::format(path, "holds no picture"))?;
        if pages.at_end() {
            return Ok(first);
        }
        let message = "holds several pages; expected one picture a file (or open this file by itself, as a sequence)";
        return Err(Error::format(path, message));
    }
    read_one_picture(path, policy)
}

pub(crate) fn is_tiff(path: &Path) -> Result<bool> {
    Ok(guessing_reader(path)?.format() == Some(ImageFormat::Tiff))
}

fn guessing_reader(path: &Path) -> Result<ImageReader<BufReader<File>>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let memory = memory_limit(&file).map_err(|e| Error::io(path, e))?;
    let mut reader = ImageReader::new(BufReader::with_capacity(1 << 16, file))
        .with_guessed_format()
        .map_err(|e| Error::io(path, e))?;
    let mut limits = ::image::Limits::default();
    limits.max_image_width = Some(MAX_SIDE as u32);
    limits.max_image_height = Some(MAX_SIDE as u32);
    limits.max_alloc = Some(memory);
    reader.limits(limits);
    Ok(reader)
}

fn read_one_picture<P: ChannelPolicy>(path: &Path, policy: P) -> Result<P::Frame> {
    let reader = guessing_reader(path)?;
    if reader.format() == Some(ImageFormat::Jpeg)
        && !jpeg::is_whole(&std::fs::read(path).map_err(|e| Error::io(path, e))?)
    {
        return Err(Error::format(path, "cut off: the JPEG picture has no end"));
    }
    if reader.format().is_none() {
        return Err(Error::format(path, "not an image of a known format (PNG, TIFF, BMP, PGM, JPEG)"));
    }
    let picture = reader.decode().map_err(|error| image_error(path, error))?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    check_size(path, width, height)?;
    let place = Place { path, width, height };
    match picture {
        DynamicImage::ImageLuma8(p) => place.frame(1, p.into_raw(), policy),
        DynamicImage::ImageLumaA8(p) => place.frame(2, p.into_raw(), policy),
        DynamicImage::ImageRgb8(p) => place.frame(3, p.into_raw(), policy),
        DynamicImage::ImageRgba8(p) => place.frame(4, p.into_raw(), policy),
        DynamicImage::ImageLuma16(p) => place.frame(1, p.into_raw(), policy),
        DynamicImage::ImageLumaA16(p) => place.frame(2, p.into_raw(), policy),
        DynamicImage::ImageRgb16(p) => place.frame(3, p.into_raw(), policy),
        DynamicImage::ImageRgba16(p) => place.frame(4, p.into_raw(), policy),
        DynamicImage::ImageRgb32F(p) => place.frame(3, p.into_raw(), policy),
        DynamicImage::ImageRgba32F(p) => place.frame(4, p.into_raw(), policy),
        _ => Err(Error::format(path, "a kind of picture that is not supported")),
    }
}

struct Place<'a> {
    path: &'a Path,
    width: usize,
    height: usize,
}

impl Place<'_> {
    fn frame<S: Sample, P: ChannelPolicy>(&self, count: usize, samples: Vec<S>, policy: P) -> Result<P::Frame> {
        policy.frame(Channels { path: self.path, width: self.width, height: self.height, count, samples })
    }
}

/// Failures of the system stay such; everything else says that the file is damaged.
fn image_error(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(error) => io_error(path, error),
        ImageError::Limits(limit) => Error::format(path, format!("too large a picture: {limit}")),
        other => Error::format(path, other.to_string()),
    }
}

fn io_error(path: &Path, error: std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::NotFound | ErrorKind::IsADirectory | ErrorKind::OutOfMemory => {
            Error::io(path, error)
        }
        ErrorKind::UnexpectedEof => Error::format(path, "cut off"),
        _ => Error::format(path, error.to_string()),
    }
}

pub(crate) fn png_error(path: &Path, error: png::DecodingError) -> Error {
    match error {
        png::DecodingError::IoError(error) => io_error(path, error),
        other => Error::format(path, other.to_string()),
    }
}

fn tiff_error(path: &Path, error: tiff::TiffError) -> Error {
    match error {
        tiff::TiffError::IoError(error) => io_error(path, error),
        other => Error::format(path, other.to_string()),
    }
}

/// The pages of a TIFF file: uint8, uint16, float32 or float64, grey or colour.
#[derive(Debug)]
pub(crate) struct TiffPages<P> {
    path: PathBuf,
    policy: P,
    /// `None` after the last page.
    decoder: Option<Decoder<BufReader<File>>>,
    page: usize,
}

impl<P: ChannelPolicy> TiffPages<P> {
    pub(crate) fn open(path: &Path, policy: P) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let memory = memory_limit(&file).map_err(|e| Error::io(path, e))?;
        let mut limits = tiff::decoder::Limits::default();
        limits.decoding_buffer_size = memory as usize;
        let decoder = Decoder::new(BufReader::with_capacity(1 << 16, file)).map_err(|e| tiff_error(path, e))?;
        Ok(Self { path: path.to_path_buf(), policy, decoder: Some(decoder.with_limits(limits)), page: 0 })
    }

    pub(crate) fn at_end(&self) -> bool {
        self.decoder.is_none()
    }

    /// Passes over a page without decoding it; false at the end.
    pub(crate) fn skip_page(&mut self) -> Result<bool> {
        let Some(decoder) = &mut self.decoder else { return Ok(false) };
        if decoder.more_images() {
            decoder.next_image().map_err(|e| tiff_error(&self.path, e))?;
        } else {
            self.decoder = None;
        }
        self.page += 1;
        Ok(true)
    }

    pub(crate) fn next_page(&mut self) -> Result<Option<P::Frame>> {
        let Some(decoder) = &mut self.decoder else { return Ok(None) };
        let frame = read_page(decoder, &self.path, self.policy, self.page)?;
        self.skip_page()?;
        Ok(Some(frame))
    }
}

fn read_page<P: ChannelPolicy>(
    decoder: &mut Decoder<BufReader<File>>,
    path: &Path,
    policy: P,
    page: usize,
) -> Result<P::Frame> {
    let (width, height) = decoder.dimensions().map_err(|e| tiff_error(path, e))?;
    let (width, height) = (width as usize, height as usize);
    check_size(path, width, height)?;
    let kind = decoder.colortype().map_err(|e| tiff_error(path, e))?;
    let channels = match kind {
        ColorType::Gray(8 | 16 | 32 | 64) => 1,
        ColorType::GrayA(8 | 16 | 32 | 64) => 2,
        ColorType::RGB(8 | 16 | 32 | 64) => 3,
        ColorType::RGBA(8 | 16 | 32 | 64) => 4,
        // Palettes, bilevel and the like: the general reader knows them for files of one page.
        _ if page == 0 && !decoder.more_images() => return read_one_picture(path, policy),
        other => return Err(Error::format(path, format!("TIFF pages of kind {other:?} are not supported"))),
    };
    let place = Place { path, width, height };
    match decoder.read_image().map_err(|e| tiff_error(path, e))? {
        DecodingResult::U8(samples) => place.frame(channels, samples, policy),
        DecodingResult::U16(samples) => place.frame(channels, samples, policy),
        DecodingResult::F32(samples) => place.frame(channels, samples, policy),
        DecodingResult::F64(samples) => place.frame(channels, samples, policy),
        _ => Err(Error::format(path, "TIFF samples other than uint8, uint16, float32 and float64 are not supported")),
    }
}
