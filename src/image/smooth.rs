//! Gaussian smoothing: a symmetric separable convolution, vectorised along rows and parallel over row bands.

use super::{Border, blocks::cover, blocks::load, blocks::store};
use crate::error::{Error, Result};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch, same, same_mut};
use crate::types::Frame;

/// Taps on one side beyond which smoothing is refused: far wider than any picture.
const MAX_RADIUS: f64 = 16_384.0;

/// Convolution with a sampled Gaussian, cut off and normalised: the conventions of
/// `scipy.ndimage.gaussian_filter`.
///
/// `out(x, y) = sum_j sum_i w_i w_j in(x + i, y + j)`, `w_i = exp(-i^2 / (2 sigma^2)) / sum`, `|i| <=
/// radius`, with `radius` the whole part of `truncate sigma + 1/2`. Each output is a direct sum over its own
/// neighbourhood, so a NaN damages only the pixels whose kernel reaches it. Results are bit-identical for any
/// number of threads.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GaussianSmoother {
    /// Standard deviation of the Gaussian, px; 0 changes nothing.
    pub sigma: f64,
    /// Where the kernel is cut off, in units of sigma; default 4.
    pub truncate: f64,
    /// What lies beyond the edge; default [`Border::Reflect`].
    pub border: Border,
}

impl GaussianSmoother {
    /// A smoother with standard deviation `sigma` px, cut off at 4 sigma, reflecting borders.
    ///
    /// # Errors
    /// [`Error::Argument`] named `smooth` unless `sigma` is finite, not negative and at most 4096 px.
    pub fn new(sigma: f64) -> Result<Self> {
        Self::with(sigma, 4.0, Border::Reflect)
    }

    /// A smoother with standard deviation `sigma` px, cut off at `truncate` sigma.
    ///
    /// # Errors
    /// [`Error::Argument`] named `smooth` or `truncate` for a negative or non-finite number or a kernel of
    /// more than 16384 px radius.
    pub fn with(sigma: f64, truncate: f64, border: Border) -> Result<Self> {
        if !(sigma >= 0.0 && sigma.is_finite()) {
            return Err(Error::argument("smooth", "a standard deviation in px, not negative and finite", sigma));
        }
        if !(truncate >= 0.0 && truncate.is_finite()) {
            return Err(Error::argument("truncate", "a number of standard deviations, not negative", truncate));
        }
        if truncate * sigma > MAX_RADIUS {
            let expected = format!("a kernel radius (truncate x sigma) of at most {MAX_RADIUS} px");
            return Err(Error::argument("smooth", expected, truncate * sigma));
        }
        Ok(Self { sigma, truncate, border })
    }

    /// Taps on each side of the centre: the whole part of `truncate sigma + 1/2`.
    pub fn radius(&self) -> usize {
        (self.truncate * self.sigma + 0.5).clamp(0.0, MAX_RADIUS + 1.0) as usize
    }

    /// The `2 radius + 1` weights of the one-dimensional kernel; they sum to 1.
    pub fn kernel(&self) -> Vec<f64> {
        let half = self.half_kernel();
        half.iter().skip(1).rev().chain(&half).copied().collect()
    }

    /// Weights of the taps at 0, 1, ..., radius.
    fn half_kernel(&self) -> Vec<f64> {
        let radius = self.radius();
        if radius == 0 || self.sigma == 0.0 {
            return vec![1.0];
        }
        let raw: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / self.sigma).powi(2)).exp()).collect();
        let sum = raw[0] + 2.0 * raw[1..].iter().rev().sum::<f64>();
        raw.iter().map(|w| w / sum).collect()
    }

    /// The smoothed frame.
    ///
    /// [`Threads::install`](crate::parallel::Threads::install) chooses the number of threads.
    pub fn apply<T: SimdReal>(&self, frame: &Frame<T>) -> Frame<T> {
        self.apply_at(Level::detect(), frame)
    }

    /// As [`GaussianSmoother::apply`], with a chosen instruction set.
    pub fn apply_at<T: SimdReal>(&self, level: Level, frame: &Frame<T>) -> Frame<T> {
        let (width, height) = frame.size();
        let mut out = Frame::filled(width, height, T::from_f64(0.0));
        if let (Some(frame), Some(out)) = (same::<_, Frame<f32>>(frame), same_mut(&mut out)) {
            self.apply_single(level, frame, out);
        } else if let (Some(frame), Some(out)) = (same::<_, Frame<f64>>(frame), same_mut(&mut out)) {
            self.apply_double(level, frame, out);
        }
        out
    }

    #[inline(never)]
    fn apply_single(&self, level: Level, frame: &Frame<f32>, out: &mut Frame<f32>) {
        self.apply_with(level, frame, out);
    }

    #[inline(never)]
    fn apply_double(&self, level: Level, frame: &Frame<f64>, out: &mut Frame<f64>) {
        self.apply_with(level, frame, out);
    }

    fn apply_with<T: SimdReal>(&self, level: Level, frame: &Frame<T>, out: &mut Frame<T>) {
        let kernel = SeparableKernel::symmetric(&self.half_kernel(), self.border);
        convolve_separable(level, &kernel, frame.data(), frame.width(), out.data_mut());
    }
}

