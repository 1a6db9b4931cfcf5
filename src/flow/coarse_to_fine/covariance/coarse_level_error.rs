//! What motion keeps of the errors of coarser levels: finer ones correct them only where they see something.
//!
//! A coarse level sees further into an area without texture than a fine one, and is less exact. How exact it
//! is, the places with texture tell, where the refined motion is known to be better: the mean squares of its
//! differences from what a level found are the variances of what was handed down from there. They are taken
//! from mean absolute values, as of Gaussian errors, so that the few places at motion boundaries do not tell
//! for all others.
//!
//! The windows of refinement carry such errors a little way out of those areas, and where they grow, the
//! slopes err by their rise.

use super::binomial_mean;
use super::constrained_directions::ConstrainedDirections;
use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::coarse_to_fine::refine::{PITCH, SPACING};
use crate::simd::SimdReal;
use std::f64::consts::FRAC_PI_2;

/// How far a level sees into what has no texture, px of the level: its stencils and the windows of its data.
const LEVEL_REACH: f64 = 4.0;
/// Variance of the slopes over the mean square of the rise of the flow's deviation: errors are not as steep
/// everywhere as at their steepest.
const RISE_SHARE: f64 = 0.35;

/// What a place has of the errors of coarser levels.
pub(super) struct CoarseLevelError {
    /// Of the flow, px^2, and of the slopes, in the directions that are not led.
    pub variances: [f64; 2],
    /// The matrix `xx, xy, yy` that leaves of motion what is in those.
    pub directions: [f64; 3],
}

/// Variances of what was found on coarser levels.
pub(super) struct CoarseLevelErrors {
    /// Of the flow, px^2 of the finest level worked on, and of the slopes; the next coarser level first.
    variances: Vec<[f64; 2]>,
    constrained: ConstrainedDirections,
}

impl CoarseLevelErrors {
    /// From the refined `motion`, that on the levels `above` it, the finest first, and where data lead.
    pub fn new<T: SimdReal>(motion: &Planes<T>, coarser: &[Planes<T>], constrained: ConstrainedDirections) -> Self {
        let mut variances: Vec<[f64; 2]> = Vec::new();
        for (k, coarse) in coarser.iter().enumerate() {
            let mut found = differences(motion, (coarse, k + 1), &constrained).unwrap_or_default();
            if let Some(finer) = variances.last() {
                // The farther, the less is known.
                found = [0, 1].map(|kind| found[kind].max(finer[kind]));
            }
            variances.push(found);
        }
        Self { variances, constrained }
    }

    /// What every place inherits, row by row.
    pub fn at_nodes(&self, size: (usize, usize)) -> Vec<CoarseLevelError> {
        let distances = (0..size.0 * size.1).map(|n| self.constrained.distance(n % size.0, n / size.0));
        let own: Vec<[f64; 2]> =
            distances.map(|distance| [0, 1].map(|kind| self.variance(kind, distance).sqrt())).collect();
        let mut carried = own.clone();
        binomial_mean(&mut carried, size);
        let deviations = |n: usize| [0, 1].map(|kind| f64::max(own[n][kind], carried[n][kind]));
        let flow: Vec<f64> = (0..own.len()).map(|n| deviations(n)[0]).collect();
        let directions = self.directions(&own, size);
        let with_rise = |n: usize| {
            let [flow_deviation, slope_deviation] = deviations(n);
            let slopes = slope_deviation.powi(2) + RISE_SHARE * squared_rise(&flow, size, n);
            CoarseLevelError { variances: [flow_deviation.powi(2), slopes], directions: directions[n] }
        };
        (0..own.len()).map(with_rise).collect()
    }

    /// In which directions places inherit: in those that are not led there, and where all is led as their
    /// neighbours, whose deviations are `own`, as far as errors are carried and rise.
    fn directions(&self, own: &[[f64; 2]], size: (usize, usize)) -> Vec<[f64; 3]> {
        let mut around: Vec<[f64; 4]> = (0..own.len())
            .map(|n| {
                let [a, b, c] = self.constrained.directions(n).map(|entry| own[n][0] * entry);
                [a, b, c, own[n][0]]
            })
            .collect();
        binomial_mean(&mut around, size);
        binomial_mean(&mut around, size);
        let mean = |n: usize| match around[n] {
            _ if own[n][0] > 0.0 => self.constrained.directions(n),
            [a, b, c, sum] if sum > 0.0 => [a / sum, b / sum, c / sum],
            _ => [1.0, 0.0, 1.0],
        };
        (0..own.len()).map(mean).collect()
    }

