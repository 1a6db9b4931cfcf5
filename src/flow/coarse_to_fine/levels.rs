//! The frames on every level of the pyramid, ready to be warped.

use super::data::View;
use super::options::LEAST_SIDE;
use super::run::Range;
use crate::image::{Spline, fill_holes, halve, halve_mask};
use crate::simd::{Level, SimdReal};
use crate::types::{Frame, Mask};

/// How far an unusable sample reaches into the jets of warped frames, px: half the taps of the spline and of the stencils.
const REACH: usize = 3;

/// The frames of one level.
#[derive(Debug)]
pub(super) struct PyramidLevel<T> {
    pub size: (usize, usize),
    /// One a frame.
    pub splines: Vec<Spline<T>>,
    /// Pixels whose neighbourhood is usable, one a frame; `None`: all.
    pub usable: Vec<Option<Mask>>,
}

impl<T: SimdReal> PyramidLevel<T> {
    fn new(simd: Level, frames: &[Frame<T>], masks: &[Option<Mask>]) -> Self {
        Self {
            size: frames[0].size(),
            splines: frames.iter().map(|frame| Spline::new(simd, frame)).collect(),
            usable: masks.iter().map(|mask| mask.as_ref().map(|m| shrunk(m, REACH))).collect(),
        }
    }

    /// The two or three frames as the data term sees them.
    pub fn views(&self) -> Vec<View<'_, T>> {
        let usable = |k: usize| self.usable[k].as_ref();
        match self.splines.as_slice() {
            [a, b] => View::pair([a, b], [usable(0), usable(1)]).to_vec(),
            [a, b, c, ..] => View::triple([a, b, c], [usable(0), usable(1), usable(2)]).to_vec(),
            _ => Vec::new(),
        }
    }
}

/// The pyramid of `frames`, brought to a common `range`, the finest level first: at most `most` levels, none below [`LEAST_SIDE`] px.
pub(super) fn pyramid<T: SimdReal>(
    simd: Level,
    frames: &[&Frame<T>],
    range: Range,
    mask: Option<&Mask>,
    most: Option<usize>,
) -> Vec<PyramidLevel<T>> {
    let mut masks: Vec<Option<Mask>> = frames.iter().map(|frame| holes(frame, range, mask)).collect();
    let mut frames: Vec<Frame<T>> = frames
        .iter()
        .zip(&masks)
        .map(|(frame, usable)| {
            let (mean, gain) = (T::from_f64(range.mean), T::from_f64(range.gain));
            let scaled = frame.map(|&value| (value - mean) * gain);
            match usable {
                Some(usable) => fill_holes(&scaled, Some(usable)).into_owned(),
                None => scaled,
            }
        })
        .collect();
    let mut levels = vec![PyramidLevel::new(simd, &frames, &masks)];
    while most.is_none_or(|most| levels.len() < most) {
        let (width, height) = frames[0].size();
        if width.min(height).div_ceil(2) < LEAST_SIDE {
            break;
        }
        frames = frames.iter().map(|frame| halve(simd, frame)).collect();
        masks = masks.iter().map(|mask| mask.as_ref().map(halve_mask)).collect();
        levels.push(PyramidLevel::new(simd, &frames, &masks));
    }
    levels
}

/// The usable pixels, if some are not.
fn holes<T: SimdReal>(frame: &Frame<T>, range: Range, mask: Option<&Mask>) -> Option<Mask> {
    if mask.is_none() && frame.data().iter().all(|value| range.holds(value.to_f64())) {
        return None;
    }
    let usable = Frame::from_fn(frame.width(), frame.height(), |x, y| {
        range.holds(frame.get(x, y).to_f64()) && mask.is_none_or(|mask| mask.get(x, y))
    });
    usable.data().contains(&false).then_some(usable)
}

/// The pixels of a mask that are `reach` px (in rows and columns) away from every unusable one.
fn shrunk(mask: &Mask, reach: usize) -> Mask {
    let (width, height) = mask.size();
    let along = Frame::from_fn(width, height, |x, y| {
        (x.saturating_sub(reach)..(x + reach + 1).min(width)).all(|x| mask.get(x, y))
    });
    Frame::from_fn(width, height, |x, y| {
        (y.saturating_sub(reach)..(y + reach + 1).min(height)).all(|y| along.get(x, y))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const AS_IT_IS: Range = Range { mean: 0.0, gain: 1.0, contrast: 1.0 };

    #[test]
    fn levels_halve_down_to_the_least_side() {
        let frame = Frame::<f32>::from_fn(100, 50, |x, y| ((x * y) as f32).sin());
        let sizes = |most| {
            pyramid(Level::SCALAR, &[&frame, &frame], AS_IT_IS, None, most).iter().map(|l| l.size).collect::<Vec<_>>()
        };
        assert_eq!(sizes(None), [(100, 50), (50, 25), (25, 13)]);
        assert_eq!(sizes(Some(2)), [(100, 50), (50, 25)]);
        let tiny = Frame::<f32>::filled(3, 3, 1.0);
        assert_eq!(pyramid(Level::SCALAR, &[&tiny, &tiny], AS_IT_IS, None, None).len(), 1);
    }

    #[test]
    fn holes_reach_as_far_as_the_stencils() {
        let mut frame = Frame::<f32>::filled(20, 16, 1.0);
        frame.row_mut(8)[10] = f32::NAN;
        let levels = pyramid(Level::SCALAR, &[&frame], AS_IT_IS, None, Some(1));
        let usable = levels[0].usable[0].as_ref().unwrap();
        let lost = usable.data().iter().filter(|&&u| !u).count();
        assert_eq!(lost, (2 * REACH + 1) * (2 * REACH + 1));
        assert!(!usable.get(10 - REACH, 8) && usable.get(10 - REACH - 1, 8));
        assert!(
            pyramid(Level::SCALAR, &[&Frame::<f32>::filled(9, 9, 1.0)], AS_IT_IS, None, None)[0].usable[0].is_none()
        );
    }
}
