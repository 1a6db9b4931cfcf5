//! From samples to spline coefficients.
//!
//! Along an axis the samples are `s_k = (c_(k-1) + 4 c_k + c_(k+1)) / 6`; the inverse is `1 / ((1 - z q)(1 -
//! z / q))`, up to a gain of `-6 z`, with the shift `q` and `z = sqrt(3) - 2`. Powers of `z` vanish soon, so
//! both passes begin near their band instead of at the frame's edge, and bands are independent:
//! - down the columns by recursion, lanes side by side (M. Unser, A. Aldroubi, M. Eden, "B-spline signal
//!   processing: part II", 1993);
//! - along the rows, where a recursion would have lanes wait for each other, by doubling: `1 / (1 - z q) = (1
//!   + z q)(1 + z^2 q^2)(1 + z^4 q^4)...`, each factor together with its mirror image a filter of three taps.

use super::{BEFORE, MARGIN};
use crate::image::{blocks::BLOCK, blocks::cover, blocks::load, blocks::store};
use crate::parallel::{BAND_ROWS, for_each_band_of};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Rows of a task: enough to pay for the rows around it that its recursion begins with.
const BAND: usize = 4 * BAND_ROWS;

/// The pole, `sqrt(3) - 2`.
const POLE: f64 = -0.267_949_192_431_122_7;

/// Fills the rows of `stride` coefficients, margins included, of the spline through `frame`.
pub(super) fn prefilter<T: SimdReal>(level: Level, frame: &Frame<T>, stride: usize, coefficients: &mut [T]) {
    for_each_band_of(BAND, coefficients, stride, |_, rows, output| {
        dispatch(level, Band { frame, first_row: rows.start, stride, output });
    });
}

/// How far samples are followed.
struct Reach {
    /// Factors of the doubling along the rows; its filter has `2^factors - 1` taps on either side.
    factors: u32,
    /// Rows that the recursion down the columns begins before and after the band.
    rows: usize,
}

impl Reach {
    /// So far that the rest, a power of the pole, is below the rounding of `T`.
    fn of<T>() -> Self {
        if size_of::<T>() == 4 { Self { factors: 4, rows: 14 } } else { Self { factors: 5, rows: 29 } }
    }

    fn columns(&self) -> usize {
        (1 << self.factors) - 1
    }
}

/// The index within `0..len` that `index` mirrors to about the outermost pixel centres.
fn mirror(index: isize, len: usize) -> usize {
    let last = len as isize - 1;
    if last == 0 {
        return 0;
    }
    (last - (index.rem_euclid(2 * last) - last).abs()) as usize
}

struct Band<'a, T> {
    frame: &'a Frame<T>,
    /// The first row, margin included.
    first_row: usize,
    stride: usize,
    output: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Band<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.frame.width() < V::LANES { self.filter::<T>() } else { self.filter::<V>() }
    }
}

impl<T: SimdReal> Band<'_, T> {
    #[inline(always)]
    fn filter<V: Lanes<Scalar = T>>(self) {
        let Self { frame, first_row, stride, output } = self;
        let (width, height) = frame.size();
        let reach = Reach::of::<T>();
        let along = Along::<T>::new(width, &reach);
        let count = output.len() / stride;
        let first = first_row as isize - (BEFORE + reach.rows) as isize;
        let sources: Vec<&[T]> =
            (0..(count + 2 * reach.rows) as isize).map(|j| frame.row(mirror(first + j, height))).collect();
        let mut scratch = vec![T::from_f64(0.0); (count + reach.rows) * BLOCK * V::LANES];
        let gain = T::from_f64(6.0 * along.gain);
        cover!(width, V, |x, N| down::<V, N>(&sources, x, reach.rows, gain, &mut scratch, stride, output));
        along.run::<V>(width, stride, output);
    }
}

