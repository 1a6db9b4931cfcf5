//! Parts of a picture, smoothed, and read between the pixels; masks.

use super::pose::Pose;
use crate::image::{Border, GaussianSmoother, all_finite, cubic_at_all};
use crate::simd::Level;
use crate::types::Frame;

/// Where Gaussians are cut off, standard deviations.
const TRUNCATE: f64 = 3.0;
/// Least share of known pixels that a mean rests on.
const MIN_KNOWN_SHARE: f64 = 1e-3;

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Patch {
    pub frame: Frame<f64>,
    /// Its first pixel in the picture.
    pub corner: [usize; 2],
}

/// Columns and rows of a rectangle: first and beyond the last.
pub(super) type Bounds = [[usize; 2]; 2];

/// Pixels of the picture that lie within `reach` px of `centre`; at least one.
pub(super) fn bounds_about(centre: [f64; 2], reach: [f64; 2], (width, height): (usize, usize)) -> Bounds {
    let lengths = [width, height];
    std::array::from_fn(|k| {
        let last = lengths[k] as f64 - 1.0;
        let first = (centre[k] - reach[k]).floor().clamp(0.0, last);
        let end = (centre[k] + reach[k]).ceil().clamp(0.0, last);
        [first as usize, end as usize + 1]
    })
}

impl Patch {
    /// A rectangle of the picture as it is.
    pub fn cut(frame: &Frame<f64>, [[x0, x1], [y0, y1]]: Bounds) -> Self {
        let mut data = Vec::with_capacity((x1 - x0) * (y1 - y0));
        (y0..y1).for_each(|y| data.extend_from_slice(&frame.row(y)[x0..x1]));
        Self { frame: Frame::new(x1 - x0, y1 - y0, data).unwrap_or_default(), corner: [x0, y0] }
    }

    /// The same, smoothed. Where samples are NaN, the mean of those that are not; NaN where there are none
    /// near.
    pub fn smoothed(mut self, sigma: f64) -> Self {
        self.frame =
            if all_finite(&self.frame) { smooth(&self.frame, sigma) } else { smooth_known(&self.frame, sigma) };
        self
    }

    /// Brightness at places of the picture; at the patch's border its last pixels go on.
    pub fn read(&self, places: &Places, out: &mut Vec<f64>) {
        places.read(&self.frame, self.corner.map(|at| at as f64), out);
    }
}

/// Gaussian smoothing; the border's pixels go on beyond it.
pub(super) fn smooth(frame: &Frame<f64>, sigma: f64) -> Frame<f64> {
    match GaussianSmoother::with(sigma, TRUNCATE, Border::Replicate) {
        Ok(smoother) => smoother.apply(frame),
        Err(_) => frame.clone(),
    }
}

/// Normalised convolution of what is known.
pub(super) fn smooth_known(frame: &Frame<f64>, sigma: f64) -> Frame<f64> {
    let value = smooth(&frame.map(|v| if v.is_nan() { 0.0 } else { *v }), sigma);
    let share = smooth(&frame.map(|v| if v.is_nan() { 0.0 } else { 1.0 }), sigma);
    let data = value.data().iter().zip(share.data());
    let data = data.map(|(v, s)| if *s < MIN_KNOWN_SHARE { f64::NAN } else { v / s }).collect();
    Frame::new(frame.width(), frame.height(), data).unwrap_or_default()
}

/// Points of the picture, px.
#[derive(Debug, Clone, Default)]
pub(super) struct Places {
    pub x: Vec<f64>,
    pub y: Vec<f64>,
}

impl Places {
    /// Where a pose brings points of the target.
    pub fn of(pose: &Pose, points: impl Iterator<Item = [f64; 2]>) -> Self {
        let mut this = Self::default();
        this.refill(pose, points);
        this
    }

    /// The same in the same memory.
    pub fn refill(&mut self, pose: &Pose, points: impl Iterator<Item = [f64; 2]>) {
        self.x.clear();
        self.y.clear();
        for xi in points {
            let [x, y] = pose.apply(xi);
            self.x.push(x);
            self.y.push(y);
        }
    }

    /// One of them.
    #[inline(always)]
    pub fn get(&self, at: usize) -> [f64; 2] {
        [self.x[at], self.y[at]]
    }

    /// Brightness at all of them, by cubic convolution; beyond the border its pixels go on.
    pub fn read(&self, frame: &Frame<f64>, origin: [f64; 2], out: &mut Vec<f64>) {
        out.clear();
        out.resize(self.x.len(), f64::NAN);
        if !frame.data().is_empty() {
            cubic_at_all(Level::detect(), frame, origin, (&self.x, &self.y), out);
        }
    }
}

pub(super) fn wide(at: usize, reach: usize, length: usize) -> std::ops::Range<usize> {
    at.saturating_sub(reach)..(at + reach + 1).min(length)
}

pub(super) fn dilated(mask: &Frame<bool>, reach: usize) -> Frame<bool> {
    let (width, height) = mask.size();
    let along = Frame::from_fn(width, height, |i, j| mask.row(j)[wide(i, reach, width)].contains(&true));
    Frame::from_fn(width, height, |i, j| wide(j, reach, height).any(|k| along.get(i, k)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_takes_no_part() {
        let mut frame = Frame::filled(12, 12, 4.0);
        frame.row_mut(5)[5] = f64::NAN;
        let patch = Patch { frame, corner: [0, 0] }.smoothed(1.0);
        assert!(patch.frame.data().iter().all(|v| (v - 4.0).abs() < 1e-12));
        assert!(smooth_known(&Frame::filled(5, 5, f64::NAN), 1.0).data().iter().all(|v| v.is_nan()));
    }
}
