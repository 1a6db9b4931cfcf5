//! Refinement: chooses at each site the window over which the motion is averaged.
//!
//! The regularised motion has the noise of each site's own data. Wider windows suppress noise, but smooth
//! away motion that is not affine in them. Data pass these files:
//!
//! * [`ladder`], [`fit`]: affine fits `K_l` to the flow in Gaussian windows of growing sigma, each repeated
//!   on its residual: `1 - (1 - K)^4`. Repeating once is J. W. Tukey's twicing (*Exploratory Data Analysis*,
//!   1977), more often P. Buehlmann and B. Yu's boosting ("Boosting with the L2 loss", 2003): bias of sixth
//!   order cancels too, and a window may be half as wide again for the same bias.
//! * [`regional_means`]: robust means of changes, misfits and data around each node.
//! * [`choose`]: O. V. Lepski's comparison of scales (1991) with soft decisions. From one window to the next
//!   the flow may change by what noise explains. With `D_l` the squared change, `d_l` its variance for white
//!   noise of unit density and `a` the noise density of the flow, `R_l = level(D_l) / (d_l a)`, the
//!   acceptance is `A_0 = 1`, `A_{l+1} = A_l / (1 + (R_l / kappa)^4)`, and window l has the weight `A_l -
//!   A_{l+1}`.
//! * [`plain_fits`], [`upsample`]: the weighted mean of the fits, grid by grid.
//! * [`edge_fits`], [`finish`]: nine windows around the site, weighted by how affine the flow is in them and
//!   how near their fit is to the site's flow (after M. Kuwahara et al., 1976). They take over where the
//!   misfit of the plain window exceeds that of its region. Slopes there come from wider windows.
//!
//! [`window_statistics`] keeps what the covariance needs. Windows wider than three sites are computed on
//! grids of every second or fourth site: smoothing before subsampling is part of the window, since variances
//! of Gaussians add.

mod choose;
mod edge_fits;
mod finish;
mod fit;
mod ladder;
mod options;
mod plain_fits;
mod regional_means;
mod upsample;
mod window_statistics;

use super::{extended::Field, plane_pool::PlanePool, planes::LEFT, planes::Planes, planes::SITE_SPACING};
use crate::parallel;
use crate::simd::{Level, SimdReal};
use fit::{FIT, FLOW};
pub(super) use ladder::TERMS;
use ladder::{Ladder, Scale};
pub(super) use options::RefineOptions;
use regional_means::Fitted;
pub(super) use window_statistics::{SITES_PER_NODE, WindowStatistics, node_count};

