//! Components that hold several things, and where the components to part them with come from.

use super::super::options::StereoTrackerOptions;
use super::super::voxels::Voxels;
use super::blobs::{Blob, blobs, gain_of_parting};
use crate::error::Result;
use crate::mixture::{Points, Posterior};

/// Least gain of a component's pixels in logarithm of the density, each, for which its parts are better components.
const WORTH_PARTING: f64 = 1.0;

/// Seeds components at the parts of others whose voxels lie far from one another: seeds of a whole scene may put two small things into one component, from which rounds do not find out. The parts that gain most come
/// first. What they are seeded with are those to which fewer than `reseed_below` pixels belong, and then one of two that lose less as one than is gained: pieces of a surface. Tells whether there were any.
///
/// # Errors
/// Those of the mixture.
pub(in super::super) fn part(
    posterior: &mut Posterior,
    voxels: &Voxels,
    points: &Points,
    options: &StereoTrackerOptions,
) -> Result<bool> {
    let labels = posterior.labels(points)?;
    let mut members = vec![vec![]; posterior.components()];
    labels.iter().enumerate().for_each(|(n, &k)| members[k as usize].push(n));
    let least = options.reseed_below.max(1.0);
    let mut worth: Vec<(usize, Parts)> =
        members.iter().enumerate().filter_map(|(k, own)| Some((k, Parts::of(voxels, own, least)?))).collect();
    worth.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
    let mut wholes: Vec<Option<Blob>> = members.iter().map(|own| Some(Blob::of(voxels, own))).collect();
    // Who is going to be parted is no piece of something else.
    worth.iter().for_each(|(k, _)| wholes[*k] = None);
    let mut parted = false;
    for (k, Parts { blobs, gain }) in worth {
        let pixels: f64 = blobs.iter().map(|part| part.pixels).sum();
        let mut at = k;
        for (i, part) in blobs.iter().enumerate() {
            if i > 0 {
                let Some(free) = spare(&mut wholes, posterior, gain * pixels, options) else { break };
                at = free;
                parted = true;
            }
            part.place(posterior, at, options);
        }
    }
    Ok(parted)
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

/// A component that can be had: one of few pixels, or one of the two that lose the least as one, less than `gain`; the other of them is made the two.
fn spare(
    wholes: &mut [Option<Blob>],
    posterior: &mut Posterior,
    gain: f64,
    options: &StereoTrackerOptions,
) -> Option<usize> {
    let few = |whole: &Option<Blob>| whole.as_ref().is_some_and(|whole| whole.pixels < options.reseed_below);
    if let Some(idle) = wholes.iter().position(few) {
        wholes[idle] = None;
        return Some(idle);
    }
    let [kept, freed] = cheapest_pair(wholes, gain)?;
    let freed_whole = wholes[freed].take()?;
    let joined = wholes[kept].as_mut()?;
    joined.join(&freed_whole);
    joined.place(posterior, kept, options);
    Some(freed)
}

/// The two that lose the least as one, where that is less than `gain` in all.
fn cheapest_pair(wholes: &[Option<Blob>], gain: f64) -> Option<[usize; 2]> {
    let known: Vec<(usize, &Blob)> =
        wholes.iter().enumerate().filter_map(|(k, whole)| Some((k, whole.as_ref()?))).collect();
    let pairs = known.iter().enumerate().flat_map(|(n, &a)| known[n + 1..].iter().map(move |&b| [a, b]));
    let lost = |[(_, a), (_, b)]: [(usize, &Blob); 2]| gain_of_parting(&[a, b]) * (a.pixels + b.pixels);
    let costs = pairs.map(|pair| (lost(pair), pair.map(|(k, _)| k)));
    costs.filter(|(cost, _)| *cost < gain).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pair)| pair)
}

#[cfg(test)]
mod tests {
    use super::super::super::clusters::tests::made_up;
    use super::super::tests::posterior;
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
            (part(&mut both, &voxels, &points, &StereoTrackerOptions::default()).unwrap(), both.means)
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
        let mut three = posterior();
        for of in [&mut three.weight_concentration, &mut three.mean_precision, &mut three.degrees_of_freedom] {
            of.push(60.0);
        }
        three.means = vec![15.5, 42.0, 30.0, 27.5, 42.0, 30.0, 26.0, 16.0, 45.0];
        three.scale_inverses = [60.0 * 12.0, 60.0 * 12.0, 60.0 * 60.0]
            .iter()
            .flat_map(|&s| [s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s / 12.0])
            .collect();
        three.scale_inverses[26] = 60.0 * 25.0;
        assert!(part(&mut three, &voxels, &points, &StereoTrackerOptions::default()).unwrap());
        let labels = three.labels(&points).unwrap();
        let of = |x: u16, y: u16| labels[voxels.cells.iter().position(|c| c[..2] == [x, y]).unwrap()];
        assert_eq!(of(10, 40), of(33, 44));
        let three_things = [of(10, 40), of(11, 11), of(41, 21)];
        assert_eq!(three_things.iter().collect::<std::collections::BTreeSet<_>>().len(), 3);
    }
}
