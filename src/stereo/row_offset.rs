//! Row offset of the right camera.
//!
//! Along a slanted edge a wrong row offset looks like a wrong disparity. Each window's own shift along x is
//! therefore solved together with the common offset.

use super::agreement::{Agreement, RowOffset, at_an_end};
use super::align::{match_aligned, rows_moved};
use super::classes::{match_classes, most_frequent_row};
use super::contrast::balanced;
use super::edges::{EdgeMap, EdgeSettings};
use super::options::EdgeDisparityOptions;
use super::semi_global::{Match, View};
use crate::error::Result;
use crate::image::{Border, GaussianSmoother, Interpolation};
use crate::math::median;
use crate::parallel;
use crate::types::Frame;

/// Passes of disparity and vertical steps.
const PASSES: usize = 2;
/// Vertical steps of a pass.
const STEPS: usize = 6;
/// Convergence tolerance of a step, rows.
const MIN_STEP: f64 = 1e-3;
/// Largest change from the start of a pass, rows.
const MAX_SHIFT: f64 = 1.5;
/// Step of the edge pixels in the class matching.
const SAMPLED: usize = 4;
/// Smallest and largest number of windows for vertical steps.
const WINDOWS: (usize, usize) = (30, 6000);
/// Largest number of windows for monitoring.
const MAX_MONITORED_WINDOWS: usize = 1000;
/// Windows of one task.
const WINDOWS_PER_TASK: usize = 64;
/// Pixels on each side of the middle of a window.
const RADIUS: usize = 4;
/// Pixels of a window.
const AREA: usize = (2 * RADIUS + 1) * (2 * RADIUS + 1);
/// Floor of the scale of residuals, grey levels: rounding.
const MIN_RESIDUAL_SCALE: f64 = 0.5;
/// Floor of the sum of squared slopes of a window, (grey levels/px)^2.
const MIN_SLOPE_SQUARES: f64 = 4.0;

