//! Options of the stereo tracker.

mod check;

use crate::mixture::{CovariancePrior, MixtureOptions};
use crate::parallel::Threads;
use crate::stereo::{EdgeDisparityOptions, Method};
use crate::types::choices;

/// `alpha_0` of (8), pixels.
pub(super) const WEIGHT_CONCENTRATION_PRIOR: f64 = 0.1;
/// `beta_0` of (9), pixels.
pub(super) const MEAN_PRECISION_PRIOR: f64 = 0.001;
/// `nu_0` of (9), pixels.
pub(super) const DEGREES_OF_FREEDOM_PRIOR: f64 = 12.1;
/// Diagonal of `W_0^-1` of (9), cells^2.
pub(super) const COVARIANCE_PRIOR: f64 = 0.1;
/// Most iterations of the mixture from seeds.
const MAX_ITERATIONS: usize = 100;
/// Most iterations from carried components.
const MAX_CARRIED_ITERATIONS: usize = 30;
/// Growth of the lower bound per pixel below which iterations end (`improved`; paper: never).
const BOUND_TOLERANCE: f64 = 1e-4;
/// Components with fewer pixels are seeded again; smallest object that is recognised, pixels.
pub(super) const MIN_COMPONENT_PIXELS: f64 = 20.0;
/// Smallest score of an arc that continues a track, 0 to 2.
pub const ARC_THRESHOLD: f64 = 0.4;

/// Which system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum StereoMode {
    /// Motion is measured by affine Lucas-Kanade and carries the mixture to the next step; hidden objects are
    /// recognised. The default.
    #[default]
    Improved,
    /// The stereo paper's text: a new mixture each step, template matching in cells, overlaps in both
    /// directions.
    Paper,
}

choices!(StereoMode, "mode": Improved "improved", Paper "paper");

/// The grid in which edge pixels are counted: cells over the picture, layers of disparity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
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

/// Options of the stereo tracker. Begin with [`StereoTrackerOptions::new`]: some defaults differ between the
/// modes.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
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
    /// Components of the mixture; default 12 (`paper`), 16 (`improved`).
    pub n_components: usize,
    /// Seed of cold starts; default 0.
    pub random_state: u64,
    /// Search reach from one ordinary step to the next, cells and disparities; default 8. Grows with the gap,
    /// at most to 64.
    pub search: usize,
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
            n_components: if improved { 16 } else { 12 },
            random_state: 0,
            search: 8,
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
    pub(super) fn matching_options(&self, row_offset: Option<f64>) -> EdgeDisparityOptions {
        let ([least, greatest], [first_row, last_row]) = (self.disparity_range, self.row_range);
        EdgeDisparityOptions {
            method: if self.mode == StereoMode::Improved { Method::SemiGlobal } else { Method::Classes },
            disparity_range: (least, greatest),
            row_range: (first_row, last_row),
            row_offset,
            threads: self.threads,
            ..EdgeDisparityOptions::default()
        }
    }

    pub(super) fn mixture_options(&self, carried: bool, step: usize) -> MixtureOptions {
        MixtureOptions {
            components: self.n_components,
            weight_concentration_prior: WEIGHT_CONCENTRATION_PRIOR,
            mean_precision_prior: MEAN_PRECISION_PRIOR,
            mean_prior: None,
            degrees_of_freedom_prior: Some(DEGREES_OF_FREEDOM_PRIOR),
            covariance_prior: CovariancePrior::Isotropic(COVARIANCE_PRIOR),
            max_iter: if carried { MAX_CARRIED_ITERATIONS } else { MAX_ITERATIONS },
            tol: (self.mode == StereoMode::Improved).then_some(BOUND_TOLERANCE),
            // Carried components keep their numbers.
            prune_weight: 0.0,
            random_state: self.random_state.wrapping_add(step as u64),
            threads: self.threads,
            ..MixtureOptions::default()
        }
    }
}
