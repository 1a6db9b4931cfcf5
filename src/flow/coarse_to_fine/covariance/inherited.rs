//! What motion keeps of the errors of coarser levels: finer ones correct them only where they see something.
//!
//! A coarse level sees further into an area without texture than a fine one, and is less exact. How exact it is, the places with texture tell, where the refined motion is known to be better: the
//! mean squares of its differences from what a level found are the variances of what was handed down from there. They are taken from mean absolute values, as of Gaussian errors, so that the few
//! places at motion boundaries do not tell for all others.
//!
//! The windows of refinement carry such errors a little way out of those areas, and where they grow, the slopes err by their rise.

use super::super::data::{MOTION, SEEN, UU, UV, VV};
use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::noise::Noise;
use super::soften;
use crate::simd::SimdReal;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// How far a level sees into what has no texture, px of the level: its stencils and the windows of its data.
const REACH: f64 = 4.0;
/// Share of the sites from which on they tell how exact coarse levels are.
const TELLING: f64 = 0.02;
/// Usable share of a window from which on a site counts as seen.
const USABLE: f64 = 0.1;
/// Sites whose information is told together reach so far from one.
const NEAR: usize = 1;
/// Sites that one thread looks at, at a time.
const PIECE: usize = 4096;

/// Variance of the slopes over the mean square of the rise of the flow's deviation: errors are not as steep everywhere as at their steepest.
const STEEP: f64 = 0.35;

/// Where data lead the motion.
pub(super) struct Led {
    width: usize,
    /// How far every site is from the next that data lead, px, row by row; 0 where nothing is seen at all: that is another matter.
    distances: Vec<f64>,
    /// The sites that tell how exact coarser levels are, row by row: seen, and led.
    telling: Vec<bool>,
}

impl Led {
    /// As the `noise` says of the sites' data.
    pub fn by<T: SimdReal>(data: &Planes<T>, noise: &Noise<'_, T>) -> Self {
        let (width, height) = (data.width, data.height);
        let around = |at: usize, len: usize| at.saturating_sub(NEAR)..(at + NEAR + 1).min(len);
        let place = |site: usize, count: usize| ((site + SPACING / 2) / SPACING).min(count.div_ceil(SPACING) - 1);
        let leads = |n: usize| {
            let (x, y) = (n % width, n / width);
            let (columns, rows) = (around(x, width), around(y, height));
            let count = (columns.len() * rows.len()) as f64;
            let mean = |k| {
                let row = |y| data.line(k, y)[columns.clone()].iter().map(|value| value.to_f64()).sum::<f64>();
                rows.clone().map(row).sum::<f64>() / count
            };
            noise.leads([UU, UV, VV].map(mean), place(x, width), place(y, height))
        };
        let led: Vec<bool> = (0..width * height).into_par_iter().with_min_len(PIECE).map(leads).collect();
        let seen = |n: usize| data.at(SEEN, n % width, n / width).to_f64() >= USABLE;
        Self::with(width, &led, seen)
    }

    /// For sites of which these are led; they all count as led where nearly none is: then they do not tell.
    fn with(width: usize, led: &[bool], seen: impl Fn(usize) -> bool) -> Self {
        let count = led.iter().filter(|led| **led).count();
        let mut distances = if (count as f64) < TELLING * led.len() as f64 || count == 0 {
            vec![0.0; led.len()]
        } else {
            distances(width, led)
        };
        (0..distances.len()).filter(|&n| !seen(n)).for_each(|n| distances[n] = 0.0);
        let telling = (0..led.len()).map(|n| led[n] && seen(n)).collect();
        Self { width, distances, telling }
    }

    /// The farthest of a place's sites.
    fn at_place(&self, x: usize, y: usize) -> f64 {
        let (width, height) = (self.width, self.distances.len() / self.width);
        let around = |place: usize, len: usize| {
            (SPACING * place).saturating_sub(SPACING / 2)..(SPACING * place + SPACING / 2 + 1).min(len)
        };
        let rows = around(y, height).map(|y| &self.distances[y * width..][..width]);
        rows.flat_map(|row| &row[around(x, width)]).fold(0.0, |most, distance| f64::max(most, *distance))
    }
}

/// From every site to the next of the `led` ones, px: the shortest way along rows, columns and diagonals.
fn distances(width: usize, led: &[bool]) -> Vec<f64> {
    let mut out: Vec<f64> = led.iter().map(|led| if *led { 0.0 } else { f64::INFINITY }).collect();
    let sites = out.len();
    let (straight, diagonal) = (PITCH, PITCH * SQRT_2);
    // Once from above and once, everything turned about, from below.
    for _ in 0..2 {
        for n in 0..sites {
            let x = n % width;
            let mut least = out[n];
            if x > 0 {
                least = least.min(out[n - 1] + straight);
            }
            if n >= width {
                least = least.min(out[n - width] + straight);
                if x > 0 {
                    least = least.min(out[n - width - 1] + diagonal);
                }
                if x + 1 < width {
                    least = least.min(out[n - width + 1] + diagonal);
                }
            }
            out[n] = least;
        }
        out.reverse();
    }
    out
}

/// Variances of what was found on coarser levels.
pub(super) struct Inherited {
    /// Of the flow, px^2 of the finest level worked on, and of the slopes; the next coarser level first.
    variances: Vec<[f64; 2]>,
    led: Led,
}

