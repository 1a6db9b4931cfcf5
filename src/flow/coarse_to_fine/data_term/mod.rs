//! Data term of one linearisation on one level: the views warped by the present motion, rows 1 to 3 of the
//! equations of affine flow at every pixel, and windowed normal equations at every site.
//!
//! A site (X, Y) is the pixel (2X, 2Y). With `A` the mean and `R` the rate of the warped views and `m` the
//! motion they were warped by, the equations of a pixel are
//!
//! ```text
//! A_x u + A_y v = -R + A_x u_m + A_y v_m
//! g (A_xx u + A_xy v) = g (-R_x + A_xx u_m + A_xy v_m)
//! g (A_xy u + A_yy v) = g (-R_y + A_xy u_m + A_yy v_m)
//! ```
//!
//! for the whole motion `u = u_0 + u_x x + u_y y` at its offset `(x, y)` from a site: rows 1 to 3 of `J(i)`
//! (21) of WO2010/098160, transported to the site. The terms by which a deforming motion changes the gradient
//! are already in the warped views. Warping towards the middle of the views follows B. D. Lucas and T.
//! Kanade, "An iterative image registration technique with an application to stereo vision", 1981. The right
//! side holds the whole motion, so that iterations do not undo the smoothing by the window. Without the
//! motion (`b = -R`) it is what the motion leaves of the flow, curved motion within the window included.
//!
//! `band` runs rows of sites through `dense` (motion at every pixel), `warp` (views along it), `products`
//! (a pixel's equations) and `moments` (their windowed sums); `scratch` holds the rows.

mod band;
mod dense;
mod moments;
mod products;
mod scratch;
#[cfg(test)]
mod tests;
mod warp;

#[cfg(test)]
pub(super) use moments::SUMMARY;
pub(super) use moments::{COUNT, ENERGY, ERROR, MEANS, SEEN, UU, UV, VALID, VV, normal, right, summary};
pub(super) use warp::{is_usable, sample_views};

use super::planes::Planes;
use crate::image::Spline;
use crate::parallel;
use crate::simd::{Level, SimdReal, dispatch};
use crate::types::Mask;
pub(super) use band::Sums;
use band::{Band, Task};
use moments::taps;
use scratch::Scratch;
use std::sync::{Mutex, PoisonError};

/// Maximum site rows of a band: its halo costs a tenth of 48 rows; larger ones leave threads idle.
const BAND: usize = 48;

/// Rows of each band: equal, and an even number of bands. The split depends on the size alone.
fn band_rows(height: usize) -> usize {
    let bands = height.div_ceil(BAND);
    height.div_ceil(if bands > 1 { bands.next_multiple_of(2) } else { bands })
}

/// Minimum usable share of a site's window: somewhat less than in a corner of the frame.
pub(super) const MIN_USABLE_SHARE: f64 = 0.1;
/// Planes of the given motion: `u, v, u_x, v_x, u_y, v_y`.
pub(super) const MOTION: usize = 6;

/// One frame of a level as input of the data term.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a, T> {
    /// Brightness between pixels.
    pub spline: &'a Spline<T>,
    /// Usable pixels; `None`: all.
    pub usable: Option<&'a Mask>,
    /// Time, in frames from that of the motion.
    pub time: T,
    /// Weight in the mean `A`.
    pub mean: T,
    /// Weight in the rate `R`.
    pub rate: T,
}

impl<'a, T: SimdReal> View<'a, T> {
    /// Two frames, half a frame before and after the motion's time.
    pub fn pair(splines: [&'a Spline<T>; 2], usable: [Option<&'a Mask>; 2]) -> [Self; 2] {
        let parts = [(-0.5, 0.5, -1.0), (0.5, 0.5, 1.0)];
        std::array::from_fn(|k| Self::new(splines[k], usable[k], parts[k]))
    }

    /// Three frames about the time of the middle one.
    pub fn triple(splines: [&'a Spline<T>; 3], usable: [Option<&'a Mask>; 3]) -> [Self; 3] {
        let parts = [(-1.0, 0.25, -0.5), (0.0, 0.5, 0.0), (1.0, 0.25, 0.5)];
        std::array::from_fn(|k| Self::new(splines[k], usable[k], parts[k]))
    }

