//! What the tracker's options mean for the matching and for the mixture.

use super::options::StereoTrackerOptions;
use crate::mixture::{CovariancePrior, MixtureOptions};
use crate::stereo::EdgeDisparityOptions;

impl StereoTrackerOptions {
    /// How views are matched, with an offset of the rows where that is given.
    pub(super) fn matching_options(&self, row_offset: Option<f64>) -> EdgeDisparityOptions {
        let ([least, greatest], [first_row, last_row]) = (self.disparity_range, self.row_range);
        EdgeDisparityOptions {
            method: self.matching,
            disparity_range: (least, greatest),
            row_range: (first_row, last_row),
            row_offset,
            threads: self.threads,
            ..EdgeDisparityOptions::default()
        }
    }

    /// How the voxels of a step are clustered, from carried components or from seeds.
    pub(super) fn mixture_options(&self, carried: bool, step: usize) -> MixtureOptions {
        MixtureOptions {
            components: self.components,
            weight_concentration_prior: self.weight_concentration_prior,
            mean_precision_prior: self.mean_precision_prior,
            mean_prior: None,
            degrees_of_freedom_prior: Some(self.degrees_of_freedom_prior),
            covariance_prior: CovariancePrior::Isotropic(self.covariance_prior),
            max_iter: if carried { self.warm_max_iter } else { self.max_iter },
            tol: self.tol,
            n_init: self.n_init,
            // Components that are carried along must keep their numbers.
            prune_weight: if carried { 0.0 } else { self.prune_weight },
            random_state: self.random_state.wrapping_add(step as u64),
            threads: self.threads,
            ..MixtureOptions::default()
        }
    }
}
