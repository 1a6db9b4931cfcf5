//! How motion is refined.

/// So many windows of the ladder are enough for what is refined once more on a finer level.
const INTERMEDIATE_WINDOWS: usize = 5;

/// The first windows of the ladder are too narrow for changes.
const FIRST_CHANGE_WINDOW: usize = 2;

/// How motion is refined. Lengths are standard deviations of Gaussians, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::flow::coarse_to_fine) struct RefineOptions {
    /// Windows, growing; at least one.
    pub ladder: &'static [f64],
    /// Change, over what noise explains, that the plain fits accept for the flow.
    pub kappa: f64,
    /// The same for their slopes, where noise is white.
    pub kappa_slopes: f64,
    /// By how much slopes may accept more where the flow is restless, at most: noise that is not white (that
    /// of particle images) reaches wider windows than its density tells, and in turbulence no window is free
    /// of bias. 1 does without.
    pub max_unrest: f64,
    /// The same for edge fits, whose change is that of the calm part of the region.
    pub kappa_edge: f64,
    /// The same for the change from the widest plain fit to nothing.
    pub kappa_nothing: f64,
    /// Region of the changes.
    pub region: f64,
    /// Region whose calm part judges the edge fits.
    pub calm_region: f64,
    /// Region that a misfit stands out of.
    pub misfit_region: f64,
    /// Region of the noise density.
    pub noise_region: f64,
    /// Relative misfit at which edge fits and plain fits count equally.
    pub edge_misfit: f64,
    /// Relative misfit at which slopes are half those of wider edge fits: a motion boundary is a step, and
    /// the slope of what the windows make of it is none.
    pub step_misfit: f64,
    /// Whether the field may be nothing but affine over the whole frame: beyond the widest window there is
    /// then one more choice.
    pub may_vanish: bool,
}

impl RefineOptions {
    /// For motion that a finer level begins with: that level's few iterations take noise away, but not what a
    /// window has smoothed away over many of its pixels.
    pub fn intermediate() -> Self {
        let Self { ladder, kappa, .. } = Self::default();
        Self {
            ladder: ladder.get(..INTERMEDIATE_WINDOWS).unwrap_or(ladder),
            kappa: 3.0 / 8.0 * kappa,
            ..Self::default()
        }
    }

    /// For motion whose last linearisation was about one that had been refined: what is left of the residual
    /// is noise then, and slopes need no more room than it explains.
    pub fn relinearised() -> Self {
        Self { kappa_slopes: 2.0, ..Self::default() }
    }

    /// For what one step of the motion differs by from another, which is small and smooth or nothing.
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
