//! Disparity by agreement of gradient classes in a window, the paper's matching.
//!
//! Few of the candidates of an edge pixel show its own class at their middle, about one in twenty. Only these
//! have their window compared, 32 pixels of a row at a time.

use super::{edges::EdgeMap, edges::NO_CLASS, options::EdgeDisparityOptions};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Pixels compared at a time; no window is wider.
const LANES: usize = 32;
/// Code of left pixels without a class, and beyond a window; differs from [`NO_CLASS`] and all classes.
const NOTHING_LEFT: u8 = NO_CLASS - 1;
/// Edge pixels of one task.
const TASK: usize = 256;

/// The match of an edge pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClassMatch {
    /// px.
    pub disparity: i32,
    /// Rows that the right view shows it lower.
    pub row_offset: i32,
    /// Share of the window's classed pixels that agree.
    pub support: f32,
}

/// Classes with a border, so that no window leaves the plane.
struct Padded {
    stride: usize,
    data: Vec<u8>,
}

impl Padded {
    /// The classes of a view with `radius` pixels before them, [`LANES`] after them, and `radius` rows on
    /// both sides; `nothing` there and where there is no class.
    fn new(class: &Frame<u8>, radius: usize, nothing: u8) -> Self {
        let (width, height) = class.size();
        let stride = width + radius + LANES;
        let mut data = vec![nothing; stride * (height + 2 * radius)];
        for (y, row) in data.chunks_exact_mut(stride).skip(radius).take(height).enumerate() {
            for (out, &value) in row[radius..radius + width].iter_mut().zip(class.row(y)) {
                *out = if value == NO_CLASS { nothing } else { value };
            }
        }
        Self { stride, data }
    }
}

/// The best match of every `every`-th edge pixel of `left`; `None` where no candidate is supported.
///
/// `S(p; d, e)` is the number of pixels `q` in the window round `p` with `class_L(q) = class_R(q - (d, -e))`.
/// A candidate must agree at `p` itself, and half the window must lie in both views. The largest `S` wins,
/// among equals the least `|e|`, then the least `d`. `rows` are the candidates of `e`.
pub(super) fn match_classes(
    left: &EdgeMap,
    right: &EdgeMap,
    options: &EdgeDisparityOptions,
    rows: (i32, i32),
    every: usize,
) -> Vec<Option<ClassMatch>> {
    let radius = options.window / 2;
    let mut offsets: Vec<i32> = (rows.0..=rows.1).collect();
    offsets.sort_by_key(|e| e.abs());
    let planes = (Padded::new(&left.class, radius, NOTHING_LEFT), Padded::new(&right.class, radius, NO_CLASS));
    let mut matches = vec![None; left.len().div_ceil(every)];
    parallel::for_each(matches.chunks_mut(TASK).enumerate(), |(task, out)| {
        let first = task * TASK;
        dispatch(Level::detect(), Task { edges: left, planes: &planes, options, offsets: &offsets, first, every, out });
    });
    matches
}

/// The row offset that most matches have; among equals the one nearest 0; 0 without matches.
pub(super) fn most_frequent_row(matches: &[Option<ClassMatch>], (least, greatest): (i32, i32)) -> i32 {
    let mut counts = vec![0usize; (greatest - least + 1) as usize];
    for found in matches.iter().flatten() {
        counts[(found.row_offset - least) as usize] += 1;
    }
    let most = (least..=greatest).max_by_key(|e| (counts[(e - least) as usize], -e.abs()));
    most.filter(|e| counts[(e - least) as usize] > 0).unwrap_or(0)
}

/// Some of the edge pixels.
struct Task<'a> {
    edges: &'a EdgeMap,
    planes: &'a (Padded, Padded),
    options: &'a EdgeDisparityOptions,
    offsets: &'a [i32],
    first: usize,
    every: usize,
    out: &'a mut [Option<ClassMatch>],
}

