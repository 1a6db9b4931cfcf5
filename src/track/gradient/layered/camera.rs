//! What moves the whole picture: the camera.

use super::layers::{Background, grown, holds, is_inside};
use super::nearby::nearby;
use super::patch::smooth;
use crate::image::{Interpolation, cubic_at};
use crate::math::robust_std;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::track::gradient::local_flow::{median, shifted_into};
use crate::types::{Frame, TargetBox};
use std::cell::OnceCell;
use std::ops::Range;

/// Pictures are reduced by these factors, one after the other.
const FACTORS: [usize; 3] = [4, 2, 1];
/// Around the target nothing is used, px.
pub(super) const AROUND: f64 = 14.0;
/// Gaussian after the reduction, reduced px.
const SIGMA: f64 = 1.0;
/// Steps at a level.
const STEPS: usize = 8;
/// A level is left when a step is shorter, reduced px.
const SETTLED: f64 = 0.005;
/// Motions nearer to each other than this lead to the same, px.
pub(super) const SAME: f64 = 0.5;
/// Shortest motion that is believed, px.
const LEAST_MOTION: f64 = 0.05;
/// By how much the capped residual must fall.
pub(super) const LESS: f64 = 0.9;
/// Pixels used at a level, at most.
const SAMPLES: usize = 4096;
/// Every which of them the deviation of the residuals is told from.
const EVERY: usize = 4;
/// Lower quartile of the absolute value of a standard normal number.
const QUARTILE: f64 = 0.3186;
/// Pixels that the scatter is told from, at most.
pub(super) const SCATTER_SAMPLES: usize = 1024;
/// Residual that all larger ones count as, grey levels.
pub(super) const CAP: f64 = 25.0;
/// Smallest information of a step, grey^2/px^2 per pixel.
const LEAST_INFORMATION: f64 = 0.05;
/// A frame and its reductions, made when they are first asked for: the next frame needs them again.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub frame: Frame<f64>,
    quarter: OnceCell<Frame<f64>>,
    half: OnceCell<Frame<f64>>,
}

impl Seen {
    pub fn new(frame: Frame<f64>) -> Self {
        Self { frame, ..Self::default() }
    }

    fn reduced(&self, factor: usize) -> &Frame<f64> {
        match factor {
            1 => &self.frame,
            2 => self.half.get_or_init(|| reduced(&self.frame, 2)),
            _ => self.quarter.get_or_init(|| reduced(&self.frame, 4)),
        }
    }
}

/// Translation of the still scene from one frame to the next, px; zero unless it explains the frames better.
/// `before` is that of the frame before. Where the scene moves, but not as one, that of what is around the
/// target.
pub(super) fn camera_motion(previous: &Seen, now: &Seen, target: TargetBox, noise: f64, before: [f64; 2]) -> [f64; 2] {
    let scene = scene_motion(previous, now, target, noise, before);
    if scene == [0.0; 2] && before == scene {
        return scene;
    }
    nearby((&previous.frame, &now.frame), target, (scene, before), noise)
}

/// That of most of the picture.
fn scene_motion(previous: &Seen, now: &Seen, target: TargetBox, noise: f64, before: [f64; 2]) -> [f64; 2] {
    let hidden = grown(target, (0.0, AROUND));
    let swinging = before != [0.0; 2];
    let mut motion = [0.0; 2];
    for factor in FACTORS {
        let (f, next) = (factor as f64, now.reduced(factor));
        let samples = Samples::of(previous.reduced(factor), &shrunk(hidden, factor));
        let reduced = |m: f64| m / f;
        let mut found = samples.refine(next, motion.map(reduced), noise);
        let finest = factor == 1;
        let goes_on = found.is_some_and(|m| (m[0] - before[0]).hypot(m[1] - before[1]) < SAME);
        if finest && swinging && !goes_on {
            found = samples.better(next, samples.refine(next, before, noise), found);
        }
        let believed = |m: [f64; 2]| m[0].hypot(m[1]) > LEAST_MOTION / f && samples.tell(next, m);
        // Most cameras stand still: the coarsest pictures, which have the least noise, tell it already.
        let asked = finest || factor == FACTORS[0] && !swinging;
        match found.filter(|m| !asked || believed(*m)) {
            Some(found) => motion = found.map(|m| m * f),
            None if finest || !swinging => return [0.0; 2],
            None => {}
        }
    }
    motion
}

