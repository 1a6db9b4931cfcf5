//! The order of the visits.
//!
//! A sweep visits all even rows, then all odd ones; the next begins with the odd rows, and so on in turn.
//! Rows of one parity do not see each other, so what counts is the order of a row and the two beside it, and
//! the visits may be arranged such that little memory is walked through:
//!
//! * The second half of a sweep and the first of the next visit the same rows: each is visited twice while
//!   its data are near. This leaves one *pass* more than there are sweeps; pass `p` visits rows of the parity
//!   of `p`, twice but in the first and last pass.
//! * Pass `p` comes to row `y` right after pass `p - 1` has left row `y + 1`: a wave as many rows deep as
//!   there are passes runs down the frame, and a row's data come from far memory once for all sweeps.
//! * Threads take bands of rows; from the band's edges inwards each pass ends one row earlier, since it lacks
//!   what the other band does. The wedges between the bands that are left out are done afterwards, growing by
//!   one row a pass.
//!
//! Whatever the number of bands, each visit finds what it would find in the plain order: the results are the
//! same to the last bit.

use super::Planes;
use super::relaxation::{PackedRow, relax_row};
use super::smoothness::{NeighbourRows, SmoothnessProblem, WEIGHTS, update_weights};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use rayon::prelude::*;
use std::ops::Range;

/// What the visits to the rows need that a wave is at work on, and which rows these are.
#[derive(Debug, Default)]
pub(super) struct Ring<T> {
    packed: Vec<PackedRow<T>>,
    rows: Vec<Option<usize>>,
}

/// The rows of pass `p`: from `first + p * slope.0` to before `last + p * slope.1`.
#[derive(Clone, Copy)]
struct Span {
    first: usize,
    last: usize,
    slope: (isize, isize),
}

impl Span {
    fn contains(&self, row: usize, pass: usize) -> bool {
        let moved = |row: usize, slope: isize| row as isize + slope * pass as isize;
        moved(self.first, self.slope.0) <= row as isize && (row as isize) < moved(self.last, self.slope.1)
    }
}

/// All sweeps over `motion`, whose samples beside the sites are zero.
pub(super) fn sweep<T: SimdReal>(
    level: Level,
    problem: &SmoothnessProblem<'_, T>,
    motion: &mut Planes<T>,
    weights: &mut Planes<T>,
    rings: &mut Vec<Ring<T>>,
) {
    weights.reshape(motion.width, motion.height, WEIGHTS);
    let (height, stride, len) = (motion.height, motion.stride(), motion.row_len());
    let passes = problem.smoothness.sweeps + 1;
    // A wedge reaches `passes` rows into the bands at both sides, and sees one more.
    let deep = passes + 1;
    let count = rayon::current_num_threads().min(height / (2 * deep)).max(1);
    let starts: Vec<usize> = (0..=count).map(|i| i * height / count).collect();
    rings.resize_with(rings.len().max(count), Ring::default);
    let run_span = |((rows, weights), span, origin): ((&mut [T], &mut [T]), Span, usize), ring: &mut Ring<T>| {
        dispatch(level, Wavefront { problem, rows, weights, origin, span, stride, ring });
    };

    let bands: Vec<Range<usize>> = starts.windows(2).map(|w| w[0]..w[1]).collect();
    let spans = bands.iter().map(|band| {
        let (top, bottom) = (usize::from(band.start > 0), usize::from(band.end < height));
        Span { first: band.start + top, last: band.end - bottom, slope: (top as isize, -(bottom as isize)) }
    });
    let parts = cut(motion.data_mut(), len, &bands).into_iter().zip(cut(weights.data_mut(), WEIGHTS * stride, &bands));
    let work: Vec<_> = parts.zip(spans).zip(&bands).map(|((part, s), b)| (part, s, b.start)).collect();
    work.into_par_iter().zip(rings.par_iter_mut()).with_max_len(1).for_each(|(part, ring)| run_span(part, ring));

    let wedges: Vec<Range<usize>> = starts[1..count].iter().map(|&s| s - deep..s + deep).collect();
    let spans = starts[1..count].iter().map(|&s| Span { first: s - 1, last: s + 1, slope: (-1, 1) });
    let parts =
        cut(motion.data_mut(), len, &wedges).into_iter().zip(cut(weights.data_mut(), WEIGHTS * stride, &wedges));
    let work: Vec<_> = parts.zip(spans).zip(&wedges).map(|((part, s), w)| (part, s, w.start)).collect();
    work.into_par_iter().zip(rings.par_iter_mut()).with_max_len(1).for_each(|(part, ring)| run_span(part, ring));
}

/// The rows in each of some ranges that ascend and do not overlap.
fn cut<'a, T>(mut data: &'a mut [T], row_len: usize, ranges: &[Range<usize>]) -> Vec<&'a mut [T]> {
    let mut parts = Vec::with_capacity(ranges.len());
    let mut done = 0;
    for range in ranges {
        let (part, rest) = data.split_at_mut((range.end - done) * row_len);
        parts.push(&mut part[(range.start - done) * row_len..]);
        (data, done) = (rest, range.end);
    }
    parts
}

/// The visits of all passes to the rows of a span.
struct Wavefront<'a, T> {
    problem: &'a SmoothnessProblem<'a, T>,
    /// The rows from `origin` on, one row more than the span at each side where there is one.
    rows: &'a mut [T],
    /// The bonds' weights there: a wedge goes on with those that the bands beside it left.
    weights: &'a mut [T],
    origin: usize,
    span: Span,
    stride: usize,
    ring: &'a mut Ring<T>,
}

impl<T: SimdReal> Kernel<T> for Wavefront<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { problem, rows, weights, origin, span, stride, ring } = self;
        let passes = problem.smoothness.sweeps + 1;
        let row_len = 6 * stride;
        let end = origin + rows.len() / row_len;
        ring.packed.resize_with(ring.packed.len().max(passes), PackedRow::default);
        ring.rows.clear();
        ring.rows.resize(passes, None);
        // Row and pass are of one parity, so their sum, the front, is even.
        for front in (origin + origin % 2..end + passes).step_by(2) {
            for pass in 0..passes.min(front + 1) {
                let y = front - pass;
                if !span.contains(y, pass) {
                    continue;
                }
                // A row is visited during `passes` fronts, and the row that takes its place in the ring comes
                // after.
                let place = y % passes;
                let packed = &mut ring.packed[place];
                let mut is_new = ring.rows[place] != Some(y);
                if is_new {
                    packed.fill::<V>(problem, y);
                    ring.rows[place] = Some(y);
                }
                let weights = &mut weights[(y - origin) * WEIGHTS * stride..][..WEIGHTS * stride];
                let (above, rest) = rows.split_at_mut((y - origin) * row_len);
                let (own, below) = rest.split_at_mut(row_len);
                let neighbours = NeighbourRows {
                    above: above.len().checked_sub(row_len).map(|start| &above[start..]),
                    below: below.get(..row_len),
                    stride,
                };
                let visits = if pass == 0 || pass == passes - 1 { 1 } else { 2 };
                for number in (pass.max(1) - 1..).take(visits) {
                    let is_reweighted = number.is_multiple_of(problem.smoothness.reweight_every);
                    if is_reweighted {
                        update_weights::<V, T>(problem, own, neighbours, weights);
                    }
                    if is_reweighted || is_new {
                        packed.factorise::<V>(problem, weights);
                        is_new = false;
                    }
                    relax_row::<V, T>(problem, (packed, weights), own, neighbours);
                }
            }
        }
    }
}
