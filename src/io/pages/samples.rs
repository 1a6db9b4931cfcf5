//! The samples of a page as a frame: types that frames do not have, packed bits, palettes, separate planes.

use super::directory::{FileDecoder, number, numbers, tiff_error, unsupported};
use super::stored::{LZMA, LZW, PALETTE, ZSTANDARD, restated};
use crate::error::{Error, Result, check_memory};
use crate::io::channels::{ChannelPolicy, Channels, exact_doubles, widened};
use crate::io::limits::check_size;
use crate::types::Sample;
use std::io::{Read, Seek};
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{ChunkType, Decoder, DecodingResult};
use tiff::tags::Tag;

/// ExtraSamples of an alpha channel: premultiplied or not.
const ALPHA: [u64; 2] = [1, 2];

/// The frame in the current page, whose data begin `shift` bytes behind where its directory says.
///
/// # Errors
/// [`Error::Format`] for a damaged page, samples that no frame type holds exactly, or a policy that refuses
/// it;
/// [`Error::Missing`] for a kind that is not read.
pub(super) fn read<P: ChannelPolicy>(
    decoder: &mut FileDecoder,
    path: &Path,
    policy: P,
    shift: u64,
    memory: u64,
) -> Result<P::Frame> {
    let (width, height) = decoder.dimensions().map_err(|e| tiff_error(path, e))?;
    check_size(path, width as usize, height as usize)?;
    let compression = number(decoder, Tag::Compression);
    let palette = if number(decoder, Tag::PhotometricInterpretation) == Some(PALETTE) {
        Some(numbers(decoder, Tag::ColorMap))
    } else {
        None
    };
    let place = Place { path, width: width as usize, height: height as usize };
    let is_tiled = decoder.get_chunk_type() == ChunkType::Tile;
    let is_foreign = |code| [LZMA, ZSTANDARD].contains(&code) || (code == LZW && is_tiled);
    if shift > 0 || palette.is_some() || compression.is_some_and(is_foreign) {
        let mut page = restated(decoder, path, shift, memory)?;
        return place.decoded(&mut page, policy, palette.as_deref());
    }
    place.decoded(decoder, policy, None)
}

struct Place<'a> {
    path: &'a Path,
    width: usize,
    height: usize,
}

