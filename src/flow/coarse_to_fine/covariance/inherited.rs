//! What motion keeps of the errors of coarser levels: finer ones correct them only where they see something.
//!
//! A coarse level sees further into an area without texture than a fine one, and is less exact. How exact it is, the places with texture tell, where the refined motion is known to be better: the
//! mean squares of its differences from what a level found are the variances of what was handed down from there. They are taken from mean absolute values, as of Gaussian errors, so that the few
//! places at motion boundaries do not tell for all others.
//!
//! The windows of refinement carry such errors a little way out of those areas, and where they grow, the slopes err by their rise.

use super::super::data::MOTION;
use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::seen::Seen;
use super::soften;
use crate::simd::SimdReal;
use std::f64::consts::FRAC_PI_2;

/// How far a level sees into what has no texture, px of the level: its stencils and the windows of its data.
const REACH: f64 = 3.0;
/// Variance of what was handed down over that of the differences where there is texture: coarse levels see less of its rim.
const LESS_SEEN: f64 = 2.0;

/// Variance of the slopes over the mean square of the rise of the flow's deviation: errors are not as steep everywhere as at their steepest.
const STEEP: f64 = 0.5;

/// Variances of what was found on coarser levels.
pub(super) struct Inherited {
    /// Of the flow, px^2 of the finest level worked on, and of the slopes; the next coarser level first.
    variances: Vec<[f64; 2]>,
}

impl Inherited {
    /// From the refined `motion`, that on the levels `above` it, the finest first, and where the texture is.
    pub fn new<T: SimdReal>(motion: &Planes<T>, above: &[Planes<T>], textured: &Seen) -> Self {
        let mut variances: Vec<[f64; 2]> = Vec::new();
        for (k, coarse) in above.iter().enumerate() {
            let mut found = differences(motion, (coarse, k + 1), textured).unwrap_or_default();
            if let Some(finer) = variances.last() {
                // The farther, the less is known.
                found = [0, 1].map(|kind| found[kind].max(finer[kind]));
            }
            variances.push(found);
        }
        Self { variances }
    }

    /// The variances of the flow and of the slopes at every place that is `seen`, row by row, and a little around: what is not seen at all is another matter.
    pub fn at_places(&self, [seen, textured]: [&Seen; 2], size: (usize, usize)) -> Vec<[f64; 2]> {
        let distances = (0..size.0 * size.1)
            .map(|n| (n % size.0, n / size.0))
            .map(|(x, y)| if seen.beyond(x, y) > 0.0 { 0.0 } else { textured.beyond(x, y) });
        let own: Vec<[f64; 2]> =
            distances.map(|distance| [0, 1].map(|kind| self.variance(kind, distance / REACH).sqrt())).collect();
        let mut carried = own.clone();
        soften(&mut carried, size);
        let deviations = |n: usize| [0, 1].map(|kind| f64::max(own[n][kind], carried[n][kind]));
        let flow: Vec<f64> = (0..own.len()).map(|n| deviations(n)[0]).collect();
        let with_rise = |n: usize| {
            let [flow_deviation, slope_deviation] = deviations(n);
            [flow_deviation.powi(2), slope_deviation.powi(2) + STEEP * squared_rise(&flow, size, n)]
        };
        (0..own.len()).map(with_rise).collect()
    }

    /// Of the flow (`kind` 0) or the slopes (1), where that level is the first to see something whose pixels are so many of the finest: linear between levels, nothing below half a pixel.
    fn variance(&self, kind: usize, pixels: f64) -> f64 {
        let (mut from, mut least) = (0.5, 0.0);
        for variances in &self.variances {
            let to = 2.0 * from;
            let most = LESS_SEEN * variances[kind];
            if pixels < to {
                return least + (most - least) * ((pixels - from) / (to - from)).max(0.0);
            }
            (from, least) = (to, most);
        }
        least
    }
}

