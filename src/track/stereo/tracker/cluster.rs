//! Voxels into clusters.

use super::super::clusters::Clusters;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::{Seeded, rearrange, reseed};
use super::StereoTracker;
use crate::error::Result;
use crate::mixture::{Fit, Points, Posterior, Start, fit};

/// What clustering gave.
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

    /// Of a step that shows nothing.
    fn nothing(points: EdgePoints, voxels: Voxels) -> Self {
        Self { clusters: Clusters::new(points, voxels, &[], 0), posterior: None, rounds: 0 }
    }

    /// The same with the components called otherwise.
    pub fn renamed(self, names: &[usize]) -> Self {
        let posterior = self.posterior.map(|posterior| posterior.renamed(names));
        Self { clusters: self.clusters.renamed(names), posterior, rounds: self.rounds }
    }
}

impl StereoTracker {
    /// Clusters voxels from where the components were carried to; which of them were seeded anew.
    pub(super) fn cluster_carried(
        &self,
        points: EdgePoints,
        voxels: Voxels,
        start: Option<Posterior>,
    ) -> Result<(Clustered, Vec<bool>)> {
        if voxels.is_empty() {
            return Ok((Clustered::nothing(points, voxels), vec![]));
        }
        let (values, weights) = (voxels.places(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let carried = self.options.mixture_options(true, self.time);
        // What is not to be fitted has no weight; it is given to a component all the same.
        let without = |start: &Posterior, strays: &[usize]| {
            let mut kept = weights.clone();
            for &n in strays.iter().filter(|_| crate::ablation::keeps("stereo.outlier_voxels")) {
                kept[n] = 0.0;
            }
            fit(&Points { weights: Some(&kept), ..weighted }, &carried, Start::Components(start))
        };
        if let Some(mut start) = start
            && let Some(Seeded { seeds, strays }) = reseed(&mut start, &voxels, &weighted, &self.options)?
        {
            let fitted = without(&start, &strays)?;
            return Ok((Clustered::new(points, voxels, fitted, &weighted)?, seeds));
        }
        // Seeds of the whole scene part what is large, miss what is small, or put two such things into one;
        // components that explain little are better used there. What was seeded so may turn out to be a piece
        // of something once it is fitted, and then nothing is seeded in its stead: it would be that piece
        // again.
        let mut fitted = fit(&weighted, &self.options.mixture_options(false, self.time), Start::Seeds)?;
        let mut left_out = vec![];
        for seeding in [true, false] {
            let mut start = fitted.posterior.clone();
            let mut changed = rearrange(&mut start, &voxels, &weighted, &self.options)?;
            if seeding && let Some(Seeded { seeds, strays }) = reseed(&mut start, &voxels, &weighted, &self.options)? {
                changed |= seeds.contains(&true);
                left_out = strays;
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