/// Scatter of what the still scene changed by since the frame before, grey levels: the deviation of
/// differences from their median, robustly, where the scene moved by `motion` in the picture. Light that
/// falls on all of it alike is no scatter.
pub(super) fn scatter(previous: &Frame<f64>, now: &Frame<f64>, target: TargetBox, motion: [f64; 2]) -> f64 {
    let hidden = grown(target, (0.0, AROUND));
    let still = motion == [0.0; 2];
    let change = |(x, y): (usize, usize)| {
        let place = [x as f64 + motion[0], y as f64 + motion[1]];
        let there = if still { now.get(x, y) } else { cubic_at(now, place[0], place[1]) };
        (still || is_inside(place, now)).then(|| there - previous.get(x, y))
    };
    let mut changes: Vec<f64> = spread(previous.size(), hidden, SCATTER_SAMPLES).filter_map(change).collect();
    let middle = median(&mut changes);
    let mut off: Vec<f64> = changes.iter().map(|change| (change - middle).abs()).collect();
    robust_std(&mut off).unwrap_or(0.0)
}

/// Means over squares of `factor` px, then a Gaussian.
fn reduced(frame: &Frame<f64>, factor: usize) -> Frame<f64> {
    let (width, height) = (frame.width() / factor, frame.height() / factor);
    let mut small = Frame::filled(width, height, 0.0);
    dispatch(Level::detect(), Squares { frame, factor, small: &mut small });
    smooth(&small, SIGMA)
}

/// Means over squares: rows are added first, which lanes like.
struct Squares<'a> {
    frame: &'a Frame<f64>,
    factor: usize,
    small: &'a mut Frame<f64>,
}

impl Kernel<f64> for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let Self { frame, factor, small } = self;
        let mut line = vec![0.0; frame.width()];
        for y in 0..small.height() {
            line.copy_from_slice(frame.row(factor * y));
            for j in factor * y + 1..factor * (y + 1) {
                line.iter_mut().zip(frame.row(j)).for_each(|(sum, value)| *sum += value);
            }
            for (mean, square) in small.row_mut(y).iter_mut().zip(line.chunks_exact(factor)) {
                *mean = square.iter().sum::<f64>() / (factor * factor) as f64;
            }
        }
    }
}

fn shrunk(bounds: TargetBox, factor: usize) -> TargetBox {
    let f = factor as f64;
    // Centres of squares lie (f - 1) / 2 px after their first pixels.
    let to = |at: f64| (at - (f - 1.0) / 2.0) / f;
    TargetBox { x: to(bounds.x), y: to(bounds.y), width: bounds.width / f, height: bounds.height / f }
}

/// Pixels outside the box, two from the border, spread evenly; about so many at most.
pub(super) fn spread(size: (usize, usize), hidden: TargetBox, most: usize) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = size;
    let step = ((width * height) as f64 / most as f64).sqrt().ceil().max(1.0) as usize;
    (2..height.saturating_sub(2)).step_by(step).flat_map(move |y| {
        (2..width.saturating_sub(2)).step_by(step).filter(move |x| !holds(&hidden, *x, y)).map(move |x| (x, y))
    })
}

/// Pixels of a frame that its motion is told from.
pub(super) struct Samples {
    places: Vec<(usize, usize)>,
    values: Vec<f64>,
    gradients: Vec<[f64; 2]>,
}

