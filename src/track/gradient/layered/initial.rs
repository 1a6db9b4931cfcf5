//! Initial segmentation: separates the target from an object at rest in front of it in the first box.
//!
//! A box that holds both makes a template of both, and the still edge between them holds the target back. The
//! first frame is therefore kept, and the displacement since then is found that explains the changes: the
//! displaced box shows the first box moved along, or the scene as it was.

use super::{layers::Target, layers::holds, patch::Bounds, patch::Patch, patch::bounds_about};
use crate::track::gradient::shift::half_a_pixel_around;
use crate::types::{Frame, TargetBox};

/// Frames that are waited for the target to move.
const MAX_FRAMES: usize = 12;
/// Farthest displacement from the first frame, px.
const MAX_DISPLACEMENT: isize = 20;
/// Farthest displacement from where it is expected, px: in the first step, and later.
const REACH: [isize; 2] = [10, 5];
/// Change over the standard deviation of a difference that noise does not make.
const CHANGE: f64 = 3.0;
/// Difference that all larger ones count as, grey levels.
const MAX_CHANGE: f64 = 40.0;
/// Of the displacements that explain the frames nearly as well as the best the smallest is taken: worse by
/// this share, or by this share of a strip a pixel wide along the shorter side.
const NEARLY: [f64; 2] = [0.05, 0.25];
/// Share of the change that may be left.
const MAX_CHANGE_LEFT: f64 = 0.5;
/// Difference of displacements that whole pixels, and what is behind the target, may make, px.
pub(super) const WHOLE_PIXEL_TOLERANCE: f64 = 2.0;
/// Pixels that judge a displacement, about.
const VOTES: f64 = 1024.0;

#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct InitialSegmentation {
    pub bounds: TargetBox,
    pub target: Target,
    pub first: Patch,
    cut: Bounds,
    /// Least and greatest brightness within half a pixel.
    between: Frame<[f64; 2]>,
    /// Pixels in the box.
    pub inside: Frame<bool>,
    frames: usize,
    moved: [isize; 2],
    /// Frames at which that was found.
    told: usize,
}

impl InitialSegmentation {
    pub fn new(frame: &Frame<f64>, bounds: TargetBox, target: Target) -> Self {
        let reach = [bounds.width, bounds.height].map(|side| side / 2.0 + MAX_DISPLACEMENT as f64 + 2.0);
        let cut = bounds_about(bounds.centre(), reach, frame.size());
        let first = Patch::cut(frame, cut);
        let ((width, height), [x0, y0]) = (first.frame.size(), first.corner);
        let inside = Frame::from_fn(width, height, |x, y| holds(&bounds, x + x0, y + y0));
        let between = half_a_pixel_around(&first.frame);
        Self { bounds, target, first, cut, between, inside, frames: 0, moved: [0; 2], told: 0 }
    }

    /// Whether nothing more is waited for.
    pub fn is_over(&self) -> bool {
        self.frames >= MAX_FRAMES || self.moved.iter().any(|moved| moved.abs() >= MAX_DISPLACEMENT)
    }

    /// A frame beside the first.
    pub fn changes(&self, frame: &Frame<f64>, noise: f64) -> Changes<'_> {
        let now = Patch::cut(frame, self.cut).frame;
        Changes { segmentation: self, now, bar: CHANGE * noise * std::f64::consts::SQRT_2 }
    }

    /// Counts a frame, looked at or not.
    pub fn advance(&mut self) {
        self.frames += 1;
    }

    /// Keeps the displacement found in the last frame.
    pub fn keep_displacement(&mut self, moved: [isize; 2]) {
        (self.moved, self.told) = (moved, self.frames);
    }

    /// Frames since the first.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Displacement of all that moved since the first frame, px; `None` if the last frame does not show it.
    pub fn moved(&self) -> Option<[f64; 2]> {
        (self.told == self.frames && self.frames > 0).then(|| self.moved.map(|moved| moved as f64))
    }

    /// Shorter side of the box, px.
    pub fn side(&self) -> f64 {
        self.bounds.width.min(self.bounds.height)
    }
}

/// A later frame beside the first.
pub(super) struct Changes<'a> {
    pub segmentation: &'a InitialSegmentation,
    pub now: Frame<f64>,
    /// Largest change that noise makes, grey levels.
    pub bar: f64,
}

