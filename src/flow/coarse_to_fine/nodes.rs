//! Nodes, every fourth site: where errors are described.

use super::data_term::MEANS;
use super::planes::{Planes, SITE_SPACING};
use super::refine::{SITES_PER_NODE, node_count};
use crate::parallel;
use crate::simd::{Level, SimdReal};

/// Distance of the nodes, pixels of the estimate's level.
pub(super) const NODE_SPACING: usize = SITES_PER_NODE * SITE_SPACING as usize;

/// Sums of `P_uu, P_uv, P_vv`, of the right sides that the motion leaves, and of the residual energy.
pub(super) type NodeSums = [f64; MEANS];
/// Entries `xx, xy, yy` of a symmetric matrix.
pub(super) type Square = [f64; 3];

/// The nodes along one axis, at equal distances except the last two: the last one is at the last site.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct NodeAxis {
    pub count: usize,
    /// Position of the last node, in distances of the others.
    end: f64,
}

impl NodeAxis {
    pub fn of(sites: usize) -> Self {
        Self { count: node_count(sites), end: (sites - 1) as f64 / SITES_PER_NODE as f64 }
    }

    /// The nodes around a coordinate and the weight of the second; beyond the last, that one alone.
    pub fn around(&self, at: f64) -> (usize, usize, f64) {
        let at = at.clamp(0.0, self.end);
        let first = (at as usize).min(self.count.saturating_sub(2));
        let length = self.length(first);
        (first, (first + 1).min(self.count - 1), if length > 0.0 { (at - first as f64) / length } else { 0.0 })
    }

    pub fn length(&self, first: usize) -> f64 {
        (self.end - first as f64).clamp(0.0, 1.0)
    }
}

/// Mean of each node and its neighbours with the weights `[1, 2, 1] / 4` along both axes.
pub(super) fn binomial_mean<const N: usize>(nodes: &mut [[f64; N]], (width, height): (usize, usize)) {
    let Some(&last) = nodes.last() else { return };
    let mean = |out: &mut [[f64; N]], around: [&[[f64; N]]; 3]| {
        // Loops over single values, so that the compiler uses lanes.
        let [before, here, after] = around.map(|nodes| nodes.as_flattened().iter());
        for (out, ((a, b), c)) in out.as_flattened_mut().iter_mut().zip(before.zip(here).zip(after)) {
            *out = 0.25 * (a + c) + 0.5 * b;
        }
    };
    let mut old = vec![last; width + 2];
    for row in nodes.chunks_exact_mut(width) {
        old[1..=width].copy_from_slice(row);
        (old[0], old[width + 1]) = (old[1], old[width]);
        mean(row, [&old, &old[1..], &old[2..]]);
    }
    let old = nodes.to_vec();
    let line = |y: usize| &old[y * width..(y + 1) * width];
    for (y, row) in nodes.chunks_exact_mut(width).enumerate() {
        mean(row, [line(y.saturating_sub(1)), line(y), line((y + 1).min(height - 1))]);
    }
}

/// Sums over all nodes with weights that fall by the factor `decay` from node to node, along both axes.
pub(super) fn decaying_sums<const N: usize>(nodes: &mut [[f64; N]], (width, height): (usize, usize), decay: f64) {
    let mut along = |first: usize, step: usize, count: usize| {
        let own: Vec<[f64; N]> = (0..count).map(|k| nodes[first + k * step]).collect();
        for is_backward in [false, true] {
            // Of the nodes before this one.
            let mut sum = [0.0; N];
            for k in 0..count {
                let k = if is_backward { count - 1 - k } else { k };
                for (c, value) in nodes[first + k * step].iter_mut().enumerate() {
                    *value += sum[c];
                    sum[c] = decay * (sum[c] + own[k][c]);
                }
            }
        }
    };
    (0..height).for_each(|y| along(y * width, 1, width));
    (0..width).for_each(|x| along(x, width, height));
}

/// Sites around a node along one axis, with the weights of a triangular window; neighbours' overlap by half.
pub(super) fn sites_around(node: usize, sites: usize) -> impl Iterator<Item = (usize, f64)> {
    let centre = (SITES_PER_NODE * node).min(sites - 1);
    let range = (centre + 1).saturating_sub(SITES_PER_NODE)..(centre + SITES_PER_NODE).min(sites);
    range.map(move |site| (site, (SITES_PER_NODE - site.abs_diff(centre)) as f64))
}

/// Sums in triangular windows around the nodes, row by row; they overlap by half.
pub(super) fn node_sums<T: SimdReal, const N: usize>(
    simd: Level,
    data: &Planes<T>,
    (columns, rows): (usize, usize),
) -> Vec<[f64; N]> {
    let row = |n: usize| {
        let down = data.weighted_rows(simd, sites_around(n, data.height));
        let node = |n: usize| {
            let sum =
                |k: usize| sites_around(n, data.width).map(|(x, weight)| weight * down.at(k, x, 0).to_f64()).sum();
            std::array::from_fn(sum)
        };
        (0..columns).map(node).collect::<Vec<[f64; N]>>()
    };
    parallel::map(0..rows, row).concat()
}
