//! PNG files of 16 bits, as the KITTI benchmark keeps flow and disparity.

use super::{decode::png_error, limits::check_size, write::atomic};
use crate::error::{Error, Result};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What a file holds, for messages, and its kind of pixels.
pub(super) struct SixteenBitPng {
    pub what: &'static str,
    pub colour: png::ColorType,
    pub colour_in_words: &'static str,
}

impl SixteenBitPng {
    /// Writes samples, row by row and big-endian.
    pub fn write(&self, path: &Path, (width, height): (usize, usize), samples: &[u8]) -> Result<()> {
        atomic(path, |file| {
            let mut encoder = png::Encoder::new(file, width as u32, height as u32);
            encoder.set_color(self.colour);
            encoder.set_depth(png::BitDepth::Sixteen);
            let written = encoder.write_header().and_then(|mut png| {
                png.write_image_data(samples)?;
                png.finish()
            });
            written.map_err(|e| Error::io(path, e.into()))
        })
    }

    /// Calls `take` with every pixel of `N` samples; returns width and height.
    pub fn read<const N: usize>(&self, path: &Path, mut take: impl FnMut([u16; N])) -> Result<(usize, usize)> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let mut reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| png_error(path, e))?;
        let info = reader.info();
        let (width, height) = (info.width as usize, info.height as usize);
        let Self { what, colour, colour_in_words } = self;
        if (info.color_type, info.bit_depth) != (*colour, png::BitDepth::Sixteen) {
            let got = format!("{:?} {:?}", info.bit_depth, info.color_type);
            return Err(Error::format(path, format!("not a {what} PNG: expected 16-bit {colour_in_words}, got {got}")));
        }
        check_size(path, width, height)?;
        // Row by row where the file allows, so that a small file cannot ask for a large picture.
        if info.interlaced {
            return Err(Error::format(path, format!("an interlaced PNG; {what} PNGs are not interlaced")));
        }
        while let Some(row) = reader.next_row().map_err(|e| png_error(path, e))? {
            for pixel in row.data().chunks_exact(2 * N) {
                take(std::array::from_fn(|i| u16::from_be_bytes([pixel[2 * i], pixel[2 * i + 1]])));
            }
        }
        Ok((width, height))
    }
}