impl Changes<'_> {
    /// Pixels in the box, every so many along both axes.
    pub fn inside(&self, every: usize) -> impl Iterator<Item = [usize; 2]> {
        let (width, height) = self.now.size();
        let all = (0..height).step_by(every).flat_map(move |y| (0..width).step_by(every).map(move |x| [x, y]));
        all.filter(|[x, y]| self.segmentation.inside.get(*x, *y))
    }

    /// A pixel of the patch moved on; `None` beyond the patch.
    pub fn on(&self, [x, y]: [usize; 2], [dx, dy]: [isize; 2]) -> Option<[usize; 2]> {
        let (i, j) = (x as isize + dx, y as isize + dy);
        let (width, height) = self.now.size();
        let inside = i >= 0 && j >= 0 && i < width as isize && j < height as isize;
        inside.then_some([i as usize, j as usize])
    }

    /// Change at a pixel, grey levels.
    pub fn at_rest(&self, [x, y]: [usize; 2]) -> f64 {
        (self.now.get(x, y) - self.segmentation.first.frame.get(x, y)).abs()
    }

    /// Change from what was at one pixel to what is at another, but for what fractions of a pixel make, grey
    /// levels.
    pub fn along(&self, from: [usize; 2], to: [usize; 2]) -> f64 {
        beyond(self.segmentation.between.get(from[0], from[1]), self.now.get(to[0], to[1]))
    }

    fn excess(&self, change: f64) -> f64 {
        (change - self.bar).clamp(0.0, MAX_CHANGE)
    }

    /// The smallest displacement of the box that explains nearly as much as any; `None` where nothing moves,
    /// or not as a whole.
    pub fn displacement(&self) -> Option<[isize; 2]> {
        let InitialSegmentation { inside, frames, moved, .. } = self.segmentation;
        let (now, before) = (*frames as isize, *frames as isize - 1);
        let (middle, reach) =
            if before == 0 { ([0; 2], REACH[0]) } else { (moved.map(|m| m * now / before), REACH[1]) };
        let beside = self.beside();
        let area = inside.data().iter().filter(|inside| **inside).count();
        let every = (area as f64 / VOTES).sqrt().ceil().max(1.0) as usize;
        let voting: Vec<_> = self.inside(every).map(|at| (at, self.segmentation.between.get(at[0], at[1]))).collect();
        let rests = self.rests();
        let cost = |d: [isize; 2]| beside + (every * every) as f64 * self.within(d, &voting, &rests);
        let rest = cost([0; 2]);
        let all: Vec<_> = (-reach..=reach)
            .flat_map(|dy| (-reach..=reach).map(move |dx| [middle[0] + dx, middle[1] + dy]))
            .map(|d| (cost(d), d))
            .collect();
        let best = all.iter().map(|(cost, _)| *cost).fold(f64::INFINITY, f64::min);
        let bar = best + NEARLY[0] * best + NEARLY[1] * self.contrast() * self.segmentation.side();
        if rest <= bar || best > MAX_CHANGE_LEFT * rest {
            return None;
        }
        let nearly = all.into_iter().filter(|(cost, _)| *cost <= bar);
        nearly.min_by_key(|(_, d)| d[0] * d[0] + d[1] * d[1]).map(|(_, d)| d)
    }

    /// Change beside the box, grey levels.
    fn beside(&self) -> f64 {
        let pixels =
            self.now.data().iter().zip(self.segmentation.first.frame.data()).zip(self.segmentation.inside.data());
        pixels.filter(|(_, inside)| !**inside).map(|((now, first), _)| self.excess((now - first).abs())).sum()
    }

    /// Change at every pixel of the patch beyond the noise, grey levels, and its part beside the box.
    fn rests(&self) -> Frame<[f64; 2]> {
        let (width, height) = self.now.size();
        Frame::from_fn(width, height, |x, y| {
            let rest = self.excess(self.at_rest([x, y]));
            [rest, if self.segmentation.inside.get(x, y) { 0.0 } else { rest }]
        })
    }

    /// Sum of changes left if the box moved by `d`; `voting`: pixels of the box with their range.
    fn within(&self, d: [isize; 2], voting: &[([usize; 2], [f64; 2])], rests: &Frame<[f64; 2]>) -> f64 {
        let left = |&(from, between): &([usize; 2], [f64; 2])| {
            let Some([x, y]) = self.on(from, d) else { return 0.0 };
            let [rest, beside] = rests.get(x, y);
            rest.min(self.excess(beyond(between, self.now.get(x, y)))) - beside
        };
        voting.iter().map(left).sum()
    }

    /// Mean of the changes that noise does not make, grey levels.
    fn contrast(&self) -> f64 {
        let pixels = self.now.data().iter().zip(self.segmentation.first.frame.data());
        let changes = pixels.map(|(now, first)| self.excess((now - first).abs())).filter(|change| *change > 0.0);
        let (sum, count) = changes.fold((0.0, 0.0), |(sum, count), change| (sum + change, count + 1.0));
        if count > 0.0 { sum / count } else { MAX_CHANGE }
    }
}

fn beyond([low, high]: [f64; 2], value: f64) -> f64 {
    (low - value).max(value - high).max(0.0)
}