impl Samples {
    fn of(frame: &Frame<f64>, hidden: &TargetBox) -> Self {
        Self::at(frame, spread(frame.size(), *hidden, SAMPLES).collect())
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

    /// What the next frame shows at the moved samples, less what they were; NaN where that is not in the
    /// frame.
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
    fn tell(&self, next: &Frame<f64>, motion: [f64; 2]) -> bool {
        self.capped(next, motion) < LESS * self.capped(next, [0.0; 2])
    }

    /// What continues the motion before, unless something else explains the next frame clearly better: where
    /// two things move, the camera is what it was.
    fn better(&self, next: &Frame<f64>, going_on: Option<[f64; 2]>, other: Option<[f64; 2]>) -> Option<[f64; 2]> {
        let left = |motion: Option<[f64; 2]>| motion.map_or(f64::INFINITY, |m| self.capped(next, m));
        if left(other) < LESS * left(going_on) { other } else { going_on.or(other) }
    }

    /// Mean residual, large ones counting alike.
    pub fn capped(&self, next: &Frame<f64>, motion: [f64; 2]) -> f64 {
        let residuals = self.residuals(next, motion);
        let sizes = residuals.iter().map(|r| r.abs().min(CAP)).filter(|r| !r.is_nan());
        let (sum, count) = sizes.fold((0.0, 0usize), |(sum, count), size| (sum + size, count + 1));
        sum / count.max(1) as f64
    }

    /// Gradient steps on all samples (5); `None` where the scene has no texture.
    pub fn refine(&self, next: &Frame<f64>, mut motion: [f64; 2], noise: f64) -> Option<[f64; 2]> {
        for _ in 0..STEPS {
            let residuals = self.residuals(next, motion);
            let s = deviation_of_the_better_half(&residuals).max(noise);
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
            let least = (LEAST_INFORMATION * count).powi(2);
            if determinant.is_nan() || determinant <= least {
                return None;
            }
            let step = [-(yy * xr - xy * yr) / determinant, -(xx * yr - xy * xr) / determinant];
            motion = [motion[0] + step[0], motion[1] + step[1]];
            if step[0].hypot(step[1]) < SETTLED {
                break;
            }
        }
        motion.iter().all(|m| m.abs() < next.width().max(next.height()) as f64 / 4.0).then_some(motion)
    }
}

/// Deviation of the residuals by their lower quartile: where half of the scene moves otherwise it is that of
/// the other half, so that steps end in one motion and not between the two.
fn deviation_of_the_better_half(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().step_by(EVERY).map(|r| r.abs()).filter(|r| !r.is_nan()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let quarter = sizes.len() / 4;
    *sizes.select_nth_unstable_by(quarter, f64::total_cmp).1 / QUARTILE
}

/// Pixels along an axis of a picture that was shifted, as far as they come from pixels.
struct Sources {
    to: Range<usize>,
    /// How much farther on the nearest pixel is that each comes from.
    by: isize,
}

/// Those of so many pixels that come from places so far on.
fn sources(length: usize, back: f64) -> Sources {
    let inside = |at: &usize| (0.0..=length as f64 - 1.0).contains(&(*at as f64 + back));
    let first = (0..length).find(inside).unwrap_or(length);
    let end = (first..length).rev().find(inside).map_or(first, |last| last + 1);
    Sources { to: first..end, by: (back + 0.5).floor() as isize }
}

impl Sources {
    /// Where the pixels come from.
    fn from(&self) -> Range<usize> {
        let on = |at: usize| (at as isize + self.by) as usize;
        on(self.to.start)..on(self.to.end)
    }

    /// Where one of them comes from.
    fn of(&self, at: usize) -> Option<usize> {
        self.to.contains(&at).then(|| (at as isize + self.by) as usize)
    }
}

impl Background {
    /// The scene moved by so many px in the picture. What comes into view is taken as it is seen, but does
    /// not count as known.
    pub(super) fn moved(&mut self, by: [f64; 2], frame: &Frame<f64>) {
        let back = by.map(|b| -b);
        let (width, height) = self.known.size();
        let picture = shifted_into(std::mem::take(&mut self.spare), &self.picture, back);
        let picture = Frame::new(width, height, picture).unwrap_or_default();
        self.spare = std::mem::replace(&mut self.picture, picture).into_data();
        // Pixels come from the nearest to where they were, if that is in the picture.
        let [columns, rows] = [(width, back[0]), (height, back[1])].map(|(length, back)| sources(length, back));
        let mut known = Frame::filled(width, height, false);
        for y in 0..height {
            if let Some(row) = rows.of(y).map(|j| self.known.row(j)) {
                known.row_mut(y)[columns.to.clone()].copy_from_slice(&row[columns.from()]);
            }
            let pixels = known.row_mut(y).iter_mut().zip(self.picture.row_mut(y)).zip(frame.row(y));
            for ((known, value), seen) in pixels.filter(|((_, value), _)| !value.is_finite()) {
                (*known, *value) = (false, *seen);
            }
        }
        self.known = known;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_of_a_shifted_row_come_from_the_nearest_that_there_are() {
        for back in [0.0, 0.3, 0.5, 0.7, 2.0, 2.6, -0.4, -0.5, -3.0, -3.2, 9.0, 12.0, -12.0] {
            let found = sources(10, back);
            for at in 0..10 {
                let place = at as f64 + back;
                let want = (0.0..=9.0).contains(&place).then(|| (place + 0.5).floor() as usize);
                assert_eq!(found.of(at), want, "{at} {back}");
            }
            assert!(found.to.is_empty() || found.from().end <= 10, "{back}");
        }
    }

    #[test]
    fn what_comes_into_view_is_seen_and_not_known() {
        let still = Frame::from_fn(30, 20, |x, y| (3 * x + 7 * y) as f64);
        let nowhere = TargetBox::about([-1e6; 2], 0.0, 0.0);
        for by in [[2.0, -1.0], [0.4, 0.0], [-1.7, 2.3]] {
            let mut background = Background::new(&still, nowhere);
            let now = Frame::filled(30, 20, -5.0);
            // Memory that was used before changes nothing.
            background.spare = vec![1e9; 700];
            background.moved(by, &now);
            assert!((background.picture.get(15, 10) - (3.0 * (15.0 - by[0]) + 7.0 * (10.0 - by[1]))).abs() < 1e-9);
            assert!(background.known.get(15, 10));
            let new =
                background.picture.data().iter().zip(background.known.data()).filter(|(value, _)| **value == -5.0);
            let unknown: Vec<bool> = new.map(|(_, known)| !*known).collect();
            assert!(!unknown.is_empty() && unknown.iter().all(|unknown| *unknown), "{by:?}");
        }
    }
}
