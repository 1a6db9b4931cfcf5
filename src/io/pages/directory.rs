//! Directories of a TIFF file: which pages are frames, and values of their tags.

use crate::error::{Error, Result};
use crate::io::limits::{io_error, memory_limit};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use tiff::TiffError;
use tiff::decoder::ifd::Value;
use tiff::decoder::{Decoder, Limits};
use tiff::tags::Tag;

pub(super) type FileDecoder = Decoder<BufReader<File>>;

/// A page is a reduced copy of another one (TIFF 6.0, NewSubfileType, bit 0) or a transparency mask (bit 2).
const NOT_A_PICTURE: u32 = 0b101;
/// As above in the older tag SubfileType.
const REDUCED: u32 = 2;

/// What becomes of a failure of the decoder.
pub(super) fn tiff_error(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(error) => io_error(path, error),
        TiffError::UnsupportedError(what) => unsupported(path, &what.to_string()),
        other => Error::format(path, other.to_string()),
    }
}

/// The answer to a kind of TIFF that is not read.
pub(super) fn unsupported(path: &Path, what: &str) -> Error {
    Error::Missing(format!(
        "{}: {what}: the built-in TIFF reader does not read this. Save it uncompressed or with LZW, Deflate, Zstandard or LZMA, grey or RGB; in Python jacoflow.io.frames reads it when tifffile is installed",
        path.display()
    ))
}

/// Opens a file at its first page; also the memory that decoding may take, bytes.
pub(super) fn open(path: &Path) -> Result<(FileDecoder, u64)> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let memory = memory_limit(&file).map_err(|e| Error::io(path, e))?;
    let decoder = Decoder::new(BufReader::with_capacity(1 << 16, file)).map_err(|e| tiff_error(path, e))?;
    Ok((decoder.with_limits(limits(memory)), memory))
}

pub(super) fn limits(memory: u64) -> Limits {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = memory as usize;
    limits.intermediate_buffer_size = memory as usize;
    // Descriptions of long recordings (OME-XML) take megabytes.
    limits.ifd_value_size = memory as usize;
    limits
}

/// Indices of the pages that are pictures of full size, in the file's order. Every page is visited.
pub(super) fn pictures(decoder: &mut FileDecoder, path: &Path) -> Result<Vec<usize>> {
    let mut pictures = Vec::new();
    for index in 0.. {
        let kind = number(decoder, Tag::NewSubfileType).unwrap_or(0) & NOT_A_PICTURE;
        if kind == 0 && number(decoder, Tag::SubfileType) != Some(REDUCED) {
            pictures.push(index);
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(|e| tiff_error(path, e))?;
    }
    if pictures.is_empty() {
        return Err(Error::format(path, "holds no picture of full size"));
    }
    Ok(pictures)
}

/// A tag's number; `None` where it is absent or no number.
pub(super) fn number<R: std::io::Read + std::io::Seek>(decoder: &mut Decoder<R>, tag: Tag) -> Option<u32> {
    decoder.find_tag_unsigned(tag).ok().flatten()
}

/// A tag's numbers; none where it is absent.
pub(super) fn numbers(decoder: &mut FileDecoder, tag: Tag) -> Vec<u64> {
    decoder.find_tag_unsigned_vec(tag).ok().flatten().unwrap_or_default()
}

/// Pixels per unit along x and y; `None` where the file does not say.
pub(super) fn resolution(decoder: &mut FileDecoder) -> Option<(f64, f64)> {
    let mut along = |tag| match decoder.find_tag(tag).ok().flatten()? {
        Value::Rational(numerator, denominator) => Some(f64::from(numerator) / f64::from(denominator)),
        _ => None,
    };
    Some((along(Tag::XResolution)?, along(Tag::YResolution)?))
}

/// The text in ImageDescription; empty where there is none. Bytes that are not UTF-8 are taken for Latin-1.
pub(super) fn description(decoder: &mut FileDecoder) -> String {
    match decoder.find_tag(Tag::ImageDescription) {
        Ok(Some(Value::Ascii(text))) => return text,
        Ok(None) => return String::new(),
        _ => {}
    }
    let mut bytes = Vec::new();
    let mut block = [0; 4096];
    while let Ok(Some(read)) = decoder.image_ifd().find_tag_bytes(Tag::ImageDescription, &mut block, bytes.len() as u64)
    {
        bytes.extend_from_slice(&block[..read.min(block.len())]);
        if read < block.len() {
            break;
        }
    }
    bytes.iter().take_while(|&&b| b != 0).map(|&b| char::from(b)).collect()
}
