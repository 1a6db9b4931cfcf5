//! Constrained directions: where the data determine the motion, and in which directions.
//!
//! Where those of the finest level do not, those of a coarser one may: smoothed frames have less noise.

use super::{noise::ALL, noise::NONE, noise::Noise, noise::UnconstrainedDirections};
use crate::ablation::keeps;
use crate::flow::coarse_to_fine::data_term::{ENERGY, MIN_USABLE_SHARE, SEEN, UU, UV, VV};
use crate::flow::coarse_to_fine::descent::CoarserLevel;
use crate::flow::coarse_to_fine::nodes::binomial_mean;
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::SITES_PER_NODE;
use crate::parallel::for_each_band;
use crate::simd::SimdReal;
use std::f64::consts::SQRT_2;

/// Minimum share of constrained sites from which the errors of coarse levels are measured.
const MIN_CONSTRAINED_SHARE: f64 = 0.02;
/// Reach, sites, of the mean of the information.
const INFORMATION_REACH: usize = 1;
/// Distance, px of a coarser level, that its constrained sites count as. At 2, half its reach, they have its
/// own error ([`coarse_level_error`](super::coarse_level_error)); its data are weaker than those of reference
/// sites.
const COARSE_DISTANCE: f64 = 2.5;
/// Minimum distance, px of a coarser level, of its constrained sites from others: nearer ones see the texture
/// beyond the edge of an area through the level's stencils and windows.
const MIN_EDGE_DISTANCE: f64 = 6.0;
/// Minimum information of constrained sites of a coarser level, as a share of the level's mean: without
/// noise, texture blurred into plain areas has some everywhere.
const MIN_INFORMATION_SHARE: f64 = 0.01;

pub(super) struct ConstrainedDirections {
    width: usize,
    /// Distance of every site from the nearest fully constrained one, px; 0 where nothing is usable, infinite
    /// where one direction is unconstrained and nearly no site is constrained.
    distances: Vec<f64>,
    /// Usable and constrained sites of the finest estimated level, then of coarser ones.
    levels: Vec<ConstrainedSites>,
    /// Means over the unconstrained sites of every node, row by row.
    directions: Vec<[f64; 3]>,
}

/// The sites of a level, row by row.
struct ConstrainedSites {
    width: usize,
    /// Whether data there determine the motion.
    sites: Vec<bool>,
    /// Mean information and residual energy around sites of coarser levels.
    means: Vec<[f64; 4]>,
}

impl ConstrainedDirections {
    /// Of the `data` of the finest estimated level and of the `coarser` ones.
    pub fn new<T: SimdReal>(
        data: &Planes<T>,
        coarser: &[CoarserLevel<T>],
        noise: &Noise<'_, T>,
        nodes: (usize, usize),
    ) -> Self {
        let (width, height) = (data.width, data.height);
        let around =
            |at: usize, len: usize| at.saturating_sub(INFORMATION_REACH)..(at + INFORMATION_REACH + 1).min(len);
        let node = |site: usize, count: usize| {
            ((site + SITES_PER_NODE / 2) / SITES_PER_NODE).min(count.div_ceil(SITES_PER_NODE) - 1)
        };
        let mut sites = vec![NONE; width * height];
        for_each_band(&mut sites, width, |_, rows, out| {
            // Down the columns, with a zero at both ends; then along the row.
            let mut down = vec![0.0; width + 2];
            let mut sums = [(); 3].map(|()| vec![0.0; width]);
            for (y, out) in rows.zip(out.chunks_exact_mut(width)) {
                let (rows, node_row) = (around(y, height), node(y, height));
                for (sums, k) in sums.iter_mut().zip([UU, UV, VV]) {
                    down.fill(0.0);
                    for y in rows.clone() {
                        down[1..].iter_mut().zip(data.line(k, y)).for_each(|(sum, value)| *sum += value.to_f64());
                    }
                    let three = down.iter().zip(&down[1..]).zip(&down[2..]).map(|((a, b), c)| a + b + c);
                    sums.iter_mut().zip(three).for_each(|(sum, three)| *sum = three);
                }
                let sufficient: Vec<f64> = (0..nodes.0).map(|x| noise.sufficient_information(x, node_row)).collect();
                for (x, out) in out.iter_mut().enumerate() {
                    let count = (around(x, width).len() * rows.len()) as f64;
                    let [a, b, c] = [sums[0][x], sums[1][x], sums[2][x]];
                    // The usual case, without a root.
                    if 0.5 * (a + c) - (0.5 * (a - c).abs() + b.abs()) < count * sufficient[node(x, width)] {
                        *out = noise.unconstrained([a, b, c].map(|sum| sum / count), node(x, width), node_row);
                    }
                }
            }
        });
        let is_usable = |n: usize| data.at(SEEN, n % width, n / width).to_f64() >= MIN_USABLE_SHARE;
        let mut out = Self::with((width, &sites), nodes, is_usable);
        if keeps("flow.coarse_constraints") && out.distances.iter().any(|distance| *distance > 0.0) {
            for (k, level) in (1..).zip(coarser) {
                out.add_level(k, constrained_sites(k, &level.data, noise));
            }
        }
        out
    }

