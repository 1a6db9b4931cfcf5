//! What stood before part of the first box, and still does.

use super::layers::{CORE, Target};
use super::outset::Outset;
use super::pose::Pose;
use crate::types::Frame;

/// Share of the target behind it up to which it hides nothing any more.
const PAST: f64 = 0.03;

/// Something still in front of the target: pixels of the first box. Beyond the box it goes on as at the
/// nearest of its pixels.
#[derive(Debug, Clone)]
pub(super) struct Front {
    /// Whether it is there; the pixels of the box.
    there: Frame<bool>,
    /// First of them in the picture.
    corner: [f64; 2],
}

impl Front {
    /// From what is `hidden` of the patch about the first box.
    pub fn of(outset: &Outset, hidden: &Frame<bool>) -> Option<Self> {
        let inside = &outset.inside;
        let (width, height) = inside.size();
        let columns: Vec<_> = (0..width).filter(|x| (0..height).any(|y| inside.get(*x, y))).collect();
        let rows: Vec<_> = (0..height).filter(|y| inside.row(*y).contains(&true)).collect();
        let (x0, y0) = (*columns.first()?, *rows.first()?);
        let there = Frame::from_fn(columns.len(), rows.len(), |i, j| hidden.get(x0 + i, y0 + j));
        let corner = [x0 + outset.first.corner[0], y0 + outset.first.corner[1]].map(|at| at as f64);
        Some(Self { there, corner })
    }

    /// Whether it is at a place of the picture, px.
    pub fn is_at(&self, place: [f64; 2]) -> bool {
        let (width, height) = self.there.size();
        let pixel =
            |k: usize, length: usize| (place[k] - self.corner[k] + 0.5).clamp(0.0, length as f64 - 0.5) as usize;
        self.there.get(pixel(0, width), pixel(1, height))
    }

    /// Whether the target has left it.
    pub fn is_past(&self, target: &Target, pose: &Pose) -> bool {
        let (mut behind, mut all) = (0.0, 0.0);
        for j in 0..target.a.height() {
            for (i, a) in target.a.row(j).iter().enumerate().filter(|(_, a)| **a > CORE) {
                all += a;
                behind += if self.is_at(pose.apply(target.xi(i, j))) { *a } else { 0.0 };
            }
        }
        behind <= PAST * all
    }
}
