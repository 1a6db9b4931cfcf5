//! How far the refined motion can be trusted: the covariance of `(u, v, u_x, v_x, u_y, v_y)`, at every eighth
//! pixel and linear in between.
//!
//! Errors of several kinds add up, all seen in the frames themselves:
//!
//! * *Noise* ([`noise`]). What the chosen windows leave of the flow's noise. How strong that noise is, is
//!   read from how much the flow changes from window to window.
//! * *Bending* ([`bending`]). Flow that is not affine within the windows (those of the data too) is smoothed.
//!   What smoothing once more takes away, as one vector of six, tells the direction and the size of the
//!   error: a bent flow without divergence has errors without divergence.
//! * *Continuation* ([`extrapolation`]). Where motion leads out of a frame, or where there is no texture, it
//!   is that of other sites, continued; the field itself tells how fast it departs from that.
//! * *Inheritance* ([`inherited`]). Where there is no texture, or only in one direction, finer levels do not
//!   correct what coarser ones left.
//! * *Peak locking* ([`Locking`]). A share of what was corrected may be left.
//! * *Change from step to step*, a triple's only: noise of its own, which is independent of the other, and a
//!   share of the acceleration.
//!
//! The constants were fitted on made scenes (three carriers, six motions, noise of 0 to 4 grey levels, pairs
//! and triples) and checked on others; `benchmarks/tables/coverage.py` measures what they hold.

mod bending;
mod carry;
mod extrapolation;
mod inherited;
mod led;
mod noise;
mod seen;
mod spread;

use super::grid::Planes;
use super::locking::Locking;
use super::run::Estimate;
use crate::flow::windowed::solve::{ENTRIES, upper};
use crate::simd::SimdReal;
pub(super) use noise::Energy;
use rayon::prelude::*;
pub(super) use spread::Spread;

/// Variance of the flow over that of averaged white noise of the density that changes between windows show:
/// the noise is not white, and strongest in what windows do not remove. Of pairs, and of triples, whose last
/// linearisation is about the refined motion.
const FLOW_NOISE: [f64; 2] = [1.15, 1.35];
/// The same for the slopes.
const SLOPE_NOISE: f64 = 0.42;
/// Errors over what bent motion loses, in the flow and in the slopes; of pairs and of triples.
const BENDING: [bending::Shares; 2] = [
    bending::Shares { fixed: [0.36, 0.66], chosen: [0.14, 0.68] },
    bending::Shares { fixed: [0.36, 0.66], chosen: [0.14, 0.46] },
];
/// Share of the corrected peak locking that is left.
const LOCKING: f64 = 0.33;
/// Share of its amplitude that is left in the flow whatever the motion is.
const AMPLITUDE: f64 = 0.06;
/// White noise in the difference of two frames over that in half the difference of the outer ones of three.
const AHEAD_ENERGY: f64 = 4.0;
/// Noise of `w_2 - (w_3 - w_1) / 2` over that of `w_3 - w_2`: what the next frame alone has beside what all
/// three have.
const CHANGE: f64 = 0.55;
/// Share of the acceleration, px/frame^2, that a triple takes for motion.
const ACCELERATION: f64 = 0.015;
/// Where no more than this share of the places has texture, they do not tell how motion differs from place to
/// place.
const TELLING: f64 = 0.02;
/// Share of the variance of noise that repeats itself in the next frames' estimates: the texture moves on
/// slowly, and its part of the errors with it.
const REPEATED: f64 = 0.3;

/// A covariance: its upper triangle, row by row.
type Entries = [f64; ENTRIES];

/// A covariance and that part of it which does not average out over time, if it was asked for.
#[derive(Debug, Default)]
pub(super) struct Spreads<T> {
    pub whole: Spread<T>,
    pub systematic: Option<Spread<T>>,
}

