//! Pixels of a frame that its motion is measured on, and gradient steps over all of them.

use super::{layers::holds, layers::is_inside};
use crate::image::{Interpolation, cubic_at};
use crate::math::robust_std;
use crate::types::{Frame, TargetBox};

/// Steps at a level.
const MAX_STEPS: usize = 8;
/// A level is left when a step is shorter, reduced px.
const MIN_STEP: f64 = 0.005;
/// By how much the capped residual must fall.
pub(super) const MAX_RESIDUAL_RATIO: f64 = 0.9;
/// Every which of them the standard deviation of the residuals is measured on.
const EVERY: usize = 4;
/// Residual that all larger ones count as, grey levels.
pub(super) const MAX_RESIDUAL: f64 = 25.0;
/// Smallest information of a step, grey^2/px^2 per pixel.
const MIN_INFORMATION: f64 = 0.05;
/// Around the target nothing is used, px.
pub(super) const SCENE_MARGIN: f64 = 14.0;
/// Motions nearer to each other than this lead to the same, px.
pub(super) const SAME_MOTION: f64 = 0.5;
/// Pixels that the scatter is measured on, at most.
pub(super) const SCATTER_SAMPLES: usize = 1024;
/// Pixels used at a level, at most.
const MAX_SAMPLES: usize = 4096;

/// Pixels outside the box, two from the border, spread evenly; about so many at most.
pub(super) fn spread(size: (usize, usize), hidden: TargetBox, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = size;
    let step = ((width * height) as f64 / most as f64).sqrt().ceil().max(1.0) as usize;
    (2..height.saturating_sub(2)).step_by(step).flat_map(move |y| {
        (2..width.saturating_sub(2)).step_by(step).filter(move |x| !holds(&hidden, *x, y)).map(move |x| (x, y))
    })
}

pub(super) struct Samples {
    places: Vec<(usize, usize)>,
    values: Vec<f64>,
    gradients: Vec<[f64; 2]>,
}

impl Samples {
    pub fn of(frame: &Frame<f64>, hidden: &TargetBox) -> Self {
        Self::at(frame, spread(frame.size(), *hidden, MAX_SAMPLES).collect())
    }

    /// At places at least one pixel from the border.
    pub fn at(frame: &Frame<f64>, places: Vec<(usize, usize)>) -> Self {
        let gradient = |&(x, y): &(usize, usize)| {
            let (row, above, below) = (frame.row(y), frame.row(y - 1), frame.row(y + 1));
            [0.5 * (row[x + 1] - row[x - 1]), 0.5 * (below[x] - above[x])]
        };
        let values = places.iter().map(|&(x, y)| frame.get(x, y)).collect();
        Self { values, gradients: places.iter().map(gradient).collect(), places }
    }

    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Brightness of the next frame at the moved samples less their own; NaN outside the frame.
    fn residuals(&self, next: &Frame<f64>, motion: [f64; 2]) -> Vec<f64> {
        let whole = motion.map(f64::floor);
        // All samples lie alike between the pixels.
        let [wx, wy] = [0, 1].map(|k| Interpolation::Bicubic.weights(motion[k] - whole[k]));
        let whole = whole.map(|w| w as isize);
        let (width, height) = (next.width() as isize, next.height() as isize);
        let read = |x: usize, y: usize| {
            let (i, j) = (x as isize + whole[0], y as isize + whole[1]);
            if i >= 1 && j >= 1 && i + 2 < width && j + 2 < height {
                let start = ((j - 1) * width + i - 1) as usize;
                let mut sum = 0.0;
                for (n, weight) in wy.iter().enumerate() {
                    let row = &next.data()[start + n * next.width()..][..4];
                    sum += weight * (wx[0] * row[0] + wx[1] * row[1] + wx[2] * row[2] + wx[3] * row[3]);
                }
                return sum;
            }
            let place = [x as f64 + motion[0], y as f64 + motion[1]];
            if is_inside(place, next) { cubic_at(next, place[0], place[1]) } else { f64::NAN }
        };
        self.places.iter().zip(&self.values).map(|(&(x, y), value)| read(x, y) - value).collect()
    }

    /// Whether a motion explains the next frame clearly better than none.
    pub fn explain(&self, next: &Frame<f64>, motion: [f64; 2]) -> bool {
        self.capped(next, motion) < MAX_RESIDUAL_RATIO * self.capped(next, [0.0; 2])
    }

    /// Mean residual, large ones counting alike.
    pub fn capped(&self, next: &Frame<f64>, motion: [f64; 2]) -> f64 {
        let residuals = self.residuals(next, motion);
        let sizes = residuals.iter().map(|r| r.abs().min(MAX_RESIDUAL)).filter(|r| !r.is_nan());
        let (sum, count) = sizes.fold((0.0, 0usize), |(sum, count), size| (sum + size, count + 1));
        sum / count.max(1) as f64
    }

    /// Gradient steps on all samples (5); `None` where the scene has no texture.
    pub fn refine(&self, next: &Frame<f64>, mut motion: [f64; 2], noise: f64) -> Option<[f64; 2]> {
        for _ in 0..MAX_STEPS {
            let residuals = self.residuals(next, motion);
            let s = residual_std(&residuals).max(noise);
            let (mut sums, mut count) = ([0.0; 5], 0.0);
            for ([gx, gy], r) in self.gradients.iter().zip(&residuals) {
                let outlying = 1.0 + (r / (3.0 * s)).powi(2);
                let weight = 1.0 / (outlying * outlying);
                if weight.is_nan() {
                    continue;
                }
                count += 1.0;
                for (sum, product) in sums.iter_mut().zip([gx * gx, gx * gy, gy * gy, gx * r, gy * r]) {
                    *sum += weight * product;
                }
            }
            let [xx, xy, yy, xr, yr] = sums;
            let determinant = xx * yy - xy * xy;
            let least = (MIN_INFORMATION * count).powi(2);
            if determinant.is_nan() || determinant <= least {
                return None;
            }
            let step = [-(yy * xr - xy * yr) / determinant, -(xx * yr - xy * xr) / determinant];
            motion = [motion[0] + step[0], motion[1] + step[1]];
            if step[0].hypot(step[1]) < MIN_STEP {
                break;
            }
        }
        motion.iter().all(|m| m.abs() < next.width().max(next.height()) as f64 / 4.0).then_some(motion)
    }
}

fn residual_std(residuals: &[f64]) -> f64 {
    let sizes = residuals.iter().step_by(EVERY).map(|r| r.abs()).filter(|r| !r.is_nan());
    robust_std(&mut sizes.collect::<Vec<f64>>()).unwrap_or(0.0)
}
