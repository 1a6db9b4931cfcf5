//! The choice of corners: best first, at a distance from each other and from points that are there already.

use crate::error::{Error, Result};
use crate::types::Frame;

/// Options of [`select_corners`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerOptions {
    /// Maximum number of corners returned; existing points do not count. Default 500.
    pub max_count: usize,
    /// Minimum score, as a share of the best score in the frame, 0 to 1. Default 0.005.
    pub quality: f64,
    /// Minimum distance between corners, and from existing points, px, finite. Default 6.
    pub min_distance: f64,
    /// Pixels at each side of the frame where no corner is taken. Default 1.
    pub margin: usize,
}

impl Default for CornerOptions {
    fn default() -> Self {
        Self { max_count: 500, quality: 0.005, min_distance: 6.0, margin: 1 }
    }
}

impl CornerOptions {
    /// Rejects values outside the ranges above.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.quality) {
            return Err(Error::argument("quality", "a number from 0 to 1", self.quality));
        }
        if !(self.min_distance >= 0.0 && self.min_distance.is_finite()) {
            return Err(Error::argument("min_distance", "a finite number >= 0", self.min_distance));
        }
        Ok(())
    }
}

/// New corners `(x, y)` px, in decreasing `score` (ties: in row-major order).
///
/// A corner has a positive score of at least `quality` times the best of the frame, no larger score among its
/// 8 neighbours. It is at least `min_distance` away from every better corner that was chosen and from every
/// `existing` point. NaN is no corner, and hides none beside it.
pub fn select_corners(score: &Frame<f32>, existing: &[[f64; 2]], options: &CornerOptions) -> Vec<[f64; 2]> {
    let (width, height) = score.size();
    if options.max_count == 0 || width.min(height) <= 2 * options.margin {
        return Vec::new();
    }
    let mut grid = CellGrid::new(score.size(), options.min_distance);
    for &point in existing {
        grid.insert(point);
    }
    let mut candidates = candidates(score, options);
    candidates.retain(|c| grid.is_free(c.position(width)));
    // Only the best can be chosen, and mostly far fewer than there are: they are sorted as needed.
    let mut chosen = Vec::new();
    let mut rest = &mut candidates[..];
    while !rest.is_empty() && chosen.len() < options.max_count {
        let wanted = options.max_count - chosen.len();
        let count = wanted.saturating_mul(2).max(SORTED_AT_ONCE).min(rest.len());
        if count < rest.len() {
            rest.select_nth_unstable_by(count - 1, Candidate::order);
        }
        let (best, others) = rest.split_at_mut(count);
        best.sort_unstable_by(Candidate::order);
        for point in best.iter().map(|c| c.position(width)) {
            if chosen.len() == options.max_count {
                break;
            }
            if grid.is_free(point) {
                grid.insert(point);
                chosen.push(point);
            }
        }
        rest = others;
    }
    chosen
}

/// Minimum number of candidates sorted together.
const SORTED_AT_ONCE: usize = 256;

#[derive(Debug, Clone, Copy)]
struct Candidate {
    score: f32,
    /// Row-major.
    index: u32,
}

impl Candidate {
    /// Best first, then in row-major order.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "what sorting asks for")]
    fn order(a: &Self, b: &Self) -> std::cmp::Ordering {
        b.score.total_cmp(&a.score).then(a.index.cmp(&b.index))
    }

    fn position(self, width: usize) -> [f64; 2] {
        let index = self.index as usize;
        [(index % width) as f64, (index / width) as f64]
    }
}

/// Values looked at together.
const STRIP: usize = 16;

/// The larger of two; `best` where the other is NaN.
fn larger(best: f32, value: f32) -> f32 {
    if value > best { value } else { best }
}

/// Best score of the frame, 0 if none is positive.
fn best_score(score: &Frame<f32>) -> f32 {
    let mut best = [0.0f32; STRIP];
    let (strips, rest) = score.data().as_chunks::<STRIP>();
    for strip in strips {
        for (best, &value) in best.iter_mut().zip(strip) {
            *best = larger(*best, value);
        }
    }
    best.iter().chain(rest).fold(0.0, |best, &value| larger(best, value))
}

