//! Where data lead the motion, and in which directions they do not.

use super::super::data::{SEEN, UU, UV, VV};
use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::noise::Noise;
use crate::simd::SimdReal;
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// Share of the sites from which on they tell how exact coarse levels are.
const TELLING: f64 = 0.02;
/// Usable share of a window from which on a site counts as seen.
const USABLE: f64 = 0.1;
/// SamplingGrid whose information is told together reach so far from one.
const NEAR: usize = 1;
/// SamplingGrid that one thread looks at, at a time.
const PIECE: usize = 4096;

/// The matrix `xx, xy, yy` that leaves of motion what data do not lead: zero where they lead all of it, the
/// unit matrix where they lead nothing, and else the projection onto the direction without texture.
pub(super) type Directions = [f32; 3];
/// Nothing is led.
pub(super) const ALL: Directions = [1.0, 0.0, 1.0];
/// Everything is.
pub(super) const NONE: Directions = [0.0; 3];

/// Where data lead the motion.
pub(super) struct Led {
    width: usize,
    /// How far every site is from the next where data lead all of the motion, px, row by row; 0 where nothing
    /// is seen at all: that is another matter. Infinite where one direction is unknown and nearly nothing
    /// else is there.
    distances: Vec<f64>,
    /// The sites that tell how exact coarser levels are, row by row: seen, and led.
    telling: Vec<bool>,
    /// Means over the sites of every place that are not led, row by row.
    directions: Vec<[f64; 3]>,
}

impl Led {
    /// As the `noise` says of the sites' data, for so many `places` along x and y.
    pub fn by<T: SimdReal>(data: &Planes<T>, noise: &Noise<'_, T>, places: (usize, usize)) -> Self {
        let (width, height) = (data.width, data.height);
        let near = |at: usize, len: usize| at.saturating_sub(NEAR)..(at + NEAR + 1).min(len);
        let place = |site: usize, count: usize| ((site + SPACING / 2) / SPACING).min(count.div_ceil(SPACING) - 1);
        let directions = |n: usize| {
            let (x, y) = (n % width, n / width);
            let (columns, rows) = (near(x, width), near(y, height));
            let count = (columns.len() * rows.len()) as f64;
            let mean = |k| {
                let row = |y| data.line(k, y)[columns.clone()].iter().map(|value| value.to_f64()).sum::<f64>();
                rows.clone().map(row).sum::<f64>() / count
            };
            noise.not_led([UU, UV, VV].map(mean), place(x, width), place(y, height))
        };
        let sites: Vec<Directions> = (0..width * height).into_par_iter().with_min_len(PIECE).map(directions).collect();
        let seen = |n: usize| data.at(SEEN, n % width, n / width).to_f64() >= USABLE;
        Self::with((width, &sites), places, seen)
    }

    /// For sites whose directions these are. Where nearly none is led in all of them, they do not tell; what
    /// is known then is that motion along a texture of one direction is not.
    pub fn with((width, sites): (usize, &[Directions]), places: (usize, usize), seen: impl Fn(usize) -> bool) -> Self {
        let led: Vec<bool> = sites.iter().map(|directions| *directions == NONE).collect();
        let count = led.iter().filter(|led| **led).count();
        let mut distances = if (count as f64) < TELLING * led.len() as f64 || count == 0 {
            let unknown = |directions: &Directions| if [NONE, ALL].contains(directions) { 0.0 } else { f64::INFINITY };
            sites.iter().map(unknown).collect()
        } else {
            distances(width, &led)
        };
        (0..distances.len()).filter(|&n| !seen(n)).for_each(|n| distances[n] = 0.0);
        let telling = (0..led.len()).map(|n| led[n] && seen(n)).collect();
        let mut out = Self { width, distances, telling, directions: Vec::new() };
        out.directions =
            (0..places.0 * places.1).map(|n| out.mean_directions(sites, n % places.0, n / places.0)).collect();
        out
    }

    /// Whether a site tells how exact coarser levels are.
    pub fn tells(&self, x: usize, y: usize) -> bool {
        self.telling[y * self.width + x]
    }

    /// What is not led at a place, if anything is not.
    pub fn directions(&self, place: usize) -> [f64; 3] {
        self.directions[place]
    }

    /// The farthest of a place's sites.
    pub fn distance(&self, x: usize, y: usize) -> f64 {
        self.around(x, y).map(|n| self.distances[n]).fold(0.0, f64::max)
    }

    fn mean_directions(&self, sites: &[Directions], x: usize, y: usize) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0.0f64);
        for directions in self.around(x, y).map(|n| sites[n]).filter(|directions| *directions != NONE) {
            sum = std::array::from_fn(|k| sum[k] + f64::from(directions[k]));
            count += 1.0;
        }
        sum.map(|sum| sum / count.max(1.0))
    }

    /// The sites of a place.
    fn around(&self, x: usize, y: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.distances.len() / self.width);
        // The last places are at the last sites.
        let near = |place: usize, len: usize| {
            let middle = (SPACING * place).min(len - 1);
            middle.saturating_sub(SPACING / 2)..(middle + SPACING / 2 + 1).min(len)
        };
        let columns = near(x, width);
        near(y, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_to_the_next_led_site() {
        let led: Vec<bool> = (0..12).map(|n| n == 0 || n == 11).collect();
        let want = [0.0, 1.0, 2.0, 2.0, 1.0, SQRT_2, SQRT_2, 1.0, 2.0, 2.0, 1.0, 0.0];
        let got = distances(4, &led);
        assert!(got.iter().zip(want).all(|(got, want)| (got - PITCH * want).abs() < 1e-12), "{got:?}");
    }

    #[test]
    fn directions_are_those_of_the_sites_that_are_not_led() {
        let (across, along) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let side = 9;
        let sites: Vec<Directions> = (0..side * side).map(|n| if n % side < 7 { NONE } else { along }).collect();
        let led = Led::with((side, &sites), (3, 3), |_| true);
        assert_eq!([0, 1, 2].map(|place| led.directions(place)), [[0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]]);
        assert_eq!([0, 1, 2].map(|place| led.distance(place, 0)), [0.0, 0.0, 2.0 * PITCH]);
        // Nothing is led as a whole: what is known is that one direction is not.
        let half: Vec<Directions> = (0..side * side).map(|n| if n % side < 4 { across } else { ALL }).collect();
        let led = Led::with((side, &half), (3, 3), |_| true);
        assert_eq!([0, 2].map(|place| led.distance(place, 0)), [f64::INFINITY, 0.0]);
        assert!((0..side).all(|x| !led.tells(x, 0)));
    }
}
