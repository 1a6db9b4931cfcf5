//! Image files to grey or colour frames.

use super::limits::{MAX_SIDE, check_size, io_error, memory_limit};
use super::{channels::ChannelPolicy, channels::Channels, jpeg, pages::Pages, planes::PlaneSelection, pnm};
use crate::error::{Error, Result, check_memory};
use crate::types::Sample;
use ::image::metadata::Orientation;
use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Extensions of the image files that sources look for.
pub(crate) const EXTENSIONS: &[&str] = &["png", "tif", "tiff", "bmp", "pgm", "pnm", "ppm", "jpg", "jpeg"];

/// Reads the picture in an image file by its content, not its extension: a grey frame with a policy of type
/// [`Colour`](super::Colour), a colour frame with one of type [`Grey`](super::Grey). JPEG and PNG are turned
/// as their EXIF data say for the display.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::Format`] when it is damaged, of an unknown format or
/// too large, has several pages, or `policy` refuses it; [`Error::Memory`] where its samples do not fit into
/// memory; [`Error::Missing`] for a kind of TIFF that is not read.
pub fn read_image<P: ChannelPolicy>(path: impl AsRef<Path>, policy: P) -> Result<P::Frame> {
    read_plane(path, policy, PlaneSelection::default())
}

/// As [`read_image`], of a TIFF file with several channels or slices, of which `selection` names one.
///
/// # Errors
/// As [`read_image`]; [`Error::Argument`] for a selection that the file does not have.
pub fn read_plane<P: ChannelPolicy>(path: impl AsRef<Path>, policy: P, selection: PlaneSelection) -> Result<P::Frame> {
    let path = path.as_ref();
    if is_tiff(path)? {
        let mut pages = Pages::open(path, policy, selection)?;
        if pages.left() > 1 {
            let message =
                "holds several pages; expected one picture a file (or open this file by itself, as a sequence)";
            return Err(Error::format(path, message));
        }
        return pages.next_frame()?.ok_or_else(|| Error::format(path, "holds no picture"));
    }
    if let Some(option) = selection.given() {
        return Err(Error::argument(option, "none, as only TIFF files name such an axis", path.display()));
    }
    read_one_picture(path, policy)
}

/// First bytes of TIFF and BigTIFF files of either byte order.
pub(crate) const TIFF_SIGNATURES: &[&[u8]] = &[b"II*\0", b"II+\0", b"MM\0*", b"MM\0+"];

/// Whether the file begins as a TIFF or BigTIFF of either byte order.
pub(crate) fn is_tiff(path: &Path) -> Result<bool> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut signature = Vec::new();
    file.take(4).read_to_end(&mut signature).map_err(|e| Error::io(path, e))?;
    Ok(TIFF_SIGNATURES.contains(&&signature[..]))
}

/// A reader of the picture, and the bytes that it may take.
fn guessing_reader(path: &Path) -> Result<(ImageReader<BufReader<File>>, u64)> {
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
    Ok((reader, memory))
}

fn read_one_picture<P: ChannelPolicy>(path: &Path, policy: P) -> Result<P::Frame> {
    let (reader, memory) = guessing_reader(path)?;
    if reader.format() == Some(ImageFormat::Jpeg)
        && !jpeg::is_whole(&std::fs::read(path).map_err(|e| Error::io(path, e))?)
    {
        return Err(Error::format(path, "cut off: the JPEG picture has no end"));
    }
    if reader.format().is_none() {
        return Err(Error::format(path, "not an image of a known format (PNG, TIFF, BMP, PGM, JPEG)"));
    }
    if reader.format() == Some(ImageFormat::Png) && is_animated(path) {
        let message =
            "an animated PNG, of several pictures; expected one (ffmpeg -i FILE frames/%06d.png takes them out)";
        return Err(Error::format(path, message));
    }
    if reader.format() == Some(ImageFormat::Pnm) {
        pnm::check(path)?;
    }
    let picture = upright(path, reader, memory)?;
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

/// The picture, turned as its EXIF data say for the display.
fn upright(path: &Path, reader: ImageReader<BufReader<File>>, memory: u64) -> Result<DynamicImage> {
    let damaged = |error| image_error(path, error);
    let mut decoder = reader.into_decoder().map_err(damaged)?;
    let mut limits = ::image::Limits::default();
    limits.max_alloc = Some(memory);
    limits.reserve(decoder.total_bytes()).map_err(damaged)?;
    // Damaged EXIF data are no reason to refuse a picture.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let copies = if orientation == Orientation::NoTransforms { 1 } else { 2 };
    check_memory(&path.display().to_string(), usize::try_from(copies * decoder.total_bytes()).ok())?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(damaged)?;
    picture.apply_orientation(orientation);
    Ok(picture)
}

fn is_animated(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let reader = png::Decoder::new(BufReader::new(file)).read_info();
    reader.is_ok_and(|reader| reader.info().animation_control().is_some())
}

fn image_error(path: &Path, error: ImageError) -> Error {
    match error {
        ImageError::IoError(error) => io_error(path, error),
        ImageError::Limits(limit) => Error::format(path, format!("too large a picture: {limit}")),
        other => Error::format(path, other.to_string()),
    }
}

pub(crate) fn png_error(path: &Path, error: png::DecodingError) -> Error {
    match error {
        png::DecodingError::IoError(error) => io_error(path, error),
        other => Error::format(path, other.to_string()),
    }
}