/// Bytes: the compiler vectorises the loops with the instructions of the level.
impl Kernel<f32> for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(mut self) {
        for i in 0..self.out.len() {
            self.out[i] = self.best(self.every * (self.first + i));
        }
    }
}

impl Task<'_> {
    /// The best match of one edge pixel.
    #[inline(always)]
    fn best(&mut self, edge: usize) -> Option<ClassMatch> {
        let (x, y) = (self.edges.columns[edge] as usize, self.edges.rows[edge] as usize);
        let (low, high) = self.options.candidates(x, y)?;
        let (width, height) = self.edges.class.size();
        let (left, right) = self.planes;
        let window = self.options.window;
        let radius = window / 2;
        let own = self.edges.class.get(x, y);
        let (block, classed) = left_block(left, x, y, window);
        // Matches must lie in the right view: 0 <= x - d < width.
        let low = low.max(x as i32 + 1 - width as i32);
        let high = high.min(x as i32);
        let mut best: Option<(u32, i32, i32)> = None;
        for &e in self.offsets {
            let row = y as i32 + e;
            if row < 0 || row >= height as i32 {
                continue;
            }
            let middle = &right.data[(row as usize + radius) * right.stride + radius..][..width];
            for d in low..=high {
                let column = (x as i32 - d) as usize;
                if middle[column] != own || !half_inside((x, y), (column, row as usize), radius, (width, height)) {
                    continue;
                }
                let support =
                    agreement(&block, &right.data[row as usize * right.stride + column..], right.stride, window);
                if best.is_none_or(|(most, _, _)| support > most) {
                    best = Some((support, d, e));
                }
            }
        }
        let (support, disparity, row_offset) = best?;
        let share = f64::from(support) / f64::from(classed);
        (share >= self.options.min_support).then_some(ClassMatch { disparity, row_offset, support: share as f32 })
    }
}

/// The classes of the window round a left pixel, and how many of its pixels have one.
#[inline(always)]
fn left_block(left: &Padded, x: usize, y: usize, window: usize) -> ([[u8; LANES]; LANES], u32) {
    let mut block = [[NOTHING_LEFT; LANES]; LANES];
    let mut classed = 0;
    for j in 0..window {
        let row = &left.data[(y + j) * left.stride + x..][..window];
        block[j][..window].copy_from_slice(row);
        for value in row {
            classed += u32::from(*value != NOTHING_LEFT);
        }
    }
    (block, classed)
}

/// In how many pixels of the window the right classes, from its first pixel on, equal the left ones.
#[inline(always)]
fn agreement(block: &[[u8; LANES]; LANES], right: &[u8], stride: usize, window: usize) -> u32 {
    // No column has more than 31 pixels: bytes do not overflow.
    let mut sums = [0u8; LANES];
    for j in 0..window {
        let row: &[u8; LANES] = right[j * stride..].first_chunk().expect("the border is as wide as a block");
        for i in 0..LANES {
            sums[i] += u8::from(block[j][i] == row[i]);
        }
    }
    let mut total = 0;
    for sum in sums {
        total += u32::from(sum);
    }
    total
}

/// Whether at least half the window lies in both views.
#[inline(always)]
fn half_inside(
    (x, y): (usize, usize),
    (column, row): (usize, usize),
    radius: usize,
    (width, height): (usize, usize),
) -> bool {
    let before = |a: usize, b: usize| radius.min(a).min(b);
    let after = |a: usize, b: usize, len: usize| radius.min(len - 1 - a).min(len - 1 - b);
    let columns = before(x, column) + after(x, column, width) + 1;
    let rows = before(y, row) + after(y, row, height) + 1;
    2 * columns * rows >= (2 * radius + 1) * (2 * radius + 1)
}

#[cfg(test)]
mod tests {
    use super::super::edges::EdgeSettings;
    use super::*;
    use crate::math::random::CounterRng;

