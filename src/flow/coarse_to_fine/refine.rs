//! The last stage: how far around each site the motion may be averaged, and across which sites it may not.
//!
//! The coupled motion is as good as its data at each site, hence noisy. Wider windows suppress noise, but
//! smooth away what is not affine in them. Three parts decide:
//!
//! * *Ladder.* Affine fits `K_l` to the flow in Gaussian windows of growing sigma, each repeated on what it
//!   leaves: `1 - (1 - K)^4`. Once more is J. W. Tukey's twicing (*Exploratory Data Analysis*, 1977), often
//!   more is P. Buehlmann and B. Yu's boosting ("Boosting with the L2 loss", 2003): bias of sixth order
//!   cancels too, and where waves are to be told from noise the window may be half as wide again as a single
//!   one.
//! * *Choice* ([`choose`]). O. V. Lepski's comparison of scales (1991), softened: from one window to the next
//!   the flow may change by what noise explains. With `D_l` the squared change, `d_l` its variance for white
//!   noise of unit density and `a` the noise density of the flow, `R_l = level(D_l) / (d_l a)`, the
//!   acceptance is `A_0 = 1`, `A_{l+1} = A_l / (1 + (R_l / kappa)^4)`, and window l has the weight `A_l -
//!   A_{l+1}`.
//! * *Edges* ([`mix`]). Nine windows around the site, each fit transported to it, weighed by how affine the
//!   flow is in the window and how near the fit comes to the site's flow (after M. Kuwahara et al., 1976).
//!   They take over where the misfit of the plain window stands out of its region. Slopes there are those of
//!   wider windows: what lies right beside a step knows the flow best, and the slope least.
//!
//! Windows wider than three sites are computed on grids of every second or fourth site: smoothing before
//! taking sites is part of the window, since variances of Gaussians add.

mod choose;
mod edges;
mod evidence;
mod field;
mod finish;
mod fit;
mod grow;
mod ladder;
mod mix;
mod region;

use super::grid::{LEFT, Planes};
use super::memory::Space;
use crate::simd::{Level, SimdReal};
pub(super) use evidence::{Evidence, SPACING, places};
use field::Field;
use fit::{FIT, FLOW};
use ladder::Ladder;
pub(super) use ladder::TERMS;
use rayon::prelude::*;
use region::Fitted;

/// Distance of the sites, px.
pub(super) const PITCH: f64 = 2.0;

/// So many windows of the ladder are enough for what is refined once more on a finer level.
const FURTHER: usize = 5;

/// The first windows of the ladder are too narrow for changes.
const CHANGES: usize = 2;

/// How motion is refined. Lengths are standard deviations of Gaussians, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Options {
    /// Windows, growing; at least one.
    pub ladder: &'static [f64],
    /// Change, over what noise explains, that the plain fits accept for the flow.
    pub kappa: f64,
    /// The same for their slopes, where noise is white.
    pub kappa_slopes: f64,
    /// By how much slopes may accept more where the flow is restless, at most: noise that is not white (that
    /// of particle images) reaches wider windows than its density tells, and in turbulence no window is free
    /// of bias. 1 does without.
    pub restless: f64,
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
    pub gate: f64,
    /// Relative misfit at which slopes are half those of wider edge fits: a motion boundary is a step, and
    /// the slope of what the windows make of it is none.
    pub step_gate: f64,
    /// Whether the field may be nothing but affine over the whole frame: beyond the widest window there is
    /// then one more choice.
    pub may_vanish: bool,
}

impl Options {
    /// For motion that a finer level begins with: that level's few iterations take noise away, but not what a
    /// window has smoothed away over many of its pixels.
    pub fn further() -> Self {
        let Self { ladder, kappa, .. } = Self::default();
        Self { ladder: ladder.get(..FURTHER).unwrap_or(ladder), kappa: 3.0 / 8.0 * kappa, ..Self::default() }
    }

