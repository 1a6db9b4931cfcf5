//! The E step (13) to (17) and the sums that the next M step needs (18) to (20), in one pass over the points.

mod any;
mod fixed;

use super::{densities::Densities, moments::Moments, points::BAND, points::BLOCK, points::Planes};
use crate::parallel;
use crate::simd::{Lanes, Level, dispatch, exp};
use any::AnyBand;
use fixed::Band;
use std::ops::Range;

/// Below this an exponential is zero; a product of it and zero is then zero, whatever the density.
const MIN_LOG_SHARE: f64 = -1000.0;

/// What the E step leaves: responsibilities only as their sums.
#[derive(Debug)]
pub(super) struct Expected {
    /// (18) to (20).
    pub moments: Moments,
    /// `sum_n f_n sum_k r_nk ln r_nk`.
    pub negentropy: f64,
}

/// Sums of one band about the components' means: of each component `N, sum d, lower triangle of sum d d^T`,
/// `d = x - m_k`.
#[derive(Debug)]
struct Sums {
    values: Vec<f64>,
    negentropy: f64,
}

/// Responsibilities under `densities`, summed. Call it inside
/// [`Threads::install`](crate::parallel::Threads::install).
///
/// Bands of fixed size are summed one after another: results do not depend on the number of threads.
pub(super) fn expect(planes: &Planes, densities: &Densities) -> Expected {
    let bands: Vec<Range<usize>> =
        (0..planes.padded).step_by(BAND).map(|from| from..(from + BAND).min(planes.padded)).collect();
    let sums: Vec<Sums> = parallel::map(bands, |band| band_sums(planes, densities, band));
    let mut sums = sums.into_iter();
    let mut all = sums.next().expect("there is at least one point");
    for band in sums {
        all.values.iter_mut().zip(&band.values).for_each(|(sum, more)| *sum += more);
        all.negentropy += band.negentropy;
    }
    Expected { moments: moments(&all.values, densities), negentropy: all.negentropy }
}

/// The sums of a band, by the kernel for its number of dimensions.
fn band_sums(planes: &Planes, densities: &Densities, band: Range<usize>) -> Sums {
    let level = Level::detect();
    match planes.dimensions {
        1 => dispatch(level, Band::<1> { planes, densities, points: band }),
        2 => dispatch(level, Band::<2> { planes, densities, points: band }),
        3 => dispatch(level, Band::<3> { planes, densities, points: band }),
        4 => dispatch(level, Band::<4> { planes, densities, points: band }),
        5 => dispatch(level, Band::<5> { planes, densities, points: band }),
        6 => dispatch(level, Band::<6> { planes, densities, points: band }),
        _ => dispatch(level, AnyBand { planes, densities, points: band }),
    }
}

/// From sums about the components' old means to means and scatters about the new ones.
fn moments(sums: &[f64], densities: &Densities) -> Moments {
    let d = densities.dimensions;
    let mut moments = Moments::none(densities.components(), d);
    for (k, sums) in sums.chunks_exact(1 + d + densities.triangle()).enumerate() {
        let count = sums[0];
        moments.counts[k] = count;
        if count <= 0.0 {
            continue;
        }
        let (first, second) = sums[1..].split_at(d);
        for i in 0..d {
            moments.means[k * d + i] = densities.means[k * d + i] + first[i] / count;
            for j in 0..=i {
                let scatter = second[i * (i + 1) / 2 + j] - first[i] * (first[j] / count);
                // A variance is not negative, whatever rounding says.
                let scatter = if i == j { scatter.max(0.0) } else { scatter };
                moments.scatters[(k * d + i) * d + j] = scatter;
                moments.scatters[(k * d + j) * d + i] = scatter;
            }
        }
    }
    moments
}

/// Turns `ln rho` (K, BLOCK) into `rho` over the greatest one's, sets the factor that makes weighted
/// responsibilities of them (`scale`), and returns `sum_n f_n sum_k r_nk ln r_nk`.
#[inline(always)]
fn shares<V: Lanes<Scalar = f64>>(
    logs: &mut [f64],
    most: &[f64; BLOCK],
    weights: &[f64],
    scale: &mut [f64; BLOCK],
) -> f64 {
    let (mut total, mut entropy) = ([0.0; BLOCK], [0.0; BLOCK]);
    for logs in logs.chunks_exact_mut(BLOCK) {
        exponentials::<V>(logs, most, &mut total, &mut entropy);
    }
    let mut negentropy = 0.0;
    for i in 0..BLOCK {
        negentropy += weights[i] * (entropy[i] / total[i] - total[i].ln());
        scale[i] = weights[i] / total[i];
    }
    negentropy
}

/// Turns `ln rho` into `rho` over the greatest one's; adds them to `total`, and times their logarithms to
/// `entropy`.
#[inline(always)]
fn exponentials<V: Lanes<Scalar = f64>>(
    logs: &mut [f64],
    most: &[f64; BLOCK],
    total: &mut [f64; BLOCK],
    entropy: &mut [f64; BLOCK],
) {
    for at in (0..BLOCK).step_by(V::LANES) {
        let log = (V::load(&logs[at..]) - V::load(&most[at..])).max(V::splat(MIN_LOG_SHARE));
        let share = exp(log);
        share.store(&mut logs[at..]);
        (V::load(&total[at..]) + share).store(&mut total[at..]);
        share.mul_add(log, V::load(&entropy[at..])).store(&mut entropy[at..]);
    }
}
