//! Plain fits: the weighted mean of the windows' fits where the flow is smooth, from the coarsest grid on.

use super::choose::{Choice, Use};
use super::fit::{FIT, MIN_MISFIT, fit_row};
use super::ladder::{EXTRA_PASSES, Scale, TERMS};
use super::upsample::{grow_row, widen};
use crate::flow::coarse_to_fine::extended::{Continuation, Field};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::LEFT;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Minimum weight of the narrowest window of a coarse grid, for interpolation to finer grids.
const MIN_FIRST_WEIGHT: f64 = 1e-3;
const PLAIN: [Use; 2] = [Use::Flow, Use::Slopes];

/// The windows of one grid: index in the ladder, window, single fits.
pub(super) type Rungs<'a, T> = Vec<(usize, &'a Scale<T>, &'a Field<T>)>;

/// The plain estimate of the coarser grids, to be completed by the windows of one grid.
pub(super) struct Plain<'a, T> {
    pub choice: &'a Choice<T>,
    pub octave: usize,
    pub rungs: Rungs<'a, T>,
    /// Planes of [`FIT`]: the mean fit of coarser grids' windows, and their mean relative misfit.
    pub coarser: Option<&'a Field<T>>,
    pub grid: &'a Field<T>,
}

struct Scratch<T> {
    down: Vec<T>,
    again: Vec<T>,
    weight: Vec<T>,
    total: Vec<T>,
    misfit: Vec<T>,
}

impl<T: SimdReal> Scratch<T> {
    fn new(stride: usize) -> Self {
        let lines = |n: usize| vec![T::from_f64(0.0); n * stride];
        Self { down: lines(4), again: lines(6 * EXTRA_PASSES), weight: lines(4), total: lines(4), misfit: lines(2) }
    }
}

impl<T: SimdReal> Plain<'_, T> {
    /// Planes of [`FIT`] along row `y`: the mean fit, and the mean relative misfit. On the finest grid the
    /// weights sum to 1, or to less where the field vanishes.
    #[inline(always)]
    fn row<V: Lanes<Scalar = T>>(&self, y: usize, scratch: &mut Scratch<T>, out: &mut [T]) {
        let stride = self.grid.stride();
        self.add_coarser::<V>(y, scratch, out);
        for (n, (l, scale, fits)) in self.rungs.iter().enumerate() {
            let min_weight = if n == 0 && self.octave > 0 { MIN_FIRST_WEIGHT } else { 0.0 };
            if !self.weigh::<V>(*l, y, min_weight, scratch) {
                continue;
            }
            for (taps, lines) in scale.again.iter().zip(scratch.again.chunks_exact_mut(6 * stride)) {
                fit_row::<V>(fits, taps, y, &mut scratch.down, lines);
            }
            let once = &fits.data()[fits.start(0, y as isize)..][..FIT * stride];
            scratch.add::<V>(once, fits.padded(), stride, out);
        }
        if self.octave > 0 {
            scratch.divide::<V>(self.grid.padded(), stride, out);
        }
    }

    /// The estimate of the coarser grids, with the weight of all their windows.
    #[inline(always)]
    fn add_coarser<V: Lanes<Scalar = T>>(&self, y: usize, scratch: &mut Scratch<T>, out: &mut [T]) {
        let Self { choice, octave, coarser, grid, .. } = self;
        let (width, stride) = (grid.width, grid.stride());
        let Some(coarser) = coarser else {
            out.fill(T::from_f64(0.0));
            scratch.total.fill(T::from_f64(0.0));
            return;
        };
        for (of, total) in PLAIN.into_iter().zip(scratch.total.chunks_exact_mut(2 * stride)) {
            widen::<V>(choice, choice.order.coarser(of, *octave), *octave, y, &mut scratch.down, total);
        }
        for (k, line) in out.chunks_exact_mut(stride).take(FIT).enumerate() {
            grow_row::<V>(coarser, k, y, width, &mut scratch.down, &mut line[LEFT..]);
            let total = &scratch.total[2 * stride * use_of(k)..];
            for x in (0..grid.padded()).step_by(V::LANES) {
                let line = &mut line[LEFT + x..];
                (V::load(line) * V::load(&total[x..])).store(line);
            }
        }
    }

    /// Weights of the window `l` along row `y`; false if there are none.
    #[inline(always)]
    fn weigh<V: Lanes<Scalar = T>>(&self, l: usize, y: usize, min_weight: f64, scratch: &mut Scratch<T>) -> bool {
        let Self { choice, octave, grid, .. } = self;
        let (width, stride) = (grid.width, grid.stride());
        for (of, weight) in PLAIN.into_iter().zip(scratch.weight.chunks_exact_mut(2 * stride)) {
            widen::<V>(choice, choice.order.weight(of, l), *octave, y, &mut scratch.down, weight);
            for x in (0..grid.padded()).step_by(V::LANES) {
                V::load(&weight[x..]).max(V::constant(min_weight)).store(&mut weight[x..]);
            }
        }
        widen::<V>(choice, choice.order.misfit(l), *octave, y, &mut scratch.down, &mut scratch.misfit);
        scratch.weight.chunks_exact(2 * stride).any(|weight| any_positive(&weight[..width]))
    }
}