    /// Of the flow (`kind` 0) or the slopes (1), so far from where data lead, px: all that a level left from
    /// where on the next finer one sees nothing, linear between levels, nothing below half the reach of the
    /// finest.
    fn variance(&self, kind: usize, distance: f64) -> f64 {
        if distance.is_infinite() {
            return self.unverified(kind);
        }
        let pixels = distance / LEVEL_REACH;
        let (mut from, mut below) = (0.5, 0.0);
        for variances in &self.variances {
            let to = 2.0 * from;
            let most = variances[kind];
            if pixels < to {
                return below + (most - below) * ((pixels - from) / (to - from)).max(0.0);
            }
            (from, below) = (to, most);
        }
        // Nothing saw further; what was never corrected grows with the distance.
        below * (pixels / from).powi(2)
    }

    /// Where nothing tells how exact the levels are: the motions that the coarsest of them tells apart, a
    /// pixel of it within its reach.
    fn unverified(&self, kind: usize) -> f64 {
        if kind == 0 { 4f64.powi(self.variances.len() as i32) } else { LEVEL_REACH.powi(-2) }
    }
}

/// Of the motion found so many levels above: the flow's and the slopes' mean square difference at those of
/// its sites that data lead, on lines through the places; if there are any.
fn differences<T: SimdReal>(
    motion: &Planes<T>,
    (coarse, coarser): (&Planes<T>, usize),
    constrained: &ConstrainedDirections,
) -> Option<[f64; 2]> {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    let step = (1 << coarser).max(SPACING);
    let every = |len: usize| (0..len).step_by(step);
    for (x, y) in every(motion.height).flat_map(|y| every(motion.width).map(move |x| (x, y))) {
        if !constrained.is_reference(x, y) {
            continue;
        }
        for k in 0..MOTION {
            let scale = if k < 2 { f64::from(1u32 << coarser) } else { 1.0 };
            let there = scale * coarse.line(k, y >> coarser)[x >> coarser].to_f64();
            sums[usize::from(k >= 2)] += (motion.line(k, y)[x].to_f64() - there).abs();
        }
        count += 1.0;
    }
    (count > 0.0).then(|| [sums[0] / 2.0, sums[1] / 4.0].map(|sum| FRAC_PI_2 * (sum / count).powi(2)))
}

