//! Constrained directions: where the data determine the motion, and in which directions.

use super::{noise::ALL, noise::NONE, noise::Noise, noise::UnconstrainedDirections};
use crate::flow::coarse_to_fine::data_term::{MIN_USABLE_SHARE, SEEN, UU, UV, VV};
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::refine::SITES_PER_NODE;
use crate::parallel::for_each_band;
use crate::simd::SimdReal;
use std::f64::consts::SQRT_2;

/// Minimum share of constrained sites from which the errors of coarse levels are measured.
const MIN_CONSTRAINED_SHARE: f64 = 0.02;
/// Reach, sites, of the mean of the information.
const INFORMATION_REACH: usize = 1;

pub(super) struct ConstrainedDirections {
    width: usize,
    /// Distance of every site from the nearest fully constrained one, px; 0 where nothing is usable, infinite
    /// where one direction is unconstrained and nearly no site is constrained.
    distances: Vec<f64>,
    /// Reference sites for the errors of coarser levels, row by row: usable and constrained.
    reference_sites: Vec<bool>,
    /// Means over the unconstrained sites of every node, row by row.
    directions: Vec<[f64; 3]>,
}

impl ConstrainedDirections {
    pub fn new<T: SimdReal>(data: &Planes<T>, noise: &Noise<'_, T>, nodes: (usize, usize)) -> Self {
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
        Self::with((width, &sites), nodes, is_usable)
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
        let reference_sites = (0..constrained.len()).map(|n| constrained[n] && is_usable(n)).collect();
        let mut out = Self { width, distances, reference_sites, directions: Vec::new() };
        out.directions = if count == sites.len() {
            vec![[0.0; 3]; nodes.0 * nodes.1]
        } else {
            (0..nodes.0 * nodes.1).map(|n| out.mean_directions(sites, n % nodes.0, n / nodes.0)).collect()
        };
        out
    }

    pub fn is_reference(&self, x: usize, y: usize) -> bool {
        self.reference_sites[y * self.width + x]
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

/// From every site to the nearest `constrained` one, px: the shortest path along rows, columns and diagonals.
fn distances(width: usize, constrained: &[bool]) -> Vec<f64> {
    let mut out: Vec<f64> =
        constrained.iter().map(|constrained| if *constrained { 0.0 } else { f64::INFINITY }).collect();
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
        assert!((0..side).all(|x| !constrained.is_reference(x, 0)));
    }
}
