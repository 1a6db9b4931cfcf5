//! Connected voxels and their moments.

use super::super::options::{
    COVARIANCE_PRIOR, DEGREES_OF_FREEDOM_PRIOR, MEAN_PRECISION_PRIOR, WEIGHT_CONCENTRATION_PRIOR,
};
use super::super::voxels::Voxels;
use super::D;
use crate::mixture::Posterior;
use nalgebra::Matrix3;
use std::borrow::Borrow;

/// Largest distance of neighbours in a blob, cells along x, y and disparity.
const SEED_REACH: [i32; D] = [2, 2, 1];

/// Mean gain of log-density per pixel from separate components instead of one.
pub(super) fn split_gain<B: Borrow<Blob>>(parts: &[B]) -> f64 {
    if parts.len() < 2 {
        return 0.0;
    }
    let mut whole = Blob::default();
    let parts = || parts.iter().map(Borrow::borrow);
    for part in parts() {
        whole.join(part);
    }
    let apart: f64 =
        parts().map(|part| part.pixels * log_density(part.pixels / whole.pixels, &part.covariance())).sum();
    apart / whole.pixels - log_density(1.0, &whole.covariance())
}

/// Log-density at one standard deviation along every axis of a component with this share of the pixels.
pub(super) fn log_density(share: f64, covariance: &Matrix3<f64>) -> f64 {
    share.ln() - 0.5 * (D as f64 + (std::f64::consts::TAU.powi(D as i32) * covariance.determinant()).ln())
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Blob {
    /// The voxels.
    pub members: Vec<usize>,
    pub pixels: f64,
    /// `sum f x`, cells.
    sums: [f64; D],
    /// `sum f x x^T`.
    squares: [f64; D * D],
}

impl Blob {
    /// Moments of some voxels; their indices are not kept.
    pub fn moments(voxels: &Voxels, some: &[usize]) -> Self {
        let mut out = Self::default();
        for &n in some {
            out.count(voxels.place(n), f64::from(voxels.counts[n]));
        }
        out
    }

    fn add(&mut self, voxel: usize, place: [f64; D], count: f64) {
        self.members.push(voxel);
        self.count(place, count);
    }

    fn count(&mut self, place: [f64; D], count: f64) {
        self.pixels += count;
        for i in 0..D {
            self.sums[i] += count * place[i];
            for j in 0..D {
                self.squares[i * D + j] += count * place[i] * place[j];
            }
        }
    }

    /// Adds the voxels of another blob.
    pub fn join(&mut self, other: &Self) {
        self.members.extend(&other.members);
        self.pixels += other.pixels;
        (0..D).for_each(|i| self.sums[i] += other.sums[i]);
        (0..D * D).for_each(|i| self.squares[i] += other.squares[i]);
    }

    /// Mean place, cells.
    pub fn middle(&self) -> [f64; D] {
        self.sums.map(|sum| sum / self.pixels)
    }

    /// Covariance, cells^2, with the quantisation variance of a cell, 1/12.
    pub fn covariance(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| {
            let counting = if i == j { 1.0 / 12.0 } else { 0.0 };
            (self.squares[i * D + j] - self.sums[i] * self.sums[j] / self.pixels) / self.pixels + counting
        })
    }

    /// Whether its density at one standard deviation counts as explained, among `all` pixels; wrong matches
    /// are spread too thinly.
    pub fn explains_itself(&self, all: f64, explained: f64) -> bool {
        log_density(self.pixels / all, &self.covariance()) >= explained
    }

    /// Sets component `k` to the posterior of these pixels alone; without pixels, to the prior at its old
    /// mean.
    pub fn place(&self, posterior: &mut Posterior, k: usize) {
        posterior.weight_concentration[k] = WEIGHT_CONCENTRATION_PRIOR + self.pixels;
        posterior.mean_precision[k] = MEAN_PRECISION_PRIOR + self.pixels;
        posterior.degrees_of_freedom[k] = DEGREES_OF_FREEDOM_PRIOR + self.pixels;
        let scatter = if self.pixels > 0.0 { self.pixels * self.covariance() } else { Matrix3::zeros() };
        for i in 0..D {
            if self.pixels > 0.0 {
                posterior.means[k * D + i] = self.middle()[i];
            }
            for j in 0..D {
                let prior = if i == j { COVARIANCE_PRIOR } else { 0.0 };
                posterior.scale_inverses[(k * D + i) * D + j] = prior + scatter[(i, j)];
            }
        }
    }
}

/// Connected components of some voxels, in the order of their first ones.
pub(super) fn blobs(voxels: &Voxels, some: &[usize]) -> Vec<Blob> {
    let lattice = &voxels.lattice;
    if some.is_empty() {
        return vec![];
    }
    let mut waiting = vec![u32::MAX; lattice.volume()];
    for &n in some {
        waiting[lattice.index(voxels.cells[n])] = n as u32;
    }
    let mut take = |cell: [u16; D]| {
        let slot = &mut waiting[lattice.index(cell)];
        Some(std::mem::replace(slot, u32::MAX)).filter(|&n| n != u32::MAX).map(|n| n as usize)
    };
    let mut out = Vec::new();
    for &first in some {
        let Some(first) = take(voxels.cells[first]) else { continue };
        let (mut blob, mut front) = (Blob::default(), vec![first]);
        while let Some(n) = front.pop() {
            blob.add(n, voxels.place(n), f64::from(voxels.counts[n]));
            let beside = within(SEED_REACH).filter_map(|by| lattice.shifted(voxels.cells[n], by));
            front.extend(beside.filter_map(&mut take));
        }
        out.push(blob);
    }
    out
}

/// Shifts to the voxels no farther along x, y and disparity.
pub(super) fn within([x, y, z]: [i32; D]) -> impl Iterator<Item = [i32; D]> {
    (-z..=z).flat_map(move |dz| (-y..=y).flat_map(move |dy| (-x..=x).map(move |dx| [dx, dy, dz])))
}
