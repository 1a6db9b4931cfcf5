//! Frames on every level of the pyramid, ready to be warped.

use super::{brightness_scale::BrightnessScale, data_term::View, options::MIN_LEVEL_SIDE};
use crate::image::{Spline, fill_holes, halve_into, halve_mask};
use crate::parallel;
use crate::simd::{Level, SimdReal};
use crate::types::{Frame, Mask};

const CHUNK: usize = 1 << 16;

/// Distance, px, over which an unusable sample affects jets: half the taps of spline and stencils.
const HOLE_REACH: usize = 3;
/// Minimum usable pixels of the 49 within [`HOLE_REACH`]: allows a straight edge or dead pixels.
const MIN_USABLE_OF_49: usize = 40;
/// Minimum usable pixels of nine, on levels that only hand motion down: keeps small areas.
const MIN_USABLE_OF_9: usize = 6;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ComparedFrames {
    /// All, warped towards the middle of their times.
    All,
    /// The middle frame of a triple and the next.
    Ahead,
}

/// The frames on one level.
#[derive(Debug, Default)]
pub(super) struct PyramidLevel<T> {
    pub size: (usize, usize),
    /// One a frame; unspecified on levels finer than the finest estimated one.
    pub splines: Vec<Spline<T>>,
    /// Pixels with usable neighbourhoods, one mask a frame; `None`: all.
    pub usable: Vec<Option<Mask>>,
    /// The frame from which the next level is made.
    picture: Frame<T>,
}

impl<T: SimdReal> PyramidLevel<T> {
    /// Two or three frames as input of the data term.
    pub fn views(&self, compared: ComparedFrames) -> Vec<View<'_, T>> {
        self.views_of(&self.splines, compared)
    }

    /// The frame whose pixels the motion belongs to and the next; for `central` motion of a triple, the
    /// frames on either side.
    pub fn views_at_reference(&self, central: bool) -> Vec<View<'_, T>> {
        let (before, after) = match self.splines.len() {
            2 => (0, 1),
            _ if central => (0, 2),
            _ => (1, 2),
        };
        let (splines, usable) = (&self.splines, |k: usize| self.usable[k].as_ref());
        let (splines, usable) = ([&splines[before], &splines[after]], [usable(before), usable(after)]);
        if after - before == 2 { View::around(splines, usable).to_vec() } else { View::ahead(splines, usable).to_vec() }
    }

    /// As [`PyramidLevel::views`], of other splines of the frames.
    pub fn views_of<'a>(&'a self, splines: &'a [Spline<T>], compared: ComparedFrames) -> Vec<View<'a, T>> {
        let usable = |k: usize| self.usable[k].as_ref();
        match (splines, compared) {
            ([_, b, c, ..], ComparedFrames::Ahead) => View::ahead([b, c], [usable(1), usable(2)]).to_vec(),
            ([a, b], _) => View::pair([a, b], [usable(0), usable(1)]).to_vec(),
            ([a, b, c, ..], _) => View::triple([a, b, c], [usable(0), usable(1), usable(2)]).to_vec(),
            _ => Vec::new(),
        }
    }
}

/// Levels of the frames, the finest first. Keeps its memory between calls.
#[derive(Debug, Default)]
pub(super) struct Pyramid<T> {
    levels: Vec<PyramidLevel<T>>,
    count: usize,
}

impl<T: SimdReal> Pyramid<T> {
    pub fn levels(&self) -> &[PyramidLevel<T>] {
        &self.levels[..self.count]
    }

    /// Approximate capacity, samples.
    pub fn samples(&self) -> usize {
        self.levels.iter().map(|level| (1 + level.splines.len()) * level.size.0 * level.size.1).sum()
    }

