//! Options of the refinement.

/// Number of windows for an intermediate refinement, which a finer level repeats.
const INTERMEDIATE_WINDOWS: usize = 5;

/// First window of the ladder for differences of motions; narrower ones leave too much noise.
const FIRST_CHANGE_WINDOW: usize = 2;

/// Options of the refinement. Lengths are standard deviations of Gaussians, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::flow::coarse_to_fine) struct RefineOptions {
    /// Windows, growing; at least one.
    pub ladder: &'static [f64],
    /// Accepted change of the flow over that explained by noise, plain fits.
    pub kappa: f64,
    /// The same for their slopes, under white noise.
    pub kappa_slopes: f64,
    /// Maximum factor by which slopes accept more in turbulent flow, where noise of particle images is not
    /// white and no window is free of bias; 1: none.
    pub max_unrest: f64,
    /// The same for edge fits, whose change is that of the calm part of the region.
    pub kappa_edge: f64,
    /// The same for the change from the widest plain fit to zero.
    pub kappa_nothing: f64,
    /// Region of the changes.
    pub region: f64,
    /// Region whose calm part decides on the edge fits.
    pub calm_region: f64,
    /// Region to whose misfit a site is compared.
    pub misfit_region: f64,
    /// Region of the noise density.
    pub noise_region: f64,
    /// Relative misfit at which edge fits and plain fits count equally.
    pub edge_misfit: f64,
    /// Relative misfit at which slopes are half those of wider edge fits.
    pub step_misfit: f64,
    /// Whether the field may be affine over the whole frame: one more choice beyond the widest window.
    pub may_vanish: bool,
}

impl RefineOptions {
    /// For motion that a finer level starts from, which cannot restore what a window has smoothed away.
    pub fn intermediate() -> Self {
        let Self { ladder, kappa, .. } = Self::default();
        Self {
            ladder: ladder.get(..INTERMEDIATE_WINDOWS).unwrap_or(ladder),
            kappa: 3.0 / 8.0 * kappa,
            ..Self::default()
        }
    }

    /// For motion linearised about a refined one: the residual is then noise, and slopes accept no more.
    pub fn relinearised() -> Self {
        Self { kappa_slopes: 2.0, ..Self::default() }
    }

    /// For the difference of two steps, which is small and smooth, or zero.
    pub fn for_changes() -> Self {
        let Self { ladder, kappa, kappa_edge, .. } = Self::default();
        Self {
            ladder: ladder.get(FIRST_CHANGE_WINDOW..).unwrap_or(ladder),
            kappa: 4.0 * kappa,
            kappa_slopes: 10.0,
            max_unrest: 1.0,
            kappa_edge: 2.0 * kappa_edge,
            may_vanish: true,
            ..Self::default()
        }
    }
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            ladder: &[1.7, 2.5, 3.7, 5.5, 8.0, 12.0, 18.0, 27.0],
            kappa: 8.0,
            kappa_slopes: 4.0,
            max_unrest: 3.1,
            kappa_edge: 6.0,
            kappa_nothing: 16.0,
            region: 20.0,
            calm_region: 20.0,
            misfit_region: 14.0,
            noise_region: 8.0,
            edge_misfit: 3.0,
            step_misfit: 6.0,
            may_vanish: false,
        }
    }
}
