//! What the M step needs to know of the points.

use super::points::Points;

/// Weight, mean and scatter of the points of each component: (18) to (20), with `scatter_k = N_k S_k`.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    /// D.
    pub dimensions: usize,
    /// `N_k` (K).
    pub counts: Vec<f64>,
    /// Means (K, D); anything where `N_k` is 0.
    pub means: Vec<f64>,
    /// `N_k S_k` (K, D, D).
    pub scatters: Vec<f64>,
}

impl Moments {
    /// Those of no points.
    pub fn none(components: usize, dimensions: usize) -> Self {
        Self {
            dimensions,
            counts: vec![0.0; components],
            means: vec![0.0; components * dimensions],
            scatters: vec![0.0; components * dimensions * dimensions],
        }
    }

    /// K.
    pub fn components(&self) -> usize {
        self.counts.len()
    }

    /// Those of points about `centre`: means first, then scatters about them. `shares(n, take)` hands each
    /// responsibility of point n that is not 0, `(k, r_nk)`, to `take`.
    pub(super) fn of(
        points: &Points,
        centre: &[f64],
        components: usize,
        shares: impl Fn(usize, &mut dyn FnMut(usize, f64)),
    ) -> Self {
        let d = points.dimensions;
        let mut this = Self::none(components, d);
        for n in 0..points.count() {
            shares(n, &mut |k, share| {
                let weight = points.weight(n) * share;
                this.counts[k] += weight;
                for (i, (x, c)) in points.at(n).iter().zip(centre).enumerate() {
                    this.means[k * d + i] += weight * (x - c);
                }
            });
        }
        for (k, count) in this.counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            this.means[k * d..(k + 1) * d].iter_mut().for_each(|mean| *mean /= count);
        }
        let mut off = vec![0.0; d];
        for n in 0..points.count() {
            shares(n, &mut |k, share| {
                for (i, off) in off.iter_mut().enumerate() {
                    *off = points.at(n)[i] - centre[i] - this.means[k * d + i];
                }
                add_outer(&mut this.scatters[k * d * d..(k + 1) * d * d], &off, points.weight(n) * share);
            });
        }
        this
    }

    /// Every weight times a factor.
    pub(super) fn scale(&mut self, factor: f64) {
        self.counts.iter_mut().chain(&mut self.scatters).for_each(|value| *value *= factor);
    }

    /// These and others of as many components together.
    pub(super) fn merged(&self, other: &Self) -> Self {
        let d = self.dimensions;
        let mut all = self.clone();
        let mut off = vec![0.0; d];
        for k in 0..self.components() {
            let [ours, theirs] = [self.counts[k], other.counts[k]];
            let count = ours + theirs;
            if theirs == 0.0 || count == 0.0 {
                continue;
            }
            all.counts[k] = count;
            for (i, off) in off.iter_mut().enumerate() {
                *off = other.means[k * d + i] - self.means[k * d + i];
                all.means[k * d + i] = self.means[k * d + i] + *off * theirs / count;
            }
            let scatter = &mut all.scatters[k * d * d..(k + 1) * d * d];
            for (sum, more) in scatter.iter_mut().zip(&other.scatters[k * d * d..]) {
                *sum += more;
            }
            add_outer(scatter, &off, ours * (theirs / count));
        }
        all
    }

    /// The components in another order, of any length: component k of the result is `order[k]`.
    pub(super) fn reordered(&self, order: &[usize]) -> Self {
        let d = self.dimensions;
        let rows = |values: &[f64], length: usize| -> Vec<f64> {
            order.iter().flat_map(|k| &values[k * length..(k + 1) * length]).copied().collect()
        };
        Self {
            dimensions: d,
            counts: rows(&self.counts, 1),
            means: rows(&self.means, d),
            scatters: rows(&self.scatters, d * d),
        }
    }

    /// Puts the only component of `one` in the place of component `k`.
    pub(super) fn replace(&mut self, k: usize, one: &Self) {
        let d = self.dimensions;
        self.counts[k] = one.counts[0];
        self.means[k * d..(k + 1) * d].copy_from_slice(&one.means);
        self.scatters[k * d * d..(k + 1) * d * d].copy_from_slice(&one.scatters);
    }

    /// Only the components for which `keep` holds.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        let d = self.dimensions;
        keep_rows(&mut self.counts, 1, keep);
        keep_rows(&mut self.means, d, keep);
        keep_rows(&mut self.scatters, d * d, keep);
    }
}

/// `matrix += weight off off^T`.
fn add_outer(matrix: &mut [f64], off: &[f64], weight: f64) {
    let d = off.len();
    for i in 0..d {
        for j in 0..d {
            matrix[i * d + j] += weight * off[i] * off[j];
        }
    }
}

/// Leaves out rows of `length` values.
pub(super) fn keep_rows(values: &mut Vec<f64>, length: usize, keep: &[bool]) {
    let mut at = 0;
    values.retain(|_| {
        at += 1;
        keep[(at - 1) / length]
    });
}