/// The mean square of how steeply values rise or fall next to a place, per px: along each axis that of both
/// sides.
fn squared_rise(values: &[f64], (width, height): (usize, usize), n: usize) -> f64 {
    let (x, y) = (n % width, n / width);
    let both = |before: Option<usize>, after: Option<usize>| {
        let rise =
            |to: Option<usize>| to.map_or(0.0, |to| ((values[to] - values[n]) / (PITCH * SPACING as f64)).powi(2));
        0.5 * (rise(before) + rise(after))
    };
    let along = both((x > 0).then(|| n - 1), (x + 1 < width).then_some(n + 1));
    let across = both((y > 0).then(|| n - width), (y + 1 < height).then_some(n + width));
    along + across
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flow::coarse_to_fine::covariance::noise::{ALL, NONE, UnconstrainedDirections};

    /// SamplingGrid led but for a square of them, all seen; and how many places there are along a side.
    fn but_for(side: usize, square: std::ops::Range<usize>) -> (ConstrainedDirections, usize) {
        let constrained = |n: usize| !(square.contains(&(n % side)) && square.contains(&(n / side)));
        let sites: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if constrained(n) { NONE } else { ALL }).collect();
        let places = side.div_ceil(SPACING);
        (ConstrainedDirections::with((side, &sites), (places, places), |_| true), places)
    }

    /// Motion of so many sites whose flow and slopes all are these.
    fn constant(side: usize, flow: f64, slope: f64) -> Planes<f64> {
        let mut motion = Planes::new(side, side, MOTION);
        for (k, y) in (0..MOTION).flat_map(|k| (0..side).map(move |y| (k, y))) {
            motion.line_mut(k, y).fill(if k < 2 { flow } else { slope });
        }
        motion
    }

    #[test]
    fn areas_without_texture_have_the_errors_of_the_levels_that_see_into_them() {
        let side = 97;
        let (constrained, places) = but_for(side, 24..73);
        // Off by .1 and .5 px of the finest level, and by .01 and .02 in the slopes.
        let coarser = [constant(49, 0.5 * 1.1, 0.01), constant(25, 0.25 * 1.5, -0.02)];
        let errors = CoarseLevelErrors::new(&constant(side, 1.0, 0.0), &coarser, constrained);
        let variances = errors.at_nodes((places, places));
        let middle = &variances[places * (places / 2) + places / 2];
        assert_eq!(middle.directions, [1.0, 0.0, 1.0]);
        let middle = middle.variances;
        // The middle is 50 px from the rim, the coarsest level has the last word from 8 px on.
        let want = [0.5f64, 0.02].map(|error| FRAC_PI_2 * error * error * (50.0f64 / 8.0).powi(2));
        // The slopes also err by the rise of the flow's deviation.
        assert!((middle[0] / want[0] - 1.0).abs() < 1e-9, "{middle:?}, {want:?}");
        assert!((1.0..1.1).contains(&(middle[1] / want[1])), "{middle:?}, {want:?}");
        let row: Vec<f64> = (0..=places / 2).map(|x| variances[places * (places / 2) + x].variances[0]).collect();
        assert_eq!(row[..4], [0.0; 4]);
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn nothing_is_inherited_where_data_lead_or_nothing_is_seen_or_there_is_one_level() {
        let none = |constrained: ConstrainedDirections, places: usize, coarser: &[Planes<f64>]| {
            let errors = CoarseLevelErrors::new(&constant(33, 1.0, 0.0), coarser, constrained);
            errors.at_nodes((places, places)).iter().all(|found| found.variances == [0.0; 2])
        };
        let coarser = [constant(17, 0.7, 0.1)];
        let (constrained, places) = but_for(33, 0..0);
        assert!(none(constrained, places, &coarser));
        let (constrained, places) = but_for(33, 8..25);
        assert!(!none(constrained, places, &coarser));
        assert!(none(but_for(33, 8..25).0, places, &[]));
        assert!(none(but_for(33, 0..33).0, places, &coarser), "no site is_reference how exact the level is");
        let hidden: Vec<UnconstrainedDirections> = (0..33 * 33).map(|n| if n % 33 < 8 { NONE } else { ALL }).collect();
        assert!(none(
            ConstrainedDirections::with((33, &hidden), (places, places), |n| hidden[n] == NONE),
            places,
            &coarser
        ));
    }

    #[test]
    fn slopes_err_by_the_rise_of_the_flow() {
        let values = [0.0, 0.0, 0.8, 0.8, 0.0, 0.0, 0.8, 2.4];
        let rises = [(0, 0.0), (1, 0.005), (2, 0.005), (3, 0.02), (6, 0.025)];
        assert!(rises.iter().all(|&(n, rise)| (squared_rise(&values, (4, 2), n) - rise).abs() < 1e-12));
    }

    #[test]
    fn only_directions_without_texture_inherit() {
        let side = 97usize;
        let (slanted, coarser) = ([0.5, 0.5, 0.5], [constant(49, 0.5 * 1.1, 0.01)]);
        let sites = |here: UnconstrainedDirections| -> Vec<UnconstrainedDirections> {
            (0..side * side).map(|n| if (24..73).contains(&(n % side)) { here } else { NONE }).collect()
        };
        let places = side.div_ceil(SPACING);
        let found = |sites: &[UnconstrainedDirections]| {
            CoarseLevelErrors::new(
                &constant(side, 1.0, 0.0),
                &coarser,
                ConstrainedDirections::with((side, sites), (places, places), |_| true),
            )
            .at_nodes((places, places))
        };
        let (partly, wholly) = (found(&sites(slanted)), found(&sites(ALL)));
        for (partly, wholly) in partly.iter().zip(&wholly).filter(|(_, wholly)| wholly.variances[1] > 0.0) {
            assert_eq!(partly.variances, wholly.variances);
            assert_eq!(wholly.directions, [1.0, 0.0, 1.0]);
            assert!(partly.directions.iter().all(|entry| (entry - 0.5).abs() < 1e-12), "{:?}", partly.directions);
        }
        // Nothing but texture of one direction: along it motion is as uncertain as what was searched.
        let all = found(&vec![slanted; side * side]);
        assert!(all.iter().all(|found| found.variances == [4.0, 1.0 / 16.0] && found.directions == [0.5; 3]));
    }
}