/// Filters `N` vectors of columns from `x` on: forwards into `scratch`, back into `output`, which begins
/// `reach` rows after `sources` and ends as many before.
#[inline(always)]
fn down<V: Lanes, const N: usize>(
    sources: &[&[V::Scalar]],
    x: usize,
    reach: usize,
    gain: V::Scalar,
    scratch: &mut [V::Scalar],
    stride: usize,
    output: &mut [V::Scalar],
) {
    let (pole, minus_pole, gain) = (V::constant(POLE), V::constant(-POLE), V::splat(gain));
    let step = |state: [V; N], terms: [V; N]| -> [V; N] { std::array::from_fn(|i| state[i].mul_add(pole, terms[i])) };
    // Both recursions begin with what they would have come to, had their first row always been the same.
    let mut state = load::<V, N>(&sources[0][x..]).map(|s| s * V::constant(1.0 / (1.0 - POLE)));
    for source in &sources[1..reach] {
        state = step(state, load::<V, N>(&source[x..]));
    }
    for (source, row) in sources[reach..].iter().zip(scratch.chunks_exact_mut(N * V::LANES)) {
        state = step(state, load::<V, N>(&source[x..]));
        store(&state, row);
    }
    let count = sources.len() - 2 * reach;
    let mut state = state.map(|s| s * V::constant(-POLE / (1.0 - POLE)));
    let mut rows = scratch.chunks_exact(N * V::LANES).take(count + reach).rev();
    for row in rows.by_ref().take(reach).skip(1) {
        state = step(state, load::<V, N>(row).map(|s| s * minus_pole));
    }
    for (row, out) in rows.zip(output.chunks_exact_mut(stride).rev()) {
        state = step(state, load::<V, N>(row).map(|s| s * minus_pole));
        store(&state.map(|c| c * gain), &mut out[BEFORE + x..]);
    }
}

struct Along<T> {
    /// For each factor the distance of its outer taps and their weight; that of the middle tap is 1.
    factors: Vec<(usize, T)>,
    /// What the result must be multiplied by; the filter down the columns does it.
    gain: f64,
    /// Columns to mirror before and after the row.
    before: Vec<usize>,
    after: Vec<usize>,
}

impl<T: SimdReal> Along<T> {
    fn new(width: usize, reach: &Reach) -> Self {
        let columns = reach.columns();
        let mut gain = -6.0 * POLE;
        let factors = (0..reach.factors)
            .map(|n| {
                let power = POLE.powi(1 << n);
                let middle = 1.0 + power * power;
                gain *= middle;
                (1 << n, T::from_f64(power / middle))
            })
            .collect();
        let mirrored = |first: isize, count: usize| (first..first + count as isize).map(|x| mirror(x, width)).collect();
        let before = mirrored(-((BEFORE + columns) as isize), BEFORE + columns);
        let after = mirrored(width as isize, MARGIN - BEFORE + columns);
        Self { factors, gain, before, after }
    }

    /// Filters every row of `output` in place, and fills its margins.
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(&self, width: usize, stride: usize, output: &mut [T]) {
        let length = self.before.len() + width + self.after.len();
        let (mut from, mut to) = (vec![T::from_f64(0.0); length], vec![T::from_f64(0.0); length]);
        for row in output.chunks_exact_mut(stride) {
            let (before, middle) = from.split_at_mut(self.before.len());
            let (middle, after) = middle.split_at_mut(width);
            middle.copy_from_slice(&row[BEFORE..][..width]);
            for (value, &x) in before.iter_mut().zip(&self.before) {
                *value = middle[x];
            }
            for (value, &x) in after.iter_mut().zip(&self.after) {
                *value = middle[x];
            }
            let mut length = length;
            for (n, &(distance, weight)) in self.factors.iter().enumerate() {
                let next = length - 2 * distance;
                if n + 1 < self.factors.len() {
                    three_taps::<V>(&from[..length], weight, distance, &mut to[..next]);
                    std::mem::swap(&mut from, &mut to);
                } else {
                    three_taps::<V>(&from[..length], weight, distance, &mut row[..next]);
                }
                length = next;
            }
        }
    }
}

/// `to[i] = from[i + d] + weight (from[i] + from[i + 2 d])`.
#[inline(always)]
fn three_taps<V: Lanes>(from: &[V::Scalar], weight: V::Scalar, distance: usize, to: &mut [V::Scalar]) {
    let weight = V::splat(weight);
    let (middle, right) = (&from[distance..], &from[2 * distance..]);
    cover!(to.len(), V, |x, N| {
        let (a, b, c) = (load::<V, N>(&from[x..]), load::<V, N>(&middle[x..]), load::<V, N>(&right[x..]));
        let sums: [V; N] = std::array::from_fn(|i| (a[i] + c[i]).mul_add(weight, b[i]));
        store(&sums, &mut to[x..]);
    });
}
