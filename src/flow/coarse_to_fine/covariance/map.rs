//! Covariance at pixels, interpolated from the nodes.

use super::Entries;
use crate::flow::coarse_to_fine::nodes::{NODE_SPACING, NodeAxis};
use crate::flow::coarse_to_fine::planes::Planes;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::SimdReal;

/// A covariance that is linear between nodes, hence positive definite where theirs is.
#[derive(Debug, Default)]
pub(in crate::flow::coarse_to_fine) struct CovarianceMap<T> {
    planes: Planes<T>,
    along: NodeAxis,
    across: NodeAxis,
    /// Pixels from one node to the next.
    step: usize,
    /// Numbers of those pixels.
    ramp: Vec<T>,
}

impl<T: SimdReal> CovarianceMap<T> {
    /// From nodes, row by row, of the given level of the pyramid: flow is scaled to pixels of the frame.
    pub(super) fn new(nodes: &[Entries], (along, across): (NodeAxis, NodeAxis), level: usize) -> Self {
        let factor = f64::from(1 << level as u32);
        let mut scale = [0.0; ENTRIES];
        for (i, j) in (0..6).flat_map(|i| (i..6).map(move |j| (i, j))) {
            scale[upper(i, j)] = factor.powi(i32::from(i < 2) + i32::from(j < 2));
        }
        let mut planes = Planes::new(along.count, across.count, ENTRIES);
        for (y, row) in nodes.chunks_exact(along.count.max(1)).enumerate() {
            for k in 0..ENTRIES {
                let line = planes.line_mut(k, y);
                line.iter_mut().zip(row).for_each(|(out, node)| *out = T::from_f64(scale[k] * node[k]));
            }
        }
        let step = NODE_SPACING << level;
        Self { planes, along, across, step, ramp: (0..step).map(|i| T::from_f64(i as f64)).collect() }
    }

    pub fn at(&self, k: usize, (x, y): (usize, usize)) -> T {
        let node = |at: usize| at as f64 / self.step as f64;
        let ((left, right, across), (above, below, share)) = (self.along.around(node(x)), self.across.around(node(y)));
        let row = |y: usize| {
            let (a, b) = (self.planes.at(k, left, y).to_f64(), self.planes.at(k, right, y).to_f64());
            a + (b - a) * across
        };
        T::from_f64(row(above) + (row(below) - row(above)) * share)
    }

    /// Entry `k` along row `y`, to the end of `out`; `nodes` is scratch memory.
    #[inline(always)]
    pub fn row(&self, k: usize, y: usize, nodes: &mut Vec<T>, out: &mut [T]) {
        let (above, below, share) = self.across.around(y as f64 / self.step as f64);
        let share = T::from_f64(share);
        nodes.clear();
        let (upper, lower) = (self.planes.line(k, above), self.planes.line(k, below));
        nodes.extend(upper.iter().zip(lower).map(|(&a, &b)| a + (b - a) * share));
        let last = nodes.len() - 1;
        for (n, out) in out.chunks_mut(self.step).enumerate() {
            let (first, next) = (nodes[n.min(last)], nodes[(n + 1).min(last)]);
            let length = self.step as f64 * self.along.length(n);
            let rise = (next - first) * T::from_f64(if length > 0.0 { 1.0 / length } else { 0.0 });
            if out.len() == self.step && length == self.step as f64 {
                // Parts of known length, so that the compiler uses lanes.
                for (out, ramp) in out.chunks_exact_mut(NODE_SPACING).zip(self.ramp.chunks_exact(NODE_SPACING)) {
                    for i in 0..NODE_SPACING {
                        out[i] = first + rise * ramp[i];
                    }
                }
                continue;
            }
            let (sloping, flat) = out.split_at_mut(out.len().min(length.ceil() as usize));
            for (out, i) in sloping.iter_mut().zip(&self.ramp) {
                *out = first + rise * *i;
            }
            flat.fill(next);
        }
    }
}