    /// Adds the next coarser level, so many above the finest estimated one.
    fn add_level(&mut self, level: usize, constrained: ConstrainedSites) {
        let distances = distances(constrained.width, &constrained.sites);
        let pixel = f64::from(1u32 << level);
        for (y, row) in self.distances.chunks_exact_mut(self.width).enumerate() {
            let there = &distances[constrained.index(0, y >> level)..];
            for (x, distance) in row.iter_mut().enumerate().filter(|(_, distance)| distance.is_finite()) {
                *distance = distance.min(pixel * there[x >> level].max(COARSE_DISTANCE));
            }
        }
        self.levels.push(constrained);
    }

    /// From the directions of all sites; if nearly none is constrained in both, there is no reference.
    pub fn with(
        (width, sites): (usize, &[UnconstrainedDirections]),
        nodes: (usize, usize),
        is_usable: impl Fn(usize) -> bool,
    ) -> Self {
        let constrained: Vec<bool> = sites.iter().map(|directions| *directions == NONE).collect();
        let count = constrained.iter().filter(|constrained| **constrained).count();
        let mut distances = if count == sites.len() {
            vec![0.0; sites.len()]
        } else if (count as f64) < MIN_CONSTRAINED_SHARE * constrained.len() as f64 || count == 0 {
            let unknown = |directions: &UnconstrainedDirections| {
                if [NONE, ALL].contains(directions) { 0.0 } else { f64::INFINITY }
            };
            sites.iter().map(unknown).collect()
        } else {
            distances(width, &constrained)
        };
        (0..distances.len()).filter(|&n| !is_usable(n)).for_each(|n| distances[n] = 0.0);
        let finest = (0..constrained.len()).map(|n| constrained[n] && is_usable(n)).collect();
        let levels = vec![ConstrainedSites { width, sites: finest, means: Vec::new() }];
        let mut out = Self { width, distances, levels, directions: Vec::new() };
        out.directions = if count == sites.len() {
            vec![[0.0; 3]; nodes.0 * nodes.1]
        } else {
            (0..nodes.0 * nodes.1).map(|n| out.mean_directions(sites, n % nodes.0, n / nodes.0)).collect()
        };
        out
    }

    /// Whether the data of a finer level than the one so many above determine the motion of a site: there
    /// that level's error shows.
    pub fn is_reference(&self, coarser: usize, x: usize, y: usize) -> bool {
        self.levels.iter().take(coarser).enumerate().any(|(k, level)| level.sites[level.index(x >> k, y >> k)])
    }

    /// Density of the noise at a node, px^4, on the finest level whose data determine its motion; `None` if
    /// that is the finest estimated one.
    pub fn coarse_density<T: SimdReal>(&self, noise: &Noise<'_, T>, x: usize, y: usize) -> Option<[f64; 3]> {
        let last = (self.width - 1, self.distances.len() / self.width - 1);
        let (x, y) = ((SITES_PER_NODE * x).min(last.0), (SITES_PER_NODE * y).min(last.1));
        let index = |k: usize| self.levels[k].index(x >> k, y >> k);
        let level = (0..self.levels.len()).find(|&k| self.levels[k].sites[index(k)]).filter(|k| *k > 0)?;
        let [a, b, c, energy] = self.levels[level].means[index(level)];
        Some(noise.density_on_coarser(level, [a, b, c], energy))
    }

    /// Unconstrained directions of a node; 0 if there are none.
    pub fn directions(&self, node: usize) -> [f64; 3] {
        self.directions[node]
    }

    /// Largest distance of a node's sites.
    pub fn distance(&self, x: usize, y: usize) -> f64 {
        self.around(x, y).map(|n| self.distances[n]).fold(0.0, f64::max)
    }

    fn mean_directions(&self, sites: &[UnconstrainedDirections], x: usize, y: usize) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0.0f64);
        for directions in self.around(x, y).map(|n| sites[n]).filter(|directions| *directions != NONE) {
            sum = std::array::from_fn(|k| sum[k] + f64::from(directions[k]));
            count += 1.0;
        }
        sum.map(|sum| sum / count.max(1.0))
    }

    fn around(&self, x: usize, y: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.distances.len() / self.width);
        // The last nodes are at the last sites.
        let around_site = |node: usize, len: usize| {
            let middle = (SITES_PER_NODE * node).min(len - 1);
            middle.saturating_sub(SITES_PER_NODE / 2)..(middle + SITES_PER_NODE / 2 + 1).min(len)
        };
        let columns = around_site(x, width);
        around_site(y, height).flat_map(move |y| columns.clone().map(move |x| y * width + x))
    }
}