    /// Random cells, 8 px wide; the left view shows at `x` what the right shows at `x - d`, `e` lower.
    fn view(d: i32, e: i32) -> Frame<f32> {
        let rng = CounterRng::new(3);
        Frame::from_fn(96, 80, |x, y| {
            let (column, row) = ((x as i32 + d + 1000) / 8, (y as i32 - e + 1000) / 8);
            (rng.uniform((row * 1000 + column) as u64) * 200.0) as f32
        })
    }

    fn edges(view: &Frame<f32>) -> EdgeMap {
        EdgeMap::new(view, &EdgeSettings { blur_sigma: 2.0, threshold: 2.0, classes: 12 })
    }

    /// The same by the definition.
    fn oracle(left: &EdgeMap, right: &EdgeMap, options: &EdgeDisparityOptions, edge: usize) -> Option<ClassMatch> {
        let (x, y) = (left.columns[edge] as i32, left.rows[edge] as i32);
        let (width, height) = (left.class.width() as i32, left.class.height() as i32);
        let radius = (options.window / 2) as i32;
        let of = |map: &EdgeMap, x: i32, y: i32| {
            let inside = (0..width).contains(&x) && (0..height).contains(&y);
            inside.then(|| map.class.get(x as usize, y as usize)).filter(|class| *class != NO_CLASS)
        };
        let mut best: Option<(i32, i32, i32)> = None;
        let mut classed = 0;
        for e in options.row_range.0..=options.row_range.1 {
            for d in options.disparity_range.0..=options.disparity_range.1 {
                let (mut agree, mut inside) = (0, 0);
                classed = 0;
                for j in -radius..=radius {
                    for i in -radius..=radius {
                        let (a, b) = (of(left, x + i, y + j), of(right, x + i - d, y + j + e));
                        classed += i32::from(a.is_some());
                        agree += i32::from(a.is_some() && a == b);
                        let both = |x: i32, y: i32| (0..width).contains(&x) && (0..height).contains(&y);
                        inside += i32::from(both(x + i, y + j) && both(x + i - d, y + j + e));
                    }
                }
                let admissible = of(left, x, y) == of(right, x - d, y + e) && 2 * inside >= (2 * radius + 1).pow(2);
                let better = best.is_none_or(|(s, bd, be)| (-agree, e.abs(), d, e) < (-s, be.abs(), bd, be));
                if admissible && better {
                    best = Some((agree, d, e));
                }
            }
        }
        let (support, disparity, row_offset) = best?;
        let share = f64::from(support) / f64::from(classed);
        (share >= options.min_support).then_some(ClassMatch { disparity, row_offset, support: share as f32 })
    }

    #[test]
    fn every_level_agrees_with_the_definition() {
        let (left, right) = (edges(&view(0, 0)), edges(&view(5, 1)));
        let options = EdgeDisparityOptions { disparity_range: (-4, 8), row_range: (-2, 2), ..Default::default() };
        let matches = match_classes(&left, &right, &options, options.row_range, 1);
        assert_eq!(matches.len(), left.len());
        for edge in (0..left.len()).step_by(7) {
            let (got, want) = (matches[edge], oracle(&left, &right, &options, edge));
            // Among equals with one |e| and one d the order of -e and e is free.
            assert_eq!(got.map(|m| (m.disparity, m.support)), want.map(|m| (m.disparity, m.support)));
            assert_eq!(got.map(|m| m.row_offset.abs()), want.map(|m| m.row_offset.abs()));
        }
        let right_ones = matches.iter().flatten().filter(|m| (m.disparity, m.row_offset) == (5, 1)).count();
        assert!(right_ones * 10 > left.len() * 9, "{right_ones} of {}", left.len());
        let planes = (Padded::new(&left.class, 8, NOTHING_LEFT), Padded::new(&right.class, 8, NO_CLASS));
        for level in Level::available() {
            let mut out = vec![None; left.len()];
            let (edges, planes, offsets) = (&left, &planes, &[0, -1, 1, -2, 2]);
            let task = Task { edges, planes, options: &options, offsets, first: 0, every: 1, out: &mut out };
            dispatch(level, task);
            assert_eq!(out, matches, "{level:?}");
        }
    }
}