    /// Two frames at the time of the first one, whose pixels the motion then belongs to.
    pub fn ahead(splines: [&'a Spline<T>; 2], usable: [Option<&'a Mask>; 2]) -> [Self; 2] {
        let parts = [(0.0, 0.5, -1.0), (1.0, 0.5, 1.0)];
        std::array::from_fn(|k| Self::new(splines[k], usable[k], parts[k]))
    }

    /// Two frames, one frame before and after the motion's time.
    pub fn around(splines: [&'a Spline<T>; 2], usable: [Option<&'a Mask>; 2]) -> [Self; 2] {
        let parts = [(-1.0, 0.5, -0.5), (1.0, 0.5, 0.5)];
        std::array::from_fn(|k| Self::new(splines[k], usable[k], parts[k]))
    }

    fn new(spline: &'a Spline<T>, usable: Option<&'a Mask>, (time, mean, rate): (f64, f64, f64)) -> Self {
        let [time, mean, rate] = [time, mean, rate].map(T::from_f64);
        Self { spline, usable, time, mean, rate }
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct DataOptions {
    /// Weight `g` of the rows 2 and 3 against row 1, px.
    pub gradient: f64,
    /// Standard deviation of the Gaussian window, px; truncated at three of them.
    pub sigma: f64,
    /// Robust constant `c`: a pixel with `R` of `c` standard deviations has weight 1/2.
    pub robust: f64,
}

impl Default for DataOptions {
    fn default() -> Self {
        Self { gradient: 5.0, sigma: 1.2, robust: 3.0 }
    }
}

#[derive(Debug, Default)]
pub(super) struct Pool<T>(Mutex<Vec<Scratch<T>>>);

#[derive(Debug)]
pub(super) struct DataTerm<'a, T> {
    level: Level,
    options: DataOptions,
    taps: Vec<[T; 3]>,
    pool: &'a Pool<T>,
}

impl<'a, T: SimdReal> DataTerm<'a, T> {
    pub fn new(level: Level, options: DataOptions, pool: &'a Pool<T>) -> Self {
        Self { level, options, taps: taps(options.sigma), pool }
    }

    /// Writes the `sums` of a level to `out`; returns `|R|` of a subsample. `motion`: finite, px of this
    /// level per frame. `scale`: standard deviation of `R` at constant brightness; without it all weights are
    /// 1. Bit-identical for any number of threads, in the caller's thread pool.
    pub fn linearise(
        &self,
        sums: Sums,
        (size, views): ((usize, usize), &[View<'_, T>]),
        motion: &Planes<T>,
        scale: Option<T>,
        out: &mut Planes<T>,
    ) -> Vec<T> {
        let (width, height) = (size.0.div_ceil(2), size.1.div_ceil(2));
        out.reshape(width, height, if sums == Sums::Moments { COUNT } else { MEANS });
        if width == 0 || height == 0 {
            return Vec::new();
        }
        let task = Task {
            sums,
            size,
            views,
            motion,
            taps: &self.taps,
            gradient: T::from_f64(self.options.gradient * self.options.gradient),
            // Squares of the inverse must not overflow.
            inverse: scale
                .map_or(T::from_f64(0.0), |s| T::from_f64(1.0 / (self.options.robust * s.to_f64()).max(1e-15))),
            stride: out.stride(),
        };
        let rows = band_rows(height);
        let len = out.row_len();
        let residuals: Vec<Vec<T>> = parallel::map(out.data_mut().chunks_mut(rows * len).enumerate(), |(band, out)| {
            let mut scratch = self.lock().pop().unwrap_or_default();
            let sites = band * rows..(band * rows + out.len() / len);
            let mut residuals = Vec::new();
            let kernel = Band { task: &task, rows: sites, out, residuals: &mut residuals, scratch: &mut scratch };
            dispatch(self.level, kernel);
            self.lock().push(scratch);
            residuals
        });
        residuals.concat()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Scratch<T>>> {
        self.pool.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
