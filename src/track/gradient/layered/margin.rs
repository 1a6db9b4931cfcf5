//! What of the first box is only background: points at its rim that never differ from what is behind them,
//! wherever the target goes.
//!
//! Before an even background nothing else tells a box that is too large: what lies between its rim and the
//! target looks the same whether it is taken along or stays. Least squares leave the support there as the box
//! has it; the simpler explanation is that it is not the target's. Points inside the target that happen to
//! look like what is behind them are not at the rim, and stay.

use super::layers::{Target, wide};
use super::level::dilated;
use super::look::View;
use crate::types::Frame;

/// Difference from what is behind over the noise, root mean square over the frames, up to which a point never
/// differed: together with those around it, and alone beside such, where those around are the target's.
const ALIKE: [f64; 2] = [2.0, 3.0];
/// Fewest frames in which what is behind a point was known.
const FRAMES: f64 = 3.0;
/// Least part of the box that must differ: of a target that is hardly seen anything might be taken for
/// background.
const REST: f64 = 0.25;

/// How far points differ from what is behind them.
#[derive(Debug, Clone)]
pub(super) struct Margin {
    /// Brightness in the first frame: what is learnt at a doubtful point is that of its neighbours.
    first: Frame<f64>,
    /// Sums of squared differences, grey^2, and of frames.
    sums: Frame<[f64; 2]>,
}

impl Margin {
    /// Nothing is known yet but how bright the points are in the first frame.
    pub fn new(first: Frame<f64>) -> Self {
        Self { sums: first.map(|_| [0.0; 2]), first }
    }

    /// What a frame says, as bright as the first one times a `gain`.
    fn add(&mut self, view: &View, gain: f64) {
        for ((sums, t), behind) in self.sums.data_mut().iter_mut().zip(self.first.data()).zip(&view.behind) {
            if !behind.is_nan() {
                *sums = [sums[0] + (gain * t - behind).powi(2), sums[1] + 1.0];
            }
        }
    }

    /// Whether what is behind every point of the box was known for long enough.
    fn is_known(&self, prior: &Frame<f64>) -> bool {
        self.sums.data().iter().zip(prior.data()).all(|(sums, a)| *a == 0.0 || sums[1] >= FRAMES)
    }

    /// Whether points within `reach` of one never differed.
    fn is_alike(&self, [i, j]: [usize; 2], reach: usize, most: f64) -> bool {
        let (width, height) = self.sums.size();
        let around = wide(j, reach, height).flat_map(|j| &self.sums.row(j)[wide(i, reach, width)]);
        let [sum, count] = around.fold([0.0; 2], |all, sums| [all[0] + sums[0], all[1] + sums[1]]);
        count > 0.0 && sum < most * most * count
    }

    /// Points of the box that never differed and are connected to what is outside by such.
    fn rim(&self, prior: &Frame<f64>, noise: f64) -> Frame<bool> {
        let (width, height) = prior.size();
        let mut rim = prior.map(|a| *a == 0.0);
        let mut next: Vec<_> =
            (0..height).flat_map(|j| (0..width).map(move |i| (i, j))).filter(|(i, j)| rim.get(*i, *j)).collect();
        while let Some((i, j)) = next.pop() {
            for (i, j) in wide(i, 1, width).map(|k| (k, j)).chain(wide(j, 1, height).map(|k| (i, k))) {
                if !rim.get(i, j) && self.is_alike([i, j], 1, ALIKE[0] * noise) {
                    rim.row_mut(j)[i] = true;
                    next.push((i, j));
                }
            }
        }
        let beside = dilated(&rim, 1);
        let alone = |i, j| beside.get(i, j) && self.is_alike([i, j], 0, ALIKE[1] * noise);
        // What is learnt outside the box stays.
        Frame::from_fn(width, height, |i, j| prior.get(i, j) > 0.0 && (rim.get(i, j) || alone(i, j)))
    }
}

impl Target {
    /// Takes points at the rim of the first box from the support that never differ from what is behind them,
    /// once that was known behind all of the box; `gain` is the brightness over that in the first frame.
    pub fn learn_margin(&mut self, view: &View, gain: f64, noise: f64) {
        let Some(mut margin) = self.margin.take() else { return };
        margin.add(view, gain);
        if !margin.is_known(&self.prior) {
            self.margin = Some(margin);
            return;
        }
        let rim = margin.rim(&self.prior, noise);
        let area = |rim: Option<&Frame<bool>>| {
            let points = self.prior.data().iter().enumerate();
            points.filter(|(at, _)| !rim.is_some_and(|rim| rim.data()[*at])).map(|(_, a)| a).sum::<f64>()
        };
        if area(Some(&rim)) < REST * area(None) {
            return;
        }
        for at in rim.data().iter().enumerate().filter(|(_, rim)| **rim).map(|(at, _)| at) {
            (self.prior.data_mut()[at], self.n.data_mut()[at], self.a.data_mut()[at]) = (0.0, 0.0, 0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::gradient::layered::learn::PRIOR;
    use crate::types::TargetBox;

    /// The target of a box of 17 px about a square of 9 px with a hole, before an even background, and what
    /// is seen of both where only the background is known.
    fn even(bright: f64) -> (Target, View) {
        let shape = |x: usize, y: usize| {
            let ring = |low, high| (low..high).contains(&x) && (low..high).contains(&y);
            if ring(26, 35) && !ring(29, 32) { bright } else { 90.0 }
        };
        let frame = Frame::from_fn(61, 61, shape);
        let target = Target::new(&frame, TargetBox::about([30.0; 2], 17.0, 17.0), PRIOR);
        let seen = target.t.data().to_vec();
        let behind = vec![90.0; seen.len()];
        (target, View { seen, guess: behind.clone(), behind })
    }

    #[test]
    fn a_rim_that_is_like_the_background_is_given_up_and_a_hole_is_not() {
        let (mut target, view) = even(200.0);
        for _ in 0..FRAMES as usize {
            assert!((target.a.data().iter().sum::<f64>() - 289.0).abs() < 1e-9);
            target.learn_margin(&view, 1.0, 1.5);
        }
        assert!((target.a.data().iter().sum::<f64>() - 81.0).abs() < 1e-9 && target.margin.is_none());
    }

    #[test]
    fn a_target_that_is_hardly_seen_and_one_whose_background_is_unknown_are_left_alone() {
        let (mut target, view) = even(91.0);
        let (mut other, seen) = even(200.0);
        let unknown = View { behind: vec![f64::NAN; seen.seen.len()], ..seen };
        for _ in 0..9 {
            target.learn_margin(&view, 1.0, 1.5);
            other.learn_margin(&unknown, 1.0, 1.5);
        }
        assert!(target.a == target.prior && other.a == other.prior && other.margin.is_some());
        assert!((target.a.data().iter().sum::<f64>() - 289.0).abs() < 1e-9);
    }
}