/// The covariance at every place of the evidence.
///
/// `energy`: the residual energy of the noise. `carried`: told at the pixels of the first frame, where the
/// motion of a pair is found midway. `apart`: with the systematic part beside it, all that is not noise, and
/// a share of that.
pub(super) fn covariance<T: SimdReal>(
    estimate: &Estimate<T>,
    energy: Energy,
    carried: bool,
    apart: bool,
) -> Spreads<T> {
    let Some(evidence) = &estimate.evidence else { return Spreads::default() };
    let (width, height) = evidence.size();
    let axes = (spread::Places::of(estimate.motion.width), spread::Places::of(estimate.motion.height));
    let seen = seen::Seen::new(&estimate.data, (width, height));
    let data = (&estimate.data, &seen);
    let noise = noise::Noise::new(evidence, data, energy, carried);
    let known = known(&noise, &estimate.data, (width, height));
    let known = known.as_ref().unwrap_or(&seen);
    let extrapolation = extrapolation::Extrapolation::new(&estimate.motion, evidence, known);
    let led = led::Led::by(&estimate.data, &noise, (width, height));
    let inherited = inherited::Inherited::new(&estimate.motion, &estimate.above, led);
    let inherited = inherited.at_places((width, height));
    let change = estimate.change.as_ref();
    let change = change
        .map(|evidence| noise::Noise::new(evidence, data, energy.times(AHEAD_ENERGY), true).no_quieter_than(&noise));
    let kind = usize::from(!carried);
    let mut places = bending::bending(&estimate.motion, evidence, BENDING[kind]);
    let mut noises = vec![[0.0; ENTRIES]; if apart { places.len() } else { 0 }];
    for (n, place) in places.iter_mut().enumerate() {
        let at = (n % width, n / width);
        let motion = bending::motion_at(&estimate.motion, at);
        let mut noisy = [0.0; ENTRIES];
        add_noise(&mut noisy, &noise.at(at.0, at.1), [FLOW_NOISE[kind], SLOPE_NOISE]);
        if let Some(change) = &change {
            add_noise(&mut noisy, &change.at(at.0, at.1), [CHANGE * FLOW_NOISE[kind], CHANGE * SLOPE_NOISE]);
        }
        extrapolation.add(place, known.distances(at.0, at.1), evidence.mean_sigmas(at.0, at.1));
        add_inherited(place, &inherited[n]);
        add_locking(place, &motion, &estimate.locking);
        if !carried {
            add_acceleration(place, &motion);
        }
        place.iter_mut().zip(&noisy).for_each(|(entry, noise)| *entry += noise);
        if apart {
            noises[n] = noisy;
        }
    }
    let spread = |places: Vec<Entries>| {
        let told = if carried { carry::to_first_frame(&places, &estimate.motion, axes) } else { places };
        Spread::new(&told, axes, estimate.level)
    };
    let systematic = apart.then(|| {
        let without =
            |(place, noise): (&Entries, &Entries)| std::array::from_fn(|k| place[k] - (1.0 - REPEATED) * noise[k]);
        spread(places.iter().zip(&noises).map(without).collect())
    });
    Spreads { whole: spread(places), systematic }
}

/// What is seen and has texture, if it is less than what is seen, and not too little to tell anything.
fn known<T: SimdReal>(noise: &noise::Noise<'_, T>, data: &Planes<T>, size: (usize, usize)) -> Option<seen::Seen> {
    let places = (0..size.0 * size.1).into_par_iter();
    let textured: Vec<bool> = places.map(|n| noise.is_textured(data, n % size.0, n / size.0)).collect();
    let count = textured.iter().filter(|textured| **textured).count();
    let tells = count < textured.len() && count as f64 >= TELLING * textured.len() as f64;
    tells.then(|| seen::Seen::textured(data, size, &textured))
}

/// Adds noise of the density times its share in the flow and in the derivatives along x and y; `factors` for
/// the flow and for the slopes.
fn add_noise(place: &mut Entries, left: &noise::Left, [flow, slopes]: [f64; 2]) {
    let factors = [flow * left.flow, slopes * left.slopes[0], slopes * left.slopes[1]];
    for (block, factor) in factors.into_iter().enumerate() {
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            place[upper(2 * block + i, 2 * block + j)] += factor * left.density[k];
        }
    }
}

/// Binomial means over three by three places.
fn soften<const N: usize>(places: &mut [[f64; N]], (width, height): (usize, usize)) {
    let mean = |[a, b, c]: [&[f64; N]; 3]| std::array::from_fn(|k| 0.25 * (a[k] + c[k]) + 0.5 * b[k]);
    let around = |n: usize, count: usize| [n.saturating_sub(1), n, (n + 1).min(count - 1)];
    for row in places.chunks_exact_mut(width.max(1)) {
        let old = row.to_vec();
        for (x, out) in row.iter_mut().enumerate() {
            *out = mean(around(x, width).map(|x| &old[x]));
        }
    }
    let old = places.to_vec();
    for (n, out) in places.iter_mut().enumerate() {
        let (x, y) = (n % width, n / width);
        *out = mean(around(y, height).map(|y| &old[y * width + x]));
    }
}

/// Adds variances of the flow and of the slopes, in the directions that are not led.
fn add_inherited(place: &mut Entries, inheritance: &inherited::Inheritance) {
    let [flow, slopes] = inheritance.variances;
    for (block, variance) in [flow, slopes, slopes].into_iter().enumerate() {
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            place[upper(2 * block + i, 2 * block + j)] += variance * inheritance.directions[k];
        }
    }
}

/// Adds what may be left of peak locking.
fn add_locking(place: &mut Entries, motion: &[f64; 6], locking: &Locking) {
    for c in 0..2 {
        let (sine, slope) = locking.phase(motion[c]);
        let square = locking.amplitude[c].powi(2);
        let share = LOCKING.powi(2) * square + locking.variance[c];
        place[upper(c, c)] += share * sine * sine + AMPLITUDE.powi(2) * square;
        for k in [2 + c, 4 + c] {
            place[upper(k, k)] += share * (slope * motion[k]).powi(2);
        }
    }
}

/// Adds what paths that are curved, `M (u, v)` in a steady flow, do to a triple: its outer frames are warped
/// as if the steps before and after were equal.
fn add_acceleration(place: &mut Entries, &[u, v, u_x, v_x, u_y, v_y]: &[f64; 6]) {
    place[upper(0, 0)] += (ACCELERATION * (u_x * u + u_y * v)).powi(2);
    place[upper(1, 1)] += (ACCELERATION * (v_x * u + v_y * v)).powi(2);
}

#[cfg(test)]
mod tests;
