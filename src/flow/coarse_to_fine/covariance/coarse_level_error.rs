//! Coarse-level error: finer levels correct coarser ones only where data constrain the motion.
//!
//! A coarse level reaches further into an area without texture than a fine one, and is less exact. Its
//! variances are mean squares of the differences from the refined motion at sites nearby whose motion the
//! data of a finer level determine, taken from mean absolute values, as for Gaussian errors, so that single
//! large ones do not dominate. Refinement windows carry such errors out of those areas; where errors grow,
//! slopes err by the rise.

use super::constrained_directions::ConstrainedDirections;
use crate::ablation::keeps;
use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::descent::CoarserLevel;
use crate::flow::coarse_to_fine::nodes::{binomial_mean, decaying_sums};
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::SITES_PER_NODE;
use crate::simd::SimdReal;
use std::f64::consts::FRAC_PI_2;

/// Distance that a level reaches into an untextured area, px of the level: its stencils and data windows.
const LEVEL_REACH: f64 = 4.0;
/// Distance, nodes, over which the weight of a reference site falls by a factor of e.
const REFERENCE_DISTANCE: f64 = 3.0;
/// Weight of the mean of the frame's reference sites, in reference sites: it counts where none are near.
const FRAME_WEIGHT: f64 = 0.2;
/// Variance of the slopes over the mean square rise of the flow's standard deviation.
const RISE_SHARE: f64 = 0.35;

pub(super) struct CoarseLevelError {
    /// Variances of the flow, px^2, and of the slopes, in the unconstrained directions.
    pub variances: [f64; 2],
    /// Projection `xx, xy, yy` onto those directions.
    pub directions: [f64; 3],
}

pub(super) struct CoarseLevelErrors {
    /// Of the flow, px^2 of the finest estimated level, and of the slopes, at every node; the next coarser
    /// level first. 0 without reference sites.
    variances: Vec<Vec<[f64; 2]>>,
    constrained: ConstrainedDirections,
}

impl CoarseLevelErrors {
    pub fn new<T: SimdReal>(
        motion: &Planes<T>,
        coarser: &[CoarserLevel<T>],
        constrained: ConstrainedDirections,
        size: (usize, usize),
    ) -> Self {
        let mut variances: Vec<Vec<[f64; 2]>> = Vec::new();
        for (k, coarse) in coarser.iter().enumerate() {
            let mut found = differences(motion, (&coarse.motion, k + 1), &constrained, size);
            if let Some(finer) = variances.last() {
                // Variances do not decrease with the distance.
                for (found, finer) in found.iter_mut().zip(finer) {
                    *found = [0, 1].map(|kind| found[kind].max(finer[kind]));
                }
            }
            variances.push(found);
        }
        Self { variances, constrained }
    }

