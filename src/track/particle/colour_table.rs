//! Colour similarity of many boxes at once: one summed-area table for every bin that the reference uses.

use super::appearance::{Appearance, BandGrid, visibility_factor};
use super::bins::NO_BIN;
use super::geometry::CentredBox;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Slots are filled up to a multiple of this, so that loops over them are whole vectors.
const LANES: usize = 16;

/// Summed-area tables over a rectangle, all slots of a pixel side by side. The last slot counts pixels with a
/// bin.
pub(super) struct ColourTable<'a> {
    appearance: &'a Appearance,
    /// Reference and weight, padded to `stride` slots a window.
    reference: Vec<f32>,
    weights: Vec<f32>,
    /// Values a pixel.
    stride: usize,
    /// First column and row of the rectangle.
    origin: [i64; 2],
    /// Columns and rows of the rectangle.
    size: [i64; 2],
    /// (rows + 1) x (columns + 1) x stride.
    sums: Vec<i32>,
    picture: (usize, usize),
}

impl<'a> ColourTable<'a> {
    /// Tables over the columns `x` and rows `y` of a picture, cut to it.
    pub fn new(appearance: &'a Appearance, bins: &Frame<u8>, x: [f64; 2], y: [f64; 2]) -> Self {
        let (width, height) = bins.size();
        let cut = |[low, high]: [f64; 2], size: usize| {
            let low = low.floor().clamp(0.0, size as f64) as i64;
            [low, (high.ceil().clamp(0.0, size as f64) as i64).max(low)]
        };
        let ([left, right], [top, bottom]) = (cut(x, width), cut(y, height));
        let used = appearance.used;
        let stride = (used + 1).next_multiple_of(LANES);
        let pad = |values: &[f32]| {
            let mut padded = vec![0.0; appearance.windows() * stride];
            for (to, from) in padded.chunks_exact_mut(stride).zip(values.chunks_exact(used.max(1))) {
                to[..from.len()].copy_from_slice(from);
            }
            padded
        };
        let mut table = Self {
            reference: pad(&appearance.reference),
            weights: pad(&appearance.weights),
            appearance,
            stride,
            origin: [left, top],
            size: [right - left, bottom - top],
            sums: Vec::new(),
            picture: bins.size(),
        };
        table.fill(bins);
        table
    }

    fn fill(&mut self, bins: &Frame<u8>) {
        let (stride, used) = (self.stride, self.appearance.used);
        let (columns, rows) = (self.size[0] as usize, self.size[1] as usize);
        let row_len = (columns + 1) * stride;
        self.sums = vec![0; (rows + 1) * row_len];
        let mut running = vec![0i32; stride];
        for y in 0..rows {
            running.fill(0);
            let (above, here) = self.sums.split_at_mut((y + 1) * row_len);
            let above = &above[y * row_len..];
            let first = self.origin[0] as usize;
            let pixels = &bins.row(self.origin[1] as usize + y)[first..first + columns];
            for (x, &bin) in pixels.iter().enumerate() {
                if bin != NO_BIN {
                    running[used] += 1;
                    let slot = self.appearance.slots[usize::from(bin)];
                    if slot != NO_BIN {
                        running[usize::from(slot)] += 1;
                    }
                }
                let at = (x + 1) * stride..(x + 2) * stride;
                for ((out, &run), &up) in here[at.clone()].iter_mut().zip(&running).zip(&above[at]) {
                    *out = run + up;
                }
            }
        }
    }

    /// Similarity of each box to the reference, 0 to 1 (equation (4) of the paper): the mean over the windows
    /// of `sum_b weight_b min(H_b, R_b)`.
    pub fn similarities(&self, boxes: &[CentredBox], out: &mut [f64]) {
        dispatch(Level::detect(), Similarities { table: self, boxes, out });
    }
}

