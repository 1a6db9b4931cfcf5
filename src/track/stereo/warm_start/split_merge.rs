//! Splits and merges the components of a cold start, so that each holds one object.

use super::super::{options::MIN_COMPONENT_PIXELS, voxels::Voxels};
use super::{blobs::Blob, blobs::blobs, blobs::split_gain, blobs::within};
use crate::error::Result;
use crate::mixture::{Points, Posterior};
use std::collections::BTreeSet;

/// Smallest gain of log-density per pixel for which a component is split.
const MIN_SPLIT_GAIN: f64 = 1.0;
/// Largest loss of log-density per pixel of the smaller one for which two touching components are merged:
/// pieces of an evenly covered surface explain it no better than the whole.
const MAX_MERGE_LOSS: f64 = 0.1;

/// Merges pieces of a surface and splits components of distant small objects, largest gains first; EM does
/// neither. Returns whether anything changed.
///
/// Unmerged pieces may become one component later, with either track, and leave none for small or new
/// objects.
pub(in super::super) fn split_and_merge(posterior: &mut Posterior, voxels: &Voxels, points: &Points) -> Result<bool> {
    let labels = posterior.labels(points)?;
    let mut members = vec![vec![]; posterior.components()];
    labels.iter().enumerate().for_each(|(n, &k)| members[k as usize].push(n));
    let least = MIN_COMPONENT_PIXELS;
    let mut several: Vec<(usize, Split)> =
        members.iter().enumerate().filter_map(|(k, own)| Some((k, Split::of(voxels, own, least)?))).collect();
    several.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    let wholes = members.iter().map(|own| Blob::moments(voxels, own)).collect();
    let mut pool = Pool::new(wholes, touching(voxels, &labels, members.len()), least);
    for (k, _) in &several {
        pool.exclude(*k);
    }
    while crate::ablation::keeps("stereo.join_pieces") && pool.merge_pieces() {}
    for (k, parts) in several.into_iter().filter(|_| crate::ablation::keeps("stereo.part")) {
        pool.split(k, parts);
    }
    pool.changed.iter().for_each(|&k| pool.wholes[k].place(posterior, k));
    Ok(!pool.changed.is_empty())
}

/// Which components have adjacent voxels.
fn touching(voxels: &Voxels, labels: &[u32], components: usize) -> Vec<Vec<bool>> {
    let lattice = &voxels.lattice;
    let mut dense = vec![u32::MAX; lattice.volume()];
    for (&cell, &label) in voxels.cells.iter().zip(labels) {
        dense[lattice.index(cell)] = label;
    }
    let mut touch = vec![vec![false; components]; components];
    for (&cell, &label) in voxels.cells.iter().zip(labels) {
        for by in within([1, 1, 1]) {
            let beside = lattice.shifted(cell, by).map(|cell| dense[lattice.index(cell)]);
            if let Some(beside) = beside.filter(|&beside| beside != u32::MAX) {
                touch[label as usize][beside as usize] = true;
            }
        }
    }
    touch
}

struct Split {
    /// The largest first.
    blobs: Vec<Blob>,
    /// What each pixel gains, logarithm of the density.
    gain: f64,
}

impl Split {
    /// Parts of at least `least` pixels, if they explain the pixels better than the whole.
    fn of(voxels: &Voxels, own: &[usize], least: f64) -> Option<Self> {
        let mut blobs: Vec<Blob> = blobs(voxels, own).into_iter().filter(|part| part.pixels >= least).collect();
        let gain = split_gain(&blobs);
        blobs.sort_by(|a, b| b.pixels.total_cmp(&a.pixels));
        (gain >= MIN_SPLIT_GAIN).then_some(Self { blobs, gain })
    }
}

/// Voxels of each component, and which components are free.
struct Pool {
    wholes: Vec<Blob>,
    /// Which of them touch.
    touch: Vec<Vec<bool>>,
    /// Candidates for a merge.
    pieces: Vec<usize>,
    /// Components without pixels.
    idle: BTreeSet<usize>,
    /// Components whose content changed.
    changed: BTreeSet<usize>,
}

impl Pool {
    /// Components of fewer than `least` pixels are idle.
    fn new(wholes: Vec<Blob>, touch: Vec<Vec<bool>>, least: f64) -> Self {
        let (pieces, idle): (Vec<_>, Vec<_>) = (0..wholes.len()).partition(|&k| wholes[k].pixels >= least);
        Self { wholes, touch, pieces, idle: idle.into_iter().collect(), changed: BTreeSet::new() }
    }

    fn exclude(&mut self, k: usize) {
        self.pieces.retain(|&piece| piece != k);
    }

    fn put(&mut self, k: usize, blob: Blob) {
        self.wholes[k] = blob;
        self.changed.insert(k);
    }