    pub fn at_nodes(&self, size: (usize, usize)) -> Vec<CoarseLevelError> {
        let distances = (0..size.0 * size.1).map(|n| self.constrained.distance(n % size.0, n / size.0));
        let own: Vec<[f64; 2]> = distances
            .enumerate()
            .map(|(n, distance)| [0, 1].map(|kind| self.variance(kind, distance, n).sqrt()))
            .collect();
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

    /// Unconstrained directions of the node, or of its neighbours, whose standard deviations are `own`.
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

    /// Variance of the flow (`kind` 0) or slopes (1) of a node at a distance, px, from constraining data: a
    /// level's own where the next finer one has no data, linear between, 0 below half the finest one's reach.
    fn variance(&self, kind: usize, distance: f64, node: usize) -> f64 {
        if distance.is_infinite() {
            return self.unverified(kind);
        }
        let pixels = distance / LEVEL_REACH;
        let (mut from, mut below) = (0.5, 0.0);
        for variances in &self.variances {
            let to = 2.0 * from;
            let most = variances[node][kind];
            if pixels < to {
                return below + (most - below) * ((pixels - from) / (to - from)).max(0.0);
            }
            (from, below) = (to, most);
        }
        // No level reaches further; the error grows with the distance.
        below * (pixels / from).powi(2)
    }

    /// Variance without any reference site: the range of motions of the coarsest level.
    fn unverified(&self, kind: usize) -> f64 {
        if kind == 0 { 4f64.powi(self.variances.len() as i32) } else { LEVEL_REACH.powi(-2) }
    }
}

/// Mean square differences of flow and slopes from the motion so many levels above, around every node: at
/// reference sites nearby and, where these are few, of the frame.
fn differences<T: SimdReal>(
    motion: &Planes<T>,
    (coarse, coarser): (&Planes<T>, usize),
    constrained: &ConstrainedDirections,
    size: (usize, usize),
) -> Vec<[f64; 2]> {
    let node = |n: usize| {
        let (x, y) = (SITES_PER_NODE * (n % size.0), SITES_PER_NODE * (n / size.0));
        // Sites of the coarser level, too.
        let is_site = (x | y) % (1 << coarser) == 0 && x < motion.width && y < motion.height;
        if !is_site || !constrained.is_reference(coarser, x, y) {
            return [0.0; 3];
        }
        let mut sums = [0.0, 0.0, 1.0];
        for k in 0..MOTION {
            let (scale, share) = if k < 2 { (f64::from(1u32 << coarser), 1.0 / 2.0) } else { (1.0, 1.0 / 4.0) };
            let there = scale * coarse.line(k, y >> coarser)[x >> coarser].to_f64();
            sums[usize::from(k >= 2)] += share * (motion.line(k, y)[x].to_f64() - there).abs();
        }
        sums
    };
    let mut sums: Vec<[f64; 3]> = (0..size.0 * size.1).map(node).collect();
    let of_frame = sums.iter().fold([0.0; 3], |all, sums| [0, 1, 2].map(|k| all[k] + sums[k]));
    let frame_share = FRAME_WEIGHT / of_frame[2].max(1.0);
    if keeps("flow.nearby_level_errors") {
        decaying_sums(&mut sums, size, (-1.0 / REFERENCE_DISTANCE).exp());
    } else {
        sums.fill([0.0; 3]);
    }
    let square = |sums: &[f64; 3], k: usize| {
        let [sum, count] = [k, 2].map(|k| sums[k] + frame_share * of_frame[k]);
        if count > 0.0 { FRAC_PI_2 * (sum / count).powi(2) } else { 0.0 }
    };
    sums.iter().map(|sums| [square(sums, 0), square(sums, 1)]).collect()
}

/// Mean square rise of values next to a node, per px: for each axis that of both sides.
fn squared_rise(values: &[f64], (width, height): (usize, usize), n: usize) -> f64 {
    let (x, y) = (n % width, n / width);
    let both = |before: Option<usize>, after: Option<usize>| {
        let rise = |to: Option<usize>| {
            to.map_or(0.0, |to| ((values[to] - values[n]) / (SITE_SPACING * SITES_PER_NODE as f64)).powi(2))
        };
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

    fn but_for(side: usize, square: std::ops::Range<usize>) -> (ConstrainedDirections, usize) {
        let constrained = |n: usize| !(square.contains(&(n % side)) && square.contains(&(n / side)));
        let sites: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if constrained(n) { NONE } else { ALL }).collect();
        let nodes = side.div_ceil(SITES_PER_NODE);
        (ConstrainedDirections::with((side, &sites), (nodes, nodes), |_| true), nodes)
    }

    fn level(motion: Planes<f64>) -> CoarserLevel<f64> {
        CoarserLevel { motion, data: Planes::new(0, 0, 0) }
    }

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
        let (constrained, nodes) = but_for(side, 24..73);
        // Errors of .1 and .5 px of the finest level, and of .01 and .02 in the slopes.
        let coarser = [constant(49, 0.5 * 1.1, 0.01), constant(25, 0.25 * 1.5, -0.02)].map(level);
        let errors = CoarseLevelErrors::new(&constant(side, 1.0, 0.0), &coarser, constrained, (nodes, nodes));
        let variances = errors.at_nodes((nodes, nodes));
        let middle = &variances[nodes * (nodes / 2) + nodes / 2];
        assert_eq!(middle.directions, [1.0, 0.0, 1.0]);
        let middle = middle.variances;
        // The middle is 50 px from the border; from 8 px on the error is that of the coarsest level.
        let want = [0.5f64, 0.02].map(|error| FRAC_PI_2 * error * error * (50.0f64 / 8.0).powi(2));
        // The slopes also err by the rise of the flow's standard deviation.
        assert!((middle[0] / want[0] - 1.0).abs() < 1e-9, "{middle:?}, {want:?}");
        assert!((1.0..1.1).contains(&(middle[1] / want[1])), "{middle:?}, {want:?}");
        let row: Vec<f64> = (0..=nodes / 2).map(|x| variances[nodes * (nodes / 2) + x].variances[0]).collect();
        assert_eq!(row[..4], [0.0; 4]);
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn errors_are_those_of_the_surroundings() {
        let side = 97usize;
        let nodes = side.div_ceil(SITES_PER_NODE);
        let is_plain = |n: usize| (36..61).contains(&(n / side));
        let sites: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if is_plain(n) { ALL } else { NONE }).collect();
        let constrained = ConstrainedDirections::with((side, &sites), (nodes, nodes), |_| true);
        // The coarser level errs by .4 px, in the right half only.
        let mut coarser = constant(49, 0.5, 0.0);
        for (k, y) in (0..2).flat_map(|k| (0..49).map(move |y| (k, y))) {
            coarser.line_mut(k, y)[24..].fill(0.5 * 1.4);
        }
        let errors = CoarseLevelErrors::new(&constant(side, 1.0, 0.0), &[level(coarser)], constrained, (nodes, nodes));
        let variances = errors.at_nodes((nodes, nodes));
        let [left, right] = [4, 20].map(|x| variances[nodes * (nodes / 2) + x].variances[0].sqrt());
        assert!(left < 0.2 * right && right > 0.4, "{left}, {right}");
    }
}
