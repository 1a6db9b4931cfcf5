//! The windows' fits, mixed: twiced plain fits where the flow is smooth, and across motion boundaries fits from windows that keep to one side.

use super::Options;
use super::choose::Choice;
use super::field::{Beyond, Field, RIM};
use super::fit::{FIT, LEAST, fit_row};
use super::grow::{grow_row, widen};
use super::ladder::Scale;
use crate::flow::coarse_to_fine::grid::{CHUNK, LEFT, Planes};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Distance of the eight windows from the site, in units of sigma.
const ASIDE: f64 = 1.5;
/// Variance added to what a window is judged by, px^2.
const SOFT: f64 = 1e-4;
/// Planes of the result: the motion, the window's sigma, the noise density.
pub(super) const RESULT: usize = 8;

/// The windows of one grid: place on the ladder, window, single fits.
pub(super) type Rungs<'a, T> = Vec<(usize, &'a Scale<T>, &'a Field<T>)>;

/// The plain estimate as far as coarser grids have it, to be completed by the windows of one grid.
pub(super) struct Plain<'a, T> {
    pub choice: &'a Choice<T>,
    pub octave: usize,
    pub rungs: Rungs<'a, T>,
    /// Planes of [`FIT`]: the sums over coarser windows of weight times fit, and of weighted relative misfit.
    pub coarser: Option<&'a Field<T>>,
    /// The flow on this grid.
    pub grid: &'a Field<T>,
}

/// Lines that rows are made in.
struct Scratch<T> {
    down: Vec<T>,
    again: Vec<T>,
    weight: Vec<T>,
    misfit: Vec<T>,
}

impl<T: SimdReal> Scratch<T> {
    fn new(stride: usize) -> Self {
        let lines = |n: usize| vec![T::from_f64(0.0); n * stride];
        Self { down: lines(4), again: lines(6), weight: lines(2), misfit: lines(2) }
    }
}

impl<T: SimdReal> Plain<'_, T> {
    /// Planes of [`FIT`] along row `y`: sum of weight times twiced fit, and the mean relative misfit.
    #[inline(always)]
    fn row<V: Lanes<Scalar = T>>(&self, y: usize, scratch: &mut Scratch<T>, out: &mut [T]) {
        let Self { choice, octave, rungs, coarser, grid } = self;
        let (width, stride) = (grid.width, grid.stride());
        for (k, line) in out.chunks_exact_mut(stride).take(FIT).enumerate() {
            match coarser {
                Some(coarser) => grow_row::<V>(coarser, k, y, width, &mut scratch.down, &mut line[LEFT..]),
                None => line.fill(T::from_f64(0.0)),
            }
        }
        for (l, scale, fits) in rungs {
            widen::<V>(choice, *l, *octave, y, &mut scratch.down, &mut scratch.weight);
            if !any(&scratch.weight[..width]) {
                continue;
            }
            widen::<V>(choice, choice.misfit(*l), *octave, y, &mut scratch.down, &mut scratch.misfit);
            fit_row::<V>(fits, &scale.second, y, &mut scratch.down, &mut scratch.again);
            let once = &fits.data()[fits.start(0, y as isize)..][..FIT * stride];
            for x in (0..fits.padded()).step_by(V::LANES) {
                let weight = V::load(&scratch.weight[x..]);
                for k in 0..FIT - 1 {
                    let at = k * stride + LEFT + x;
                    let (first, second) = (V::load(&once[at..]), V::load(&scratch.again[at..]));
                    (first + first - second).mul_add(weight, V::load(&out[at..])).store(&mut out[at..]);
                }
                let at = (FIT - 1) * stride + LEFT + x;
                let misfit = V::load(&once[at..]).max(V::constant(LEAST));
                misfit.mul_add(V::load(&scratch.misfit[x..]), V::load(&out[at..])).store(&mut out[at..]);
            }
        }
    }
}

#[inline(always)]
fn any<T: SimdReal>(weights: &[T]) -> bool {
    let mut most = T::from_f64(0.0);
    for w in weights {
        most = if most < *w { *w } else { most };
    }
    most > T::from_f64(0.0)
}

