//! Pages stored in ways that the decoder does not know (Zstandard, LZMA, palettes, planes without a directory
//! of their own) or misreads (tiles in LZW), restated as a TIFF file in memory that it knows.

use super::directory::{FileDecoder, limits, number, numbers, tiff_error};
use crate::error::{Error, Result};
use crate::io::limits::io_error;
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use tiff::decoder::Decoder;
use tiff::tags::{ByteOrder, Tag};

/// Tiles in LZW may be full before their end code has been read, which crate `tiff` 0.11 takes for a file
/// that is cut off (image-rs/image-tiff, 395).
pub(super) const LZW: u32 = 5;
/// LZMA2 in xz streams, as libtiff numbers it.
pub(super) const LZMA: u32 = 34925;
/// Zstandard, as libtiff numbers it.
pub(super) const ZSTANDARD: u32 = 50000;
/// PhotometricInterpretation of indices into a palette.
pub(super) const PALETTE: u32 = 3;
const BLACK_IS_ZERO: u32 = 1;
const UNCOMPRESSED: u32 = 1;

/// Tags that say how samples lie in their strips or tiles; all are numbers.
const LAYOUT: [Tag; 12] = [
    Tag::ImageWidth,
    Tag::ImageLength,
    Tag::BitsPerSample,
    Tag::SamplesPerPixel,
    Tag::RowsPerStrip,
    Tag::PlanarConfiguration,
    Tag::Predictor,
    Tag::TileWidth,
    Tag::TileLength,
    Tag::ExtraSamples,
    Tag::SampleFormat,
    Tag::FillOrder,
];

/// The current page as a file of its own; its data are read `shift` bytes behind where its directory says.
/// `memory`: most bytes that it may take.
pub(super) fn restated(
    decoder: &mut FileDecoder,
    path: &Path,
    shift: u64,
    memory: u64,
) -> Result<Decoder<Cursor<Vec<u8>>>> {
    let is_tiled = !numbers(decoder, Tag::TileOffsets).is_empty();
    let (places, lengths) =
        if is_tiled { (Tag::TileOffsets, Tag::TileByteCounts) } else { (Tag::StripOffsets, Tag::StripByteCounts) };
    let compression = number(decoder, Tag::Compression).unwrap_or(UNCOMPRESSED);
    let chunks = numbers(decoder, places).into_iter().zip(numbers(decoder, lengths));
    let mut file = Restated::new(decoder.byte_order());
    let (mut starts, mut counts) = (Vec::new(), Vec::new());
    for (start, length) in chunks.collect::<Vec<_>>() {
        let source = decoder.inner();
        source.seek(SeekFrom::Start(start.saturating_add(shift))).map_err(|e| io_error(path, e))?;
        let left = memory.saturating_sub(file.bytes.len() as u64);
        let chunk = expanded(source.take(length), compression, left).map_err(|e| io_error(path, e))?;
        if chunk.len() as u64 > left {
            return Err(Error::format(path, "too large a picture for a file of its length"));
        }
        starts.push(file.bytes.len() as u32);
        counts.push(chunk.len() as u32);
        file.bytes.extend_from_slice(&chunk);
    }
    let is_foreign = [LZW, LZMA, ZSTANDARD].contains(&compression);
    let photometric = match number(decoder, Tag::PhotometricInterpretation) {
        Some(PALETTE) | None => BLACK_IS_ZERO,
        Some(other) => other,
    };
    let mut entries = vec![
        (Tag::Compression, vec![if is_foreign { UNCOMPRESSED } else { compression }]),
        (Tag::PhotometricInterpretation, vec![photometric]),
        (places, starts),
        (lengths, counts),
    ];
    for tag in LAYOUT {
        let values: Vec<u32> = numbers(decoder, tag).into_iter().map(|value| value as u32).collect();
        if !values.is_empty() {
            entries.push((tag, values));
        }
    }
    let page = Decoder::new(Cursor::new(file.finish(entries))).map_err(|e| tiff_error(path, e))?;
    Ok(page.with_limits(limits(memory)))
}