    /// For motion whose last linearisation was about one that had been refined: what is left of the residual
    /// is noise then, and slopes need no more room than it explains.
    pub fn again() -> Self {
        Self { kappa_slopes: 2.0, ..Self::default() }
    }

    /// For what one step of the motion differs by from another, which is small and smooth or nothing.
    pub fn for_changes() -> Self {
        let Self { ladder, kappa, kappa_edge, .. } = Self::default();
        Self {
            ladder: ladder.get(CHANGES..).unwrap_or(ladder),
            kappa: 4.0 * kappa,
            kappa_slopes: 10.0,
            restless: 1.0,
            kappa_edge: 2.0 * kappa_edge,
            may_vanish: true,
            ..Self::default()
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            ladder: &[1.7, 2.5, 3.7, 5.5, 8.0, 12.0, 18.0, 27.0],
            kappa: 8.0,
            kappa_slopes: 4.0,
            restless: 3.1,
            kappa_edge: 6.0,
            kappa_nothing: 16.0,
            region: 20.0,
            calm_region: 20.0,
            misfit_region: 14.0,
            noise_region: 8.0,
            gate: 3.0,
            step_gate: 6.0,
            may_vanish: false,
        }
    }
}

/// Planes of [`refine`]'s result: after the six of the motion, the mean sigma of the windows used, px; the
/// last plane is the noise density `a`, px^4.
#[cfg(test)]
pub(super) const SIGMA: usize = 6;

/// Refines `motion` (u, v, u_x, v_x, u_y, v_y on sites [`PITCH`] px apart; the slopes are not used), given
/// the summary of the last data term.
///
/// Eight planes: the motion, the mean sigma, the noise density of the flow that came in (its variance times
/// the area over which the noise is independent). Both inputs must have the same size and be finite; without
/// sites there is nothing to do. Bit-identical for any number of threads. With them comes what the choice of
/// windows rested on, if there was one.
pub(super) fn refine<T: SimdReal>(
    simd: Level,
    space: &Space<T>,
    options: &Options,
    motion: &Planes<T>,
    data: &Planes<T>,
) -> (Planes<T>, Option<Evidence<T>>) {
    if motion.width == 0 || motion.height == 0 || options.ladder.is_empty() {
        return (Planes::new(motion.width, motion.height, finish::RESULT), None);
    }
    let ladder = Ladder::new(options.ladder, PITCH);
    let base = mean_motion(motion);
    let grids = grids(simd, space, &ladder, motion, &base);
    let scales = ladder.scales.par_iter();
    let mut fits: Vec<_> = scales.clone().map(|s| fit::fits(simd, space, &grids[s.octave], s)).collect();
    let samples = scales.zip(&fits);
    let samples = samples.map(|(s, f)| fit::samples(simd, space, f, s, if s.octave == 0 { 2 } else { 1 })).collect();
    let fitted = Fitted { fits: &fits, samples };
    let means = region::regional_means(simd, space, options, &ladder, &fitted, data);
    Field::keep(space, fitted.samples);
    let choice = choose::choose(simd, space, options, &ladder, &means);

    let plain_on = |octave: usize, coarser: Option<&Field<T>>| {
        let rungs = ladder.scales.iter().zip(&fits).enumerate();
        let rungs = rungs.filter(|(_, (s, _))| s.octave == octave).map(|(l, (s, f))| (l, s, f)).collect();
        mix::mix(simd, space, &mix::Plain { choice: &choice, octave, rungs, coarser, grid: &grids[octave] })
    };
    let coarsest = grids.len() - 1;
    let plain = (0..coarsest).rev().fold(plain_on(coarsest, None), |coarser, octave| {
        let plain = plain_on(octave, Some(&coarser));
        Field::keep(space, [coarser]);
        plain
    });
    let last = finish::Last { choice: &choice, grid: &grids[0], plain: &plain, options };

    // One window after the other: each has planes of its own on the finest grid.
    let sums = last.is_broken().then(|| {
        let mut sums = finish::no_sums(space, &grids[0]);
        for wanted in &edges::wanted(&choice) {
            let scale = &ladder.scales[wanted.place];
            for octave in (0..scale.octave).rev() {
                let finer = grow::grow(simd, space, &fits[wanted.place], FIT, &grids[octave]);
                Field::keep(space, [std::mem::replace(&mut fits[wanted.place], finer)]);
            }
            let edges = edges::Edges::new(wanted, scale.sigma, PITCH, &fits[wanted.place]);
            finish::add(simd, &last, &edges, &mut sums);
            Field::keep(space, fits[wanted.place].take());
        }
        sums
    });
    let out = finish::finish(simd, space, &last, sums.as_ref(), (&base, PITCH));
    if let Some(sums) = sums {
        space.keep(sums);
    }
    Field::keep(space, fits.into_iter().chain(grids).chain([plain]));
    (out, Some(Evidence::new(means, choice, ((motion.width, motion.height), options.ladder))))
}