struct Collapse<'a, T> {
    plain: &'a Plain<'a, T>,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Collapse<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let mut scratch = Scratch::new(self.plain.grid.stride());
        for (y, out) in self.rows.zip(self.out.chunks_exact_mut(FIT * self.plain.grid.stride())) {
            self.plain.row::<V>(y, &mut scratch, out);
        }
    }
}

/// The plain estimate of a coarse grid.
pub(super) fn collapse<T: SimdReal>(simd: Level, plain: &Plain<'_, T>) -> Field<T> {
    let mut out = Field::new(plain.grid.width, plain.grid.height, FIT);
    let len = out.row_len();
    for_each_band(out.rows_mut(), len, |_, rows, out| dispatch(simd, Collapse { plain, rows, out }));
    out.extend(0..2, Beyond::Odd, 2);
    out.extend(2..FIT, Beyond::Even, 2);
    out
}

/// What the last step needs beside the plain estimate.
pub(super) struct Final<'a, T> {
    pub plain: Plain<'a, T>,
    /// Single fits at the finest sites, of the windows whose edge fits are wanted, with the window's place.
    pub edges: Vec<(usize, f64, &'a Field<T>)>,
    pub options: &'a Options,
    /// Added to the result: u, v, then the slopes, about site (0, 0).
    pub base: [f64; 6],
    pub pitch: f64,
}

struct Finish<'a, T> {
    job: &'a Final<'a, T>,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Finish<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { job, rows, out } = self;
        let (stride, choice) = (job.plain.grid.stride(), job.plain.choice);
        let mut scratch = Scratch::new(stride);
        let mut row = vec![T::from_f64(0.0); FIT * stride];
        let mut weights = vec![T::from_f64(0.0); 2 * stride * (job.edges.len() + 3)];
        for (y, out) in rows.zip(out.chunks_exact_mut(RESULT * stride)) {
            job.plain.row::<V>(y, &mut scratch, &mut row);
            let planes = [choice.density(), choice.sigma(false), choice.sigma(true)];
            let planes = planes.into_iter().chain(job.edges.iter().map(|(l, ..)| choice.edge(*l)));
            for (k, line) in planes.zip(weights.chunks_exact_mut(2 * stride)) {
                widen::<V>(choice, k, 0, y, &mut scratch.down, line);
            }
            let mut x = 0;
            while x < job.plain.grid.width {
                job.chunk::<V>(x, y, &row, &weights, out);
                x += CHUNK;
            }
        }
    }
}