/// Local maxima (3 x 3) at or above the threshold, in row-major order.
fn candidates(score: &Frame<f32>, options: &CornerOptions) -> Vec<Candidate> {
    let (width, height) = score.size();
    let threshold = (f64::from(best_score(score)) * options.quality) as f32;
    // Nothing without structure.
    let threshold = threshold.max(f32::MIN_POSITIVE);
    let mut found = Vec::new();
    // The largest of each column of three rows, with a column that exceeds nothing at either end.
    let mut columns = vec![0.0f32; width + 2];
    let mut is_maximum = vec![0u8; width];
    for y in options.margin..height - options.margin {
        let (above, row) = (score.row(y.saturating_sub(1)), score.row(y));
        let below = score.row((y + 1).min(height - 1));
        for (x, largest) in columns[1..=width].iter_mut().enumerate() {
            *largest = larger(larger(larger(0.0, above[x]), row[x]), below[x]);
        }
        let (left, middle, right) = (&columns[..width], &columns[1..=width], &columns[2..]);
        for (x, is_maximum) in is_maximum.iter_mut().enumerate() {
            let limit = larger(larger(larger(threshold, left[x]), middle[x]), right[x]);
            *is_maximum = u8::from(row[x] >= limit);
        }
        is_maximum[..options.margin].fill(0);
        is_maximum[width - options.margin..].fill(0);
        for (strip, flags) in is_maximum.chunks(STRIP).enumerate() {
            // Few pixels are maxima: strips without any are passed over whole.
            if flags.iter().fold(0, |any, flag| any | flag) != 0 {
                for x in (strip * STRIP..).take(flags.len()).filter(|&x| is_maximum[x] != 0) {
                    found.push(Candidate { score: row[x], index: (y * width + x) as u32 });
                }
            }
        }
    }
    found
}

/// Points in square cells of the side of the distance to be kept, so that only 3 x 3 cells need be looked at.
struct CellGrid {
    distance: f64,
    cell: f64,
    columns: usize,
    rows: usize,
    /// First point of each cell in `points`, and for each point the next of its cell; [`NONE`] ends the list.
    first: Vec<u32>,
    points: Vec<([f64; 2], u32)>,
}

const NONE: u32 = u32::MAX;

impl CellGrid {
    fn new((width, height): (usize, usize), distance: f64) -> Self {
        // Cells of less than a pixel would only cost memory.
        let cell = distance.max(1.0);
        let count = |size: usize| (size as f64 / cell) as usize + 1;
        let (columns, rows) = (count(width), count(height));
        Self { distance, cell, columns, rows, first: vec![NONE; columns * rows], points: Vec::new() }
    }

    /// Column and row of the cell of a point; points beyond the frame count to the outermost cells.
    fn cell_of(&self, [x, y]: [f64; 2]) -> (usize, usize) {
        let at = |value: f64, count: usize| ((value / self.cell).max(0.0) as usize).min(count - 1);
        (at(x, self.columns), at(y, self.rows))
    }

    fn insert(&mut self, point: [f64; 2]) {
        let (column, row) = self.cell_of(point);
        let first = &mut self.first[row * self.columns + column];
        self.points.push((point, *first));
        *first = self.points.len() as u32 - 1;
    }

    /// Whether no point is nearer than the distance.
    fn is_free(&self, [x, y]: [f64; 2]) -> bool {
        let (column, row) = self.cell_of([x, y]);
        for row in row.saturating_sub(1)..(row + 2).min(self.rows) {
            for column in column.saturating_sub(1)..(column + 2).min(self.columns) {
                let mut at = self.first[row * self.columns + column];
                while at != NONE {
                    let ([px, py], next) = self.points[at as usize];
                    if (px - x).powi(2) + (py - y).powi(2) < self.distance * self.distance {
                        return false;
                    }
                    at = next;
                }
            }
        }
        true
    }
}