impl ConstrainedSites {
    fn index(&self, x: usize, y: usize) -> usize {
        y * self.width + x
    }
}

/// Those of a level so many above the finest estimated one.
fn constrained_sites<T: SimdReal>(level: usize, data: &Planes<T>, noise: &Noise<'_, T>) -> ConstrainedSites {
    let (width, height) = (data.width, data.height);
    let of_row = |y: usize| {
        let lines = [UU, UV, VV, ENERGY].map(|k| data.line(k, y));
        (0..width).map(move |x| lines.map(|line| line[x].to_f64()))
    };
    let mut means: Vec<[f64; 4]> = (0..height).flat_map(of_row).collect();
    binomial_mean(&mut means, (width, height));
    let mean_information = means.iter().map(|[a, _, c, _]| 0.5 * (a + c)).sum::<f64>() / means.len() as f64;
    let is_unconstrained = |(n, [a, b, c, energy]): (usize, &[f64; 4])| {
        let least = 0.5 * (a + c) - (0.5 * (a - c)).hypot(*b);
        let sufficient = noise.sufficient_on_coarser(level, *energy).max(MIN_INFORMATION_SHARE * mean_information);
        data.at(SEEN, n % width, n / width).to_f64() < MIN_USABLE_SHARE || least.is_nan() || least <= sufficient
    };
    let unconstrained: Vec<bool> = means.iter().enumerate().map(is_unconstrained).collect();
    let sites = distances(width, &unconstrained).iter().map(|distance| *distance >= MIN_EDGE_DISTANCE).collect();
    ConstrainedSites { width, sites, means }
}

/// From every site to the nearest of the `given` ones, px: the shortest path along rows, columns and
/// diagonals.
fn distances(width: usize, given: &[bool]) -> Vec<f64> {
    let mut out: Vec<f64> = given.iter().map(|is_given| if *is_given { 0.0 } else { f64::INFINITY }).collect();
    let sites = out.len();
    let (straight, diagonal) = (SITE_SPACING, SITE_SPACING * SQRT_2);
    // Once from above, and once reversed from below.
    for _ in 0..2 {
        for n in 0..sites {
            let x = n % width;
            let mut shortest = out[n];
            if shortest == 0.0 {
                continue;
            }
            if x > 0 {
                shortest = shortest.min(out[n - 1] + straight);
            }
            if n >= width {
                shortest = shortest.min(out[n - width] + straight);
                if x > 0 {
                    shortest = shortest.min(out[n - width - 1] + diagonal);
                }
                if x + 1 < width {
                    shortest = shortest.min(out[n - width + 1] + diagonal);
                }
            }
            out[n] = shortest;
        }
        out.reverse();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_those_of_the_sites_that_are_not_led() {
        let (across, along) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let side = 9;
        let sites: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if n % side < 7 { NONE } else { along }).collect();
        let constrained = ConstrainedDirections::with((side, &sites), (3, 3), |_| true);
        assert_eq!([0, 1, 2].map(|node| constrained.directions(node)), [[0.0; 3], [0.0; 3], [0.0, 0.0, 1.0]]);
        assert_eq!([0, 1, 2].map(|node| constrained.distance(node, 0)), [0.0, 0.0, 2.0 * SITE_SPACING]);
        let half: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if n % side < 4 { across } else { ALL }).collect();
        let constrained = ConstrainedDirections::with((side, &half), (3, 3), |_| true);
        assert_eq!([0, 2].map(|node| constrained.distance(node, 0)), [f64::INFINITY, 0.0]);
        assert!((0..side).all(|x| !constrained.is_reference(1, x, 0)));
    }

    #[test]
    fn what_a_coarser_level_determines_is_near() {
        let side = 65usize;
        let sites: Vec<UnconstrainedDirections> =
            (0..side * side).map(|n| if n % side < 8 { NONE } else { ALL }).collect();
        let mut constrained = ConstrainedDirections::with((side, &sites), (17, 17), |_| true);
        let far = constrained.distance(10, 8);
        // The second level above determines the right half.
        let width = side.div_ceil(4);
        constrained.add_level(1, ConstrainedSites { width: 33, sites: vec![false; 33 * 33], means: vec![] });
        assert_eq!(constrained.distance(10, 8), far);
        let sites = (0..width * width).map(|n| n % width >= 8).collect();
        constrained.add_level(2, ConstrainedSites { width, sites, means: vec![] });
        assert_eq!(constrained.distance(10, 8), 4.0 * COARSE_DISTANCE);
        // Between both it is the nearer one that counts.
        assert_eq!(constrained.distance(3, 8), 14.0);
        // Only errors of still coarser levels show there.
        assert_eq!([1, 2, 3].map(|coarser| constrained.is_reference(coarser, 40, 32)), [false, false, true]);
        assert!(constrained.is_reference(1, 4, 32));
    }
}