impl<T: SimdReal> Final<'_, T> {
    /// The result at [`CHUNK`] sites from `x` on.
    #[inline(always)]
    fn chunk<V: Lanes<Scalar = T>>(&self, x: usize, y: usize, plain: &[T], weights: &[T], out: &mut [T]) {
        let stride = self.plain.grid.stride();
        let mut sums = [[T::from_f64(0.0); CHUNK]; 6];
        for ((_, sigma, fits), weight) in self.edges.iter().zip(weights.chunks_exact(2 * stride).skip(3)) {
            if any(&weight[x..x + CHUNK]) {
                self.edge::<V>(*sigma, fits, [x, y], &weight[x..x + CHUNK], &mut sums);
            }
        }
        let cube = V::constant(self.options.gate.powi(3));
        let slope = [self.base[2], self.base[3], self.base[4], self.base[5]].map(|b| b * self.pitch);
        for i in (0..CHUNK).step_by(V::LANES) {
            let at = LEFT + x + i;
            let misfit = V::load(&plain[(FIT - 1) * stride + at..]).max(V::zero());
            let third = misfit * misfit * misfit;
            let gate = V::constant(1.0) - cube / (third + cube);
            for (k, sum) in sums.iter().enumerate() {
                let value = V::load(&plain[k * stride + at..]);
                let mut value = (V::load(&sum[i..]) - value).mul_add(gate, value);
                if k < 2 {
                    let here = self.base[k] + slope[k] * (x + i) as f64 + slope[2 + k] * y as f64;
                    value = value + V::constant(slope[k]).mul_add(V::load(&ramp::<T>()[..]), V::constant(here));
                } else {
                    value = value + V::constant(self.base[k]);
                }
                value.store(&mut out[k * stride + at..]);
            }
            let line = |n: usize| &weights[2 * n * stride + x + i..];
            let (narrow, wide) = (V::load(line(1)), V::load(line(2)));
            (wide - narrow).mul_add(gate, narrow).store(&mut out[6 * stride + at..]);
            V::load(line(0)).store(&mut out[7 * stride + at..]);
        }
    }

    /// Adds weight times edge fit of one window: nine windows around the site, the better the closer to affine and to the site's own flow.
    ///
    /// M. Kuwahara et al., "Processing of RI-angiocardiographic images" (1976) choose the calmest of four windows; here each is an affine model, and all count.
    #[inline(always)]
    fn edge<V: Lanes<Scalar = T>>(
        &self,
        sigma: f64,
        fits: &Field<T>,
        site: [usize; 2],
        weights: &[T],
        sums: &mut [[T; CHUNK]; 6],
    ) {
        let windows = around(sigma / self.pitch);
        let (stride, [x, y]) = (fits.stride(), site);
        let (data, soft) = (fits.data(), V::constant(SOFT));
        let (u, v) =
            (&self.plain.grid.line(0, y as isize)[LEFT + x..], &self.plain.grid.line(1, y as isize)[LEFT + x..]);
        for i in (0..CHUNK).step_by(V::LANES) {
            let own = [V::load(&u[i..]), V::load(&v[i..])];
            let (mut total, mut sum) = (V::zero(), [V::zero(); 6]);
            for [dx, dy] in windows {
                let from = (fits.start(0, y as isize + dy) + LEFT + x + i).wrapping_add_signed(dx);
                let fit = &data[from..from + 6 * stride + V::LANES];
                let (back, up) = (V::constant(dx as f64 * self.pitch), V::constant(dy as f64 * self.pitch));
                let slopes = [
                    V::load(&fit[2 * stride..]),
                    V::load(&fit[3 * stride..]),
                    V::load(&fit[4 * stride..]),
                    V::load(&fit[5 * stride..]),
                ];
                let here = [
                    slopes[2].neg_mul_add(up, slopes[0].neg_mul_add(back, V::load(fit))),
                    slopes[3].neg_mul_add(up, slopes[1].neg_mul_add(back, V::load(&fit[stride..]))),
                ];
                let (du, dv) = (here[0] - own[0], here[1] - own[1]);
                let misfit = V::load(&fit[6 * stride..]).max(V::zero()) + soft;
                let error = du.mul_add(du, dv.mul_add(dv, misfit));
                let weight = V::constant(1.0) / (error * error);
                total = total + weight;
                sum[0] = here[0].mul_add(weight, sum[0]);
                sum[1] = here[1].mul_add(weight, sum[1]);
                for k in 0..4 {
                    sum[2 + k] = slopes[k].mul_add(weight, sum[2 + k]);
                }
            }
            let share = V::load(&weights[i..]) / total;
            for k in 0..6 {
                sum[k].mul_add(share, V::load(&sums[k][i..])).store(&mut sums[k][i..]);
            }
        }
    }
}

/// Offsets of the nine windows, sites.
fn around(sigma: f64) -> [[isize; 2]; 9] {
    let aside = (ASIDE * sigma).min(RIM as f64);
    let (a, d) = (aside.round() as isize, (aside / std::f64::consts::SQRT_2).round() as isize);
    [[0, 0], [a, 0], [-a, 0], [0, a], [0, -a], [d, d], [d, -d], [-d, d], [-d, -d]]
}

/// 0, 1, 2, ...
#[inline(always)]
fn ramp<T: SimdReal>() -> [T; CHUNK] {
    std::array::from_fn(|i| T::from_f64(i as f64))
}

/// The refined motion, with the window's sigma and the noise density: planes of [`RESULT`].
pub(super) fn finish<T: SimdReal>(simd: Level, job: &Final<'_, T>) -> Planes<T> {
    let mut out = Planes::new(job.plain.grid.width, job.plain.grid.height, RESULT);
    let len = out.row_len();
    for_each_band(out.data_mut(), len, |_, rows, out| dispatch(simd, Finish { job, rows, out }));
    out
}
