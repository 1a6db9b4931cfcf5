//! The pages of a TIFF file as frames.
//!
//! `directory` finds the pages and reads their tags; `imagej`, `ome` (with `xml`) and `shaped` read what the
//! first page's description says of axes, time and scale; `recording` chooses planes; `stored` undoes ways of
//! storing that the decoder does not know; `samples` makes frames.

mod directory;
mod imagej;
mod ome;
mod recording;
mod samples;
mod shaped;
mod stored;
mod xml;

use super::channels::ChannelPolicy;
use super::planes::{PixelSize, PlaneSelection};
use crate::error::{Error, Result};
use directory::FileDecoder;
use recording::Recording;
use std::path::{Path, PathBuf};
use tiff::tags::Tag;

/// A frame's place: page of the file, bytes by which its data lie behind those that the page's directory
/// names, time in s where the file says.
#[derive(Debug, Clone, Copy)]
struct Place {
    page: usize,
    shift: u64,
    time: Option<f64>,
}

/// Frames of a TIFF file: pages of full size along time, of one channel and slice, grey or colour. Thumbnails
/// and masks are left out. Samples of int8, int16 and float16 become float32, those of int32, uint32, int64
/// and uint64 float64.
#[derive(Debug)]
pub(crate) struct Pages<P> {
    path: PathBuf,
    policy: P,
    decoder: FileDecoder,
    memory: u64,
    places: Vec<Place>,
    next: usize,
    frame_rate: Option<f64>,
    pixel_size: Option<PixelSize>,
}

impl<P: ChannelPolicy> Pages<P> {
    /// Opens a file and chooses its frames.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be read; [`Error::Format`] when it is damaged, or has axes beside time
    /// from which nothing is selected; [`Error::Argument`] for a selection that it does not have.
    pub(crate) fn open(path: &Path, policy: P, selection: PlaneSelection) -> Result<Self> {
        let (mut decoder, memory) = directory::open(path)?;
        let found = directory::pictures(&mut decoder, path)?;
        decoder.seek_to_image(found[0]).map_err(|e| directory::tiff_error(path, e))?;
        let recording = describe(&mut decoder, path, found.len())?.map(|own| own.fitted(found.len()));
        let stored = places(&mut decoder, path, &found, recording.as_ref())?;
        let only = |place: Place| vec![place];
        let places = match (&recording, &stored[..]) {
            (Some(recording), [_, _, ..]) => {
                let planes = recording.select(path, selection)?;
                planes.iter().map(|&(page, time)| Place { time, ..stored[page] }).collect()
            }
            (Some(recording), [one]) if selection == PlaneSelection::default() => {
                let time = recording.planes.iter().find(|plane| plane.page.is_some()).and_then(|plane| plane.time);
                only(Place { time, ..*one })
            }
            (Some(recording), [one]) => {
                recording.select(path, selection)?;
                only(*one)
            }
            _ => match selection.given() {
                None => stored,
                Some(option) => {
                    return Err(Error::argument(option, "none, as the file names no such axis", path.display()));
                }
            },
        };
        let (frame_rate, pixel_size) =
            recording.map_or((None, None), |recording| (recording.frame_rate, recording.pixel_size));
        Ok(Self { path: path.to_path_buf(), policy, decoder, memory, places, next: 0, frame_rate, pixel_size })
    }

    /// Frames that are left.
    pub(crate) fn left(&self) -> usize {
        self.places.len() - self.next
    }

    /// Passes over up to `count` frames; returns how many there were.
    pub(crate) fn skip(&mut self, count: usize) -> usize {
        let passed = count.min(self.left());
        self.next += passed;
        passed
    }

    /// The next frame; `None` after the last.
    pub(crate) fn next_frame(&mut self) -> Result<Option<P::Frame>> {
        let Some(&Place { page, shift, .. }) = self.places.get(self.next) else { return Ok(None) };
        self.decoder.seek_to_image(page).map_err(|e| directory::tiff_error(&self.path, e))?;
        let frame = samples::read(&mut self.decoder, &self.path, self.policy, shift, self.memory)?;
        self.next += 1;
        Ok(Some(frame))
    }

    /// Time of the frame delivered last, s: its own, else by the frame rate, where the file says either.
    pub(crate) fn time(&self) -> Option<f64> {
        let last = self.next.checked_sub(1)?;
        self.places.get(last)?.time.or_else(|| Some(last as f64 / self.frame_rate?))
    }

    /// Frames per second, where the file says so.
    pub(crate) fn frame_rate(&self) -> Option<f64> {
        self.frame_rate
    }

    /// Size of a pixel, where the file says so.
    pub(crate) fn pixel_size(&self) -> Option<&PixelSize> {
        self.pixel_size.as_ref()
    }
}

/// What the metadata of the current page, the first picture, say.
fn describe(decoder: &mut FileDecoder, path: &Path, pages: usize) -> Result<Option<Recording>> {
    let description = directory::description(decoder);
    let resolution = directory::resolution(decoder);
    if let Some(recording) = imagej::parse(&description, resolution) {
        return Ok(Some(recording));
    }
    if let Some(recording) = ome::parse(path, &description, pages)? {
        return Ok(Some(recording));
    }
    let (width, height) = decoder.dimensions().map_err(|e| directory::tiff_error(path, e))?;
    shaped::parse(path, &description, pages, (width as usize, height as usize))
}

/// The places of all planes in the file's order: pages, or for large files of ImageJ, which have one
/// directory, the planes that follow the first one's data.
fn places(
    decoder: &mut FileDecoder,
    path: &Path,
    found: &[usize],
    recording: Option<&Recording>,
) -> Result<Vec<Place>> {
    let pages = || found.iter().map(|&page| Place { page, shift: 0, time: None }).collect();
    let Some(recording) = recording else { return Ok(pages()) };
    let named = recording.planes.iter().filter_map(|plane| plane.page).max().map_or(0, |last| last + 1);
    if named == found.len() || (named < found.len() && recording.sizes.planes() != Some(named)) {
        return Ok(pages());
    }
    let mismatch = || {
        let message = format!("its metadata name {named} planes, the file has {} pages", found.len());
        Err(Error::format(path, message))
    };
    let starts = directory::numbers(decoder, Tag::StripOffsets);
    let lengths = directory::numbers(decoder, Tag::StripByteCounts);
    let is_plain = directory::number(decoder, Tag::Compression).unwrap_or(1) == 1;
    let (Some(&start), 1, true) = (starts.first(), found.len(), is_plain) else { return mismatch() };
    let size: u64 = lengths.iter().fold(0, |sum, &length| sum.saturating_add(length));
    let end = (named as u64).checked_mul(size).and_then(|bytes| bytes.checked_add(start));
    let available = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.len();
    if size == 0 || end.is_none_or(|end| end > available) {
        return mismatch();
    }
    Ok((0..named as u64).map(|k| Place { page: found[0], shift: k * size, time: None }).collect())
}
