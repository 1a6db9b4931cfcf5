//! Matching cost of two pixels.
//!
//! `C(p, d)` is the mean over 5 x 5 px of `min(|g_x - g_x'| + |g_y - g_y'|, 6)`, gradients with a Gaussian of
//! 1 px. Gradients are quantised to sixteenths of a grey level/px, far below their noise: 16 candidates are
//! compared at a time, and sums are exact in any order.

use super::edges::EdgeMap;
use crate::parallel::{self, for_each_band};
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Candidates compared at a time.
pub(super) const CHUNK: usize = 16;
/// Pixels on each side of the middle of the window.
const RADIUS: usize = 2;
/// Side of the window, px.
const SIDE: usize = 2 * RADIUS + 1;
/// Steps of a gradient in one grey level/px.
const STEPS: f32 = 16.0;
/// Truncation of the difference of two gradients, grey levels/px.
const TRUNCATION: u16 = 6;
/// Cost of one grey level/px.
pub(super) const UNIT: u16 = STEPS as u16 * (SIDE * SIDE) as u16;
/// The highest cost: no pixel of the window is alike.
pub(super) const MAX_COST: u16 = TRUNCATION * UNIT;
/// Largest gradient, steps; larger ones are clamped.
const MAX_GRADIENT: f32 = 8000.0;
/// Code of unknown or outside gradients of each view, farther than the truncation from every gradient.
const UNKNOWN: [i16; 2] = [-16000, 16000];
/// Edge pixels of one task.
const TASK: usize = 256;

/// Which view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
}

/// Gradients of a view in steps, with a border wide enough for every candidate.
pub(super) struct Coded {
    stride: usize,
    border: usize,
    x: Vec<i16>,
    y: Vec<i16>,
}

impl Coded {
    /// Of both slopes of a view, with room for candidates up to `reach` px beside every pixel.
    pub(super) fn new(along_x: &Frame<f32>, along_y: &Frame<f32>, side: Side, reach: usize) -> Self {
        let border = reach + RADIUS + CHUNK;
        let stride = along_x.width() + 2 * border;
        let unknown = UNKNOWN[side as usize];
        let code = |slopes: &Frame<f32>| {
            let mut plane = vec![unknown; stride * (slopes.height() + 2 * RADIUS)];
            for_each_band(&mut plane, stride, |_, rows, band| {
                for (row, out) in rows.zip(band.chunks_exact_mut(stride)) {
                    let Some(y) = row.checked_sub(RADIUS).filter(|y| *y < slopes.height()) else { continue };
                    for (out, &slope) in out[border..].iter_mut().zip(slopes.row(y)) {
                        if slope.is_finite() {
                            *out = rounded((slope * STEPS).clamp(-MAX_GRADIENT, MAX_GRADIENT));
                        }
                    }
                }
            });
            plane
        };
        Self { stride, border, x: code(along_x), y: code(along_y) }
    }
}

/// Rounds a value within [`MAX_GRADIENT`] of 0 by truncation, which vectorises on every processor.
#[inline(always)]
fn rounded(value: f32) -> i16 {
    const SHIFT: f32 = 2.0 * MAX_GRADIENT;
    ((value + (SHIFT + 0.5)) as i32 - SHIFT as i32) as i16
}

/// Candidate `k` of an edge pixel in column `x` is column `x + first + k` of the other view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Candidates {
    /// Where the first lies, px from the pixel.
    pub first: i32,
    /// How many.
    pub count: usize,
}

impl Candidates {
    /// Their number up to whole chunks.
    pub(super) fn padded(self) -> usize {
        self.count.next_multiple_of(CHUNK)
    }

    /// How far from the pixel they lie at most, px.
    pub(super) fn reach(self) -> usize {
        (self.first.unsigned_abs() as usize).max((self.first + self.padded() as i32).unsigned_abs() as usize)
    }

    /// The candidates of a pixel in column `x` that lie in a view of `width` px; may be empty.
    pub(super) fn inside(self, x: u32, width: usize) -> std::ops::Range<usize> {
        let at = i64::from(x) + i64::from(self.first);
        let first = (-at).max(0);
        let end = (width as i64 - at).clamp(first, (self.count as i64).max(first));
        first as usize..end as usize
    }
}

