//! Planes of a tile: a part of the frame with what surrounds it, small enough for the nearer caches.

use crate::flow::coarse_to_fine::planes::LEFT;
use crate::simd::SimdReal;
use std::ops::Range;

/// Size, pixels, of the part of a tile that it is solved for.
pub(super) const TILE_ROWS: usize = 64;
pub(super) const TILE_COLUMNS: usize = 112;
/// Width of the strip around it, pixels: beyond it the increment is taken as zero.
const HALO: usize = 8;
/// Width of the strip around that, over which derivatives reach.
pub(super) const RIM: usize = 4;

/// Samples of a line, the same in every tile, so that the compiler knows where the next begins.
const STRIDE: usize = (TILE_COLUMNS + 2 * HALO).next_multiple_of(LEFT) + 3 * LEFT;
/// A row of a plane: the first column without rim is at [`LEFT`].
pub(super) type Line<T> = [T; STRIDE];
/// Row after row, the lines of `COUNT` planes.
pub(super) type Rows<T, const COUNT: usize> = [[Line<T>; COUNT]];

/// Planes of [`Tile::fields`].
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
const FIELDS: usize = 15;

/// Planes of [`Tile::system`]: the inverse matrices and the right sides.
pub(super) const INVERSE: usize = 0;
pub(super) const SIDE: usize = 3;
pub(super) const SYSTEM: usize = 5;

/// Planes of [`Tile::weights`]: those of the right and the lower neighbours.
pub(super) const WEIGHT_RIGHT: usize = 0;
pub(super) const WEIGHT_LOWER: usize = 1;

const ROWS: usize = TILE_ROWS + 2 * HALO + 2 * RIM;
/// Samples of a tile.
pub(super) const SAMPLES: usize = ROWS * STRIDE * (FIELDS + SYSTEM + 2 + 2 * 2);

/// Planes over a tile, its halo and its rim.
pub(super) struct Tile<'a, T> {
    pub layout: Layout,
    pub columns: Columns<T>,
    pub fields: &'a mut Rows<T, FIELDS>,
    pub system: &'a mut Rows<T, SYSTEM>,
    pub weights: &'a mut Rows<T, 2>,
    /// The increment, and the same before or after half a sweep.
    pub increment: [&'a mut Rows<T, 2>; 2],
}

/// Where a tile lies. Rows are counted from the rim's first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub frame: (usize, usize),
    /// The frame's pixel at the first sample of the halo.
    pub origin: (usize, usize),
    /// Size with halo, without rim.
    pub size: (usize, usize),
}

impl Layout {
    /// Of the given columns and rows of a frame.
    fn new(frame: (usize, usize), columns: &Range<usize>, rows: &Range<usize>) -> Self {
        let reach = |range: &Range<usize>, end: usize| (range.start.saturating_sub(HALO), (range.end + HALO).min(end));
        let ((left, right), (top, bottom)) = (reach(columns, frame.0), reach(rows, frame.1));
        Self { frame, origin: (left, top), size: (right - left, bottom - top) }
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
pub(super) struct Columns<T> {
    /// Column of the frame; beyond the frame its outermost.
    pub number: Line<T>,
    /// 1 on columns of the tile and its halo of even or odd number.
    pub even: Line<T>,
    pub odd: Line<T>,
    /// 1 on columns with a right neighbour in the frame.
    pub has_right: Line<T>,
}

impl<T: SimdReal> Columns<T> {
    fn new(layout: Layout) -> Self {
        let (first, last) = (layout.origin.0 as f64 - LEFT as f64, layout.frame.0 as f64 - 1.0);
        let inside = LEFT..LEFT + layout.size.0;
        let truth = |holds: bool| T::from_f64(f64::from(u8::from(holds)));
        Self {
            number: std::array::from_fn(|at| T::from_f64((first + at as f64).clamp(0.0, last))),
            even: std::array::from_fn(|at| truth(inside.contains(&at) && at % 2 == 0)),
            odd: std::array::from_fn(|at| truth(inside.contains(&at) && at % 2 == 1)),
            has_right: std::array::from_fn(|at| truth(first + at as f64 >= 0.0 && first + (at as f64) < last)),
        }
    }
}

impl<'a, T: SimdReal> Tile<'a, T> {
    /// The given columns and rows of a frame, with an increment of zero, in memory for [`SAMPLES`].
    pub fn new(frame: (usize, usize), columns: &Range<usize>, rows: &Range<usize>, memory: &'a mut [T]) -> Self {
        let layout = Layout::new(frame, columns, rows);
        let (lines, _) = memory.as_chunks_mut::<STRIDE>();
        let (fields, lines) = lines.split_at_mut(ROWS * FIELDS);
        let (system, lines) = lines.split_at_mut(ROWS * SYSTEM);
        let (weights, lines) = lines.split_at_mut(ROWS * 2);
        let (increment, lines) = lines.split_at_mut(ROWS * 2);
        let other = &mut lines[..ROWS * 2];
        for line in increment.iter_mut().chain(other.iter_mut()) {
            line.fill(T::from_f64(0.0));
        }
        Self {
            layout,
            columns: Columns::new(layout),
            fields: fields.as_chunks_mut().0,
            system: system.as_chunks_mut().0,
            weights: weights.as_chunks_mut().0,
            increment: [increment.as_chunks_mut().0, other.as_chunks_mut().0],
        }
    }
}
