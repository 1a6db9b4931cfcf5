//! Components carried to the next step, and new seeds for those without pixels, from connected voxels
//! (`blobs`). After a cold start `split_merge` makes one component of each object.

mod blobs;
mod split_merge;

use self::blobs::{Blob, blobs, log_density};
pub(super) use self::split_merge::split_and_merge;
use super::{options::MIN_COMPONENT_PIXELS, voxels::Voxels};
use crate::error::Result;
use crate::mixture::{Points, Posterior};
use nalgebra::Matrix3;

/// Dimensions of a voxel.
const D: usize = 3;
/// Standard deviations of a typical seed, cells along x, y and disparity.
const SEED_STD: [f64; D] = [2.0, 2.0, 0.7];
/// Share of unexplained pixels above which the scene counts as a new one.
const MAX_UNEXPLAINED_SHARE: f64 = 0.5;

/// Uncertainty of a moved component, cells along x, y and disparity: half a voxel.
const MOTION_STD: [f64; D] = [0.5, 0.5, 0.5];

/// Moves the means by the motions, cells, and widens the components by the uncertainty; those without a
/// motion stay.
///
/// A flat component is as thin as the noise of disparity; after a wrong motion it would explain few of its
/// own voxels. Its shape is recovered in the first iteration.
pub(super) fn moved(posterior: &Posterior, motions: &[Option<[f64; D]>]) -> Posterior {
    let mut out = posterior.clone();
    for (matrix, nu) in out.scale_inverses.chunks_exact_mut(D * D).zip(&out.degrees_of_freedom) {
        for i in 0..D {
            matrix[i * D + i] +=
                if crate::ablation::keeps("stereo.widened") { 1.0 } else { 0.0 } * nu * MOTION_STD[i] * MOTION_STD[i];
        }
    }
    for (mean, motion) in out.means.chunks_exact_mut(D).zip(motions) {
        if let Some(motion) = motion {
            mean.iter_mut().zip(motion).for_each(|(mean, by)| *mean += by);
        }
    }
    out
}

/// A partly covered object as it was when visible, at its predicted place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WholeObject {
    /// Along x and y, cells.
    pub middle: [f64; 2],
    /// Along x and y, cells^2.
    pub variance: [f64; 2],
    /// Edge pixels.
    pub pixels: f64,
}

impl WholeObject {
    /// Extends component `k` to the whole object.
    pub fn extend(&self, posterior: &mut Posterior, k: usize) {
        let nu = posterior.degrees_of_freedom[k];
        for i in 0..2 {
            posterior.means[k * D + i] = self.middle[i];
            let scatter = &mut posterior.scale_inverses[(k * D + i) * D + i];
            *scatter = scatter.max(nu * self.variance[i]);
        }
        posterior.weight_concentration[k] = posterior.weight_concentration[k].max(self.pixels);
    }
}

/// Seeds components with fewer than [`MIN_COMPONENT_PIXELS`] pixels, or spread so thinly that they explain
/// none, at the largest blobs of unexplained pixels. Returns which were seeded and the unexplained voxels
/// outside of such blobs; `None` if most pixels are unexplained: a new scene.
///
/// One seed a blob: several would compete for it over the next steps and exchange tracks. Explained pixels do
/// not count, because a seed beside a flat component could take that over.
///
/// A blob at a place, with its number of pixels, may be what has `reappeared` of a partly covered object.
/// That object's component is extended then: a seed would compete for the object and take most of it.
///
/// # Errors
/// Those of the mixture.
pub(super) fn reseed(
    posterior: &mut Posterior,
    voxels: &Voxels,
    points: &Points,
    reappeared: impl Fn([f64; D], f64) -> Option<(usize, WholeObject)>,
) -> Result<Option<Seeded>> {
    let components = posterior.components();
    let (densities, shares) = posterior.log_densities(points)?;
    let all: f64 = voxels.counts.iter().map(|&count| f64::from(count)).sum();
    let least = MIN_COMPONENT_PIXELS;
    let explained = explaining(all);
    let unexplained: Vec<usize> = (0..densities.len()).filter(|&n| densities[n] < explained).collect();
    let (mut blobs, outliers): (Vec<Blob>, Vec<Blob>) = blobs(voxels, &unexplained).into_iter().partition(|blob| {
        blob.pixels >= least && (!crate::ablation::keeps("stereo.thin_blobs") || blob.explains_itself(all, explained))
    });
    if crate::ablation::keeps("stereo.another_scene")
        && unexplained.iter().map(|&n| f64::from(voxels.counts[n])).sum::<f64>() > MAX_UNEXPLAINED_SHARE * all
    {
        return Ok(None);
    }
    let outliers = outliers.into_iter().flat_map(|blob| blob.members).collect();
    let mut extended = vec![false; components];
    if crate::ablation::keeps("stereo.covered_extent") {
        blobs.retain(|blob| {
            let Some((k, whole)) = reappeared(blob.middle(), blob.pixels) else { return true };
            whole.extend(posterior, k);
            extended[k] = true;
            false
        });
    }
    // Ties keep the order of the voxels.
    blobs.sort_by(|a, b| b.pixels.total_cmp(&a.pixels));
    let mut pixels = vec![0.0; components];
    for (row, &count) in shares.chunks_exact(components).zip(&voxels.counts) {
        pixels.iter_mut().zip(row).for_each(|(sum, share)| *sum += share * f64::from(count));
    }
    let dead: Vec<usize> =
        (0..components).filter(|&k| !extended[k] && is_left_over(posterior, k, (pixels[k], all))).collect();
    let mut seeds = vec![false; components];
    for (k, blob) in dead.into_iter().zip(&blobs).filter(|_| crate::ablation::keeps("stereo.reseed")) {
        blob.place(posterior, k);
        seeds[k] = true;
    }
    Ok(Some(Seeded { seeds, outliers }))
}

