//! Luminance reduced to the cells of the grid, and templates compared in it: equation (29) of the stereo
//! paper.

use super::{exposure::Exposure, voxels::Lattice};
use crate::types::Frame;

/// Levels of the reduced luminance.
pub(super) const LUMINANCE_LEVELS: usize = 64;
/// Level of a cell without a finite pixel.
const NONE: i32 = -1;

/// Mean luminance of each cell in whole levels.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct CellLuminance {
    columns: i32,
    rows: i32,
    /// Grey levels, NaN in a cell without a finite pixel.
    means: Vec<f64>,
    /// Levels for each grey level, and how many there are.
    scale: (f64, usize),
    levels: Vec<i32>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    /// Shift `(dx, dy)`, cells.
    pub shift: [i32; 2],
    /// Mean absolute difference there, levels.
    pub difference: f64,
}

impl CellLuminance {
    /// Averages grey levels (0 to 255) over cells: `floor(Y 64 / 256)`. Pixels that are not finite are
    /// left out.
    pub fn new(frame: &Frame<f32>, lattice: &Lattice) -> Self {
        let (columns, rows) = (lattice.grid.columns, lattice.grid.rows);
        let (cell_columns, cell_rows) = (lattice.cell_columns(), lattice.cell_rows());
        let (mut sums, mut counts) = (vec![0.0f64; columns * rows], vec![0u32; columns * rows]);
        for y in 0..frame.height() {
            let first = usize::from(cell_rows[y]) * columns;
            for (&value, &column) in frame.row(y).iter().zip(&cell_columns) {
                if value.is_finite() {
                    sums[first + usize::from(column)] += f64::from(value);
                    counts[first + usize::from(column)] += 1;
                }
            }
        }
        // Without a finite pixel 0 / 0.
        let means = sums.into_iter().zip(counts).map(|(sum, count)| sum / f64::from(count)).collect();
        Self::of_means((columns as i32, rows as i32), means, (LUMINANCE_LEVELS as f64 / 256.0, LUMINANCE_LEVELS))
    }

    fn of_means((columns, rows): (i32, i32), means: Vec<f64>, scale: (f64, usize)) -> Self {
        let highest = scale.1 as f64 - 1.0;
        let level = |mean: &f64| {
            if mean.is_nan() { NONE } else { (mean * scale.0).floor().clamp(0.0, highest) as i32 }
        };
        let levels = means.iter().map(level).collect();
        Self { columns, rows, means, scale, levels }
    }

    /// The view under another exposure.
    pub fn exposed(&self, exposure: &Exposure) -> Self {
        let means = self.means.iter().map(|mean| exposure.gain * mean + exposure.offset).collect();
        Self::of_means((self.columns, self.rows), means, self.scale)
    }

    fn level(&self, x: i32, y: i32) -> Option<i32> {
        let inside = (0..self.columns).contains(&x) && (0..self.rows).contains(&y);
        if !inside {
            return None;
        }
        Some(self.levels[(y * self.columns + x) as usize]).filter(|&level| level != NONE)
    }

    /// Shift of the template (cells of `self`) over `next`, up to `reach`, with the least mean absolute
    /// difference (29) over at least half of it; the shorter of equals, `None` if no shift keeps half.
    pub fn find(&self, template: &[[u16; 2]], next: &Self, reach: i32) -> Option<Match> {
        let cells: Vec<(i32, i32, i32)> = template
            .iter()
            .filter_map(|&[x, y]| {
                self.level(i32::from(x), i32::from(y)).map(|level| (i32::from(x), i32::from(y), level))
            })
            .collect();
        let mut best: Option<Match> = None;
        let length = |[x, y]: [i32; 2]| x * x + y * y;
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let (mut sum, mut count) = (0, 0);
                for &(x, y, level) in &cells {
                    if let Some(other) = next.level(x + dx, y + dy) {
                        sum += (level - other).abs();
                        count += 1;
                    }
                }
                if count == 0 || 2 * count < template.len() {
                    continue;
                }
                let (shift, difference) = ([dx, dy], f64::from(sum) / count as f64);
                let better = best.is_none_or(|best| {
                    difference < best.difference || difference == best.difference && length(shift) < length(best.shift)
                });
                if better {
                    best = Some(Match { shift, difference });
                }
            }
        }
        best
    }
}
