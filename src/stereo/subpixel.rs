//! Fractions of a pixel by Lucas-Kanade steps along x.
//!
//! With the left slope `g` less its mean over the window, and the right window summed with it, `A(t) = sum g
//! R(x' + t)`, a step is `(A(t) - sum g L) / sum g^2`; a difference in brightness drops out because the
//! weights sum to 0. `A` at whole pixels says all there is about the right view: between them it is
//! interpolated just as the view would be, by cubic convolution, and steps cost next to nothing.

use super::{semi_global::Match, semi_global::View};
use crate::image::{Border, GaussianSmoother, Interpolation};
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::types::Frame;

/// Pixels on each side of the middle of the window.
const RADIUS: usize = 4;
/// Side of the window, px.
const SIDE: usize = 2 * RADIUS + 1;
/// Values of a window's row as they are kept.
const ROW: usize = 16;
/// Steps at most.
const STEPS: usize = 5;
/// Largest shift from the start, px.
const MAX_SHIFT: f32 = 1.0;
/// Convergence tolerance, px.
const MIN_STEP: f32 = 0.005;
/// Whole pixels round the start: enough for cubic convolution anywhere within [`MAX_SHIFT`].
const PLACES: usize = 6;
/// Floor of `sum g^2` over the window, (grey levels/px)^2: noise.
const MIN_SLOPE_SQUARES: f32 = 4.0;
/// Edge pixels of one task.
const TASK: usize = 256;

/// Refines every match; one that does not converge within 1 px inside both views stays as it is.
pub(super) fn refine(left: &Frame<f32>, view: &View, right: &Frame<f32>, matches: &mut [Option<Match>]) {
    // The right view is smoothed as the slopes are, so that noise does not bias the steps.
    let smoother = GaussianSmoother { sigma: 1.0, truncate: 4.0, border: Border::Replicate };
    let (left, right) = parallel::join(|| smoother.apply(left), || smoother.apply(right));
    parallel::for_each(matches.chunks_mut(TASK).enumerate(), |(task, matches)| {
        dispatch(Level::detect(), Task { left: &left, view, right: &right, first: task * TASK, matches });
    });
}

/// Some of the edge pixels.
struct Task<'a> {
    left: &'a Frame<f32>,
    view: &'a View,
    right: &'a Frame<f32>,
    first: usize,
    matches: &'a mut [Option<Match>],
}

impl Kernel<f32> for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f32>>(self) {
        for i in 0..self.matches.len() {
            let Some(found) = self.matches[i] else { continue };
            let edge = self.first + i;
            let (x, y) = (self.view.edges.columns[edge] as usize, self.view.edges.rows[edge] as usize);
            if let Some(shift) = self.shift(x, y, x as f32 - found.disparity) {
                self.matches[i] = Some(Match { disparity: found.disparity - shift, ..found });
            }
        }
    }
}

impl Task<'_> {
    /// How much further right than column `start` the right view shows a left pixel, px.
    #[inline(always)]
    fn shift(&self, x: usize, y: usize, start: f32) -> Option<f32> {
        let (width, height) = self.left.size();
        let base = start.floor();
        // Places base - 2 to base + 3, each with a window of its own.
        let leftmost = base - 2.0 - RADIUS as f32;
        let inside = x >= RADIUS && x + RADIUS < width && y >= RADIUS && y + RADIUS < height;
        if !inside || leftmost < 0.0 || leftmost as usize + PLACES + ROW > width {
            return None;
        }
        let (slopes, sum, squares) = self.template(x, y)?;
        let mut places = [0.0f32; PLACES];
        for j in 0..SIDE {
            let row = &self.right.row(y + j - RADIUS)[leftmost as usize..];
            for (k, place) in places.iter_mut().enumerate() {
                let row: &[f32; ROW] = row[k..].first_chunk().expect("windows inside the view");
                let mut parts = [0.0f32; 8];
                for i in 0..8 {
                    parts[i] = slopes[j][i] * row[i] + slopes[j][i + 8] * row[i + 8];
                }
                *place +=
                    (parts[0] + parts[4]) + (parts[1] + parts[5]) + ((parts[2] + parts[6]) + (parts[3] + parts[7]));
            }
        }
        let from = start - base;
        let mut at = from;
        for _ in 0..STEPS {
            let step = (sum - between(&places, at)) / squares;
            at += step;
            // NaN comes from a bad sample.
            if at.is_nan() || (at - from).abs() > MAX_SHIFT {
                return None;
            }
            if step.abs() < MIN_STEP {
                break;
            }
        }
        Some(at - from)
    }

    /// The left slopes less their mean, sums of their products with the left view and of their squares.
    #[inline(always)]
    fn template(&self, x: usize, y: usize) -> Option<([[f32; ROW]; SIDE], f32, f32)> {
        let mut slopes = [[0.0f32; ROW]; SIDE];
        let mut mean = 0.0;
        for j in 0..SIDE {
            let row: &[f32; SIDE] = self.view.along_x.row(y + j - RADIUS)[x - RADIUS..].first_chunk().expect("inside");
            for i in 0..SIDE {
                slopes[j][i] = row[i];
                mean += row[i];
            }
        }
        mean /= (SIDE * SIDE) as f32;
        let (mut sum, mut squares) = (0.0, 0.0);
        for j in 0..SIDE {
            let row: &[f32; SIDE] = self.left.row(y + j - RADIUS)[x - RADIUS..].first_chunk().expect("inside");
            for i in 0..SIDE {
                slopes[j][i] -= mean;
                sum += slopes[j][i] * row[i];
                squares += slopes[j][i] * slopes[j][i];
            }
        }
        (squares > MIN_SLOPE_SQUARES * (SIDE * SIDE) as f32 / 81.0).then_some((slopes, sum, squares))
    }
}

/// Cubic convolution between places; `at` px after the third, within 1 px of the way to the fourth.
#[inline(always)]
fn between(places: &[f32; PLACES], at: f32) -> f32 {
    let whole = at.floor().clamp(-1.0, 1.0);
    let weights = Interpolation::Bicubic.weights(f64::from(at - whole));
    let first = (whole + 1.0) as usize;
    let mut sum = 0.0;
    for i in 0..4 {
        sum += weights[i] as f32 * places[first + i];
    }
    sum
}