/// How many rows lower the right view shows a point, `y_right - y_left`; 0 without matches.
///
/// The most frequent row offset of the class matching of some edge pixels within `row_range`, then twice:
/// disparity by semi-global matching of the rows so aligned, and Lucas-Kanade steps along y in 9 x 9 windows
/// round edge pixels, weighted by `1 / (1 + (r / 2 s)^2)^2`, r a window's residual and s the median of all.
/// `row_offset`, `prior` and the method of the options are not looked at. Identical for any number of
/// threads.
pub fn estimate_row_offset(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> Result<f64> {
    find_row_offset(left, right, options).map(|found| found.rows)
}

/// As [`estimate_row_offset`], with its reliability.
pub fn find_row_offset(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> Result<RowOffset> {
    options.check_views(left, right)?;
    Ok(options.threads.install(|| {
        let view = View::new(left, &EdgeSettings::of(options));
        row_offset_of(left, &view, &balanced(left, right), options).row_offset(options)
    }))
}

/// Row offset from one pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowEstimate {
    /// `y_right - y_left`.
    pub rows: f64,
    /// Whether the vertical steps converged; otherwise `rows` is the most frequent offset of the classes.
    pub settled: bool,
    /// Agreement of the views with it.
    pub agreement: Agreement,
}

impl RowEstimate {
    /// Whether it did not converge or is at an end of the range, and the agreement is bad. Rows that are not
    /// observable, as with vertical edges alone, do no harm.
    pub fn is_doubtful(&self, options: &EdgeDisparityOptions) -> bool {
        self.agreement.is_doubtful(!self.settled || at_an_end(self.rows, options.row_range))
    }

    /// The estimate with its reliability.
    pub fn row_offset(&self, options: &EdgeDisparityOptions) -> RowOffset {
        RowOffset { rows: self.rows, doubtful: self.is_doubtful(options) }
    }

    /// Whether it may be used for other pairs.
    pub fn is_believed(&self, options: &EdgeDisparityOptions) -> bool {
        !crate::ablation::keeps("edges.believed_rows")
            || self.settled && self.agreement.suffices() && !self.is_doubtful(options)
    }
}

/// As [`estimate_row_offset`], for a left view that is prepared.
pub(super) fn row_offset_of(
    left: &Frame<f32>,
    view: &View,
    right: &Frame<f32>,
    options: &EdgeDisparityOptions,
) -> RowEstimate {
    let options = EdgeDisparityOptions { prior: None, subpixel: true, left_right_check: true, ..options.clone() };
    let classes = EdgeMap::new(right, &EdgeSettings::of(&options));
    let matches = match_classes(&view.edges, &classes, &options, options.row_range, SAMPLED);
    let mut offset = f64::from(most_frequent_row(&matches, options.row_range));
    let (left_smooth, right_smooth) = smoothed(left, right);
    let mut agreement = Agreement::new(std::iter::empty());
    for _ in 0..if crate::ablation::keeps("edges.second_pass") { PASSES } else { 1 } {
        let matches = match_aligned(left, view, right, offset, &options);
        agreement = Agreement::of(&matches);
        let mut windows = windows(&left_smooth, view, &matches, WINDOWS.1);
        match vertical_steps(&mut windows, &right_smooth, offset, STEPS) {
            Some(refined) => offset = refined,
            None => return RowEstimate { rows: offset, settled: false, agreement },
        }
    }
    RowEstimate { rows: offset, settled: true, agreement }
}

/// One vertical step from the offset of the matches, rows; none for too few windows.
pub(super) fn misalignment(
    left: &Frame<f32>,
    view: &View,
    right: &Frame<f32>,
    matches: &[Option<Match>],
    rows: f64,
) -> Option<f64> {
    let (left_smooth, right_smooth) = smoothed(left, right);
    let mut windows = windows(&left_smooth, view, matches, MAX_MONITORED_WINDOWS);
    // A step beyond the limit still shows a misalignment.
    vertical_step(&mut windows, &rows_moved(&right_smooth, rows))
}

/// Both views, smoothed.
fn smoothed(left: &Frame<f32>, right: &Frame<f32>) -> (Frame<f32>, Frame<f32>) {
    let smoother = GaussianSmoother { sigma: 1.0, truncate: 4.0, border: Border::Replicate };
    parallel::join(|| smoother.apply(left), || smoother.apply(right))
}

/// The window round a matched edge pixel.
struct Window {
    /// Slopes along x and along y, each less its mean.
    slopes: [[f64; 2]; AREA],
    /// Brightness on the left.
    brightness: [f64; AREA],
    /// `sum g_x^2`, `sum g_x g_y`, `sum g_y^2`.
    squares: [f64; 3],
    /// Column of the match and row of the pixel, px.
    at: (f64, usize),
}

/// Contribution of one window: `sum g (L - R)` along x and y, and the rms of `L - R` less its mean.
#[derive(Clone, Copy)]
struct Misfit {
    moments: [f64; 2],
    residual: f64,
}

/// Windows that lie inside the left view, at most `most` of them, spread over the picture.
fn windows(left: &Frame<f32>, view: &View, matches: &[Option<Match>], most: usize) -> Vec<Window> {
    let (width, height) = left.size();
    let inside = |x: usize, y: usize| x >= RADIUS && y >= RADIUS && x + RADIUS < width && y + RADIUS < height;
    let places: Vec<(usize, usize, f64)> = (view.edges.rows.iter().zip(&view.edges.columns).zip(matches))
        .filter_map(|((&row, &column), found)| Some((column as usize, row as usize, f64::from((*found)?.disparity))))
        .filter(|&(x, y, _)| inside(x, y))
        .collect();
    let every = places.len().div_ceil(most).max(1);
    places.iter().step_by(every).map(|&(x, y, disparity)| Window::new(left, view, (x, y), disparity)).collect()
}

impl Window {
    fn new(left: &Frame<f32>, view: &View, (x, y): (usize, usize), disparity: f64) -> Self {
        let (mut slopes, mut brightness) = ([[0.0; 2]; AREA], [0.0; AREA]);
        let mut mean = [0.0; 2];
        for (i, (slope, value)) in slopes.iter_mut().zip(&mut brightness).enumerate() {
            let (column, row) = (x - RADIUS + i % (2 * RADIUS + 1), y - RADIUS + i / (2 * RADIUS + 1));
            *slope = [view.along_x.get(column, row), view.along_y.get(column, row)].map(f64::from);
            *value = f64::from(left.get(column, row));
            mean = [mean[0] + slope[0] / AREA as f64, mean[1] + slope[1] / AREA as f64];
        }
        let mut squares = [0.0; 3];
        for slope in &mut slopes {
            *slope = [slope[0] - mean[0], slope[1] - mean[1]];
            squares[0] += slope[0] * slope[0];
            squares[1] += slope[0] * slope[1];
            squares[2] += slope[1] * slope[1];
        }
        squares[0] = squares[0].max(MIN_SLOPE_SQUARES);
        Self { slopes, brightness, squares, at: (x as f64 - disparity, y) }
    }

    /// Compares the window with the aligned right view; none where that does not reach, or knows nothing.
    fn misfit(&self, right: &Frame<f32>) -> Option<Misfit> {
        let first = self.at.0.floor();
        let leftmost = first - RADIUS as f64 - 1.0;
        if !(leftmost >= 0.0 && leftmost + 2.0 * RADIUS as f64 + 4.0 <= right.width() as f64) {
            return None;
        }
        let weights = Interpolation::Bicubic.weights(self.at.0 - first);
        let (mut moments, mut sum, mut square) = ([0.0; 2], 0.0, 0.0);
        for j in 0..=2 * RADIUS {
            let row = &right.row(self.at.1 + j - RADIUS)[leftmost as usize..];
            for i in 0..=2 * RADIUS {
                let value: f64 = (0..4).map(|k| weights[k] * f64::from(row[i + k])).sum();
                let pixel = j * (2 * RADIUS + 1) + i;
                let difference = self.brightness[pixel] - value;
                moments[0] += self.slopes[pixel][0] * difference;
                moments[1] += self.slopes[pixel][1] * difference;
                sum += difference;
                square += difference * difference;
            }
        }
        let area = AREA as f64;
        let residual = (square / area - (sum / area).powi(2)).max(0.0).sqrt();
        residual.is_finite().then_some(Misfit { moments, residual })
    }

    /// Moment and square of the offset once the window's own shift along x is solved for.
    fn vertical(&self, moments: [f64; 2]) -> (f64, f64) {
        let [xx, xy, yy] = self.squares;
        (moments[1] - xy / xx * moments[0], yy - xy * xy / xx)
    }
}

/// The offset after at most so many Lucas-Kanade steps along y; none if they fail or lead away.
fn vertical_steps(windows: &mut [Window], right: &Frame<f32>, start: f64, steps: usize) -> Option<f64> {
    let mut offset = start;
    for _ in 0..steps {
        let step = vertical_step(windows, &rows_moved(right, offset))?;
        offset += step;
        if offset.is_nan() || (offset - start).abs() > MAX_SHIFT {
            return None;
        }
        if step.abs() < MIN_STEP {
            break;
        }
    }
    Some(offset)
}

/// One step along y, rows, with each window's own along x. None without enough windows.
fn vertical_step(windows: &mut [Window], aligned: &Frame<f32>) -> Option<f64> {
    let misfits: Vec<Option<Misfit>> =
        parallel::map_range(windows.len(), WINDOWS_PER_TASK, |n| windows[n].misfit(aligned));
    let mut residuals: Vec<f64> = misfits.iter().flatten().map(|misfit| misfit.residual).collect();
    if residuals.len() < WINDOWS.0 {
        return None;
    }
    let scale = median(&mut residuals)?.max(MIN_RESIDUAL_SCALE);
    // Summed in the order of the windows, independent of threads.
    let (mut moment, mut square) = (0.0, 0.0);
    for (window, misfit) in windows.iter().zip(&misfits) {
        let Some(misfit) = misfit else { continue };
        let weight = (1.0 + (misfit.residual / (2.0 * scale)).powi(2)).powi(-2);
        let (m, s) = window.vertical(misfit.moments);
        moment += weight * m;
        square += weight * s;
    }
    let step = moment / square;
    for (window, misfit) in windows.iter_mut().zip(&misfits) {
        let Some(misfit) = misfit else { continue };
        let [xx, xy, _] = window.squares;
        window.at.0 += ((misfit.moments[0] - xy * step) / xx).clamp(-1.0, 1.0);
    }
    Some(step)
}
