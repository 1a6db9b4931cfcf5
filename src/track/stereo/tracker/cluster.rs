//! Voxels into clusters.

use super::super::clusters::Clusters;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::reseed;
use super::StereoTracker;
use crate::error::Result;
use crate::mixture::{CovariancePrior, MixtureOptions, Points, Posterior, Start, fit};

/// What clustering gave.
pub(super) struct Clustered {
    pub clusters: Clusters,
    pub posterior: Option<Posterior>,
    pub rounds: usize,
}

impl StereoTracker {
    /// Clusters voxels from where the components were carried to; which of them were seeded anew.
    pub(super) fn cluster_carried(
        &self,
        points: EdgePoints,
        voxels: Voxels,
        start: Option<Posterior>,
    ) -> Result<(Clustered, Vec<bool>)> {
        let Some(mut start) = start.filter(|_| !voxels.is_empty()) else {
            return Ok((self.cluster(points, voxels, None)?, vec![]));
        };
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let seeded = reseed(&mut start, &voxels, &weighted, &self.options)?;
        Ok((self.cluster(points, voxels, Some(&start))?, seeded))
    }

    /// Fits the mixture to the voxels, from seeds or from components, and gives each voxel to one.
    pub(super) fn cluster(&self, points: EdgePoints, voxels: Voxels, start: Option<&Posterior>) -> Result<Clustered> {
        if voxels.is_empty() {
            return Ok(Clustered { clusters: Clusters::new(points, voxels, &[], 0), posterior: None, rounds: 0 });
        }
        let options = MixtureOptions {
            components: self.options.components,
            weight_concentration_prior: self.options.weight_concentration_prior,
            mean_precision_prior: self.options.mean_precision_prior,
            mean_prior: None,
            degrees_of_freedom_prior: Some(self.options.degrees_of_freedom_prior),
            covariance_prior: CovariancePrior::Isotropic(self.options.covariance_prior),
            max_iter: if start.is_some() { self.options.warm_max_iter } else { self.options.max_iter },
            tol: self.options.tol,
            n_init: self.options.n_init,
            // Components that are carried along must keep their numbers.
            prune_weight: if start.is_some() { 0.0 } else { self.options.prune_weight },
            seed: self.options.seed.wrapping_add(self.time as u64),
            threads: self.options.threads,
            ..MixtureOptions::default()
        };
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let fitted = fit(&weighted, &options, start.map_or(Start::Seeds, Start::Components))?;
        let labels = fitted.posterior.labels(&weighted)?;
        let clusters = Clusters::new(points, voxels, &labels, fitted.posterior.components());
        Ok(Clustered { clusters, rounds: fitted.lower_bounds.len(), posterior: Some(fitted.posterior) })
    }
}