/// Of the motion found so many levels above: the flow's and the slopes' mean square difference at the places with texture that lie on its sites, if there are any.
fn differences<T: SimdReal>(
    motion: &Planes<T>,
    (coarse, above): (&Planes<T>, usize),
    textured: &Seen,
) -> Option<[f64; 2]> {
    let (width, height) = (motion.width.div_ceil(SPACING), motion.height.div_ceil(SPACING));
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    let step = ((1 << above) / SPACING).max(1);
    for (x, y) in (0..height).step_by(step).flat_map(|y| (0..width).step_by(step).map(move |x| (x, y))) {
        if textured.beyond(x, y) > 0.0 {
            continue;
        }
        let (x, y) = (SPACING * x, SPACING * y);
        for k in 0..MOTION {
            let scale = if k < 2 { f64::from(1u32 << above) } else { 1.0 };
            let there = scale * coarse.line(k, y >> above)[x >> above].to_f64();
            sums[usize::from(k >= 2)] += (motion.line(k, y)[x].to_f64() - there).abs();
        }
        count += 1.0;
    }
    (count > 0.0).then(|| [sums[0] / 2.0, sums[1] / 4.0].map(|sum| FRAC_PI_2 * (sum / count).powi(2)))
}

/// The mean square of how steeply values rise or fall next to a place, per px: along each axis that of both sides.
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
    use super::super::super::data::SEEN;
    use super::*;

    /// What is seen at the places, and what is textured there, which a square is not.
    fn with_a_flat_square(side: usize, square: std::ops::Range<usize>) -> ([Seen; 2], usize) {
        let mut data = Planes::<f64>::new(side, side, SEEN + 1);
        (0..side).for_each(|y| data.line_mut(SEEN, y).fill(1.0));
        let places = side.div_ceil(SPACING);
        let has = |n: usize| square.contains(&(SPACING * n));
        let textured: Vec<bool> = (0..places * places).map(|n| !(has(n % places) && has(n / places))).collect();
        let size = (places, places);
        ([Seen::new(&data, size), Seen::textured(&data, size, &textured)], places)
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
        let ([seen, textured], places) = with_a_flat_square(side, 24..73);
        // Off by .1 and .5 px of the finest level, and by .01 and .02 in the slopes.
        let above = [constant(49, 0.5 * 1.1, 0.01), constant(25, 0.25 * 1.5, -0.02)];
        let inherited = Inherited::new(&constant(side, 1.0, 0.0), &above, &textured);
        let variances = inherited.at_places([&seen, &textured], (places, places));
        let middle = variances[places * (places / 2) + places / 2];
        let want = [0.5f64, 0.02].map(|error| LESS_SEEN * FRAC_PI_2 * error * error);
        assert!((0..2).all(|kind| (middle[kind] / want[kind] - 1.0).abs() < 1e-9), "{middle:?}, {want:?}");
        let row: Vec<f64> = (0..=places / 2).map(|x| variances[places * (places / 2) + x][0]).collect();
        assert_eq!(row[..4], [0.0; 4]);
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn nothing_is_inherited_where_all_has_texture_or_nothing_is_seen_or_there_is_one_level() {
        let ([seen, all], places) = with_a_flat_square(33, 0..0);
        let inherited = Inherited::new(&constant(33, 1.0, 0.0), &[constant(17, 0.7, 0.1)], &all);
        assert!(inherited.at_places([&seen, &all], (places, places)).iter().all(|variances| *variances == [0.0; 2]));
        let ([_, textured], places) = with_a_flat_square(33, 8..25);
        let inherited = Inherited::new(&constant(33, 1.0, 0.0), &[constant(17, 0.7, 0.1)], &textured);
        let areas = [(&seen, true), (&textured, false)];
        for (seen, inherits) in areas {
            let variances = inherited.at_places([seen, &textured], (places, places));
            assert_eq!(variances.iter().any(|variances| *variances != [0.0; 2]), inherits);
        }
        let one_level = Inherited::new(&constant(33, 1.0, 0.0), &[], &textured);
        assert!(one_level.at_places([&seen, &textured], (places, places)).iter().all(|v| *v == [0.0; 2]));
    }

    #[test]
    fn slopes_err_by_the_rise_of_the_flow() {
        let values = [0.0, 0.0, 0.8, 0.8, 0.0, 0.0, 0.8, 2.4];
        let rises = [(0, 0.0), (1, 0.005), (2, 0.005), (3, 0.02), (6, 0.025)];
        assert!(rises.iter().all(|&(n, rise)| (squared_rise(&values, (4, 2), n) - rise).abs() < 1e-12));
    }
}
