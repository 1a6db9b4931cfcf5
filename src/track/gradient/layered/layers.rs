//! The two layers of the picture: the target (its brightness and its support, in its own coordinates) and
//! what is behind it.
//!
//! `C(xi) = g a(xi) T(xi) + (1 - a(xi)) Bg(W(xi))`.

use super::{patch::Patch, patch::Places, patch::bounds_about, patch::wide, pose::Pose};
use crate::image::{cubic_at, fill_holes};
use crate::types::{Frame, TargetBox};

/// Around the box, share of its sides, and least margin, px.
const MARGIN: (f64, f64) = (0.2, 4.0);
/// Around the box, nothing is known of the background: share of its sides, and px.
pub(super) const UNSEEN: (f64, f64) = (0.1, 2.0);
/// Distance from the box at which the first frame most likely shows what is behind the target, px.
const BESIDE: f64 = 0.5;
/// Around what is guessed, what the guess rests on, px.
const AROUND: f64 = 3.0;
/// Support from which on a point is the target's.
pub(super) const CORE: f64 = 0.6;
/// Distance from the support at which points still count, px of the target.
const NEAR: f64 = 2.0;
/// Difference of the support's sides from the first box's that changes nothing, share.
const MAX_CHANGE: f64 = 0.2;
/// Support that distances are counted from.
const EDGE: f64 = 0.1;

/// Weight of the first support, grey^2.
pub(super) const PRIOR: f64 = 144.0;

#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Target {
    /// Support, 0 to 1.
    pub a: Frame<f64>,
    /// Brightness, grey levels.
    pub t: Frame<f64>,
    /// Support at first: the box.
    pub prior: Frame<f64>,
    /// Sums behind the support.
    pub n: Frame<f64>,
    /// As above.
    pub d: Frame<f64>,
    /// How much of what is seen next of a point becomes its brightness, where that was hidden at first; 0
    /// where it was seen.
    pub fresh: Option<Frame<f64>>,
    /// Sides at first, px.
    pub size: [f64; 2],
}

impl Target {
    /// What the box holds.
    pub fn new(frame: &Frame<f64>, bounds: TargetBox, prior_weight: f64) -> Self {
        let size = [bounds.width, bounds.height];
        let half = size.map(|side| (side / 2.0 + (MARGIN.0 * side).max(MARGIN.1)).ceil() as usize);
        let centre = bounds.centre();
        let shape = half.map(|h| 2 * h + 1);
        let along = |at: usize, k: usize| at as f64 - half[k] as f64;
        let cover = |at: f64, side: f64| (side / 2.0 - at.abs() + 0.5).clamp(0.0, 1.0);
        let prior =
            Frame::from_fn(shape[0], shape[1], |i, j| cover(along(i, 0), size[0]) * cover(along(j, 1), size[1]));
        let t = Frame::from_fn(shape[0], shape[1], |i, j| {
            cubic_at(frame, centre[0] + along(i, 0), centre[1] + along(j, 1))
        });
        Self {
            a: prior.clone(),
            t,
            n: prior.map(|a| prior_weight * a),
            d: prior.map(|_| prior_weight),
            prior,
            fresh: None,
            size,
        }
    }

    /// Target coordinates of a node.
    #[inline(always)]
    pub fn xi(&self, i: usize, j: usize) -> [f64; 2] {
        [i as f64 - (self.a.width() / 2) as f64, j as f64 - (self.a.height() / 2) as f64]
    }

    /// Half the sides of the grid.
    pub fn half(&self) -> [f64; 2] {
        [(self.a.width() / 2) as f64, (self.a.height() / 2) as f64]
    }

    /// Centroid of the support as learned so far, target coordinates.
    pub fn centroid(&self) -> [f64; 2] {
        self.centroid_of(|at| self.a.data()[at])
    }

    /// Centroid of the support that the target is expected to have, target coordinates. As much of it at a
    /// point as the prior still decides is taken from the opposite point: behind a moving target the
    /// background is seen last, and the background that the box holds counts as target there until then.
    pub fn expected_centroid(&self) -> [f64; 2] {
        let (support, prior, weight) = (self.a.data(), self.prior.data(), self.d.data());
        self.centroid_of(|at| {
            let opposite = support[support.len() - 1 - at];
            (support[at] + PRIOR / weight[at] * (opposite - prior[at])).clamp(0.0, 1.0)
        })
    }

