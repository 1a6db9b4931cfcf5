//! Order of the relaxation: sweeps as a wavefront through the rows.
//!
//! A sweep visits all even rows, then all odd ones; the next begins with the odd rows, and so on in turn.
//! Rows of one parity do not depend on each other, so only the order of a row and its two neighbours matters,
//! and the visits are arranged to read memory once:
//!
//! * The second half of a sweep and the first of the next visit the same rows: each is visited twice while
//!   its data are in the cache. This gives one *pass* more than there are sweeps; pass `p` visits rows of the
//!   parity of `p`, twice except in the first and last pass.
//! * Pass `p` reaches row `y` right after pass `p - 1` has left row `y + 1`: a wavefront as many rows deep as
//!   there are passes runs down the frame, and reads a row's data once for all sweeps.
//! * Threads take bands of rows. From the edges of a band inwards each pass ends one row earlier, since it
//!   lacks the results of the other band. The wedges left out between bands are done afterwards, growing by
//!   one row a pass.
//!
//! Each visit finds the values of the plain order whatever the number of bands: results are bit-identical.

use super::Planes;
use super::relaxation::{PackedRow, relax_row};
use super::smoothness::{NeighbourRows, SmoothnessProblem, WEIGHTS, update_weights};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

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
    // A wedge reaches `passes` rows into the bands on both sides, and reads one more.
    let deep = passes + 1;
    let count = parallel::thread_count().min(height / (2 * deep)).max(1);
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
    let work = parts.zip(spans).zip(&bands).map(|((part, s), b)| (part, s, b.start));
    parallel::for_each(work.zip(rings.iter_mut()), |(part, ring)| run_span(part, ring));

    let wedges: Vec<Range<usize>> = starts[1..count].iter().map(|&s| s - deep..s + deep).collect();
    let spans = starts[1..count].iter().map(|&s| Span { first: s - 1, last: s + 1, slope: (-1, 1) });
    let parts =
        cut(motion.data_mut(), len, &wedges).into_iter().zip(cut(weights.data_mut(), WEIGHTS * stride, &wedges));
    let work = parts.zip(spans).zip(&wedges).map(|((part, s), w)| (part, s, w.start));
    parallel::for_each(work.zip(rings.iter_mut()), |(part, ring)| run_span(part, ring));
}

/// The rows in each of some ascending ranges that do not overlap.
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
    /// The rows from `origin` on, with one more than the span on each side where there is one.
    rows: &'a mut [T],
    /// The smoothness weights there: a wedge continues with those that the bands beside it left.
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
                // A row is visited during `passes` fronts, before another row takes its slot in the ring.
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
