//! Places of the target's nodes in the picture, and what is read there; column by column of a table, as lanes
//! like it.

use super::pose::Pose;
use crate::image::cubic_at_all;
use crate::simd::Level;
use crate::types::Frame;

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