impl<T: SimdReal> Scratch<T> {
    /// Adds weights times `1 - (1 - K)^4` of the present window.
    #[inline(always)]
    fn add<V: Lanes<Scalar = T>>(&mut self, once: &[T], padded: usize, stride: usize, out: &mut [T]) {
        let terms = TERMS.map(V::constant);
        for x in (0..padded).step_by(V::LANES) {
            let weights = [0, 1].map(|n| V::load(&self.weight[2 * stride * n + x..]));
            for k in 0..FIT - 1 {
                let at = k * stride + LEFT + x;
                let mut value = V::load(&once[at..]) * terms[0];
                for n in 0..EXTRA_PASSES {
                    value = V::load(&self.again[at + 6 * n * stride..]).mul_add(terms[n + 1], value);
                }
                value.mul_add(weights[use_of(k)], V::load(&out[at..])).store(&mut out[at..]);
            }
            let at = (FIT - 1) * stride + LEFT + x;
            let misfit = V::load(&once[at..]).max(V::constant(MIN_MISFIT));
            misfit.mul_add(V::load(&self.misfit[x..]), V::load(&out[at..])).store(&mut out[at..]);
            for (n, weight) in weights.into_iter().enumerate() {
                let total = &mut self.total[2 * stride * n + x..];
                (V::load(total) + weight).store(total);
            }
        }
    }

    #[inline(always)]
    fn divide<V: Lanes<Scalar = T>>(&self, padded: usize, stride: usize, out: &mut [T]) {
        for x in (0..padded).step_by(V::LANES) {
            let whole = [0, 1].map(|n| V::constant(1.0) / V::load(&self.total[2 * stride * n + x..]));
            for k in 0..FIT {
                let line = &mut out[k * stride + LEFT + x..];
                (V::load(line) * whole[use_of(k)]).store(line);
            }
        }
    }
}

/// Index of the weights of plane `k` of [`FIT`].
#[inline(always)]
fn use_of(k: usize) -> usize {
    usize::from((2..FIT - 1).contains(&k))
}

#[inline(always)]
pub(super) fn any_positive<T: SimdReal>(weights: &[T]) -> bool {
    let mut most = T::from_f64(0.0);
    for w in weights {
        most = if most < *w { *w } else { most };
    }
    most > T::from_f64(0.0)
}

struct Mix<'a, T> {
    plain: &'a Plain<'a, T>,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Mix<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let mut scratch = Scratch::new(self.plain.grid.stride());
        for (y, out) in self.rows.zip(self.out.chunks_exact_mut(FIT * self.plain.grid.stride())) {
            self.plain.row::<V>(y, &mut scratch, out);
        }
    }
}

pub(super) fn mix<T: SimdReal>(simd: Level, space: &PlanePool<T>, plain: &Plain<'_, T>) -> Field<T> {
    let mut out = Field::make(space, plain.grid.width, plain.grid.height, FIT);
    let len = out.row_len();
    for_each_band(out.rows_mut(), len, |_, rows, out| dispatch(simd, Mix { plain, rows, out }));
    out.extend(0..2, Continuation::Odd, 2);
    out.extend(2..FIT, Continuation::Even, 2);
    out
}
