//! A first box that holds only the middle of the target: what moves goes on beyond it on all sides.
//!
//! Such a box makes a template without edges, and a background that holds the rest of the target. In the
//! first frames that move, what moves is therefore looked for without the box ([`detect_moving_target`]);
//! where it is larger than the box on all sides, and what lies between moved with it, it is the target.

use super::initial::{Changes, InitialSegmentation};
use super::layers::holds;
use crate::track::gradient::detect::{MovingTarget, detect_moving_target};
use crate::types::{Frame, TargetBox};

/// Sides of what moves over those of a box that holds only the middle of it.
const SIDE_RATIO_RANGE: [f64; 2] = [1.25, 2.5];
/// Distance of the middles of the two, share of the box's sides.
const MAX_CENTER_OFFSET: f64 = 0.3;
/// Frames in which that may be seen: what turns goes beyond its box later.
const MAX_FRAMES: usize = 4;
/// Changed pixels of a row or column that noise does not make, share of the box's shorter side, and least.
const LINE: (f64, f64) = (0.2, 3.0);
/// Share of what lies between the two that may not have moved with the target.
const MAX_OUTLIER_SHARE: f64 = 0.15;

impl InitialSegmentation {
    /// What moved, where the box holds only the middle of it: its outline goes on beyond the box on all
    /// sides, and what is between moved with it.
    pub fn outgrown(&self, frame: &Frame<f64>, noise: f64) -> Option<MovingTarget> {
        if self.frames() > MAX_FRAMES {
            return None;
        }
        let changes = self.changes(frame, noise);
        if !changes.reach_beyond() {
            return None;
        }
        let corner = self.first.corner.map(|at| at as f64);
        let centre = self.bounds.centre();
        let near = [0, 1].map(|k| centre[k] - corner[k]);
        let found = detect_moving_target(&self.first.frame, &changes.now, Some(near))?;
        let at = found.bounds.centre();
        let sides = [(found.bounds.width, self.bounds.width), (found.bounds.height, self.bounds.height)];
        let larger =
            sides.iter().all(|(now, first)| (SIDE_RATIO_RANGE[0]..SIDE_RATIO_RANGE[1]).contains(&(now / first)));
        let middle = (0..2).all(|k| (at[k] - found.displacement[k] - near[k]).abs() < MAX_CENTER_OFFSET * sides[k].1);
        let bounds = TargetBox { x: found.bounds.x + corner[0], y: found.bounds.y + corner[1], ..found.bounds };
        (larger && middle && changes.moved_with(&found)).then_some(MovingTarget { bounds, ..found })
    }
}

impl Changes<'_> {
    /// Whether what changed reaches beyond the box on opposite sides, along both axes.
    fn reach_beyond(&self) -> bool {
        let (width, height) = self.now.size();
        let mut counts = [vec![0; width], vec![0; height]];
        for y in 0..height {
            let pixels = self.now.row(y).iter().zip(self.outset.first.frame.row(y));
            for (x, _) in pixels.enumerate().filter(|(_, (now, first))| (*now - *first).abs() > self.bar) {
                counts[0][x] += 1;
                counts[1][y] += 1;
            }
        }
        let TargetBox { x, y, width, height } = self.outset.bounds;
        [(x, width), (y, height)].into_iter().zip(counts).enumerate().all(|(k, ((from, side), counts))| {
            let beyond = 0.5 * (SIDE_RATIO_RANGE[0] - 1.0) * side;
            let fewest = (LINE.0 * self.outset.side()).max(LINE.1) as usize;
            let corner = self.outset.first.corner[k] as f64;
            let mut changed =
                counts.iter().enumerate().filter(|(_, count)| **count >= fewest).map(|(at, _)| at as f64 + corner);
            let first = changed.next();
            let last = changed.next_back().or(first);
            first.is_some_and(|low| low < from - beyond) && last.is_some_and(|high| high > from + side + beyond)
        })
    }

    /// Whether what lies between the box and the outline of what moved did as that did.
    fn moved_with(&self, found: &MovingTarget) -> bool {
        let d = found.displacement.map(|d| d as isize);
        let corner = self.outset.first.corner;
        let (mut count, mut strays) = (0.0, 0.0);
        for y in 0..self.now.height() {
            for x in (0..self.now.width()).filter(|x| holds(&found.bounds, *x, y)) {
                let Some(from) = self.on([x, y], d.map(|d| -d)) else { continue };
                if !holds(&self.outset.bounds, from[0] + corner[0], from[1] + corner[1]) {
                    count += 1.0;
                    strays += f64::from(u8::from(self.along(from, [x, y]) > self.bar));
                }
            }
        }
        strays < MAX_OUTLIER_SHARE * count
    }
}