/// The flow on every grid of the ladder, finest first, less the `base` motion.
fn grids<T: SimdReal>(
    simd: Level,
    space: &Space<T>,
    ladder: &Ladder<T>,
    motion: &Planes<T>,
    base: &[f64; 6],
) -> Vec<Field<T>> {
    let mut finest = Field::make(space, motion.width, motion.height, FLOW);
    for k in 0..2 {
        for y in 0..motion.height {
            let start = finest.start(k, y as isize) + LEFT;
            let target = &mut finest.data_mut()[start..start + motion.width];
            let (first, slope) = (base[k] + base[4 + k] * PITCH * y as f64, base[2 + k] * PITCH);
            let (first, slope) = (T::from_f64(first), T::from_f64(slope));
            for (x, (t, m)) in target.iter_mut().zip(motion.line(k, y)).enumerate() {
                *t = *m - (first + slope * T::from_f64(x as f64));
            }
        }
    }
    // Nothing has been smoothed away yet.
    for y in 0..motion.height {
        let start = finest.start(2, y as isize) + LEFT;
        finest.data_mut()[start..start + motion.width].fill(T::from_f64(0.0));
    }
    fit::finish(&mut finest);
    let mut grids = vec![finest];
    for octave in 0..ladder.octaves() {
        let next = fit::halve(simd, space, &grids[octave], &ladder.halving);
        grids.push(next);
    }
    grids
}

/// The affine motion nearest to all sites, about site (0, 0): u, v, u_x, v_x, u_y, v_y. Without it, squares
/// of large motion would drown the misfits of single precision.
fn mean_motion<T: SimdReal>(motion: &Planes<T>) -> [f64; 6] {
    let (width, height) = (motion.width as f64, motion.height as f64);
    let (middle_x, middle_y) = ((width - 1.0) / 2.0, (height - 1.0) / 2.0);
    let mut base = [0.0; 6];
    for k in 0..2 {
        let mut sums = [0.0; 3];
        for y in 0..motion.height {
            let mut row = [0.0; 2];
            for (x, value) in motion.line(k, y).iter().enumerate() {
                let value = value.to_f64();
                row[0] += value;
                row[1] += value * (x as f64 - middle_x);
            }
            sums[0] += row[0];
            sums[1] += row[1];
            sums[2] += row[0] * (y as f64 - middle_y);
        }
        // Sums of squared distances from the middle, over all sites; a single column or row has no slope.
        let spread = |n: f64, other: f64| (other * n * (n * n - 1.0) / 12.0).max(f64::MIN_POSITIVE);
        let slope_x = sums[1] / spread(width, height);
        let slope_y = sums[2] / spread(height, width);
        base[2 + k] = slope_x / PITCH;
        base[4 + k] = slope_y / PITCH;
        base[k] = sums[0] / (width * height) - slope_x * middle_x - slope_y * middle_y;
    }
    base
}

#[cfg(test)]
mod tests;