/// A symmetric kernel, the same along both axes.
#[derive(Debug, Clone)]
pub(crate) struct SeparableKernel<T> {
    /// Weights of the taps at distance 0, 1, ..., radius.
    half: Vec<T>,
    border: Border,
}

impl<T: SimdReal> SeparableKernel<T> {
    /// From the weights at distance 0, 1, ..., radius (at least one).
    pub(crate) fn symmetric(half: &[f64], border: Border) -> Self {
        Self { half: half.iter().map(|&w| T::from_f64(w)).collect(), border }
    }

    fn radius(&self) -> usize {
        self.half.len().saturating_sub(1)
    }
}

/// Convolves a row-major plane of rows of `width` samples along both axes into `output`, of the same size.
pub(crate) fn convolve_separable<T: SimdReal>(
    level: Level,
    kernel: &SeparableKernel<T>,
    input: &[T],
    width: usize,
    output: &mut [T],
) {
    if width == 0 || input.is_empty() {
        return;
    }
    let rows_in = input.len() / width;
    for_each_band(output, width, |_, rows, slice| {
        dispatch(
            level,
            BandConvolution { kernel, input, width, height: rows_in, first_row: rows.start, output: slice },
        );
    });
}

/// One band of rows: each is summed down into a scratch row, extended at both ends, then summed along.
struct BandConvolution<'a, T> {
    kernel: &'a SeparableKernel<T>,
    input: &'a [T],
    width: usize,
    height: usize,
    first_row: usize,
    output: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for BandConvolution<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.width < V::LANES { self.rows::<T>() } else { self.rows::<V>() }
    }
}

impl<T: SimdReal> BandConvolution<'_, T> {
    #[inline(always)]
    fn rows<V: Lanes<Scalar = T>>(self) {
        let Self { kernel, input, width, height, first_row, output } = self;
        let (radius, half) = (kernel.radius(), kernel.half.as_slice());
        let row = |y: usize| &input[y * width..(y + 1) * width];
        let mut scratch = vec![T::from_f64(0.0); width + 2 * radius];
        let mut pairs: Vec<RowPair<'_, T>> = Vec::with_capacity(radius);
        for (offset, out) in output.chunks_exact_mut(width).enumerate() {
            let y = first_row + offset;
            pairs.clear();
            pairs.extend((1..=radius as isize).map(|k| {
                let y = y as isize;
                (row(kernel.border.index(y - k, height)), row(kernel.border.index(y + k, height)))
            }));
            sum_down::<V>(row(y), &pairs, half, &mut scratch[radius..radius + width]);
            extend(&mut scratch, radius, width, kernel.border);
            sum_along::<V>(&scratch, half, out);
        }
    }
}

/// The rows at equal distance above and below.
type RowPair<'a, T> = (&'a [T], &'a [T]);

/// Fills the `radius` samples before and after the `width` samples in the middle of `row`.
#[inline(always)]
fn extend<T: Copy>(row: &mut [T], radius: usize, width: usize, border: Border) {
    for i in 0..radius {
        row[i] = row[radius + border.index(i as isize - radius as isize, width)];
        row[radius + width + i] = row[radius + border.index((width + i) as isize, width)];
    }
}

/// `out = half[0] centre + sum_k half[k] (above_k + below_k)`.
#[inline(always)]
fn sum_down<V: Lanes>(
    centre: &[V::Scalar],
    pairs: &[RowPair<'_, V::Scalar>],
    half: &[V::Scalar],
    out: &mut [V::Scalar],
) {
    cover!(out.len(), V, |x, N| {
        let mut sums = load::<V, N>(&centre[x..]).map(|c| c * V::splat(half[0]));
        for (&(above, below), &weight) in pairs.iter().zip(&half[1..]) {
            add_pair::<V, N>(&mut sums, &above[x..], &below[x..], weight);
        }
        store::<V, N>(&sums, &mut out[x..]);
    });
}

/// `out[x] = half[0] row[x + r] + sum_k half[k] (row[x + r - k] + row[x + r + k])`.
#[inline(always)]
fn sum_along<V: Lanes>(row: &[V::Scalar], half: &[V::Scalar], out: &mut [V::Scalar]) {
    let radius = half.len() - 1;
    cover!(out.len(), V, |x, N| {
        let mut sums = load::<V, N>(&row[x + radius..]).map(|c| c * V::splat(half[0]));
        for (k, &weight) in half.iter().enumerate().skip(1) {
            add_pair::<V, N>(&mut sums, &row[x + radius - k..], &row[x + radius + k..], weight);
        }
        store::<V, N>(&sums, &mut out[x..]);
    });
}

#[inline(always)]
fn add_pair<V: Lanes, const N: usize>(sums: &mut [V; N], a: &[V::Scalar], b: &[V::Scalar], weight: V::Scalar) {
    let (a, b) = (&a[..N * V::LANES], &b[..N * V::LANES]);
    let weight = V::splat(weight);
    for i in 0..N {
        sums[i] = (V::load(&a[i * V::LANES..]) + V::load(&b[i * V::LANES..])).mul_add(weight, sums[i]);
    }
}