/// Whether a component has fewer than [`MIN_COMPONENT_PIXELS`] of all pixels, or is spread so thinly that it
/// explains none.
pub(super) fn is_left_over(posterior: &Posterior, k: usize, (pixels, all): (f64, f64)) -> bool {
    pixels < MIN_COMPONENT_PIXELS || log_density(pixels / all, &covariance(posterior, k)) < explaining(all)
}

/// Log-density from which a voxel counts as explained: that of a typical seed with the fewest pixels at one
/// standard deviation.
fn explaining(all: f64) -> f64 {
    let least = MIN_COMPONENT_PIXELS;
    log_density(least / all.max(least), &Matrix3::from_diagonal(&SEED_STD.map(|s| s * s).into()))
}

/// Covariance of a component, cells^2.
fn covariance(posterior: &Posterior, k: usize) -> Matrix3<f64> {
    Matrix3::from_row_slice(&posterior.scale_inverses[k * D * D..][..D * D]) / posterior.degrees_of_freedom[k]
}

/// Result of seeding.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Seeded {
    /// Which components were seeded.
    pub seeds: Vec<bool>,
    /// Unexplained voxels that are too few or too thinly spread for an object: wrong matches, excluded from
    /// the fit.
    pub outliers: Vec<usize>,
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::clusters::tests::synthetic_clusters;
    use super::super::options::COVARIANCE_PRIOR;
    use super::*;

    /// Two components, one of them where nothing is.
    pub fn posterior() -> Posterior {
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
    fn what_reappears_extends_its_component_and_seeds_none() {
        let block = |at: [u16; 3], n: u16| (0..n).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        let cells: Vec<_> = block([10, 10, 30], 90).chain(block([17, 12, 30], 45)).collect();
        let voxels = synthetic_clusters(&cells, 1).voxels;
        let (values, weights) = (voxels.places(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut got = posterior();
        let whole = WholeObject { middle: [14.0, 12.0], variance: [9.0, 0.1], pixels: 400.0 };
        let reappeared = |place, pixels| {
            assert_eq!((place, pixels), ([18.0, 13.0, 30.0], 45.0));
            Some((0, whole))
        };
        assert_eq!(reseed(&mut got, &voxels, &points, reappeared).unwrap().unwrap().seeds, [false, false]);
        assert_eq!(got.means, [14.0, 12.0, 30.0, 70.0, 50.0, 3.0]);
        assert_eq!([0, 4, 8].map(|i| got.scale_inverses[i]), [540.0, 50.0, 50.0]);
        assert_eq!(got.weight_concentration, [400.0, 60.0]);
    }

    #[test]
    fn who_has_no_pixels_goes_where_the_others_explain_least() {
        let block = |at: [u16; 3], n: u16| (0..n).map(move |i| ([at[0] + i % 3, at[1] + i / 3 % 3, at[2]], 0));
        // A block that the first component explains, one that none does, and a single outlier.
        let cells: Vec<_> =
            block([10, 10, 30], 90).chain(block([40, 20, 20], 45)).chain(block([5, 50, 60], 1)).collect();
        let voxels = synthetic_clusters(&cells, 1).voxels;
        let (values, weights) = (voxels.places(), voxels.weights());
        let points = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let mut posterior = posterior();
        assert_eq!(reseed(&mut posterior, &voxels, &points, |_, _| None).unwrap().unwrap().seeds, [false, true]);
        let mean = &posterior.means[3..];
        assert_eq!(mean, [41.0, 21.0, 20.0]);
        // Its extent: cells 40 to 42 and 20 to 22, each counted five times, one layer.
        let scatter = |i: usize| posterior.scale_inverses[9 + 4 * i] - COVARIANCE_PRIOR - 45.0 / 12.0;
        assert!((scatter(0) - 30.0).abs() < 1e-9 && (scatter(1) - 30.0).abs() < 1e-9 && scatter(2).abs() < 1e-9);
        assert_eq!(reseed(&mut posterior, &voxels, &points, |_, _| None).unwrap().unwrap().seeds, [false, false]);
    }
}