/// The bytes of a strip or tile without LZW, Zstandard or LZMA, at most one more than `most`; other
/// compression is left to the decoder.
fn expanded(mut chunk: impl Read, compression: u32, most: u64) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let most = most.saturating_add(1);
    match compression {
        ZSTANDARD => {
            let stream = ruzstd::decoding::StreamingDecoder::new(chunk).map_err(std::io::Error::other)?;
            stream.take(most).read_to_end(&mut bytes)?;
        }
        LZW => {
            let mut stored = Vec::new();
            chunk.read_to_end(&mut stored)?;
            unpack_lzw(&stored, &mut bytes, most)?;
        }
        LZMA => {
            let kilobytes = u32::try_from(most / 1024).unwrap_or(u32::MAX);
            let stream = lzma_rust2::XzReader::new_mem_limit(chunk, false, kilobytes);
            stream.take(most).read_to_end(&mut bytes)?;
        }
        _ => {
            chunk.take(most).read_to_end(&mut bytes)?;
        }
    }
    Ok(bytes)
}

/// Appends what is `stored` to `bytes` until its end or until they are `most`.
fn unpack_lzw(mut stored: &[u8], bytes: &mut Vec<u8>, most: u64) -> std::io::Result<()> {
    let mut decoder = weezl::decode::Decoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8);
    let mut part = [0; 1 << 13];
    while (bytes.len() as u64) < most {
        let step = decoder.decode_bytes(stored, &mut part);
        stored = &stored[step.consumed_in..];
        bytes.extend_from_slice(&part[..step.consumed_out]);
        let status = step.status.map_err(|e| std::io::Error::new(std::io::ErrorKind::InvalidData, e))?;
        if !matches!(status, weezl::LzwStatus::Ok) {
            break;
        }
    }
    bytes.truncate(usize::try_from(most).unwrap_or(usize::MAX));
    Ok(())
}

/// A file in the making: header, data, then one directory.
struct Restated {
    order: ByteOrder,
    bytes: Vec<u8>,
}

impl Restated {
    fn new(order: ByteOrder) -> Self {
        let mut file = Self { order, bytes: Vec::new() };
        file.bytes.extend_from_slice(if file.is_little() { b"II" } else { b"MM" });
        file.short(42);
        file.long(0);
        file
    }

    fn is_little(&self) -> bool {
        matches!(self.order, ByteOrder::LittleEndian)
    }

    fn short(&mut self, value: u16) {
        self.bytes.extend_from_slice(&if self.is_little() { value.to_le_bytes() } else { value.to_be_bytes() });
    }

    fn long(&mut self, value: u32) {
        self.bytes.extend_from_slice(&if self.is_little() { value.to_le_bytes() } else { value.to_be_bytes() });
    }

    /// Appends the directory with these tags, all of type LONG.
    fn finish(mut self, mut entries: Vec<(Tag, Vec<u32>)>) -> Vec<u8> {
        const LONG: u16 = 4;
        entries.sort_by_key(|(tag, _)| tag.to_u16());
        let mut fields = Vec::new();
        for (tag, values) in &entries {
            let field = if let [one] = values[..] {
                one
            } else {
                let place = self.bytes.len() as u32;
                for &value in values {
                    self.long(value);
                }
                place
            };
            fields.push((tag.to_u16(), values.len() as u32, field));
        }
        let directory = self.bytes.len() as u32;
        self.short(fields.len() as u16);
        for (tag, count, field) in fields {
            self.short(tag);
            self.short(LONG);
            self.long(count);
            self.long(field);
        }
        self.long(0);
        let place = if self.is_little() { directory.to_le_bytes() } else { directory.to_be_bytes() };
        self.bytes[4..8].copy_from_slice(&place);
        self.bytes
    }
}
