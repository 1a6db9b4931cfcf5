//! How far the refined motion can be trusted: the covariance of `(u, v, u_x, v_x, u_y, v_y)`, at every eighth pixel and linear in between.
//!
//! Three errors add up, each seen in the frames themselves:
//!
//! * *Noise* ([`noise`]). What the chosen windows leave of the flow's noise. How strong that noise is, is read from how much the flow changes from window to window.
//! * *Bending* ([`bending`]). Flow that is not affine within the windows (those of the data too) is smoothed. What smoothing once more takes away, as one
//!   vector of six, tells the direction and the size of the error: a bent flow without divergence has errors without divergence.
//! * *Peak locking* ([`Locking`](super::locking::Locking)). A share of what was corrected may be left.
//!
//! The constants were fitted on made scenes (three carriers, six motions, noise of 0 to 4 grey levels, pairs and triples) and checked on others; `benchmarks/coverage.py` measures what they hold.

mod bending;
mod carry;
mod noise;
mod spread;

use super::refine::Evidence;
use super::run::Estimate;
use crate::flow::windowed::solve::{ENTRIES, upper};
use crate::simd::SimdReal;
pub(super) use spread::Spread;

/// Variance of the flow over that of averaged white noise of the density that changes between windows show: the noise is not white, and strongest in what windows do not remove.
const FLOW_NOISE: f64 = 1.65;
/// The same for the slopes.
const SLOPE_NOISE: f64 = 1.02;
/// Error of the flow over what smoothing once more takes away.
const FLOW_BENDING: f64 = 0.4;
/// The same for the slopes.
const SLOPE_BENDING: f64 = 0.57;
/// Share of the corrected peak locking that is left.
const LOCKING: f64 = 0.25;
/// Share of its amplitude that is left whatever the motion is.
const AMPLITUDE: f64 = 0.07;

/// A covariance: its upper triangle, row by row.
type Entries = [f64; ENTRIES];

/// The covariance at every place of the evidence.
///
/// `energy`: the residual energy that the noise is known to leave; without it, it is read from the residuals. `carried`: told at the pixels of the first
/// frame, where the motion of a pair is found midway.
pub(super) fn covariance<T: SimdReal>(estimate: &Estimate<T>, energy: Option<f64>, carried: bool) -> Spread<T> {
    let Some(evidence) = &estimate.evidence else { return Spread::default() };
    let (width, height) = evidence.size();
    let noise = noise::Noise::new(evidence, &estimate.data, energy);
    let mut places = bending::bending(&estimate.motion, (width, height), [FLOW_BENDING, SLOPE_BENDING]);
    for (n, place) in places.iter_mut().enumerate() {
        let (x, y) = (n % width, n / width);
        let left = noise.at(x, y);
        add_noise(place, &left);
        add_locking(place, estimate, evidence, (x, y));
    }
    if carried {
        places = carry::to_first_frame(&places, &estimate.motion, (width, height));
    }
    Spread::new(&places, (width, height))
}

/// Adds noise of the density times its share in the flow and in the derivatives along x and y.
fn add_noise(place: &mut Entries, left: &noise::Left) {
    let factors = [FLOW_NOISE * left.flow, SLOPE_NOISE * left.slopes[0], SLOPE_NOISE * left.slopes[1]];
    for (block, factor) in factors.into_iter().enumerate() {
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            place[upper(2 * block + i, 2 * block + j)] += factor * left.density[k];
        }
    }
}

/// Adds what may be left of peak locking.
fn add_locking<T: SimdReal>(
    place: &mut Entries,
    estimate: &Estimate<T>,
    evidence: &Evidence<T>,
    (x, y): (usize, usize),
) {
    let (motion, locking) = (&estimate.motion, &estimate.locking);
    let site = |n: usize, count: usize| (n * super::refine::SPACING).min(count - 1);
    let at = |k: usize| motion.at(k, site(x, motion.width), site(y, motion.height)).to_f64();
    // Waves of the amplitude that windows leave.
    let lengths: f64 = evidence.sigmas.iter().enumerate().map(|(l, s)| evidence.weight(l, x, y) / (s * s)).sum();
    for c in 0..2 {
        let (sine, slope) = locking.phase(at(c));
        let square = locking.amplitude[c].powi(2);
        let share = LOCKING.powi(2) * square + locking.variance[c];
        let always = AMPLITUDE.powi(2) * square;
        place[upper(c, c)] += share * sine * sine + always;
        for k in [2 + c, 4 + c] {
            place[upper(k, k)] += share * (slope * at(k)).powi(2) + always * lengths;
        }
    }
}

#[cfg(test)]
mod tests;
