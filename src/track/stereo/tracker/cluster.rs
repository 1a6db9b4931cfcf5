//! Clusters the voxels of a step.

use super::super::clusters::Clusters;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::{Seeded, WholeObject, reseed, split_and_merge};
use super::StereoTracker;
use crate::error::Result;
use crate::mixture::{Fit, Points, Posterior, Start, fit};

pub(super) struct Clustered {
    pub clusters: Clusters,
    pub posterior: Option<Posterior>,
    pub rounds: usize,
}

impl Clustered {
    /// Each voxel with the component that explains it best.
    fn new(points: EdgePoints, voxels: Voxels, fitted: Fit, weighted: &Points<'_>) -> Result<Self> {
        let labels = fitted.posterior.labels(weighted)?;
        let clusters = Clusters::new(points, voxels, &labels, fitted.posterior.components());
        Ok(Self { clusters, rounds: fitted.lower_bounds.len(), posterior: Some(fitted.posterior) })
    }

    fn nothing(points: EdgePoints, voxels: Voxels) -> Self {
        Self { clusters: Clusters::new(points, voxels, &[], 0), posterior: None, rounds: 0 }
    }

    /// Renumbers the components.
    pub fn renamed(self, names: &[usize]) -> Self {
        let posterior = self.posterior.map(|posterior| posterior.renamed(names));
        Self { clusters: self.clusters.renamed(names), posterior, rounds: self.rounds }
    }
}

impl StereoTracker {
    /// Clusters voxels from carried components; `reappeared`: that of [`reseed`]. Returns which components
    /// were seeded.
    pub(super) fn cluster_carried(
        &self,
        points: EdgePoints,
        voxels: Voxels,
        start: Option<Posterior>,
        reappeared: impl Fn([f64; 3], f64) -> Option<(usize, WholeObject)>,
    ) -> Result<(Clustered, Vec<bool>)> {
        if voxels.is_empty() {
            return Ok((Clustered::nothing(points, voxels), vec![]));
        }
        let (values, weights) = (voxels.places(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let carried = self.options.mixture_options(true, self.time);
        // Outliers have no weight in the fit, but are labelled.
        let without = |start: &Posterior, outliers: &[usize]| {
            let mut kept = weights.clone();
            for &n in outliers.iter().filter(|_| crate::ablation::keeps("stereo.outlier_voxels")) {
                kept[n] = 0.0;
            }
            fit(&Points { weights: Some(&kept), ..weighted }, &carried, Start::Components(start))
        };
        if let Some(mut start) = start
            && let Some(Seeded { seeds, outliers }) = reseed(&mut start, &voxels, &weighted, reappeared)?
        {
            let fitted = without(&start, &outliers)?;
            return Ok((Clustered::new(points, voxels, fitted, &weighted)?, seeds));
        }
        // A cold start splits large objects and misses or merges small ones: components that explain little
        // are seeded again, unless a new seed is a piece of a larger object after the fit.
        let mut fitted = fit(&weighted, &self.options.mixture_options(false, self.time), Start::Seeds)?;
        let mut left_out = vec![];
        for seeding in [true, false] {
            let mut start = fitted.posterior.clone();
            let mut changed = split_and_merge(&mut start, &voxels, &weighted)?;
            if seeding && let Some(Seeded { seeds, outliers }) = reseed(&mut start, &voxels, &weighted, |_, _| None)? {
                changed |= seeds.contains(&true);
                left_out = outliers;
            }
            if changed {
                fitted = without(&start, &left_out)?;
            }
        }
        let seeds = vec![true; fitted.posterior.components()];
        Ok((Clustered::new(points, voxels, fitted, &weighted)?, seeds))
    }

    /// Fits the mixture to the voxels from seeds, and gives each voxel to a component.
    pub(super) fn cluster(&self, points: EdgePoints, voxels: Voxels) -> Result<Clustered> {
        if voxels.is_empty() {
            return Ok(Clustered::nothing(points, voxels));
        }
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let fitted = fit(&weighted, &self.options.mixture_options(false, self.time), Start::Seeds)?;
        Clustered::new(points, voxels, fitted, &weighted)
    }
}
