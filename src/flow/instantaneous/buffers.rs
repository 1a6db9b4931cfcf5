//! Working memory of a thread that walks rows.

use super::{dense::Source, dense::scratch_len, detail::BLOCK_LEN, detail::RATES};
use crate::simd::SimdReal;
use std::ops::Range;

/// What one thread needs to walk rows.
pub(super) struct RowBuffers<T> {
    /// Columns of the frame that are computed.
    pub columns: Range<usize>,
    pub stride: usize,
    pub scratch: Vec<T>,
    /// One value a site.
    pub trust: Vec<T>,
    /// Rows of motion that are thinned out afterwards, or of coefficients.
    pub spare: Vec<T>,
    pub block: Vec<T>,
}

impl<T: SimdReal> RowBuffers<T> {
    pub fn new(source: &Source<T>, width: usize, columns: Range<usize>, stride: usize, detailed: bool) -> Self {
        let n = columns.len();
        let rows = match (detailed, stride) {
            (true, _) => RATES,
            (false, 1) => 0,
            (false, _) => 6,
        };
        Self {
            columns,
            stride,
            scratch: vec![T::default(); scratch_len(source, width)],
            trust: vec![T::default(); n],
            spare: vec![T::default(); rows * n],
            block: vec![T::default(); if detailed { BLOCK_LEN } else { 0 }],
        }
    }

    /// Whether all of these sites are.
    pub fn trusted(&self, sites: Range<usize>) -> bool {
        // Without a way out in the middle, so that several are compared at once.
        self.trust[sites].iter().fold(true, |all, trust| all & (*trust > T::default()))
    }
}
