//! What the metadata of a TIFF file say about its planes, and which of these are chosen as frames.

use crate::error::{Error, Result};
use crate::io::planes::{PixelSize, PlaneSelection, Slices};
use std::path::Path;

/// Most planes that metadata may name: more is taken for damage, not for a recording.
const MAX_PLANES: usize = 1 << 26;

/// Numbers of channels, slices and times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sizes {
    pub channels: usize,
    pub slices: usize,
    pub times: usize,
}

impl Sizes {
    /// Number of planes; `None` beyond what any recording has.
    pub fn planes(self) -> Option<usize> {
        let Self { channels, slices, times } = self;
        channels.checked_mul(slices)?.checked_mul(times).filter(|planes| (1..=MAX_PLANES).contains(planes))
    }
}

/// Axes from which planes are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axis {
    Channel,
    Slice,
    Time,
}

/// A plane's place in the file, and its time, s, where the file says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Plane {
    /// Index among the pages that are pictures; `None`: not in this file.
    pub page: Option<usize>,
    pub time: Option<f64>,
}

/// What a file's metadata say.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Recording {
    pub sizes: Sizes,
    /// Planes, channels innermost, then slices, then times.
    pub planes: Vec<Plane>,
    pub frame_rate: Option<f64>,
    pub pixel_size: Option<PixelSize>,
}

impl Recording {
    /// Planes in the file's order, along `order` from the innermost axis outwards. `None` when there are
    /// impossibly many.
    pub fn in_order(sizes: Sizes, order: [Axis; 3]) -> Option<Self> {
        let count = sizes.planes()?;
        let length = |axis| match axis {
            Axis::Channel => sizes.channels,
            Axis::Slice => sizes.slices,
            Axis::Time => sizes.times,
        };
        let planes = (0..count).map(|k| {
            let index = |axis| match axis {
                Axis::Channel => k % sizes.channels,
                Axis::Slice => k / sizes.channels % sizes.slices,
                Axis::Time => k / (sizes.channels * sizes.slices),
            };
            let page = order.iter().rev().fold(0, |page, &axis| page * length(axis) + index(axis));
            Plane { page: Some(page), time: None }
        });
        Some(Self { sizes, planes: planes.collect(), frame_rate: None, pixel_size: None })
    }

    /// The same for a file of `pages` pages: where time is the only axis, all its pages are frames.
    pub fn fitted(mut self, pages: usize) -> Self {
        if self.sizes.channels == 1 && self.sizes.slices == 1 && pages > self.planes.len() {
            self.planes = (0..pages).map(|page| Plane { page: Some(page), time: None }).collect();
            self.sizes.times = pages;
        }
        self
    }

    /// Index of a plane in `planes`.
    pub fn place(&self, channel: usize, slice: usize, time: usize) -> usize {
        (time * self.sizes.slices + slice) * self.sizes.channels + channel
    }

    /// The planes that are frames, in the order of time, those in this file.
    ///
    /// # Errors
    /// [`Error::Format`] when the file has channels or slices and none is chosen, [`Error::Argument`] for an
    /// index beyond them.
    pub fn select(&self, path: &Path, selection: PlaneSelection) -> Result<Vec<(usize, Option<f64>)>> {
        let Sizes { channels, slices, times } = self.sizes;
        let ambiguous = |count: usize, what: &str, advice: String| {
            let each = if times == 1 { String::new() } else { format!(" at each of {times} times") };
            Error::format(path, format!("holds {count} {what}{each}; choose one with {advice}"))
        };
        let channel = match selection.channel {
            Some(channel) if channel >= channels => {
                return Err(Error::argument("channel", format!("an index below {channels}"), channel));
            }
            None if channels > 1 => {
                let last = channels - 1;
                return Err(ambiguous(channels, "channels (C)", format!("channel=0 to channel={last} (--channel)")));
            }
            channel => channel.unwrap_or(0),
        };
        let places: Vec<usize> = match selection.z {
            Some(Slices::Index(z)) if z >= slices => {
                return Err(Error::argument("z", format!("an index below {slices}"), z));
            }
            Some(Slices::AsTime) if times > 1 => {
                return Err(Error::argument("z", format!("an index, as the file holds {times} times"), "time"));
            }
            Some(Slices::AsTime) => (0..slices).map(|z| self.place(channel, z, 0)).collect(),
            None if slices > 1 => {
                let as_time = if times == 1 { ", or take them as frames with z=\"time\" (--z time)" } else { "" };
                let advice = format!("z=0 to z={} (--z){as_time}", slices - 1);
                return Err(ambiguous(slices, "slices (Z)", advice));
            }
            chosen => {
                let z = if let Some(Slices::Index(z)) = chosen { z } else { 0 };
                (0..times).map(|time| self.place(channel, z, time)).collect()
            }
        };
        let chosen: Vec<_> = places
            .iter()
            .filter_map(|&place| self.planes[place].page.map(|page| (page, self.planes[place].time)))
            .collect();
        if chosen.is_empty() {
            return Err(Error::format(path, "its OME-XML says that the chosen planes are in other files"));
        }
        Ok(chosen)
    }
}
