//! Components carried to the next step, and new seeds for those that lost their pixels; section 6.5 of the stereo tracker's design.

use super::options::StereoTrackerOptions;
use super::voxels::Voxels;
use crate::error::Result;
use crate::mixture::{Points, Posterior};

/// Coordinates of a voxel.
const D: usize = 3;
/// Standard deviations of a new seed, cells along x, y and disparity.
const SEED_SPREAD: [f64; D] = [2.0, 2.0, 0.7];
/// Cells along x, y and disparity round a seed that support it, and in which there is none other.
const SEED_REACH: [i32; D] = [2, 2, 1];

/// How far off a moved component may be, cells along x, y and disparity: half a voxel, by which counting in whole voxels alone moves a flat one.
const UNCERTAINTY: [f64; D] = [0.5, 0.5, 0.5];

/// The components with their means moved, cells, and as much wider as the motion is uncertain; those without a motion stay.
///
/// A flat component may be thinner than a hundredth of a layer. Moved by a fraction of a layer it would explain none of its own voxels; its shape is found again in the first round.
pub(super) fn moved(posterior: &Posterior, motions: &[Option<[f64; D]>]) -> Posterior {
    let mut out = posterior.clone();
    for (matrix, nu) in out.scale_inverses.chunks_exact_mut(D * D).zip(&out.degrees_of_freedom) {
        for i in 0..D {
            matrix[i * D + i] += nu * UNCERTAINTY[i] * UNCERTAINTY[i];
        }
    }
    for (mean, motion) in out.means.chunks_exact_mut(D).zip(motions) {
        if let Some(motion) = motion {
            mean.iter_mut().zip(motion).for_each(|(mean, by)| *mean += by);
        }
    }
    out
}

/// Seeds every component to which fewer than `reseed_below` pixels belong at the voxel that the others explain worst, among those whose
/// neighbourhood holds as many pixels that such a seed would explain better. Returns which were seeded anew.
///
/// Pixels that are explained already do not count: a seed beside a flat component could take it over, as the sharper of the two, and with it the identity.
///
/// # Errors
/// Those of the mixture.
pub(super) fn reseed(
    posterior: &mut Posterior,
    voxels: &Voxels,
    points: &Points,
    options: &StereoTrackerOptions,
) -> Result<Vec<bool>> {
    let components = posterior.components();
    let (densities, shares) = posterior.log_densities(points)?;
    let mut pixels = vec![0.0; components];
    for (row, &count) in shares.chunks_exact(components).zip(&voxels.counts) {
        pixels.iter_mut().zip(row).for_each(|(sum, share)| *sum += share * f64::from(count));
    }
    let dead: Vec<usize> = (0..components).filter(|&k| pixels[k] < options.reseed_below).collect();
    let mut seeded = vec![false; components];
    if dead.is_empty() {
        return Ok(seeded);
    }
    let least = options.reseed_below.max(1.0);
    let share = least / voxels.counts.iter().map(|&count| f64::from(count)).sum::<f64>().max(least);
    let explained = share.ln() + seed_log_density();
    let mut worst: Vec<usize> = (0..densities.len()).filter(|&n| densities[n] < explained).collect();
    let unexplained = worst.clone();
    worst.sort_by(|&a, &b| densities[a].total_cmp(&densities[b]).then(a.cmp(&b)));
    let mut seeds: Vec<[u16; D]> = Vec::new();
    let mut candidates = worst.into_iter();
    for k in dead {
        let found = candidates.by_ref().map(|n| voxels.cells[n]).find_map(|cell| {
            let far = !seeds.iter().any(|&seed| near(cell, seed));
            far.then(|| (cell, support(voxels, &unexplained, cell)))
                .filter(|(_, support)| *support >= options.reseed_below)
        });
        let Some((cell, support)) = found else { break };
        seeds.push(cell);
        place(posterior, k, cell, support, options);
        seeded[k] = true;
    }
    Ok(seeded)
}

/// Whether two voxels are neighbours.
fn near(a: [u16; D], b: [u16; D]) -> bool {
    (0..D).all(|i| (i32::from(a[i]) - i32::from(b[i])).abs() <= SEED_REACH[i])
}