    #[inline(always)]
    fn centroid_of(&self, support: impl Fn(usize) -> f64) -> [f64; 2] {
        let mut sums = [0.0; 3];
        let (width, height) = self.a.size();
        for j in 0..height {
            for i in 0..width {
                let (a, xi) = (support(j * width + i), self.xi(i, j));
                sums[0] += a;
                sums[1] += a * xi[0];
                sums[2] += a * xi[1];
            }
        }
        if sums[0] > 0.0 { [sums[1] / sums[0], sums[2] / sums[0]] } else { [0.0; 2] }
    }

    /// Sides of the support, px of the target: those of the first box unless it is clearly larger or smaller.
    pub fn extent(&self) -> [f64; 2] {
        let (width, height) = self.a.size();
        let columns: Vec<f64> = (0..width).map(|i| (0..height).map(|j| self.a.get(i, j)).sum()).collect();
        let rows: Vec<f64> = (0..height).map(|j| self.a.row(j).iter().sum()).collect();
        [columns, rows]
            .map(|sums| {
                let most = sums.iter().copied().fold(0.0, f64::max);
                sums.iter()
                    .map(|sum| (sum / (0.5 * most.max(1e-9))).min(1.0))
                    .filter(|share| *share >= 0.5)
                    .sum::<f64>()
            })
            .into_iter()
            .zip(self.size)
            .map(|(extent, first)| {
                if crate::ablation::keeps("gradient.first_extent") && (extent / first - 1.0).abs() < MAX_CHANGE {
                    first
                } else {
                    extent
                }
            })
            .collect::<Vec<_>>()
            .try_into()
            .unwrap_or(self.size)
    }

    /// Points no farther than 2 px from the support.
    pub fn near(&self) -> Frame<bool> {
        let reach = NEAR as usize;
        let (width, height) = self.a.size();
        let along =
            Frame::from_fn(width, height, |i, j| self.a.row(j)[wide(i, reach, width)].iter().any(|a| *a > EDGE));
        Frame::from_fn(width, height, |i, j| wide(j, reach, height).any(|k| along.get(i, k)))
    }

    /// The places of all nodes in the picture.
    pub fn places(&self, pose: &Pose) -> Places {
        let (width, height) = self.a.size();
        Places::of(pose, (0..height).flat_map(|j| (0..width).map(move |i| self.xi(i, j))))
    }
}

#[inline(always)]
pub(super) fn is_inside([x, y]: [f64; 2], frame: &Frame<f64>) -> bool {
    x >= 0.0 && y >= 0.0 && x <= frame.width() as f64 - 1.0 && y <= frame.height() as f64 - 1.0
}

/// The picture behind the target, and where it is known.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Background {
    /// Brightness; where it was never seen, a guess.
    pub picture: Frame<f64>,
    /// Where it was seen.
    pub known: Frame<bool>,
    /// Memory of the picture before the camera moved.
    pub spare: Vec<f64>,
}

impl Background {
    /// The first frame; nothing is known of what the box covers.
    pub fn new(frame: &Frame<f64>, bounds: TargetBox) -> Self {
        let hidden = grown(bounds, UNSEEN);
        let known = Frame::from_fn(frame.width(), frame.height(), |x, y| !holds(&hidden, x, y));
        let mut this = Self { picture: frame.clone(), known, spare: Vec::new() };
        let inside = if crate::ablation::keeps("gradient.beside") { grown(bounds, (0.0, BESIDE)) } else { hidden };
        this.guess(&hidden, |x, y| !holds(&inside, x, y));
        this
    }

