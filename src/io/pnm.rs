//! What the decoder of PBM, PGM and PPM files passes over: another picture in the file, and samples above the
//! maximum that the header states, which it clips.

use crate::error::{Error, Result};
use ::image::ImageDecoder;
use ::image::codecs::pnm::{PnmDecoder, PnmSubtype, SampleEncoding};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Refuses a file that holds another picture or a sample above its maximum. Damaged files, also those whose
/// header promises more than a file can hold, are left to the decoder.
///
/// # Errors
/// [`Error::Io`], [`Error::Format`].
pub fn check(path: &Path) -> Result<()> {
    let mut file = BufReader::new(File::open(path).map_err(|e| Error::io(path, e))?);
    let Ok(decoder) = PnmDecoder::new(&mut file) else { return Ok(()) };
    let (subtype, maximum, (width, height)) =
        (decoder.subtype(), decoder.header().maximal_sample(), decoder.dimensions());
    let bytes = match subtype {
        // Eight pixels a byte, rows padded.
        PnmSubtype::Bitmap(SampleEncoding::Binary) => u64::from(width.div_ceil(8)) * u64::from(height),
        _ => decoder.total_bytes(),
    };
    let found = match subtype {
        PnmSubtype::Bitmap(SampleEncoding::Ascii)
        | PnmSubtype::Graymap(SampleEncoding::Ascii)
        | PnmSubtype::Pixmap(SampleEncoding::Ascii) => plain(file),
        _ => binary(file, bytes, maximum),
    };
    let Ok(Raster { largest, has_another }) = found else { return Ok(()) };
    if has_another {
        let message = "several PGM or PPM pictures in one file; expected one (ffmpeg -f image2pipe -i FILE frames/%06d.png takes binary ones out)";
        return Err(Error::format(path, message));
    }
    // Bits that are packed without spaces read as one number.
    if largest > maximum && !matches!(subtype, PnmSubtype::Bitmap(_)) {
        let message = format!("holds a sample of {largest}; expected at most {maximum}, the maximum in its header");
        return Err(Error::format(path, message));
    }
    Ok(())
}

/// The samples of a picture and what follows them.
#[derive(Default)]
struct Raster {
    largest: u32,
    has_another: bool,
}

/// Samples as decimal numbers, to the end of the file.
fn plain(file: impl BufRead) -> std::io::Result<Raster> {
    let mut raster = Raster::default();
    for line in file.split(b'\n') {
        let line = line?;
        let numbers = line.split(|&byte| byte == b'#').next().unwrap_or_default();
        for word in numbers.split(u8::is_ascii_whitespace) {
            if word.first() == Some(&b'P') {
                raster.has_another = true;
                return Ok(raster);
            }
            let sample = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
            raster.largest = raster.largest.max(sample.unwrap_or(0));
        }
    }
    Ok(raster)
}

/// Samples of one byte, or of two where `maximum` needs them, `bytes` in all.
fn binary(mut file: BufReader<File>, bytes: u64, maximum: u32) -> std::io::Result<Raster> {
    let mut raster = Raster::default();
    if maximum == u32::from(u8::MAX) || maximum == u32::from(u16::MAX) {
        file.seek_relative(i64::try_from(bytes).unwrap_or(i64::MAX))?;
    } else {
        let mut samples = Vec::new();
        file.by_ref().take(bytes).read_to_end(&mut samples)?;
        raster.largest = if maximum < u32::from(u8::MAX) {
            samples.iter().copied().max().map_or(0, u32::from)
        } else {
            samples.as_chunks::<2>().0.iter().map(|&pair| u32::from(u16::from_be_bytes(pair))).max().unwrap_or(0)
        };
    }
    let mut magic = Vec::new();
    file.take(2).read_to_end(&mut magic)?;
    raster.has_another = matches!(magic[..], [b'P', digit] if digit.is_ascii_digit());
    Ok(raster)
}