/// The loop over the boxes, compiled for each instruction set.
struct Similarities<'a> {
    table: &'a ColourTable<'a>,
    boxes: &'a [CentredBox],
    out: &'a mut [f64],
}

impl Kernel<f32> for Similarities<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        let Self { table, boxes, out } = self;
        let stride = table.stride;
        let mut edges = vec![0i32; (table.appearance.bands + 1) * stride];
        for (&bounds, out) in boxes.iter().zip(out) {
            let grid = BandGrid::new(bounds, table.appearance.bands);
            let at = |value: i64, axis: usize| (value - table.origin[axis]).clamp(0, table.size[axis]) as usize;
            let [left, right] = grid.columns.map(|x| at(x, 0) * stride);
            let row_len = (table.size[0] as usize + 1) * stride;
            // Counts between the two columns, above each edge.
            for (edge, counts) in grid.edges.iter().zip(edges.chunks_exact_mut(stride)) {
                let row = &table.sums[at(*edge, 1) * row_len..][..row_len];
                let (low, high) = (&row[left..left + stride], &row[right..right + stride]);
                for ((count, &high), &low) in counts.iter_mut().zip(high).zip(low) {
                    *count = high - low;
                }
            }
            let mut sum = 0.0;
            for window in 0..table.appearance.windows() {
                let above = &edges[window * stride..][..stride];
                let below = &edges[(window + 3) * stride..][..stride];
                let pixels = below[table.appearance.used] - above[table.appearance.used];
                if pixels > 0 {
                    let reference = &table.reference[window * stride..][..stride];
                    let weights = &table.weights[window * stride..][..stride];
                    sum += window_similarity(above, below, reference, weights, 1.0 / pixels as f32);
                }
            }
            let windows = table.appearance.windows() as f64;
            *out = f64::from(sum) / windows * visibility_factor(bounds, table.picture);
        }
    }
}

/// `sum_b weight_b min(H_b, R_b)` of one window.
#[inline(always)]
fn window_similarity(above: &[i32], below: &[i32], reference: &[f32], weights: &[f32], share: f32) -> f32 {
    let mut lanes = [0f32; LANES];
    let chunks = above.chunks_exact(LANES).zip(below.chunks_exact(LANES));
    let shares = reference.chunks_exact(LANES).zip(weights.chunks_exact(LANES));
    for ((above, below), (reference, weights)) in chunks.zip(shares) {
        for i in 0..LANES {
            let shown = (below[i] - above[i]) as f32 * share;
            let least = if shown < reference[i] { shown } else { reference[i] };
            lanes[i] += weights[i] * least;
        }
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;

    #[test]
    fn tables_agree_with_counting() {
        let rng = CounterRng::new(5);
        let bins = Frame::from_fn(90, 70, |x, y| {
            let k = rng.bits((y * 90 + x) as u64) % 40;
            if k == 39 { NO_BIN } else { (k * 2) as u8 }
        });
        for contrast in [false, true] {
            let appearance = Appearance::learn(&bins, [40.0, 33.0, 21.0, 37.0], contrast);
            let table = ColourTable::new(&appearance, &bins, [0.0, 90.0], [0.0, 70.0]);
            let uniform = |k: usize, low: f64, high: f64| low + (high - low) * rng.uniform(10_000 + k as u64);
            let boxes: Vec<CentredBox> = (0..200)
                .map(|k| {
                    let k = 4 * k;
                    [
                        uniform(k, -20.0, 110.0),
                        uniform(k + 1, -20.0, 90.0),
                        uniform(k + 2, 4.0, 40.0),
                        uniform(k + 3, 9.0, 60.0),
                    ]
                })
                .collect();
            let mut out = vec![0.0; boxes.len()];
            table.similarities(&boxes, &mut out);
            for (&bounds, &got) in boxes.iter().zip(&out) {
                let want = appearance.similarity(&bins, bounds);
                assert!((got - want).abs() < 1e-5, "{bounds:?}: {got} {want}");
            }
        }
    }
}
