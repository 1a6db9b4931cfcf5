//! Options of the stereo tracker.

mod check;

use crate::mixture::{CovariancePrior, MixtureOptions};
use crate::parallel::Threads;
use crate::stereo::{EdgeDisparityOptions, Method};

/// Which system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StereoMode {
    /// Motion is measured by affine Lucas-Kanade and carries the mixture to the next step; hidden objects are
    /// recognised. The default.
    #[default]
    Improved,
    /// The stereo paper's text: a new mixture each step, template matching in cells, overlaps in both
    /// directions.
    Paper,
}

impl StereoMode {
    /// Every mode.
    pub const ALL: [Self; 2] = [Self::Improved, Self::Paper];

    /// The word used in Python and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Improved => "improved",
            Self::Paper => "paper",
        }
    }
}

/// The grid in which edge pixels are counted: cells over the picture, layers of disparity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VoxelGrid {
    /// Cells along x; default 80.
    pub columns: usize,
    /// Cells along y; default 60.
    pub rows: usize,
    /// Layers of one disparity each; default 64. The greatest disparity is counted in the last layer, as is
    /// what refinement moved up to 1.5 px beyond; other disparities are left out.
    pub layers: usize,
    /// Disparity of the first layer, px; default -40.
    pub first_disparity: i32,
}

impl Default for VoxelGrid {
    fn default() -> Self {
        Self { columns: 80, rows: 60, layers: 64, first_disparity: -40 }
    }
}

/// The cameras, for depths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoCamera {
    /// Focal length, px.
    pub focal: f64,
    /// Distance of the cameras, in the unit that depths shall have.
    pub baseline: f64,
    /// Disparity of a point at infinity, px: below 0 where the cameras converge.
    pub d_infinity: f64,
}

impl StereoCamera {
    /// Depth `Z = f B / (d - d_infinity)`, in units of the baseline; NaN for a disparity at or beyond
    /// infinity.
    pub fn depth(&self, disparity: f64) -> f64 {
        let from_infinity = disparity - self.d_infinity;
        if from_infinity > 0.0 { self.focal * self.baseline / from_infinity } else { f64::NAN }
    }

    /// Place `(X, Y, Z)` of `(x, y, d)`, px, in units of the baseline, for a principal point `centre`, px.
    pub fn place(&self, [x, y, d]: [f64; 3], centre: [f64; 2]) -> [f64; 3] {
        let depth = self.depth(d);
        [(x - centre[0]) * depth / self.focal, (y - centre[1]) * depth / self.focal, depth]
    }
}

/// Recognition of lost tracks (`improved`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recognition {
    /// Overlap of a component with its moved self below which it loses its track; default 0.2.
    pub least_overlap: f64,
    /// Ordinary steps that a lost track is kept; default 10.
    pub patience: usize,
    /// Tolerance of the position of a recognised track, cells along x, y and disparity; default (3, 4, 1).
    pub tolerance: [f64; 3],
    /// Growth of the tolerance per ordinary step; default (0.5, 0.5, 0.2).
    pub tolerance_per_step: [f64; 3],
    /// Steps without a jump after which a track is steady; default 2.
    pub steady: usize,
    /// Largest number of ordinary steps that a steady track coasts through a jump with a support below 0.6;
    /// default 3.
    pub coast: usize,
    /// A jump in the picture: change of the motion, px per ordinary step; default 24.
    pub jump: f64,
    /// A jump in disparity, per ordinary step; default 1.5.
    pub jump_disparity: f64,
}

impl Default for Recognition {
    fn default() -> Self {
        Self {
            least_overlap: 0.2,
            patience: 10,
            tolerance: [3.0, 4.0, 1.0],
            tolerance_per_step: [0.5, 0.5, 0.2],
            steady: 2,
            coast: 3,
            jump: 24.0,
            jump_disparity: 1.5,
        }
    }
}

/// Grouping of clusters (`improved`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grouping {
    /// Largest distance of grouped clusters, cells; default 3.5.
    pub reach: f64,
    /// Largest median difference of their affine motions, px per ordinary step; default 1.
    pub motion: f64,
    /// Largest difference of their depth motions, disparity per ordinary step; default 0.15.
    pub depth_motion: f64,
}

impl Default for Grouping {
    fn default() -> Self {
        Self { reach: 3.5, motion: 1.0, depth_motion: 0.15 }
    }
}

