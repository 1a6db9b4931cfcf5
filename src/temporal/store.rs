//! The states of all sites, in blocks.

use super::kernel::factor::square;
use super::kernel::{BLOCK, Constants, N, PACKED, PLANES, SCALE, order, packed, places};
use super::options::FlowFilterOptions;
use crate::error::Result;
use crate::jet::Reach;
use crate::parallel::checkpoint;
use crate::simd::SimdReal;
use crate::types::Status;

/// Sites that have a filter, and their states: per block of [`BLOCK`] sites, `PLANES` rows of `BLOCK`
/// numbers. Border and masked sites have none.
#[derive(Debug, Clone)]
pub(super) struct Store<T> {
    /// Pixel index in the frame of each filter; padded to whole blocks with the last one.
    pub pixels: Vec<usize>,
    /// Result index of each filter; not padded.
    pub sites: Vec<usize>,
    /// Status of every result site before any frame: `Ok`, `Border` or `Masked`.
    pub fixed: Vec<Status>,
    /// The states.
    pub blocks: Vec<T>,
    /// Whether the root takes the motion first.
    pub motion_first: bool,
}

impl<T: SimdReal> Store<T> {
    pub(super) fn new(
        frame_size: (usize, usize),
        options: &FlowFilterOptions,
        offsets: &[(i32, i32)],
        reach: Reach,
        constants: &Constants<T>,
    ) -> Result<Self> {
        let (width, height) = options.sites.shape(frame_size)?;
        let (mut pixels, mut sites) = (Vec::new(), Vec::new());
        let mut fixed = Vec::with_capacity(width * height);
        for row in 0..height {
            checkpoint();
            for col in 0..width {
                let (x, y) = options.sites.pixel(col, row);
                let masked = |(ex, ey): &(i32, i32)| {
                    options.mask.as_ref().is_some_and(|mask| {
                        !mask.get(x.wrapping_add_signed(*ex as isize), y.wrapping_add_signed(*ey as isize))
                    })
                };
                let status = if !reach.fits((x, y), frame_size) {
                    Status::Border
                } else if masked(&(0, 0)) || offsets.iter().any(masked) {
                    Status::Masked
                } else {
                    pixels.push(y * frame_size.0 + x);
                    sites.push(fixed.len());
                    Status::Ok
                };
                fixed.push(status);
            }
        }
        if let Some(&last) = pixels.last() {
            pixels.resize(pixels.len().next_multiple_of(BLOCK), last);
        }
        let mut blocks = vec![T::from_f64(0.0); pixels.len() / BLOCK * PLANES * BLOCK];
        for block in blocks.chunks_exact_mut(PLANES * BLOCK) {
            checkpoint();
            for k in 0..N {
                block[k * BLOCK..(k + 1) * BLOCK].fill(constants.start.0[k]);
                let deviation = constants.start.1[order(constants.motion_first)[k]].to_f64().sqrt();
                let plane = N + packed(k, k);
                block[plane * BLOCK..(plane + 1) * BLOCK].fill(T::from_f64(deviation));
            }
            block[SCALE * BLOCK..].fill(T::from_f64(1.0));
        }
        Ok(Self { pixels, sites, fixed, blocks, motion_first: constants.motion_first })
    }

    /// Planes `from .. from + count` of every filter, one row a filter.
    pub(super) fn gather(&self, from: usize, count: usize) -> Vec<T> {
        let mut out = Vec::with_capacity(self.sites.len() * count);
        for index in 0..self.sites.len() {
            let block = &self.blocks[index / BLOCK * PLANES * BLOCK..];
            out.extend((from..from + count).map(|plane| block[plane * BLOCK + index % BLOCK]));
        }
        out
    }

    /// The reverse of [`Store::gather`]; the padding of the last block repeats the last filter.
    pub(super) fn scatter(&mut self, from: usize, count: usize, values: &[T]) {
        let last = self.sites.len().saturating_sub(1);
        for index in 0..self.pixels.len() {
            let row = &values[index.min(last) * count..];
            let block = &mut self.blocks[index / BLOCK * PLANES * BLOCK..];
            for k in 0..count {
                block[(from + k) * BLOCK + index % BLOCK] = row[k];
            }
        }
    }

    /// Mean and full covariance of filter `index`.
    pub(super) fn state(&self, index: usize) -> ([f64; N], [[f64; N]; N]) {
        let block = &self.blocks[index / BLOCK * PLANES * BLOCK..][..PLANES * BLOCK];
        let value = |plane: usize| block[plane * BLOCK + index % BLOCK].to_f64();
        let root: [f64; PACKED] = std::array::from_fn(|k| value(N + k));
        let cov = square(&root, places(self.motion_first));
        (std::array::from_fn(value), std::array::from_fn(|a| std::array::from_fn(|b| cov[packed(a, b)])))
    }
}
