//! Image files to grey frames.

use super::jpeg;
use super::source::Colour;
use crate::error::{Error, Result};
use crate::image::luminance;
use crate::types::{AnyFrame, Frame, Sample};
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
/// Bytes of picture that one byte of file can stand for in the densest of the codings (long runs in LZW), with room to spare.
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

/// What colour input is answered with.
pub(crate) fn refuse_colour(path: &Path) -> Error {
    Error::format(
        path,
        "holds colour; expected grey. Ask for luminance (0.299 R + 0.587 G + 0.114 B) by --luminance or colour=\"luminance\", or convert it to grey first",
    )
}

/// Reads the picture in an image file, whatever its extension says.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is damaged, of an unknown format or too large, has several pages, or holds
/// colour and `colour` refuses it.
pub fn read_image(path: impl AsRef<Path>, colour: Colour) -> Result<AnyFrame> {
    let path = path.as_ref();
    if is_tiff(path)? {
        let mut pages = TiffPages::open(path, colour)?;
        let first = pages.next_page()?.ok_or_else(|| Error::format(path, "holds no picture"))?;
        if pages.at_end() {
            return Ok(first);
        }
        let message = "holds several pages; expected one picture a file (or open this file by itself, as a sequence)";
        return Err(Error::format(path, message));
    }
    read_one_picture(path, colour)
}

/// Whether the file's content is TIFF.
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

fn read_one_picture(path: &Path, colour: Colour) -> Result<AnyFrame> {
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
    let grey = Grey { path, width, height, colour };
    match picture {
        DynamicImage::ImageLuma8(p) => grey.from(1, &p).map(AnyFrame::U8),
        DynamicImage::ImageLumaA8(p) => grey.from(2, &p).map(AnyFrame::U8),
        DynamicImage::ImageRgb8(p) => grey.from(3, &p).map(AnyFrame::U8),
        DynamicImage::ImageRgba8(p) => grey.from(4, &p).map(AnyFrame::U8),
        DynamicImage::ImageLuma16(p) => grey.from(1, &p).map(AnyFrame::U16),
        DynamicImage::ImageLumaA16(p) => grey.from(2, &p).map(AnyFrame::U16),
        DynamicImage::ImageRgb16(p) => grey.from(3, &p).map(AnyFrame::U16),
        DynamicImage::ImageRgba16(p) => grey.from(4, &p).map(AnyFrame::U16),
        DynamicImage::ImageRgb32F(p) => grey.from(3, &p).map(AnyFrame::F32),
        DynamicImage::ImageRgba32F(p) => grey.from(4, &p).map(AnyFrame::F32),
        _ => Err(Error::format(path, "a kind of picture that is not supported")),
    }
}

/// Interleaved samples of a picture on their way to a grey frame.
struct Grey<'a> {
    path: &'a Path,
    width: usize,
    height: usize,
    colour: Colour,
}

impl Grey<'_> {
    fn from<S: Sample>(&self, channels: usize, samples: &[S]) -> Result<Frame<S>> {
        if channels > 2 && self.colour == Colour::Error && holds_colour(channels, samples) {
            return Err(refuse_colour(self.path));
        }
        // A damaged file may decode to another number of samples than its size promises.
        luminance(self.width, self.height, channels, samples).map_err(|e| Error::format(self.path, e.to_string()))
    }
}

/// Whether any pixel's red, green and blue differ. Grey stored as RGB (the only way in BMP) is grey: its luma is the level itself.
fn holds_colour<S: Sample>(channels: usize, samples: &[S]) -> bool {
    samples.chunks_exact(channels).any(|p| {
        let [r, g, b] = [p[0], p[1], p[2]].map(S::to_real::<f64>);
        (r != g || g != b) && !(r.is_nan() && g.is_nan() && b.is_nan())
    })
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

/// As for other images.
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
pub(crate) struct TiffPages {
    path: PathBuf,
    colour: Colour,
    /// `None` after the last page.
    decoder: Option<Decoder<BufReader<File>>>,
    page: usize,
}

impl TiffPages {
    pub(crate) fn open(path: &Path, colour: Colour) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let memory = memory_limit(&file).map_err(|e| Error::io(path, e))?;
        let mut limits = tiff::decoder::Limits::default();
        limits.decoding_buffer_size = memory as usize;
        let decoder = Decoder::new(BufReader::with_capacity(1 << 16, file)).map_err(|e| tiff_error(path, e))?;
        Ok(Self { path: path.to_path_buf(), colour, decoder: Some(decoder.with_limits(limits)), page: 0 })
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

    pub(crate) fn next_page(&mut self) -> Result<Option<AnyFrame>> {
        let Some(decoder) = &mut self.decoder else { return Ok(None) };
        let frame = read_page(decoder, &self.path, self.colour, self.page)?;
        self.skip_page()?;
        Ok(Some(frame))
    }
}

fn read_page(decoder: &mut Decoder<BufReader<File>>, path: &Path, colour: Colour, page: usize) -> Result<AnyFrame> {
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
        _ if page == 0 && !decoder.more_images() => return read_one_picture(path, colour),
        other => return Err(Error::format(path, format!("TIFF pages of kind {other:?} are not supported"))),
    };
    let grey = Grey { path, width, height, colour };
    match decoder.read_image().map_err(|e| tiff_error(path, e))? {
        DecodingResult::U8(samples) => grey.from(channels, &samples).map(AnyFrame::U8),
        DecodingResult::U16(samples) => grey.from(channels, &samples).map(AnyFrame::U16),
        DecodingResult::F32(samples) => grey.from(channels, &samples).map(AnyFrame::F32),
        DecodingResult::F64(samples) => grey.from(channels, &samples).map(AnyFrame::F64),
        _ => Err(Error::format(path, "TIFF samples other than uint8, uint16, float32 and float64 are not supported")),
    }
}