/// Options of the stereo tracker. Begin with [`StereoTrackerOptions::new`]: some defaults differ between the
/// modes.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoTrackerOptions {
    /// Which system.
    pub mode: StereoMode,
    /// Grid of the voxels.
    pub grid: VoxelGrid,
    /// Smallest and largest disparity, px; default (-40, 24).
    pub disparity_range: [i32; 2],
    /// Smallest and largest row offset, px; default (-4, 4).
    pub row_range: [i32; 2],
    /// Offset of the right view's rows, px; none (default): searched at each pixel (`Classes`), or estimated
    /// at the first suitable step and monitored (`SemiGlobal`).
    pub row_offset: Option<f64>,
    /// How views are matched; default classes (`paper`), semi-global (`improved`).
    pub matching: Method,
    /// Components of the mixture; default 12 (`paper`), 16 (`improved`).
    pub components: usize,
    /// `alpha_0` of (8); default 0.1.
    pub weight_concentration_prior: f64,
    /// `beta_0` of (9); default 0.001.
    pub mean_precision_prior: f64,
    /// `nu_0` of (9); default 12.1.
    pub degrees_of_freedom_prior: f64,
    /// Diagonal of `W_0^-1` of (9), cells^2; default 0.1.
    pub covariance_prior: f64,
    /// Most iterations of a cold start; default 100.
    pub max_iter: usize,
    /// Most iterations from carried components (`improved`); default 30.
    pub warm_max_iter: usize,
    /// The mixture stops when its lower bound grows by less than this for each pixel; none: never. Default
    /// none (`paper`), 1e-4 (`improved`).
    pub tol: Option<f64>,
    /// Cold starts of which the best is kept; default 1.
    pub n_init: usize,
    /// Components with fewer pixels are dropped while fitting; default 0, which drops none.
    pub prune_weight: f64,
    /// Seed of cold starts; default 0.
    pub random_state: u64,
    /// Search reach from one ordinary step to the next, cells and disparities; default 8. Grows with the gap,
    /// at most to 64.
    pub search: usize,
    /// Levels of the reduced luminance; default 64.
    pub luminance_levels: usize,
    /// Smallest score of an arc that continues a track, 0 to 2; default 0.4.
    pub arc_threshold: f64,
    /// Components with fewer pixels are seeded again, and cold starts are split and merged (`improved`); 0:
    /// neither; default 20.
    pub reseed_below: f64,
    /// Recognition of lost tracks (`improved`).
    pub recognition: Option<Recognition>,
    /// Grouping of clusters (`improved`).
    pub grouping: Option<Grouping>,
    /// The cameras, if depths are wanted.
    pub camera: Option<StereoCamera>,
    /// Duration of an ordinary step, in the unit of times and velocities; default 1. Every number of steps in
    /// these options means ordinary steps; 1/30 for times in seconds and 30 frames a second.
    pub step_time: f64,
    /// Number of threads; results do not depend on it.
    pub threads: Threads,
}

impl Default for StereoTrackerOptions {
    fn default() -> Self {
        Self::new(StereoMode::default())
    }
}

impl StereoTrackerOptions {
    /// The defaults of a mode.
    pub fn new(mode: StereoMode) -> Self {
        let improved = mode == StereoMode::Improved;
        Self {
            mode,
            grid: VoxelGrid::default(),
            disparity_range: [-40, 24],
            row_range: [-4, 4],
            row_offset: None,
            matching: if improved { Method::SemiGlobal } else { Method::Classes },
            components: if improved { 16 } else { 12 },
            weight_concentration_prior: 0.1,
            mean_precision_prior: 1e-3,
            degrees_of_freedom_prior: 12.1,
            covariance_prior: 0.1,
            max_iter: 100,
            warm_max_iter: 30,
            tol: improved.then_some(1e-4),
            n_init: 1,
            prune_weight: 0.0,
            random_state: 0,
            search: 8,
            luminance_levels: 64,
            arc_threshold: 0.4,
            reseed_below: 20.0,
            recognition: improved.then(Recognition::default),
            grouping: improved.then(Grouping::default),
            camera: None,
            step_time: 1.0,
            threads: Threads::default(),
        }
    }

    /// Sets the range of disparities, with one layer of the grid each; the greatest one shares the layer
    /// before it.
    pub fn with_disparities(mut self, range: [i32; 2]) -> Self {
        let [least, greatest] = range;
        self.disparity_range = range;
        self.grid.first_disparity = least;
        self.grid.layers = greatest.saturating_sub(least).max(1) as usize;
        self
    }
}

impl StereoTrackerOptions {
    /// Options of the matching.
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

    /// Options of the mixture, from carried components or from seeds.
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
            // Carried components keep their numbers.
            prune_weight: if carried { 0.0 } else { self.prune_weight },
            random_state: self.random_state.wrapping_add(step as u64),
            threads: self.threads,
            ..MixtureOptions::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_that_of_two_cameras() {
        let camera = StereoCamera { focal: 800.0, baseline: 0.075, d_infinity: -44.0 };
        assert_eq!(camera.depth(-4.0), 1.5);
        assert_eq!(camera.place([400.0, 200.0, -4.0], [320.0, 240.0]), [0.15, -0.075, 1.5]);
        assert!(camera.depth(-44.0).is_nan());
    }
}
