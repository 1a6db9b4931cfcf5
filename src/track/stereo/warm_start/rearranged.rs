//! From components that seeds of a whole scene ended in to those of things.

use super::super::options::StereoTrackerOptions;
use super::super::voxels::Voxels;
use super::blobs::{Blob, blobs, gain_of_parting, within};
use crate::error::Result;
use crate::mixture::{Points, Posterior};
use std::collections::BTreeSet;

/// Least gain of a component's pixels in logarithm of the density, each, for which its parts are better
/// components.
const WORTH_PARTING: f64 = 1.0;
/// Most that each pixel of the smaller of two components that touch may lose, logarithm of the density, for
/// them to be pieces of one surface: of what is spread evenly, pieces are no better than the whole.
const PIECES: f64 = 0.1;

/// Makes one component of the pieces of a surface, and several of one that holds small things far from one
/// another: rounds find out of neither. The things that gain most come first. Tells whether there was
/// anything to do; where components are not to be seeded anew (`reseed_below` 0), there is not.
///
/// Left as they are, two pieces may become one at some later step, with either's name; and they leave no
/// component for what is small, or comes to light.
///
/// # Errors
/// Those of the mixture.
pub(in super::super) fn rearrange(
    posterior: &mut Posterior,
    voxels: &Voxels,
    points: &Points,
    options: &StereoTrackerOptions,
) -> Result<bool> {
    if options.reseed_below <= 0.0 {
        return Ok(false);
    }
    let labels = posterior.labels(points)?;
    let mut members = vec![vec![]; posterior.components()];
    labels.iter().enumerate().for_each(|(n, &k)| members[k as usize].push(n));
    let least = options.reseed_below.max(1.0);
    let mut several: Vec<(usize, Parts)> =
        members.iter().enumerate().filter_map(|(k, own)| Some((k, Parts::of(voxels, own, least)?))).collect();
    several.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    let wholes = members.iter().map(|own| Blob::moments(voxels, own)).collect();
    let mut pool = Pool::new(wholes, touching(voxels, &labels, members.len()), least);
    for (k, _) in &several {
        pool.leave_alone(*k);
    }
    while crate::ablation::keeps("stereo.join_pieces") && pool.join_pieces() {}
    for (k, parts) in several.into_iter().filter(|_| crate::ablation::keeps("stereo.part")) {
        pool.part(k, parts);
    }
    pool.changed.iter().for_each(|&k| pool.wholes[k].place(posterior, k, options));
    Ok(!pool.changed.is_empty())
}

/// Which components have voxels beside one another.
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

/// A component's parts that are far from one another.
struct Parts {
    /// The largest first.
    blobs: Vec<Blob>,
    /// What each pixel gains, logarithm of the density.
    gain: f64,
}

impl Parts {
    /// Those of `least` pixels and more, where they are better components than the whole.
    fn of(voxels: &Voxels, own: &[usize], least: f64) -> Option<Self> {
        let mut blobs: Vec<Blob> = blobs(voxels, own).into_iter().filter(|part| part.pixels >= least).collect();
        let gain = gain_of_parting(&blobs);
        blobs.sort_by(|a, b| b.pixels.total_cmp(&a.pixels));
        (gain >= WORTH_PARTING).then_some(Self { blobs, gain })
    }
}

/// What components hold, and which of them can be had.
struct Pool {
    wholes: Vec<Blob>,
    /// Which of them touch.
    touch: Vec<Vec<bool>>,
    /// Those that may be pieces of something.
    pieces: Vec<usize>,
    /// Those that hold nothing, or next to nothing.
    idle: BTreeSet<usize>,
    /// Those that hold something else than at first.
    changed: BTreeSet<usize>,
}

impl Pool {
    /// Those of fewer than `least` pixels are idle.
    fn new(wholes: Vec<Blob>, touch: Vec<Vec<bool>>, least: f64) -> Self {
        let (pieces, idle): (Vec<_>, Vec<_>) = (0..wholes.len()).partition(|&k| wholes[k].pixels >= least);
        Self { wholes, touch, pieces, idle: idle.into_iter().collect(), changed: BTreeSet::new() }
    }