impl Inherited {
    /// From the refined `motion`, that on the levels `above` it, the finest first, and where data lead.
    pub fn new<T: SimdReal>(motion: &Planes<T>, above: &[Planes<T>], led: Led) -> Self {
        let mut variances: Vec<[f64; 2]> = Vec::new();
        for (k, coarse) in above.iter().enumerate() {
            let mut found = differences(motion, (coarse, k + 1), &led).unwrap_or_default();
            if let Some(finer) = variances.last() {
                // The farther, the less is known.
                found = [0, 1].map(|kind| found[kind].max(finer[kind]));
            }
            variances.push(found);
        }
        Self { variances, led }
    }

    /// The variances of the flow and of the slopes at every place, row by row.
    pub fn at_places(&self, size: (usize, usize)) -> Vec<[f64; 2]> {
        let distances = (0..size.0 * size.1).map(|n| self.led.at_place(n % size.0, n / size.0));
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
            let most = variances[kind];
            if pixels < to {
                return least + (most - least) * ((pixels - from) / (to - from)).max(0.0);
            }
            (from, least) = (to, most);
        }
        // Nothing saw further; what was never corrected grows with the distance.
        least * (pixels / from).powi(2)
    }
}

/// Of the motion found so many levels above: the flow's and the slopes' mean square difference at those of its sites that data lead, on lines through the places; if there are any.
fn differences<T: SimdReal>(motion: &Planes<T>, (coarse, above): (&Planes<T>, usize), led: &Led) -> Option<[f64; 2]> {
    let (mut sums, mut count) = ([0.0; 2], 0.0);
    let step = (1 << above).max(SPACING);
    let every = |len: usize| (0..len).step_by(step);
    for (x, y) in every(motion.height).flat_map(|y| every(motion.width).map(move |x| (x, y))) {
        if !led.telling[y * led.width + x] {
            continue;
        }
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
    use super::*;

    /// Sites led but for a square of them, all seen; and how many places there are along a side.
    fn but_for(side: usize, square: std::ops::Range<usize>) -> (Led, usize) {
        let led = |n: usize| !(square.contains(&(n % side)) && square.contains(&(n / side)));
        let led: Vec<bool> = (0..side * side).map(led).collect();
        (Led::with(side, &led, |_| true), side.div_ceil(SPACING))
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
        let (led, places) = but_for(side, 24..73);
        // Off by .1 and .5 px of the finest level, and by .01 and .02 in the slopes.
        let above = [constant(49, 0.5 * 1.1, 0.01), constant(25, 0.25 * 1.5, -0.02)];
        let inherited = Inherited::new(&constant(side, 1.0, 0.0), &above, led);
        let variances = inherited.at_places((places, places));
        let middle = variances[places * (places / 2) + places / 2];
        // The middle is 50 px from the rim, the coarsest level sees 8 px into the square.
        let want = [0.5f64, 0.02].map(|error| FRAC_PI_2 * error * error * (50.0f64 / 8.0).powi(2));
        // The slopes also err by the rise of the flow's deviation.
        assert!((middle[0] / want[0] - 1.0).abs() < 1e-9, "{middle:?}, {want:?}");
        assert!((1.0..1.1).contains(&(middle[1] / want[1])), "{middle:?}, {want:?}");
        let row: Vec<f64> = (0..=places / 2).map(|x| variances[places * (places / 2) + x][0]).collect();
        assert_eq!(row[..4], [0.0; 4]);
        assert!(row.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn nothing_is_inherited_where_data_lead_or_nothing_is_seen_or_there_is_one_level() {
        let none = |led: Led, places: usize, above: &[Planes<f64>]| {
            let inherited = Inherited::new(&constant(33, 1.0, 0.0), above, led);
            inherited.at_places((places, places)).iter().all(|variances| *variances == [0.0; 2])
        };
        let above = [constant(17, 0.7, 0.1)];
        let (led, places) = but_for(33, 0..0);
        assert!(none(led, places, &above));
        let (led, places) = but_for(33, 8..25);
        assert!(!none(led, places, &above));
        assert!(none(but_for(33, 8..25).0, places, &[]));
        assert!(none(but_for(33, 0..33).0, places, &above), "no site tells how exact the level is");
        let hidden: Vec<bool> = (0..33 * 33).map(|n| n % 33 < 8).collect();
        assert!(none(Led::with(33, &hidden, |n| hidden[n]), places, &above));
    }

    #[test]
    fn distances_are_those_to_the_next_led_site() {
        let led: Vec<bool> = (0..12).map(|n| n == 0 || n == 11).collect();
        let want = [0.0, 1.0, 2.0, 2.0, 1.0, SQRT_2, SQRT_2, 1.0, 2.0, 2.0, 1.0, 0.0];
        let got = distances(4, &led);
        assert!(got.iter().zip(want).all(|(got, want)| (got - PITCH * want).abs() < 1e-12), "{got:?}");
    }

    #[test]
    fn slopes_err_by_the_rise_of_the_flow() {
        let values = [0.0, 0.0, 0.8, 0.8, 0.0, 0.0, 0.8, 2.4];
        let rises = [(0, 0.0), (1, 0.005), (2, 0.005), (3, 0.02), (6, 0.025)];
        assert!(rises.iter().all(|&(n, rise)| (squared_rise(&values, (4, 2), n) - rise).abs() < 1e-12));
    }
}
