//! Voxels into clusters.

use super::super::clusters::Clusters;
use super::super::voxels::{EdgePoints, Voxels};
use super::super::warm_start::{Seeded, part, reseed};
use super::StereoTracker;
use crate::error::Result;
use crate::mixture::{Points, Posterior, Start, fit};

/// What clustering gave.
pub(super) struct Clustered {
    pub clusters: Clusters,
    pub posterior: Option<Posterior>,
    pub rounds: usize,
}

impl Clustered {
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
            return Ok((self.cluster(points, voxels, None)?, vec![]));
        }
        let (values, weights) = (voxels.centres(), voxels.weights());
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        if let Some(mut start) = start
            && let Some(Seeded { seeds, strays }) = reseed(&mut start, &voxels, &weighted, &self.options)?
        {
            return Ok((self.cluster_without(points, voxels, Some(&start), &strays)?, seeds));
        }
        // Seeds of the whole scene miss what is small, or put two such things into one; components that explain little are better used there.
        let mut fitted = fit(&weighted, &self.options.mixture_options(false, self.time), Start::Seeds)?.posterior;
        let parted = part(&mut fitted, &voxels, &weighted, &self.options)?;
        let again = reseed(&mut fitted, &voxels, &weighted, &self.options)?;
        let strays = match again {
            Some(Seeded { seeds, strays }) if parted || seeds.contains(&true) => Some(strays),
            _ => parted.then(Vec::new),
        };
        let clustered = match strays {
            Some(strays) => self.cluster_without(points, voxels, Some(&fitted), &strays)?,
            None => self.cluster(points, voxels, None)?,
        };
        let seeds = vec![true; clustered.clusters.components()];
        Ok((clustered, seeds))
    }

    /// Fits the mixture to the voxels, from seeds or from components, and gives each voxel to one.
    pub(super) fn cluster(&self, points: EdgePoints, voxels: Voxels, start: Option<&Posterior>) -> Result<Clustered> {
        self.cluster_without(points, voxels, start, &[])
    }

    /// The same, with voxels that are given to a component but are not fitted.
    fn cluster_without(
        &self,
        points: EdgePoints,
        voxels: Voxels,
        start: Option<&Posterior>,
        strays: &[usize],
    ) -> Result<Clustered> {
        if voxels.is_empty() {
            return Ok(Clustered { clusters: Clusters::new(points, voxels, &[], 0), posterior: None, rounds: 0 });
        }
        let options = self.options.mixture_options(start.is_some(), self.time);
        let (values, mut weights) = (voxels.centres(), voxels.weights());
        strays.iter().for_each(|&n| weights[n] = 0.0);
        let weighted = Points { dimensions: 3, values: &values, weights: Some(&weights) };
        let fitted = fit(&weighted, &options, start.map_or(Start::Seeds, Start::Components))?;
        let labels = fitted.posterior.labels(&weighted)?;
        let clusters = Clusters::new(points, voxels, &labels, fitted.posterior.components());
        Ok(Clustered { clusters, rounds: fitted.lower_bounds.len(), posterior: Some(fitted.posterior) })
    }
}