/// Costs of all candidates of all edge pixels, `candidates.padded()` for each, in the order of the edges.
/// What `allowed` leaves out costs the most.
pub(super) fn costs(
    edges: &EdgeMap,
    own: &Coded,
    other: &Coded,
    candidates: Candidates,
    allowed: impl Fn(usize) -> std::ops::Range<usize> + Sync,
) -> Vec<u16> {
    let padded = candidates.padded();
    let mut costs = vec![MAX_COST; edges.len() * padded];
    parallel::for_each(costs.chunks_mut(TASK * padded).enumerate(), |(task, out)| {
        for (i, out) in out.chunks_exact_mut(padded).enumerate() {
            let edge = task * TASK + i;
            let allowed = allowed(edge);
            if allowed.is_empty() {
                continue;
            }
            let (x, y) = (edges.columns[edge] as usize, edges.rows[edge] as usize);
            let window = y * own.stride + own.border + x - RADIUS;
            let others = y * other.stride + other.border + x - RADIUS;
            let others = (others as isize + candidates.first as isize) as usize;
            let chunks = allowed.start / CHUNK..allowed.end.div_ceil(CHUNK);
            dispatch(Level::detect(), OnePixel { own, other, window, others, chunks, out });
            out[..allowed.start].fill(MAX_COST);
            out[allowed.end..].fill(MAX_COST);
        }
    });
    costs
}

/// The costs of one edge pixel.
struct OnePixel<'a> {
    own: &'a Coded,
    other: &'a Coded,
    /// The first pixel of the window, and of that of the first candidate.
    window: usize,
    others: usize,
    chunks: std::ops::Range<usize>,
    out: &'a mut [u16],
}

/// Small integers: the compiler vectorises the loops with the instructions of the level.
impl Kernel<f32> for OnePixel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        let Self { own, other, window, others, chunks, out } = self;
        for chunk in chunks {
            let mut sums = [0u16; CHUNK];
            for j in 0..SIDE {
                let (at, first) = (window + j * own.stride, others + j * other.stride + chunk * CHUNK);
                let mine: (&[i16; SIDE], &[i16; SIDE]) = (chunk_of(&own.x[at..]), chunk_of(&own.y[at..]));
                let theirs: (&[i16; 24], &[i16; 24]) = (chunk_of(&other.x[first..]), chunk_of(&other.y[first..]));
                for i in 0..SIDE {
                    for k in 0..CHUNK {
                        let difference = theirs.0[i + k].abs_diff(mine.0[i]) + theirs.1[i + k].abs_diff(mine.1[i]);
                        sums[k] += difference.min(TRUNCATION * STEPS as u16);
                    }
                }
            }
            out[chunk * CHUNK..(chunk + 1) * CHUNK].copy_from_slice(&sums);
        }
    }
}

/// The first `N` values.
#[inline(always)]
fn chunk_of<const N: usize>(values: &[i16]) -> &[i16; N] {
    values.first_chunk().expect("the border is as wide as the candidates reach")
}

#[cfg(test)]
mod tests {
    use super::super::edges::EdgeSettings;
    use super::*;
    use crate::math::random::CounterRng;

    fn slopes(seed: u64) -> Frame<f32> {
        let rng = CounterRng::new(seed);
        Frame::from_fn(40, 30, |x, y| (rng.normal((40 * y + x) as u64) * 4.0) as f32)
    }

    #[test]
    fn costs_are_those_of_the_definition() {
        let view = Frame::from_fn(40, 30, |x, y| if (x / 9 + y / 7) % 2 == 0 { 50.0f32 } else { 150.0 });
        let edges = EdgeMap::new(&view, &EdgeSettings { blur_sigma: 2.0, threshold: 2.0, classes: 12 });
        let (own, mut other) = ([slopes(1), slopes(2)], [slopes(3), slopes(4)]);
        other[0].data_mut()[15 * 40 + 20] = f32::NAN;
        let candidates = Candidates { first: -6, count: 19 };
        let coded = Coded::new(&own[0], &own[1], Side::Left, candidates.reach());
        let others = Coded::new(&other[0], &other[1], Side::Right, candidates.reach());
        let allowed = |edge: usize| candidates.inside(edges.columns[edge], 40);
        let got = costs(&edges, &coded, &others, candidates, allowed);
        assert!(edges.len() > 50);
        for edge in 0..edges.len() {
            let (x, y) = (i64::from(edges.columns[edge]), i64::from(edges.rows[edge]));
            for k in 0..candidates.padded() {
                let middle = x + i64::from(candidates.first) + k as i64;
                let mut sum = 0.0f32;
                for (j, i) in (-2..=2).flat_map(|j| (-2..=2).map(move |i| (j, i))) {
                    let at = |plane: &Frame<f32>, x: i64, y: i64| {
                        let inside = (0..40).contains(&x) && (0..30).contains(&y);
                        if inside { plane.get(x as usize, y as usize) } else { f32::NAN }
                    };
                    let difference: f32 =
                        (0..2).map(|c| (at(&own[c], x + i, y + j) - at(&other[c], middle + i, y + j)).abs()).sum();
                    sum += if difference < 6.0 { difference } else { 6.0 };
                }
                let mut want = sum / 25.0;
                if k >= candidates.count || !(0..40).contains(&middle) {
                    want = 6.0;
                }
                let cost = f32::from(got[edge * candidates.padded() + k]) / f32::from(UNIT);
                assert!((cost - want).abs() < 0.08, "{edge} {k}: {cost} {want}");
            }
        }
    }
}
