//! Sites of a field as independent bands, and a fast test for masked pixels.

use crate::jet::Reach;
use crate::parallel::BAND_ROWS;
use crate::types::{FlowField, Mask, SamplingGrid, Status};
use std::ops::Range;

/// Points of one task, where the sites are a list. Fixed, like [`BAND_ROWS`].
const BAND_POINTS: usize = 256;

/// A run of consecutive sites with their share of every plane of the field.
pub(super) struct FieldBand<'a, T> {
    /// The sites, as indices into the field's planes.
    pub sites: Range<usize>,
    /// One slice a parameter.
    pub motion: Vec<&'a mut [T]>,
    /// One slice a pair of parameters, or none.
    pub covariance: Vec<&'a mut [T]>,
    pub systematic: Vec<&'a mut [T]>,
    pub status: &'a mut [Status],
    pub residual: Option<&'a mut [T]>,
    pub rank: Option<&'a mut [u8]>,
    pub condition: Option<&'a mut [T]>,
    /// Window of the slopes.
    pub window: Option<&'a mut [T]>,
}

/// Cuts a field into bands of [`BAND_ROWS`] rows ([`BAND_POINTS`] points) for any number of threads.
pub(super) fn bands<T>(field: &mut FlowField<T>) -> Vec<FieldBand<'_, T>> {
    let n = field.width * field.height;
    if n == 0 {
        return Vec::new();
    }
    let size = match field.layout.sites {
        SamplingGrid::Points(_) => BAND_POINTS,
        SamplingGrid::Grid { .. } => BAND_ROWS * field.width,
    };
    let mut motion: Vec<_> = field.motion.chunks_mut(n).map(|p| p.chunks_mut(size)).collect();
    let mut covariance: Vec<_> =
        field.covariance.iter_mut().flat_map(|c| c.chunks_mut(n)).map(|p| p.chunks_mut(size)).collect();
    let mut systematic: Vec<_> =
        field.systematic.iter_mut().flat_map(|c| c.chunks_mut(n)).map(|p| p.chunks_mut(size)).collect();
    let mut status = field.status.chunks_mut(size);
    let mut residual = field.residual.as_mut().map(|r| r.chunks_mut(size));
    let mut rank = field.rank.as_mut().map(|r| r.chunks_mut(size));
    let mut condition = field.condition.as_mut().map(|r| r.chunks_mut(size));
    let mut window = field.window.as_mut().map(|r| r.chunks_mut(size));
    (0..n.div_ceil(size))
        .map(|b| FieldBand {
            sites: b * size..((b + 1) * size).min(n),
            motion: motion.iter_mut().map(|c| c.next().unwrap_or_default()).collect(),
            covariance: covariance.iter_mut().map(|c| c.next().unwrap_or_default()).collect(),
            systematic: systematic.iter_mut().map(|c| c.next().unwrap_or_default()).collect(),
            status: status.next().unwrap_or_default(),
            residual: residual.as_mut().and_then(Iterator::next),
            rank: rank.as_mut().and_then(Iterator::next),
            condition: condition.as_mut().and_then(Iterator::next),
            window: window.as_mut().and_then(Iterator::next),
        })
        .collect()
}

/// Tests in constant time whether a rectangle of pixels contains a masked one.
pub(super) struct MaskCounts {
    width: usize,
    /// Masked pixels above and to the left of each corner; `width + 1` values a row.
    sums: Vec<u32>,
}

impl MaskCounts {
    pub fn new(mask: &Mask) -> Self {
        let (width, height) = mask.size();
        let stride = width + 1;
        let mut sums = vec![0u32; stride * (height + 1)];
        for y in 0..height {
            let mut row = 0;
            for x in 0..width {
                row += u32::from(!mask.get(x, y));
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
            }
        }
        Self { width, sums }
    }

    /// Whether any pixel of the frame within `reach` of `(x, y)` is masked.
    pub fn touches(&self, (x, y): (usize, usize), reach: Reach) -> bool {
        let at = |x: usize, y: usize| self.sums[y * (self.width + 1) + x];
        let height = self.sums.len() / (self.width + 1) - 1;
        let (x0, x1) = (x.saturating_sub(reach.left), (x + reach.right + 1).min(self.width));
        let (y0, y1) = (y.saturating_sub(reach.up), (y + reach.down + 1).min(height));
        at(x1, y1) + at(x0, y0) != at(x0, y1) + at(x1, y0)
    }
}
