//! Gaussian windows, and the moments of planes over them.
//!
//! The normal equations of a window need sums of products weighted by `w`, `w x`, `w y`, `w x^2`, `w x y` and
//! `w y^2`, with `w = g(x) g(y)`: three one-dimensional filters down the columns, and along the rows those of
//! each result that are still needed.

use super::{plan::Plan, plan::moments, tile::GROUP_ROWS, tile::Planes, tile::TILE_COLUMNS};
use crate::flow::moment_filter::{filter, weights};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Filters of one axis: `taps[k] = [g, g k/s, g (k/s)^2]` for the distances k = 0 ..= radius, s the unit of
/// length.
#[derive(Debug, Clone)]
pub(super) struct Window<T> {
    pub taps: Vec<[T; 3]>,
}

impl<T: SimdReal> Window<T> {
    /// The Gaussian of `sigma` px cut off at `radius`, normalised to a sum of 1; lengths in units of `sigma`.
    pub fn gaussian(sigma: f64, radius: usize) -> Self {
        Self::new(&weights(sigma, radius), sigma)
    }

    /// Squares of the weights with which a window of `sigma` px sees the noise of samples that were smoothed
    /// by a Gaussian of `smooth` px, cut where they are as small as the Gaussian at `radius`.
    ///
    /// `g_sigma(p) g_smooth(q - p)` is `g(q)`, wider by the smoothing, times a kernel about `p = a q`, `a =
    /// sigma^2 / (sigma^2 + smooth^2)`; the weights are those at p, their squares summed over q. Lengths are
    /// in units of `sigma`.
    pub fn squared(sigma: f64, radius: usize, smooth: f64) -> Self {
        let narrow = sigma * sigma / sigma.hypot(smooth);
        let share = (narrow / sigma).powi(2);
        let reach = (radius as f64 / std::f64::consts::SQRT_2 * narrow / sigma).ceil() as usize;
        let g: Vec<f64> = weights(narrow, radius.max(reach)).iter().map(|w| share * w * w).collect();
        Self::new(&g[..=reach.min(radius)], sigma)
    }

    /// A filter from its weights at distance 0, 1, ...; lengths in `unit`.
    pub fn new(half: &[f64], unit: f64) -> Self {
        let tap = |(k, g): (usize, &f64)| {
            let x = k as f64 / unit;
            [*g, g * x, g * x * x].map(T::from_f64)
        };
        Self { taps: half.iter().enumerate().map(tap).collect() }
    }

    /// Largest distance, px.
    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }
}

/// Moments of a group of rows: moment `k` of row `j` is `data[(k * GROUP_ROWS + j) * TILE_COLUMNS ..][..
/// TILE_COLUMNS]`.
#[derive(Default)]
pub(super) struct Moments<T> {
    data: Vec<T>,
    column_sums: [Vec<T>; 3],
}

impl<T: SimdReal> Moments<T> {
    /// Sums the first `count` planes of a plan around rows `centres` (at most [`GROUP_ROWS`]) and columns
    /// `radius ..` of the planes.
    pub fn sum(
        &mut self,
        level: Level,
        window: &Window<T>,
        planes: &Planes<T>,
        (plan, count): (Plan, usize),
        centres: &[usize],
    ) {
        self.data.resize(plan.base(count) * GROUP_ROWS * TILE_COLUMNS, T::default());
        for v in &mut self.column_sums {
            v.resize(planes.width, T::default());
        }
        for p in 0..count {
            let (plane, order, base) = (planes.plane(p), plan.order(p), plan.base(p));
            dispatch(level, Sum { moments: self, taps: &window.taps, plane, order, base, centres });
        }
    }

    /// Moment `k` of row `j` of the group.
    #[inline(always)]
    pub fn row(&self, k: usize, j: usize) -> &[T] {
        &self.data[(k * GROUP_ROWS + j) * TILE_COLUMNS..][..TILE_COLUMNS]
    }

    /// Moment `k` of a plane, or zero without one, at row `j` of the group, column `c`.
    #[inline(always)]
    pub fn load<V: Lanes<Scalar = T>>(&self, plan: Plan, plane: Option<usize>, k: usize, at: (usize, usize)) -> V {
        match plane {
            Some(plane) => V::load(&self.row(plan.base(plane) + k, at.0)[at.1..]),
            None => V::zero(),
        }
    }
}

/// The sums of one plane.
struct Sum<'a, T> {
    moments: &'a mut Moments<T>,
    taps: &'a [[T; 3]],
    plane: &'a [T],
    order: usize,
    base: usize,
    centres: &'a [usize],
}

impl<T: SimdReal> Kernel<T> for Sum<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { moments: sums, taps, plane, order, base, centres } = self;
        let radius = taps.len() - 1;
        let size = GROUP_ROWS * TILE_COLUMNS;
        let [v0, v1, v2] = &mut sums.column_sums;
        let width = v0.len();
        for (j, &row) in centres.iter().enumerate() {
            let centre = row * width;
            let mut places = sums.data[base * size..(base + moments(order)) * size].chunks_exact_mut(size);
            let mut next = || &mut places.next().unwrap_or_default()[j * TILE_COLUMNS..(j + 1) * TILE_COLUMNS];
            match order {
                0 => {
                    filter::<V, 1>(plane, centre, width, width, taps, [v0]);
                    filter::<V, 1>(v0, radius, 1, TILE_COLUMNS, taps, [next()]);
                }
                1 => {
                    filter::<V, 2>(plane, centre, width, width, taps, [v0, v1]);
                    let (one, x, y) = (next(), next(), next());
                    filter::<V, 2>(v0, radius, 1, TILE_COLUMNS, taps, [one, x]);
                    filter::<V, 1>(v1, radius, 1, TILE_COLUMNS, taps, [y]);
                }
                _ => {
                    filter::<V, 3>(plane, centre, width, width, taps, [v0, v1, v2]);
                    let (one, x, y, xx, xy, yy) = (next(), next(), next(), next(), next(), next());
                    filter::<V, 3>(v0, radius, 1, TILE_COLUMNS, taps, [one, x, xx]);
                    filter::<V, 2>(v1, radius, 1, TILE_COLUMNS, taps, [y, xy]);
                    filter::<V, 1>(v2, radius, 1, TILE_COLUMNS, taps, [yy]);
                }
            }
        }
    }
}
