//! Flow and Jacobian of every frame from the frames before and after it.
//!
//! A filter runs through the frames and another one through them backwards, and both are joined at each frame:
//! the two-filter smoother (D. C. Fraser, J. E. Potter, "The optimum linear smoother as a combination of two
//! optimum linear filters", IEEE Transactions on Automatic Control 14, 1969), of the motion alone. With `m`,
//! `P` of the filter, `-m'`, `P'` of the one that runs backwards, and `m0`, `P0` of what that one knows
//! without any frame,
//!
//! ```text
//! P_s = (P^-1 + P'^-1 - P0^-1)^-1,   m_s = P_s (P^-1 m - P'^-1 m' + P0^-1 m0).
//! ```
//!
//! Both have measured the frame itself; its noise enters them with opposite signs, so that `P_s` is not too
//! small. What the fields hold beyond `P` (systematic errors, the same both ways) is kept whole.

use super::FlowFilter;
use super::flow_filter::PAIRS;
use crate::error::{Result, check_memory};
use crate::parallel::checkpoint;
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, MOTION_NAMES, Status};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Numbers of a site: motion, and the upper triangle of its covariance.
const NUMBERS: usize = 6 + PAIRS.len();
/// Share of a variance by which the field's and the filter's differ in single precision.
const ROUNDING: f64 = 1e-5;
/// Index of `u` in a state.
const MOTION: usize = 6;

/// The fields of `frames` by a smoother with the options of `filter`, which has seen no frame.
///
/// A site whose frame is missing there has the motion of the frames around it, [`Status::Predicted`].
///
/// # Errors
/// Those of [`FlowFilter::push`]; [`Error::Memory`](crate::Error::Memory) for more frames than there is room.
pub(super) fn smooth<T: SimdReal>(filter: &FlowFilter<T>, frames: &[Frame<T>]) -> Result<Vec<FlowField<T>>> {
    let sites = filter.store.sites.len();
    check_memory("frames", frames.len().checked_mul(2 * sites * NUMBERS * size_of::<T>()))?;
    let threads = filter.options.threads;
    let (mut ahead, mut options) = (filter.clone(), filter.options.clone());
    options.initial_mean[MOTION..].iter_mut().for_each(|m| *m = -*m);
    let mut back = FlowFilter::<T>::new(filter.frame_size, options)?;
    let (mut fields, mut states) = (Vec::new(), Vec::new());
    for frame in frames {
        checkpoint();
        fields.push(ahead.push(frame)?);
        states.push(threads.install(|| motions(&ahead)));
    }
    for (t, frame) in frames.iter().enumerate().rev() {
        checkpoint();
        back.push(frame)?;
        let known = Known::new(&back, frames.len() - t);
        threads.install(|| {
            let joined: Vec<_> = states[t].par_iter().zip(motions(&back)).map(|(a, b)| known.join(a, &b)).collect();
            write(&mut fields[t], (&filter.store.sites, &states[t]), &joined);
        });
    }
    Ok(fields)
}

/// The motion of a site with its covariance.
type Site<T> = [T; NUMBERS];

fn motions<T: SimdReal>(filter: &FlowFilter<T>) -> Vec<Site<T>> {
    let site = |index: usize| {
        let (mean, covariance) = filter.store.state(index);
        std::array::from_fn(|k| match k {
            0..6 => T::from_f64(mean[MOTION + k]),
            _ => T::from_f64(covariance[MOTION + PAIRS[k - 6].0][MOTION + PAIRS[k - 6].1]),
        })
    };
    (0..filter.store.sites.len()).into_par_iter().map(site).collect()
}

fn parts<T: SimdReal>(site: &Site<T>) -> (Vector6<f64>, Matrix6<f64>) {
    let mut covariance = Matrix6::zeros();
    for (value, &(i, j)) in site[6..].iter().zip(&PAIRS) {
        (covariance[(i, j)], covariance[(j, i)]) = (value.to_f64(), value.to_f64());
    }
    (Vector6::from_fn(|k, _| site[k].to_f64()), covariance)
}

/// What a filter knows of the motion after some frames that it has not seen.
struct Known {
    information: Matrix6<f64>,
    /// Information times mean.
    weighted: Vector6<f64>,
}

impl Known {
    fn new<T: SimdReal>(filter: &FlowFilter<T>, frames: usize) -> Self {
        let options = &filter.options;
        let variance = |k: usize| options.initial_covariance[k] + frames as f64 * options.process_noise[k];
        let inverse = Vector6::from_fn(|k, _| variance(MOTION + k).recip());
        let mean = Vector6::from_fn(|k, _| options.initial_mean[MOTION + k]);
        Self { information: Matrix6::from_diagonal(&inverse), weighted: inverse.component_mul(&mean) }
    }

    /// Both filters' states joined; that of the first where the other one adds nothing.
    fn join<T: SimdReal>(&self, ahead: &Site<T>, back: &Site<T>) -> Site<T> {
        let joined = || {
            let ((m, p), (n, q)) = (parts(ahead), parts(back));
            let (inverse, other) = (p.cholesky()?.inverse(), q.cholesky()?.inverse());
            let root = (inverse + other - self.information).cholesky()?;
            let (mean, covariance) = (root.solve(&(inverse * m - (other * n - self.weighted))), root.inverse());
            let is_better = (0..6).all(|k| covariance[(k, k)] <= p[(k, k)]);
            (is_better && mean.iter().all(|value| value.is_finite())).then_some((mean, covariance))
        };
        let Some((mean, covariance)) = joined() else { return *ahead };
        std::array::from_fn(|k| T::from_f64(if k < 6 { mean[k] } else { covariance[PAIRS[k - 6]] }))
    }
}

/// Replaces the motion of the live sites in a field, and in their covariance the part of the filter.
fn write<T: SimdReal>(field: &mut FlowField<T>, (sites, before): (&[usize], &[Site<T>]), joined: &[Site<T>]) {
    let n = field.len();
    let units = MOTION_NAMES.map(|name| T::from_f64(field.layout.units.scale(name)));
    for ((&site, old), new) in sites.iter().zip(before).zip(joined) {
        let is_missing = field.status[site] == Status::NonFinite;
        if is_missing {
            field.status[site] = Status::Predicted;
        }
        for k in 0..6 {
            field.motion[k * n + site] = new[k] * units[k];
        }
        let Some(covariance) = &mut field.covariance else { continue };
        let own = |site: &Site<T>, k: usize| site[6 + k] * units[PAIRS[k].0] * units[PAIRS[k].1];
        let mut beyond: [T; PAIRS.len()] = std::array::from_fn(|k| covariance[k * n + site] - own(old, k));
        let is_rounding = |k: usize| beyond[k].to_f64() < ROUNDING * own(old, k).to_f64();
        if is_missing || (0..PAIRS.len()).filter(|&k| PAIRS[k].0 == PAIRS[k].1).all(is_rounding) {
            beyond = [T::from_f64(0.0); PAIRS.len()];
        }
        for k in 0..PAIRS.len() {
            covariance[k * n + site] = own(new, k) + beyond[k];
        }
    }
}
