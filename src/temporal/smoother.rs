//! Flow and Jacobian of every frame from the frames before and after it.
//!
//! A filter runs through the frames and another one through them backwards, and both are joined at each
//! frame: the two-filter smoother (D. C. Fraser, J. E. Potter, "The optimum linear smoother as a combination
//! of two optimum linear filters", IEEE Transactions on Automatic Control 14, 1969), of the motion alone.
//! With `m`, `P` of the filter, `m'`, `P'` of the one that runs backwards, and `m0`, `P0` of what that one
//! knows without any frame,
//!
//! ```text
//! P_s = (P^-1 + P'^-1 - P0^-1)^-1,   m_s = P_s (P^-1 m - P'^-1 m' + P0^-1 m0).
//! ```
//!
//! Both have measured the frame itself; its noise enters them with opposite signs, so that `P_s` is not too
//! small. What the fields hold beyond `P` (systematic errors, the same both ways) is kept whole; at a missing
//! frame it is that of the next one.

use super::FlowFilter;
use super::flow_filter::PAIRS;
use crate::error::Result;
use crate::parallel::{self, checkpoint};
use crate::simd::SimdReal;
use crate::types::{FlowField, Frame, MOTION_NAMES, Status};
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

/// Numbers of a site: motion, and the upper triangle of its covariance.
const NUMBERS: usize = 6 + PAIRS.len();
/// Share of a variance by which the field's and the filter's differ in single precision.
const ROUNDING: f64 = 1e-5;
/// Index of `u` in a state.
const MOTION: usize = 6;
/// Sites of one task.
const SITES_PER_TASK: usize = 64;

/// The fields of `frames` by a smoother with the options of `filter`, which has seen no frame.
///
/// A site whose frame is missing there has the motion of the frames around it, [`Status::Predicted`].
///
/// # Errors
/// Those of [`FlowFilter::push`]; [`Error::Memory`](crate::Error::Memory) for more frames than there is room.
pub(super) fn smooth<T: SimdReal>(filter: &FlowFilter<T>, frames: &[Frame<T>]) -> Result<Vec<FlowField<T>>> {
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
    let sites = &filter.store.sites;
    let is_seen = |&site: &usize| fields.iter().any(|field| field.status[site] != Status::NonFinite);
    let seen: Vec<bool> = sites.iter().map(is_seen).collect();
    let mut beyond = vec![Matrix6::zeros(); sites.len()];
    for (t, frame) in frames.iter().enumerate().rev() {
        checkpoint();
        back.push(frame)?;
        let known = Known::new(&back, frames.len() - t);
        threads.install(|| {
            update_beyond(&mut beyond, &fields[t], (sites, &states[t]));
            let (ahead, back) = (&states[t], motions(&back));
            let joined =
                parallel::map_range(sites.len(), SITES_PER_TASK, |n| with(known.join(&ahead[n], &back[n]), &beyond[n]));
            write(&mut fields[t], sites.iter().zip(&seen).zip(&joined));
        });
    }
    Ok(fields)
}