impl Place<'_> {
    fn decoded<R: Read + Seek, P: ChannelPolicy>(
        &self,
        decoder: &mut Decoder<R>,
        policy: P,
        palette: Option<&[u64]>,
    ) -> Result<P::Frame> {
        let path = self.path;
        let kind = decoder.colortype().map_err(|e| tiff_error(path, e))?;
        let (count, bits) = match kind {
            ColorType::Gray(bits) => (1, bits),
            ColorType::GrayA(bits) => (2, bits),
            ColorType::RGB(bits) => (3, bits),
            ColorType::RGBA(bits) => (4, bits),
            ColorType::Multiband { bit_depth, num_samples: 2 } if has_alpha(decoder) => (2, bit_depth),
            ColorType::Multiband { bit_depth, num_samples } => {
                return Err(unsupported(path, &format!("{num_samples} samples of {bit_depth} bit a pixel")));
            }
            other => return Err(unsupported(path, &format!("pixels of kind {other:?}"))),
        };
        if count > 1 && has_cut_tiles(decoder) {
            return Err(unsupported(path, "colours in planes of tiles that reach beyond the picture"));
        }
        let bytes = self.width.checked_mul(self.height * count * usize::from(bits.div_ceil(8)));
        check_memory(&path.display().to_string(), bytes)?;
        let mut result = DecodingResult::U8(Vec::new());
        let layout = decoder.read_image_to_buffer(&mut result).map_err(|e| tiff_error(path, e))?;
        let planes = if layout.planes > 1 { count } else { 1 };
        if let (Some(palette), 1) = (palette, planes) {
            return match result {
                DecodingResult::U8(indices) if bits < 8 => {
                    self.coloured(&self.unpacked(&indices, bits), palette, policy)
                }
                DecodingResult::U8(indices) => self.coloured(&indices, palette, policy),
                DecodingResult::U16(indices) => self.coloured(&indices, palette, policy),
                _ => Err(Error::format(path, "a palette whose indices are no unsigned integers")),
            };
        }
        match result {
            DecodingResult::U8(samples) if bits < 8 && count == 1 => {
                let full = 255 / ((1_u16 << bits) - 1) as u8;
                let levels = self.unpacked(&samples, bits).iter().map(|&level| level * full).collect();
                self.frame(count, planes, levels, policy)
            }
            DecodingResult::U8(samples) => self.frame(count, planes, samples, policy),
            DecodingResult::U16(samples) => self.frame(count, planes, samples, policy),
            DecodingResult::F32(samples) => self.frame(count, planes, samples, policy),
            DecodingResult::F64(samples) => self.frame(count, planes, samples, policy),
            DecodingResult::I8(samples) => self.frame(count, planes, widened::<_, f32>(samples), policy),
            DecodingResult::I16(samples) => self.frame(count, planes, widened::<_, f32>(samples), policy),
            DecodingResult::F16(samples) => self.frame(count, planes, widened::<_, f32>(samples), policy),
            DecodingResult::I32(samples) => self.frame(count, planes, widened::<_, f64>(samples), policy),
            DecodingResult::U32(samples) => self.frame(count, planes, widened::<_, f64>(samples), policy),
            DecodingResult::I64(samples) => self.frame(count, planes, exact_doubles(path, &samples)?, policy),
            DecodingResult::U64(samples) => self.frame(count, planes, exact_doubles(path, &samples)?, policy),
        }
    }

    /// A frame of `count` samples a pixel, which lie in `planes` planes.
    fn frame<S: Sample, P: ChannelPolicy>(
        &self,
        count: usize,
        planes: usize,
        samples: Vec<S>,
        policy: P,
    ) -> Result<P::Frame> {
        let pixels = self.width * self.height;
        let samples = if planes == 1 || samples.len() != pixels * planes {
            samples
        } else {
            (0..pixels * planes).map(|k| samples[k % planes * pixels + k / planes]).collect()
        };
        policy.frame(Channels { path: self.path, width: self.width, height: self.height, count, samples })
    }

    /// Samples of `bits` bits each from rows that begin at whole bytes.
    fn unpacked(&self, packed: &[u8], bits: u8) -> Vec<u8> {
        let row_bytes = (self.width * usize::from(bits)).div_ceil(8);
        let sample = |row: &[u8], x: usize| {
            let at = x * usize::from(bits);
            row[at / 8] >> (8 - usize::from(bits) - at % 8) & ((1_u16 << bits) - 1) as u8
        };
        packed.chunks_exact(row_bytes).flat_map(|row| (0..self.width).map(move |x| sample(row, x))).collect()
    }

    /// Indices by a palette (all reds, all greens, all blues, 16 bit); grey where all its entries are.
    fn coloured<I: Copy + Into<usize>, P: ChannelPolicy>(
        &self,
        indices: &[I],
        palette: &[u64],
        policy: P,
    ) -> Result<P::Frame> {
        let entries = palette.len() / 3;
        let colour = |index: usize| [0, 1, 2].map(|k| palette[k * entries + index] as u16);
        if let Some(beyond) = indices.iter().find(|&&index| index.into() >= entries) {
            let message = format!("index {} of a palette of {entries} entries", (*beyond).into());
            return Err(Error::format(self.path, message));
        }
        let is_grey = (0..entries).map(colour).all(|[r, g, b]| r == g && g == b);
        let channels = if is_grey { 1 } else { 3 };
        let levels: Vec<u16> =
            indices.iter().flat_map(|&index| colour(index.into()).into_iter().take(channels)).collect();
        // Eight bits are stored as k * 257, by some programs as k * 256.
        let is_shallow = palette.iter().all(|&v| v % 257 == 0) || palette.iter().all(|&v| v % 256 == 0);
        if is_shallow {
            return self.frame(channels, 1, levels.iter().map(|&level| (level >> 8) as u8).collect(), policy);
        }
        self.frame(channels, 1, levels, policy)
    }
}

/// Whether each channel has tiles of its own and the last ones reach beyond the picture: the decoder panics.
fn has_cut_tiles<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    let (tile, size) = (decoder.chunk_dimensions(), decoder.dimensions().unwrap_or_default());
    let is_cut = !size.0.is_multiple_of(tile.0.max(1)) || !size.1.is_multiple_of(tile.1.max(1));
    is_cut && decoder.get_chunk_type() == ChunkType::Tile && number(decoder, Tag::PlanarConfiguration) == Some(2)
}

fn has_alpha<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    let extra: Option<Vec<u64>> = decoder.find_tag_unsigned_vec(Tag::ExtraSamples).ok().flatten();
    extra.is_some_and(|extra| extra.first().is_some_and(|kind| ALPHA.contains(kind)))
}
