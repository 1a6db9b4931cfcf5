//! Planes of a tile: a part of the frame with what surrounds it, small enough for the nearer caches.

use crate::flow::coarse_to_fine::planes::LEFT;
use crate::simd::{Lanes, SimdReal};
use std::ops::Range;

/// Size, pixels, of the part of a tile that it is solved for.
pub(super) const TILE_ROWS: usize = 64;
pub(super) const TILE_COLUMNS: usize = 112;
/// Width of the strip around it, pixels: beyond it the increment is taken as zero.
const HALO: usize = 8;
/// Width of the strip around that, over which derivatives reach.
pub(super) const RIM: usize = 4;

/// Planes of a tile.
pub(super) const FLOW: usize = 0;
/// Differences of the flow to the right and lower neighbours beyond those that the Jacobian implies.
pub(super) const RIGHT: usize = 2;
pub(super) const LOWER: usize = 4;
/// Mean and rate of the views and their derivatives.
pub(super) const RATE: usize = 6;
pub(super) const RATE_X: usize = 7;
pub(super) const RATE_Y: usize = 8;
pub(super) const X: usize = 9;
pub(super) const Y: usize = 10;
pub(super) const XX: usize = 11;
pub(super) const XY: usize = 12;
pub(super) const YY: usize = 13;
/// 1 where the views are usable.
pub(super) const SEEN: usize = 14;
/// The increment, and the same before or after half a sweep.
pub(super) const D: usize = 15;
pub(super) const OTHER: usize = 17;
/// The inverse matrices, the right sides and the weights of the neighbours.
pub(super) const INVERSE: usize = 19;
pub(super) const SIDE: usize = 22;
pub(super) const WEIGHT: usize = 24;
pub(super) const WEIGHT_RIGHT: usize = 25;
pub(super) const WEIGHT_LOWER: usize = 26;
const COUNT: usize = 27;

/// Samples of the largest tile, and of a vector after its last.
pub(super) const SAMPLES: usize =
    (TILE_COLUMNS + 2 * HALO + 2 * RIM + 3 * LEFT) * COUNT * (TILE_ROWS + 2 * HALO + 2 * RIM) + LEFT;

/// Planes over a tile, its halo and its rim.
#[derive(Debug)]
pub(super) struct Tile<T> {
    pub layout: Layout,
    pub columns: Columns<T>,
    pub data: Vec<T>,
}

/// Where the samples of a tile are: row after row, all planes of a row together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub frame: (usize, usize),
    /// The frame's pixel at the first sample of the halo.
    pub origin: (usize, usize),
    /// Size with halo, without rim.
    pub size: (usize, usize),
    /// Samples from a plane to the next.
    pub stride: usize,
}

impl Layout {
    /// Of the given columns and rows of a frame.
    fn new(frame: (usize, usize), columns: &Range<usize>, rows: &Range<usize>) -> Self {
        let reach = |range: &Range<usize>, end: usize| (range.start.saturating_sub(HALO), (range.end + HALO).min(end));
        let ((left, right), (top, bottom)) = (reach(columns, frame.0), reach(rows, frame.1));
        let stride = (right - left + RIM).next_multiple_of(LEFT) + 2 * LEFT;
        Self { frame, origin: (left, top), size: (right - left, bottom - top), stride }
    }

    /// Start of row `y` of plane `k`, counted from the rim's first row, at the first column without rim.
    #[inline(always)]
    pub fn at(&self, k: usize, y: usize) -> usize {
        (y * COUNT + k) * self.stride + LEFT
    }

    /// Samples from a row to the next.
    #[inline(always)]
    pub fn down(&self) -> usize {
        COUNT * self.stride
    }

    /// Rows with halo, without rim.
    pub fn inner(&self) -> Range<usize> {
        RIM..RIM + self.size.1
    }

    /// Whether row `y` and the next both lie in the frame.
    pub fn has_lower(&self, y: usize) -> bool {
        let row = self.origin.1 + y;
        row >= RIM && row + 1 < RIM + self.frame.1
    }

    /// The frame's row at row `y` of the tile; beyond the frame its outermost.
    pub fn row(&self, y: usize) -> usize {
        (self.origin.1 + y).saturating_sub(RIM).min(self.frame.1 - 1)
    }
}

/// What is the same in all rows of a tile.
#[derive(Debug)]
pub(super) struct Columns<T> {
    /// Column of the frame, from the rim's first; beyond the frame its outermost.
    pub number: Vec<T>,
    /// 1 on columns of the tile and its halo of even or odd number, from the halo's first.
    pub even: Vec<T>,
    pub odd: Vec<T>,
    /// 1 on columns with a right neighbour in the frame, from the one before the halo.
    pub has_right: Vec<T>,
}

impl<T: SimdReal> Columns<T> {
    fn new(layout: Layout) -> Self {
        let (first, width, last) = (layout.origin.0 as f64, layout.size.0, layout.frame.0 as f64 - 1.0);
        let each = |value: &dyn Fn(usize) -> f64| (0..layout.stride).map(|at| T::from_f64(value(at))).collect();
        let truth = |holds: bool| f64::from(u8::from(holds));
        Self {
            number: each(&|at| (first + at as f64 - RIM as f64).clamp(0.0, last)),
            even: each(&|at| truth(at < width && at % 2 == 0)),
            odd: each(&|at| truth(at < width && at % 2 == 1)),
            has_right: each(&|at| truth(first + at as f64 >= 1.0 && first + (at as f64) < last + 1.0)),
        }
    }
}

impl<T: SimdReal> Tile<T> {
    /// The given columns and rows of a frame, with an increment of zero, in memory for [`SAMPLES`].
    pub fn new(frame: (usize, usize), columns: &Range<usize>, rows: &Range<usize>, data: Vec<T>) -> Self {
        let layout = Layout::new(frame, columns, rows);
        let mut tile = Self { layout, columns: Columns::new(layout), data };
        let zero = T::from_f64(0.0);
        for y in 0..layout.size.1 + 2 * RIM {
            let at = layout.at(D, y) - LEFT;
            tile.data[at..at + 4 * layout.stride].fill(zero);
        }
        tile
    }

    #[inline(always)]
    pub fn load<V: Lanes<Scalar = T>>(&self, at: usize) -> V {
        V::load(&self.data[at..])
    }

    #[inline(always)]
    pub fn store<V: Lanes<Scalar = T>>(&mut self, at: usize, value: V) {
        value.store(&mut self.data[at..]);
    }
}