/// Logarithm of a seed's density at one standard deviation along every axis.
fn seed_log_density() -> f64 {
    SEED_SPREAD.iter().map(|spread| -0.5 * (std::f64::consts::TAU * spread * spread).ln() - 0.5).sum()
}

/// Pixels in those voxels, of some, that are in the neighbourhood of one.
fn support(voxels: &Voxels, some: &[usize], cell: [u16; D]) -> f64 {
    some.iter().filter(|&&n| near(voxels.cells[n], cell)).map(|&n| f64::from(voxels.counts[n])).sum()
}

/// Makes component `k` a small one with `pixels` about a voxel.
fn place(posterior: &mut Posterior, k: usize, cell: [u16; D], pixels: f64, options: &StereoTrackerOptions) {
    posterior.weight_concentration[k] = options.weight_concentration_prior + pixels;
    posterior.mean_precision[k] = options.mean_precision_prior + pixels;
    posterior.degrees_of_freedom[k] = options.degrees_of_freedom_prior + pixels;
    for i in 0..D {
        posterior.means[k * D + i] = f64::from(cell[i]);
        for j in 0..D {
            let spread = if i == j { options.covariance_prior + pixels * SEED_SPREAD[i].powi(2) } else { 0.0 };
            posterior.scale_inverses[(k * D + i) * D + j] = spread;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::clusters::tests::made_up;
    use super::*;

    /// Two components, one of them where nothing is.
    fn posterior() -> Posterior {
        let mut scale_inverses = vec![0.0; 18];
        (0..6).for_each(|i| scale_inverses[i / 3 * 9 + i % 3 * 4] = 50.0);
        Posterior {
            dimensions: 3,
            weight_concentration: vec![60.0; 2],
            mean_precision: vec![60.0; 2],
            degrees_of_freedom: vec![60.0; 2],
            means: vec![11.0, 11.0, 30.0, 70.0, 50.0, 3.0],
            scale_inverses,
        }
    }

    #[test]
    fn means_are_moved_by_their_motions() {
        let got = moved(&posterior(), &[Some([1.0, -2.0, 0.5]), None]);
        assert_eq!(got.means, [12.0, 9.0, 30.5, 70.0, 50.0, 3.0]);
        // 50 / 60 of before and a quarter.
        assert_eq!((got.scale_inverses[0], got.scale_inverses[8], got.scale_inverses[1]), (65.0, 65.0, 0.0));
    }

    #[test]
    fn who_has_no_pixels_goes_where_the_others_explain_least() {
        let block = |at: [u16; 3], n: u16| (0..n).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        // A block that the first explains, one that nobody does, and a single outlier farther off.
        let cells: Vec<_> =
            block([10, 10, 30], 90).chain(block([40, 20, 20], 45)).chain(block([5, 50, 60], 1)).collect();
        let voxels = made_up(&cells, 1).voxels;
        let (values, weights) = (voxels.centres(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut posterior = posterior();
        let options = StereoTrackerOptions::default();
        assert_eq!(reseed(&mut posterior, &voxels, &points, &options).unwrap(), [false, true]);
        let mean = &posterior.means[3..];
        assert!((40.0..=42.0).contains(&mean[0]) && (20.0..=22.0).contains(&mean[1]) && mean[2] == 20.0, "{mean:?}");
        assert_eq!(reseed(&mut posterior, &voxels, &points, &options).unwrap(), [false, false]);
    }

    #[test]
    fn nobody_is_seeded_into_what_is_explained() {
        // A flat block with a few voxels beside its layer: near one of them there are enough pixels, but not of its kind.
        let block = |z: u16, n: u16| (0..n).map(move |i| ([10 + i % 3, 10 + i / 3 % 3, z], 0));
        let cells: Vec<_> = block(30, 90).chain(block(31, 9)).collect();
        let voxels = made_up(&cells, 1).voxels;
        let (values, weights) = (voxels.centres(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut posterior = posterior();
        let options = StereoTrackerOptions::default();
        assert_eq!(reseed(&mut posterior, &voxels, &points, &options).unwrap(), [false, false]);
        assert_eq!(posterior.means[3..], [70.0, 50.0, 3.0]);
    }
}