    /// Builds at most `max_levels` levels of `frames` (of one size), none below
    /// [`MIN_LEVEL_SIDE`](super::MIN_LEVEL_SIDE) px. Returns the finest level that can be warped:
    /// `finest`, or the coarsest there is.
    pub fn fill(
        &mut self,
        simd: Level,
        frames: &[&Frame<T>],
        brightness: BrightnessScale,
        mask: Option<&Mask>,
        (max_levels, finest): (Option<usize>, usize),
    ) -> usize {
        let size = frames.first().map_or((0, 0), |frame| frame.size());
        self.count = count(size, max_levels);
        let finest = finest.min(self.count - 1);
        self.levels.resize_with(self.levels.len().max(self.count), PyramidLevel::default);
        for level in &mut self.levels {
            level.splines.resize_with(frames.len(), Spline::default);
            level.usable.clear();
        }
        // One frame after the other, so that each level holds one picture at a time.
        for (n, frame) in frames.iter().enumerate() {
            let mut mask = holes(frame, brightness, mask);
            for k in 0..self.count {
                let (before, rest) = self.levels.split_at_mut(k);
                let level = &mut rest[0];
                if let Some(finer) = before.last() {
                    halve_into(simd, &finer.picture, &mut level.picture);
                    mask = mask.as_ref().map(halve_mask);
                } else {
                    scale(frame, brightness, &mut level.picture);
                    if mask.is_some() {
                        level.picture = fill_holes(&level.picture, mask.as_ref()).into_owned();
                    }
                }
                level.size = level.picture.size();
                level.usable.push(mask.as_ref().map(|mask| usable_around(mask, k > finest)));
                if k >= finest {
                    level.splines[n].refill(simd, &level.picture);
                }
            }
        }
        finest
    }
}

fn count(size: (usize, usize), max_levels: Option<usize>) -> usize {
    let (mut side, mut count) = (size.0.min(size.1), 1);
    while max_levels.is_none_or(|max_levels| count < max_levels) && side.div_ceil(2) >= MIN_LEVEL_SIDE {
        (side, count) = (side.div_ceil(2), count + 1);
    }
    count
}

fn scale<T: SimdReal>(from: &Frame<T>, brightness: BrightnessScale, to: &mut Frame<T>) {
    if to.size() != from.size() {
        *to = Frame::filled(from.width(), from.height(), T::from_f64(0.0));
    }
    let (mean, gain) = (T::from_f64(brightness.mean), T::from_f64(brightness.gain));
    parallel::for_each(to.data_mut().chunks_mut(CHUNK).zip(from.data().chunks(CHUNK)), |(to, from)| {
        for (to, &value) in to.iter_mut().zip(from) {
            *to = (value - mean) * gain;
        }
    });
}

/// The usable pixels, if some are not.
fn holes<T: SimdReal>(frame: &Frame<T>, brightness: BrightnessScale, mask: Option<&Mask>) -> Option<Mask> {
    // Without a short circuit within a task, so that the compiler uses lanes.
    let all_hold = |part: &[T]| part.iter().fold(true, |so_far, value| so_far & brightness.holds(value.to_f64()));
    if mask.is_none() && parallel::map(frame.data().chunks(CHUNK), all_hold).into_iter().all(|all_hold| all_hold) {
        return None;
    }
    let usable = Frame::from_fn(frame.width(), frame.height(), |x, y| {
        brightness.holds(frame.get(x, y).to_f64()) && mask.is_none_or(|mask| mask.get(x, y))
    });
    usable.data().contains(&false).then_some(usable)
}

/// Pixels with enough usable ones around them that the filling of holes counts little: most of the 3 x 3 and,
/// unless the level is coarse, most of the pixels that splines and stencils read.
fn usable_around(mask: &Mask, is_coarse: bool) -> Mask {
    let near = usable_counts(mask, 1);
    if is_coarse {
        return near.map(|&count| count >= MIN_USABLE_OF_9);
    }
    let wide = usable_counts(mask, HOLE_REACH);
    Frame::from_fn(mask.width(), mask.height(), |x, y| {
        near.get(x, y) >= MIN_USABLE_OF_9 && wide.get(x, y) >= MIN_USABLE_OF_49
    })
}

/// Number of usable pixels in the square of `reach` px around each, the border replicated.
fn usable_counts(mask: &Mask, reach: usize) -> Frame<usize> {
    let (width, height) = mask.size();
    let around = |at: usize, len: usize| (0..=2 * reach).map(move |k| (at + k).saturating_sub(reach).min(len - 1));
    let along = Frame::from_fn(width, height, |x, y| around(x, width).filter(|&x| mask.get(x, y)).count());
    Frame::from_fn(width, height, |x, y| around(y, height).map(|y| along.get(x, y)).sum())
}