/// Refines the flow of `motion`, given the summary of the last data term; both finite and of one size.
/// Returns eight planes: the motion, the mean sigma, the noise density of the given flow (its variance times
/// the area over which the noise is independent); and the statistics of the choice, `None` without sites.
pub(super) fn refine<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    options: &RefineOptions,
    motion: &Planes<T>,
    data: &Planes<T>,
) -> (Planes<T>, Option<WindowStatistics<T>>) {
    if motion.width == 0 || motion.height == 0 || options.ladder.is_empty() {
        return (Planes::new(motion.width, motion.height, finish::RESULT), None);
    }
    let ladder = Ladder::new(options.ladder, SITE_SPACING);
    let base = mean_motion(motion);
    let grids = grids(simd, space, &ladder, motion, &base);
    // Memory in one order, so that it does not depend on the threads.
    let field = |octave: usize, step: usize, count: usize| {
        let grid = &grids[octave];
        Field::make(space, grid.width.div_ceil(step), grid.height.div_ceil(step), count)
    };
    let sample_step = |scale: &Scale<T>| if scale.octave == 0 { 2 } else { 1 };
    let mut fits: Vec<_> = ladder.scales.iter().map(|s| field(s.octave, 1, FIT)).collect();
    parallel::for_each(fits.iter_mut().zip(&ladder.scales), |(out, s)| fit::fits(simd, &grids[s.octave], s, out));
    let mut samples: Vec<_> = ladder.scales.iter().map(|s| field(s.octave, sample_step(s), 2)).collect();
    let fitted = samples.iter_mut().zip(&fits).zip(&ladder.scales);
    parallel::for_each(fitted, |((out, fits), s)| fit::samples(simd, fits, s, sample_step(s), out));
    let fitted = Fitted { fits: &fits, samples };
    let means = regional_means::regional_means(simd, space, options, &ladder, &fitted, data);
    Field::keep(space, fitted.samples);
    let choice = choose::choose(simd, space, options, &ladder, &means);

    let plain_on = |octave: usize, coarser: Option<&Field<T>>| {
        let rungs = ladder.scales.iter().zip(&fits).enumerate();
        let rungs = rungs.filter(|(_, (s, _))| s.octave == octave).map(|(l, (s, f))| (l, s, f)).collect();
        plain_fits::mix(
            simd,
            space,
            &plain_fits::Plain { choice: &choice, octave, rungs, coarser, grid: &grids[octave] },
        )
    };
    let coarsest = grids.len() - 1;
    let plain = (0..coarsest).rev().fold(plain_on(coarsest, None), |coarser, octave| {
        let plain = plain_on(octave, Some(&coarser));
        Field::keep(space, [coarser]);
        plain
    });
    let inputs = finish::FinishInputs { choice: &choice, grid: &grids[0], plain: &plain, options };

    // One window after the other: each has planes of its own on the finest grid.
    let sums = inputs.has_edges().then(|| {
        let mut sums = finish::no_sums(space, &grids[0]);
        for window in &edge_fits::used_windows(&choice) {
            let scale = &ladder.scales[window.index];
            for octave in (0..scale.octave).rev() {
                let finer = upsample::grow(simd, space, &fits[window.index], FIT, &grids[octave]);
                Field::keep(space, [std::mem::replace(&mut fits[window.index], finer)]);
            }
            let edge_fits = edge_fits::Edges::new(window, scale.sigma, SITE_SPACING, &fits[window.index]);
            finish::add(simd, &inputs, &edge_fits, &mut sums);
            Field::keep(space, fits[window.index].take());
        }
        sums
    });
    let out = finish::finish(simd, space, &inputs, sums.as_ref(), (&base, SITE_SPACING));
    if let Some(sums) = sums {
        space.keep(sums);
    }
    Field::keep(space, fits.into_iter().chain(grids).chain([plain]));
    (out, Some(WindowStatistics::new(means, choice, ((motion.width, motion.height), options.ladder))))
}

/// The flow on every grid of the ladder, finest first, less the `base` motion.
fn grids<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    ladder: &Ladder<T>,
    motion: &Planes<T>,
    base: &[f64; 6],
) -> Vec<Field<T>> {
    let mut finest = Field::make(space, motion.width, motion.height, FLOW);
    for k in 0..2 {
        for y in 0..motion.height {
            let start = finest.start(k, y as isize) + LEFT;
            let target = &mut finest.data_mut()[start..start + motion.width];
            let (first, slope) = (base[k] + base[4 + k] * SITE_SPACING * y as f64, base[2 + k] * SITE_SPACING);
            let (first, slope) = (T::from_f64(first), T::from_f64(slope));
            for (x, (t, m)) in target.iter_mut().zip(motion.line(k, y)).enumerate() {
                *t = *m - (first + slope * T::from_f64(x as f64));
            }
        }
    }
    // No variance has been smoothed away yet.
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

/// The affine motion nearest to all sites, about site (0, 0): u, v, u_x, v_x, u_y, v_y. Without subtracting
/// it, squares of large motion would exceed the misfits in single precision.
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
        base[2 + k] = slope_x / SITE_SPACING;
        base[4 + k] = slope_y / SITE_SPACING;
        base[k] = sums[0] / (width * height) - slope_x * middle_x - slope_y * middle_y;
    }
    base
}

#[cfg(test)]
mod tests;