    /// Takes a component for no piece of anything.
    fn leave_alone(&mut self, k: usize) {
        self.pieces.retain(|&piece| piece != k);
    }

    fn put(&mut self, k: usize, blob: Blob) {
        self.wholes[k] = blob;
        self.changed.insert(k);
    }

    /// Gives the parts of component `k` one each, the largest its own, as far as there are components to be
    /// had for less than is gained; what gets none stays with the largest.
    fn part(&mut self, k: usize, Parts { blobs, gain }: Parts) {
        let mut left = gain * blobs.iter().map(|part| part.pixels).sum::<f64>();
        let mut blobs = blobs.into_iter();
        let Some(mut own) = blobs.next() else { return };
        let mut parted = false;
        for part in blobs {
            if let Some(at) = self.take(&mut left) {
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

    /// An idle component, or one of two that lose less than what is `left` to be lost as one.
    fn take(&mut self, left: &mut f64) -> Option<usize> {
        if self.idle.is_empty()
            && let Some((loss, pair)) = self.cheapest(|_, _| true, |_, _| 1.0)
            && loss < *left
        {
            *left -= loss;
            self.join(pair);
        }
        self.idle.pop_first()
    }

    /// Makes those two pieces of a surface one that lose the least by it. Tells whether there were such.
    fn join_pieces(&mut self) -> bool {
        let found = self.cheapest(|a, b| self.touch[a][b], |a, b| a.pixels.min(b.pixels));
        let pieces = found.filter(|(loss, _)| *loss < PIECES);
        if let Some((_, pair)) = pieces {
            self.join(pair);
        }
        pieces.is_some()
    }

    /// The two, of those that may be, whose pixels lose the least as one, in units of `unit`, and how much,
    /// logarithm of the density.
    fn cheapest(
        &self,
        may: impl Fn(usize, usize) -> bool,
        unit: impl Fn(&Blob, &Blob) -> f64,
    ) -> Option<(f64, [usize; 2])> {
        let pieces = &self.pieces;
        let pairs = pieces.iter().enumerate().flat_map(|(n, &a)| pieces[n + 1..].iter().map(move |&b| [a, b]));
        let loss = |pair: [usize; 2]| {
            let [a, b] = pair.map(|k| &self.wholes[k]);
            gain_of_parting(&[a, b]) * (a.pixels + b.pixels) / unit(a, b)
        };
        let losses = pairs.filter(|&[a, b]| may(a, b)).map(|pair| (loss(pair), pair));
        losses.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Makes two one, and the second idle.
    fn join(&mut self, [kept, freed]: [usize; 2]) {
        let mut joined = std::mem::take(&mut self.wholes[freed]);
        joined.join(&self.wholes[kept]);
        self.put(kept, joined);
        for k in 0..self.touch.len() {
            let touched = self.touch[freed][k] || self.touch[kept][k];
            (self.touch[kept][k], self.touch[k][kept]) = (touched, touched);
        }
        self.leave_alone(freed);
        self.idle.insert(freed);
        self.changed.insert(freed);
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::clusters::tests::made_up;
    use super::super::tests::{posterior, with_a_third};
    use super::*;

    #[test]
    fn two_small_things_in_one_component_are_parted() {
        let block = |at: [u16; 3], n: u16| (0..n).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        let told = |second: [u16; 3]| {
            let cells: Vec<_> = block([10, 10, 30], 45).chain(block(second, 45)).collect();
            let voxels = made_up(&cells, 1).voxels;
            let (values, weights) = (voxels.places(), voxels.weights());
            let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
            let mut both = posterior();
            both.means[..3].copy_from_slice(&[20.0, 16.0, 35.0]);
            (0..3).for_each(|i| both.scale_inverses[4 * i] = 60.0 * 40.0);
            (rearrange(&mut both, &voxels, &points, &StereoTrackerOptions::default()).unwrap(), both.means)
        };
        let (parted, means) = told([30, 20, 40]);
        assert!(parted);
        assert_eq!(means, [11.0, 11.0, 30.0, 31.0, 21.0, 40.0]);
        // Beside one another they are one thing.
        assert!(!told([14, 10, 30]).0);
    }

    #[test]
    fn pieces_of_a_surface_make_room_where_no_component_is_idle() {
        let strip = |x: u16| (0..240).map(move |i| ([x + i % 12, 40 + i / 12 % 5, 30], 0));
        let block = |at: [u16; 3]| (0..45).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        // A wall of which two components hold a half each, and a third that holds two small things.
        let cells: Vec<_> = strip(10).chain(strip(22)).chain(block([10, 10, 40])).chain(block([40, 20, 50])).collect();
        let voxels = made_up(&cells, 1).voxels;
        let (values, weights) = (voxels.places(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut three = with_a_third();
        three.means = vec![15.5, 42.0, 30.0, 27.5, 42.0, 30.0, 26.0, 16.0, 45.0];
        three.scale_inverses = [60.0 * 12.0, 60.0 * 12.0, 60.0 * 60.0]
            .iter()
            .flat_map(|&s| [s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s / 12.0])
            .collect();
        three.scale_inverses[26] = 60.0 * 25.0;
        // Nothing is where components are not to be seeded anew.
        let never = StereoTrackerOptions { reseed_below: 0.0, ..StereoTrackerOptions::default() };
        assert!(!rearrange(&mut three, &voxels, &points, &never).unwrap());
        assert!(rearrange(&mut three, &voxels, &points, &StereoTrackerOptions::default()).unwrap());
        let labels = three.labels(&points).unwrap();
        let of = |x: u16, y: u16| labels[voxels.cells.iter().position(|c| c[..2] == [x, y]).unwrap()];
        assert_eq!(of(10, 40), of(33, 44));
        let three_things = [of(10, 40), of(11, 11), of(41, 21)];
        assert_eq!(three_things.iter().collect::<std::collections::BTreeSet<_>>().len(), 3);
    }

    #[test]
    fn what_is_in_front_of_a_surface_is_no_piece_of_it() {
        let strip = (0..480).map(|i| ([10 + i % 24, 40 + i / 24 % 5, 30], 0));
        // As large a piece of the surface, something two layers in front of it, and something beyond a gap.
        let told = |left: u16, depth: u16| {
            let beside = (0..240).map(move |i| ([left + i % 12, 40 + i / 12 % 5, depth], 1));
            let voxels = made_up(&strip.clone().chain(beside).collect::<Vec<_>>(), 2).voxels;
            let (values, weights) = (voxels.places(), voxels.weights());
            let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
            let mut two = posterior();
            two.means = vec![21.5, 42.0, 30.0, f64::from(left) + 5.5, 42.0, f64::from(depth)];
            two.scale_inverses = [48.0, 2.0, 0.1, 12.0, 2.0, 0.1]
                .iter()
                .enumerate()
                .flat_map(|(i, s)| (0..3).map(move |j| if i % 3 == j { 60.0 * s } else { 0.0 }))
                .collect();
            let changed = rearrange(&mut two, &voxels, &points, &StereoTrackerOptions::default()).unwrap();
            let labels = two.labels(&points).unwrap();
            (changed, labels.iter().collect::<std::collections::BTreeSet<_>>().len())
        };
        assert_eq!(told(34, 30), (true, 1));
        assert_eq!(told(34, 32), (false, 2));
        assert_eq!(told(35, 30), (false, 2));
    }

    #[test]
    fn parts_for_which_there_is_no_component_stay_where_they_are() {
        let block = |at: [u16; 3]| (0..45).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        // Two in one component, and a third thing as far away as they are from one another.
        let cells: Vec<_> = block([10, 10, 30]).chain(block([30, 20, 40])).chain(block([60, 50, 10])).collect();
        let voxels = made_up(&cells, 1).voxels;
        let (values, weights) = (voxels.places(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut two = posterior();
        two.means = vec![20.0, 16.0, 35.0, 61.0, 51.0, 10.0];
        (0..3).for_each(|i| two.scale_inverses[4 * i] = 60.0 * 40.0);
        let before = two.clone();
        assert!(!rearrange(&mut two, &voxels, &points, &StereoTrackerOptions::default()).unwrap());
        assert_eq!(two, before);
    }
}