/// Bytes that a smoother needs for so many frames: the frames, and at each site states, fields, and fields in
/// a stack.
pub(super) fn bytes<T>(filter: &FlowFilter<T>, frames: usize) -> Option<usize> {
    let (width, height) = filter.frame_size;
    let sites = filter.store.sites.len().checked_mul(3 * NUMBERS + 2)?;
    frames.checked_mul(width.checked_mul(height)?.checked_add(sites)?)?.checked_mul(size_of::<T>())
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
    parallel::map_range(filter.store.sites.len(), SITES_PER_TASK, site)
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
    fn join<T: SimdReal>(&self, ahead: &Site<T>, back: &Site<T>) -> (Vector6<f64>, Matrix6<f64>) {
        let ((m, p), (n, q)) = (parts(ahead), parts(back));
        // In units in which the first filter's variances are one.
        let unit = p.diagonal().map(f64::sqrt);
        let scaled = |c: &Matrix6<f64>| Matrix6::from_fn(|i, j| c[(i, j)] / unit[i] / unit[j]);
        let joined = || {
            let (inverse, other) = (scaled(&p).cholesky()?.inverse(), scaled(&q).cholesky()?.inverse());
            let known = Matrix6::from_fn(|i, j| self.information[(i, j)] * unit[i] * unit[j]);
            let root = (inverse + other - known).cholesky()?;
            let right = inverse * m.component_div(&unit)
                - (other * n.component_div(&unit) - self.weighted.component_mul(&unit));
            let mean = root.solve(&right).component_mul(&unit);
            // A square, so that rounding leaves it definite.
            let half = root.l().try_inverse()?;
            let covariance = half.transpose() * half;
            let is_better = (0..6).all(|k| covariance[(k, k)] <= 1.0);
            let covariance = Matrix6::from_fn(|i, j| covariance[(i, j)] * unit[i] * unit[j]);
            (is_better && mean.iter().all(|value| value.is_finite())).then_some((mean, covariance))
        };
        joined().unwrap_or((m, p))
    }
}

/// A motion with what its covariance lacks.
fn with<T: SimdReal>((mean, covariance): (Vector6<f64>, Matrix6<f64>), beyond: &Matrix6<f64>) -> Site<T> {
    std::array::from_fn(|k| T::from_f64(if k < 6 { mean[k] } else { covariance[PAIRS[k - 6]] + beyond[PAIRS[k - 6]] }))
}

/// What the covariance of a field holds beyond that of the filter, at each site that is measured there: the
/// part of it that is positive semi-definite and more than rounding.
fn update_beyond<T: SimdReal>(
    beyond: &mut [Matrix6<f64>],
    field: &FlowField<T>,
    (sites, states): (&[usize], &[Site<T>]),
) {
    let Some(planes) = &field.covariance else { return };
    let (n, units) = (field.len(), MOTION_NAMES.map(|name| field.layout.units.scale(name)));
    parallel::for_each_value(beyond, SITES_PER_TASK, |place, beyond| {
        let (site, state) = (sites[place], &states[place]);
        if field.status[site] == Status::NonFinite {
            return;
        }
        let (_, own) = parts(state);
        let unit = own.diagonal().map(f64::sqrt);
        let mut excess = Matrix6::zeros();
        for (k, &(i, j)) in PAIRS.iter().enumerate() {
            let whole = planes[k * n + site].to_f64() / (units[i] * units[j]);
            let value = (whole - own[(i, j)]) / (unit[i] * unit[j]);
            (excess[(i, j)], excess[(j, i)]) = (value, value);
        }
        *beyond = Matrix6::zeros();
        if excess.iter().all(|value| value.is_finite()) && excess.amax() > ROUNDING {
            let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(excess);
            let kept = eigenvalues.map(|value| if value > ROUNDING { value } else { 0.0 });
            let part = eigenvectors * Matrix6::from_diagonal(&kept) * eigenvectors.transpose();
            *beyond = Matrix6::from_fn(|i, j| part[(i, j)] * unit[i] * unit[j]);
        }
    });
}

/// Replaces the motion of live sites in a field, and its covariance. Sites that no frame has measured stay
/// unknown.
fn write<'a, T: SimdReal>(field: &mut FlowField<T>, sites: impl Iterator<Item = ((&'a usize, &'a bool), &'a Site<T>)>) {
    let n = field.len();
    let units = MOTION_NAMES.map(|name| T::from_f64(field.layout.units.scale(name)));
    for ((&site, _), new) in sites.filter(|((_, is_seen), _)| **is_seen) {
        if field.status[site] == Status::NonFinite {
            field.status[site] = Status::Predicted;
        }
        for k in 0..6 {
            field.motion[k * n + site] = new[k] * units[k];
        }
        if let Some(covariance) = &mut field.covariance {
            for (k, &(i, j)) in PAIRS.iter().enumerate() {
                covariance[k * n + site] = new[6 + k] * units[i] * units[j];
            }
        }
    }
}