    /// Pixels in and around a box that are neither known nor given get a smooth continuation of those that
    /// are.
    pub fn guess(&mut self, hidden: &TargetBox, told: impl Fn(usize, usize) -> bool) {
        let reach = [hidden.width, hidden.height].map(|side| 0.5 * side + AROUND);
        let mut around = Patch::cut(&self.picture, bounds_about(hidden.centre(), reach, self.picture.size()));
        let [left, top] = around.corner;
        let (width, height) = around.frame.size();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            if !self.known.get(left + x, top + y) && !told(left + x, top + y) {
                around.frame.row_mut(y)[x] = f64::NAN;
            }
        }
        if around.frame.data().iter().all(|value| value.is_nan()) {
            return;
        }
        let filled = fill_holes(&around.frame, None);
        for y in 0..height {
            self.picture.row_mut(top + y)[left..left + width].copy_from_slice(filled.row(y));
        }
    }

    /// Whether it is known at the pixel nearest to a place.
    #[inline(always)]
    pub fn is_known(&self, [x, y]: [f64; 2]) -> bool {
        let nearest = |at: f64, length: usize| (at.max(0.0) + 0.5) as usize * usize::from(length > 0);
        let (x, y) = (nearest(x, self.known.width()), nearest(y, self.known.height()));
        self.known.get(x.min(self.known.width() - 1), y.min(self.known.height() - 1))
    }
}

/// A box with a margin on every side: a share of the side, and px.
pub(super) fn grown(bounds: TargetBox, (share, more): (f64, f64)) -> TargetBox {
    TargetBox::about(
        bounds.centre(),
        bounds.width * (1.0 + 2.0 * share) + 2.0 * more,
        bounds.height * (1.0 + 2.0 * share) + 2.0 * more,
    )
}

pub(super) fn contains(bounds: &TargetBox, [x, y]: [f64; 2]) -> bool {
    let within = |at: f64, from: f64, length: f64| (from..=from + length).contains(&at);
    within(x, bounds.x, bounds.width) && within(y, bounds.y, bounds.height)
}

pub(super) fn holds(bounds: &TargetBox, x: usize, y: usize) -> bool {
    contains(bounds, [x as f64, y as f64])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_that_is_not_determined_is_like_the_opposite_one() {
        let frame = Frame::filled(60, 50, 90.0);
        let mut target = Target::new(&frame, TargetBox::about([30.0, 20.0], 13.0, 9.0), PRIOR);
        let (width, height) = target.a.size();
        // The last three columns of the box turn out to be background; the first three were not seen yet.
        for (i, j) in (0..height).flat_map(|j| (0..width).map(move |i| (i, j))) {
            let at = j * width + i;
            if target.xi(i, j)[0] > 3.5 {
                (target.a.data_mut()[at], target.d.data_mut()[at]) = (0.0, 1e9);
            }
        }
        assert!((target.centroid()[0] + 1.5).abs() < 1e-9);
        assert!(target.expected_centroid()[0].abs() < 1e-4);
        // Once those are determined as well, they count as they are.
        target.d = target.d.map(|_| 1e9);
        assert!((target.expected_centroid()[0] + 1.5).abs() < 1e-4);
    }

    #[test]
    fn the_support_begins_as_the_box_with_its_area() {
        let frame = Frame::from_fn(60, 50, |x, y| (x + 2 * y) as f64);
        let bounds = TargetBox::about([30.25, 20.5], 13.0, 9.5);
        let target = Target::new(&frame, bounds, 144.0);
        assert!((target.a.data().iter().sum::<f64>() - 13.0 * 9.5).abs() < 1e-9);
        assert_eq!(target.centroid(), [0.0, 0.0]);
        let middle = (target.a.width() / 2, target.a.height() / 2);
        assert!((target.t.get(middle.0, middle.1) - (30.25 + 41.0)).abs() < 1e-9);
        let near = target.near();
        assert!(near.get(middle.0, middle.1) && !near.get(0, 0));
        let background = Background::new(&frame, bounds);
        assert!(
            !background.is_known([30.0, 20.0])
                && background.is_known([45.0, 20.0])
                && background.is_known([-3.0, 90.0])
        );
        // A continuation from all sides, of a ramp of 32 grey levels across the box.
        assert!((background.picture.get(30, 20) - 70.0).abs() < 6.0);
    }
}
