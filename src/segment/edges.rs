//! The edges of the 8-connected pixel grid, in the order in which equal weights are merged.

use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// An edge: its weight as an integer key of the same order, and the number of its end and direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Edge<K> {
    /// Order-preserving bits of the weight.
    pub key: K,
    /// `4 pixel + direction`, the pixel being the one at the left or above.
    pub code: u32,
}

/// A floating-point weight, at least 0, with its order-preserving integer key.
pub trait EdgeWeight: SimdReal {
    /// The key: the bits of the number, which are ordered like non-negative numbers.
    type Key: EdgeKey;
    /// The key of a weight; that of infinity for NaN.
    fn key(self) -> Self::Key;
    /// The weight of a key.
    fn of_key(key: Self::Key) -> Self;
    /// The option `scale` in this precision.
    fn from_scale(scale: f64) -> Self {
        Self::from_f64(scale)
    }
}

/// An unsigned integer that is sorted digit by digit.
pub trait EdgeKey: Copy + Ord + Default + Send + Sync {
    /// Number of bits.
    const BITS: u32;
    /// The bits from `shift` on, `mask` of them.
    fn digit(self, shift: u32, mask: usize) -> usize;
}

macro_rules! weights {
    ($($float:ty, $key:ty;)*) => {$(
        impl EdgeWeight for $float {
            type Key = $key;
            #[inline(always)]
            fn key(self) -> $key {
                // Comparison and select, so that the loop over a row is vectorised.
                if self < <$float>::INFINITY { self.to_bits() } else { <$float>::INFINITY.to_bits() }
            }
            #[inline(always)]
            fn of_key(key: $key) -> Self {
                Self::from_bits(key)
            }
        }
        impl EdgeKey for $key {
            const BITS: u32 = <$key>::BITS;
            #[inline(always)]
            fn digit(self, shift: u32, mask: usize) -> usize {
                (self >> shift) as usize & mask
            }
        }
    )*};
}
weights!(f32, u32; f64, u64;);

/// One of the four directions of edges.
#[derive(Debug, Clone, Copy)]
struct Direction {
    /// Offset of the edge's first pixel from the upper left one of the rectangle that both span.
    first: (usize, usize),
    /// Offset of its second pixel.
    second: (usize, usize),
}

/// Right, lower, lower right and upper right neighbour, `(dx, dy)`.
const DIRECTIONS: [Direction; 4] = [
    Direction { first: (0, 0), second: (1, 0) },
    Direction { first: (0, 0), second: (0, 1) },
    Direction { first: (0, 0), second: (1, 1) },
    Direction { first: (0, 1), second: (1, 0) },
];

/// What must be added to an edge's pixel to reach its second one, by direction.
pub(super) fn second_offsets(width: usize) -> [u32; 4] {
    let width = width as u32;
    // Upper right: modulo 2^32.
    [1, width, width + 1, 1u32.wrapping_sub(width)]
}

/// All edges between neighbouring pixels, weighted by the Euclidean distance of their values in `planes`.
pub(super) fn grid_edges<T: EdgeWeight>(planes: &[Frame<T>], width: usize, height: usize) -> Vec<Edge<T::Key>> {
    let extent = |d: &Direction| (width - d.second.0, height - d.first.1.max(d.second.1));
    let count = DIRECTIONS.iter().map(|d| extent(d).0 * extent(d).1).sum();
    let mut edges = vec![Edge::default(); count];
    let mut rest = edges.as_mut_slice();
    let level = Level::detect();
    for (number, direction) in DIRECTIONS.iter().enumerate() {
        let (columns, rows) = extent(direction);
        let (own, others) = rest.split_at_mut(columns * rows);
        rest = others;
        for_each_band(own, columns, |_, rows, edges| {
            let number = number as u32;
            dispatch(level, BandEdges { planes, direction, number, first_row: rows.start, columns, edges });
        });
    }
    edges
}

/// The edges of one direction in a band of rows.
struct BandEdges<'a, T: EdgeWeight> {
    planes: &'a [Frame<T>],
    direction: &'a Direction,
    number: u32,
    first_row: usize,
    columns: usize,
    edges: &'a mut [Edge<T::Key>],
}

impl<T: EdgeWeight> Kernel<T> for BandEdges<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { planes, direction, number, first_row, columns, edges } = self;
        let width = planes[0].width();
        let mut weights = vec![T::from_f64(0.0); columns];
        for (row, edges) in edges.chunks_exact_mut(columns).enumerate() {
            let y = first_row + row;
            let start = |(dx, dy): (usize, usize)| (y + dy) * width + dx;
            let (first, second) = (start(direction.first), start(direction.second));
            // A row narrower than one vector is left to single lanes.
            if columns < V::LANES {
                row_weights::<T>(planes, first, second, &mut weights);
            } else {
                row_weights::<V>(planes, first, second, &mut weights);
            }
            for (x, (edge, weight)) in edges.iter_mut().zip(&weights).enumerate() {
                *edge = Edge { key: weight.key(), code: (((first + x) as u32) << 2) | number };
            }
        }
    }
}

/// `weights[x] = sqrt(sum_c (planes[c][first + x] - planes[c][second + x])^2)`, at least one vector of them.
#[inline(always)]
fn row_weights<V: Lanes>(planes: &[Frame<V::Scalar>], first: usize, second: usize, weights: &mut [V::Scalar]) {
    let last = weights.len() - V::LANES;
    let mut x = 0;
    loop {
        let mut sum = V::zero();
        for plane in planes {
            let difference = V::load(&plane.data()[first + x..]) - V::load(&plane.data()[second + x..]);
            sum = difference.mul_add(difference, sum);
        }
        sum.sqrt().store(&mut weights[x..]);
        if x == last {
            return;
        }
        // The last vector overlaps the one before, so that every weight is rounded in the same way.
        x = (x + V::LANES).min(last);
    }
}
