//! The filter's arithmetic, for lanes of pixels; the same source with one lane is the scalar reference.
//!
//! Per chunk of blocks three passes run one after the other: measurement, prediction, update. Each is a
//! kernel of its own, so that the number of compiled variants is a sum, not a product. `predict` moves
//! sigma points by `transition` with process `noise` and sums their `moments`; `update` takes the measured
//! jet; `factor` and `vector` serve both.
//!
//! Between frames a state holds the lower root `L` of its covariance `L L^T`, with the components in
//! [`order`]: rounding cannot make the product indefinite, and the next prediction spreads its sigma
//! points by the root. From `predict` to `update` the same planes hold the predicted covariance.

pub(super) mod factor;
mod moments;
mod noise;
pub(super) mod predict;
pub(super) mod transition;
pub(super) mod update;
mod vector;

use super::options::FlowFilterOptions;
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};

/// Dimensions of the state.
pub(super) const N: usize = 12;
/// Entries of a packed lower triangle of the covariance.
pub(super) const PACKED: usize = N * (N + 1) / 2;
/// Plane of the noise scale: by how much the innovations say that the misfit varies from frame to frame.
pub(super) const SCALE: usize = N + PACKED;
/// Numbers of one pixel's state: mean, covariance, noise scale.
pub(super) const PLANES: usize = SCALE + 1;
/// Pixels of one block: the widest lanes. A block is `PLANES` rows of `BLOCK` values.
pub(super) const BLOCK: usize = 16;

/// Place of entry `(a, b)` in the packed lower triangle, row by row.
#[inline(always)]
pub(super) const fn packed(a: usize, b: usize) -> usize {
    if a >= b { a * (a + 1) / 2 + b } else { b * (b + 1) / 2 + a }
}

/// The components in the order of the root: brightness first, as the state stands and `filterpy` does.
const BRIGHTNESS_FIRST: [usize; N] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
/// Motion first, then the Hessian, the gradient and `I`: the last columns touch ever less.
const MOTION_FIRST: [usize; N] = [6, 7, 8, 9, 10, 11, 5, 4, 3, 2, 1, 0];

/// The component at each place of the root.
#[inline(always)]
pub(super) const fn order(motion_first: bool) -> &'static [usize; N] {
    if motion_first { &MOTION_FIRST } else { &BRIGHTNESS_FIRST }
}

/// The place of each component in the root.
#[inline(always)]
pub(super) const fn places(motion_first: bool) -> &'static [usize; N] {
    const MOTION_FIRST_PLACES: [usize; N] = [11, 10, 9, 8, 7, 6, 0, 1, 2, 3, 4, 5];
    if motion_first { &MOTION_FIRST_PLACES } else { &BRIGHTNESS_FIRST }
}

/// The filter's constants in working precision.
#[derive(Debug, Clone)]
pub(super) struct Constants<T> {
    /// Diagonal of Q.
    pub q: [T; N],
    /// Square root of `n + lambda`: how far the sigma points lie, in columns of the factor.
    pub spread: T,
    /// `beta - alpha^2`: weight of the squared shift of the mean, beyond the points' own moments.
    pub shift: T,
    /// Whether the square root takes the motion first.
    pub motion_first: bool,
    /// Normalised innovation squared beyond which the brightness starts anew.
    pub gate: T,
    /// Mean and covariance diagonal of a filter that starts.
    pub start: ([T; N], [T; N]),
}

impl<T: SimdReal> Constants<T> {
    pub(super) fn new(options: &FlowFilterOptions) -> Self {
        let points = options.sigma_points;
        let n = if options.form == super::FilterForm::Augmented { 2 * N } else { N };
        Self {
            q: options.process_noise.map(T::from_f64),
            spread: T::from_f64(points.spread(n).sqrt()),
            shift: T::from_f64(points.beta - points.alpha * points.alpha),
            motion_first: options.motion_first(),
            gate: T::from_f64(if options.adaptive { update::GATE } else { f64::MAX }),
            start: (options.initial_mean.map(T::from_f64), options.initial_covariance.map(T::from_f64)),
        }
    }
}

/// Mean, and packed covariance or root, of `V::LANES` pixels.
pub(super) struct Lane<V> {
    pub mean: [V; N],
    pub cov: [V; PACKED],
}

impl<V: Lanes> Lane<V> {
    #[inline(always)]
    pub(super) fn load(block: &[V::Scalar], at: usize) -> Self {
        let mut lane = Self { mean: [V::zero(); N], cov: [V::zero(); PACKED] };
        let rows = &block[..PLANES * BLOCK];
        for k in 0..N {
            lane.mean[k] = V::load(&rows[k * BLOCK + at..]);
        }
        for k in 0..PACKED {
            lane.cov[k] = V::load(&rows[(N + k) * BLOCK + at..]);
        }
        lane
    }

    #[inline(always)]
    pub(super) fn store(&self, block: &mut [V::Scalar], at: usize) {
        let rows = &mut block[..PLANES * BLOCK];
        for k in 0..N {
            self.mean[k].store(&mut rows[k * BLOCK + at..]);
        }
        for k in 0..PACKED {
            self.cov[k].store(&mut rows[(N + k) * BLOCK + at..]);
        }
    }
}

/// The lanes that are not one, as bits.
#[inline(always)]
pub(super) fn failed<V: Lanes>(ok: V) -> u32 {
    let mut lanes = [V::Scalar::from_f64(1.0); BLOCK];
    ok.store(&mut lanes);
    let mut bits = 0;
    for k in 0..V::LANES {
        bits |= u32::from(lanes[k] != V::Scalar::from_f64(1.0)) << k;
    }
    bits
}