    /// Gives each part a component, the largest its own, while a free one costs less than the gain.
    fn split(&mut self, k: usize, Split { blobs, gain }: Split) {
        let mut left = gain * blobs.iter().map(|part| part.pixels).sum::<f64>();
        let mut blobs = blobs.into_iter();
        let Some(mut own) = blobs.next() else { return };
        let mut parted = false;
        for part in blobs {
            if let Some(at) = self.free_component(&mut left) {
                self.put(at, part);
                parted = true;
            } else {
                own.join(&part);
            }
        }
        if parted {
            self.put(k, own);
        }
    }

    /// An idle component, or one freed by the cheapest merge that loses less than `left`.
    fn free_component(&mut self, left: &mut f64) -> Option<usize> {
        if self.idle.is_empty()
            && let Some((loss, pair)) = self.cheapest(|_, _| true, |_, _| 1.0)
            && loss < *left
        {
            *left -= loss;
            self.merge(pair);
        }
        self.idle.pop_first()
    }

    /// Merges the two touching pieces that lose least. Returns whether there were any.
    fn merge_pieces(&mut self) -> bool {
        let found = self.cheapest(|a, b| self.touch[a][b], |a, b| a.pixels.min(b.pixels));
        let pieces = found.filter(|(loss, _)| *loss < MAX_MERGE_LOSS);
        if let Some((_, pair)) = pieces {
            self.merge(pair);
        }
        pieces.is_some()
    }

    /// The pair with the smallest loss of log-density, in units of `unit`.
    fn cheapest(
        &self,
        may: impl Fn(usize, usize) -> bool,
        unit: impl Fn(&Blob, &Blob) -> f64,
    ) -> Option<(f64, [usize; 2])> {
        let pieces = &self.pieces;
        let pairs = pieces.iter().enumerate().flat_map(|(n, &a)| pieces[n + 1..].iter().map(move |&b| [a, b]));
        let loss = |pair: [usize; 2]| {
            let [a, b] = pair.map(|k| &self.wholes[k]);
            split_gain(&[a, b]) * (a.pixels + b.pixels) / unit(a, b)
        };
        let losses = pairs.filter(|&[a, b]| may(a, b)).map(|pair| (loss(pair), pair));
        losses.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn merge(&mut self, [kept, freed]: [usize; 2]) {
        let mut joined = std::mem::take(&mut self.wholes[freed]);
        joined.join(&self.wholes[kept]);
        self.put(kept, joined);
        for k in 0..self.touch.len() {
            let touched = self.touch[freed][k] || self.touch[kept][k];
            (self.touch[kept][k], self.touch[k][kept]) = (touched, touched);
        }
        self.exclude(freed);
        self.idle.insert(freed);
        self.changed.insert(freed);
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::clusters::tests::synthetic_clusters;
    use super::super::tests::posterior;
    use super::*;

    #[test]
    fn two_small_objects_in_one_component_are_parted() {
        let block = |at: [u16; 3], n: u16| (0..n).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        let result = |second: [u16; 3]| {
            let cells: Vec<_> = block([10, 10, 30], 45).chain(block(second, 45)).collect();
            let voxels = synthetic_clusters(&cells, 1).voxels;
            let (values, weights) = (voxels.places(), voxels.weights());
            let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
            let mut both = posterior();
            both.means[..3].copy_from_slice(&[20.0, 16.0, 35.0]);
            (0..3).for_each(|i| both.scale_inverses[4 * i] = 60.0 * 40.0);
            (split_and_merge(&mut both, &voxels, &points).unwrap(), both.means)
        };
        let (parted, means) = result([30, 20, 40]);
        assert!(parted);
        assert_eq!(means, [11.0, 11.0, 30.0, 31.0, 21.0, 40.0]);
        // Adjacent blocks are one object.
        assert!(!result([14, 10, 30]).0);
    }

    #[test]
    fn what_is_in_front_of_a_surface_is_no_piece_of_it() {
        let strip = (0..480).map(|i| ([10 + i % 24, 40 + i / 24 % 5, 30], 0));
        // A piece of the surface, an object two layers in front of it, and one beyond a gap.
        let result = |left: u16, depth: u16| {
            let beside = (0..240).map(move |i| ([left + i % 12, 40 + i / 12 % 5, depth], 1));
            let voxels = synthetic_clusters(&strip.clone().chain(beside).collect::<Vec<_>>(), 2).voxels;
            let (values, weights) = (voxels.places(), voxels.weights());
            let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
            let mut two = posterior();
            two.means = vec![21.5, 42.0, 30.0, f64::from(left) + 5.5, 42.0, f64::from(depth)];
            two.scale_inverses = [48.0, 2.0, 0.1, 12.0, 2.0, 0.1]
                .iter()
                .enumerate()
                .flat_map(|(i, s)| (0..3).map(move |j| if i % 3 == j { 60.0 * s } else { 0.0 }))
                .collect();
            let changed = split_and_merge(&mut two, &voxels, &points).unwrap();
            let labels = two.labels(&points).unwrap();
            (changed, labels.iter().collect::<std::collections::BTreeSet<_>>().len())
        };
        assert_eq!(result(34, 30), (true, 1));
        assert_eq!(result(34, 32), (false, 2));
        assert_eq!(result(35, 30), (false, 2));
    }
}
