//! Slopes of brightness: convolution with the derivatives of a Gaussian, by row bands; and the structure
//! tensor of a window: sums or means of their products.

use super::{Border, blocks::cover, blocks::load, blocks::store};
use crate::parallel::{self, BAND_ROWS};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Weights of a Gaussian and of its derivative at distance 0, 1, ..., radius.
#[derive(Debug, Clone)]
struct Weights<T> {
    /// `G(k) = exp(-k^2 / (2 sigma^2)) / (sigma sqrt(2 pi))`.
    gaussian: Vec<T>,
    /// `-G'(k) = k / sigma^2 G(k)`: what the sample `k` after is weighted with in a slope.
    derivative: Vec<T>,
}

impl<T: SimdReal> Weights<T> {
    fn new(sigma: f64, radius: usize) -> Self {
        let gaussian = |k: f64| (-0.5 * (k / sigma).powi(2)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt());
        let of = |weight: &dyn Fn(f64) -> f64| (0..=radius).map(|k| T::from_f64(weight(k as f64))).collect();
        Self { gaussian: of(&gaussian), derivative: of(&|k| k / (sigma * sigma) * gaussian(k)) }
    }
}

/// Slopes of `frame` along x and along y, in its levels per px: convolutions with `G'(x) G(y)` and `G(x)
/// G'(y)` of a Gaussian of `sigma` px, sampled up to `radius` px, the border replicated.
///
/// They are the slopes of the plane that fits the neighbourhood best under Gaussian weights. A sample that is
/// not finite damages every pixel whose kernel reaches it, and no other. Identical for any number of threads.
/// `sigma` must be positive.
pub fn gaussian_gradient<T: SimdReal>(
    level: Level,
    frame: &Frame<T>,
    sigma: f64,
    radius: usize,
) -> (Frame<T>, Frame<T>) {
    let (width, height) = frame.size();
    let mut along_x = Frame::filled(width, height, T::from_f64(0.0));
    let mut along_y = along_x.clone();
    if frame.data().is_empty() {
        return (along_x, along_y);
    }
    let weights = Weights::new(sigma, radius);
    let bands = along_x.data_mut().chunks_mut(BAND_ROWS * width);
    let bands = bands.zip(along_y.data_mut().chunks_mut(BAND_ROWS * width)).enumerate();
    parallel::for_each(bands, |(band, (along_x, along_y))| {
        dispatch(level, Band { frame, weights: &weights, first_row: band * BAND_ROWS, along_x, along_y });
    });
    (along_x, along_y)
}

struct Band<'a, T> {
    frame: &'a Frame<T>,
    weights: &'a Weights<T>,
    first_row: usize,
    along_x: &'a mut [T],
    along_y: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Band<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.frame.width() < V::LANES { self.rows::<T>() } else { self.rows::<V>() }
    }
}

impl<T: SimdReal> Band<'_, T> {
    #[inline(always)]
    fn rows<V: Lanes<Scalar = T>>(self) {
        let Self { frame, weights, first_row, along_x, along_y } = self;
        let (width, height) = frame.size();
        let radius = weights.gaussian.len() - 1;
        // Both sums down the columns, with room for the border at either end.
        let mut smooth = vec![T::from_f64(0.0); width + 2 * radius];
        let mut slope = smooth.clone();
        let mut pairs: Vec<RowPair<'_, T>> = Vec::with_capacity(radius);
        for (offset, (out_x, out_y)) in along_x.chunks_exact_mut(width).zip(along_y.chunks_exact_mut(width)).enumerate()
        {
            let y = (first_row + offset) as isize;
            let row = |at: isize| frame.row(Border::Replicate.index(at, height));
            pairs.clear();
            for k in 1..=radius as isize {
                pairs.push((row(y - k), row(y + k)));
            }
            let centre = frame.row(y as usize);
            cover!(width, V, |x, N| {
                sum_down::<V, N>(centre, &pairs, weights, x, &mut smooth[radius + x..], &mut slope[radius + x..]);
            });
            for plane in [&mut smooth, &mut slope] {
                let (first, last) = (plane[radius], plane[radius + width - 1]);
                plane[..radius].fill(first);
                plane[radius + width..].fill(last);
            }
            cover!(width, V, |x, N| sum_differences::<V, N>(&smooth[x..], &weights.derivative, &mut out_x[x..]));
            cover!(width, V, |x, N| sum_along::<V, N>(&slope[x..], &weights.gaussian, &mut out_y[x..]));
        }
    }
}

/// The rows at equal distance above and below.
type RowPair<'a, T> = (&'a [T], &'a [T]);

/// Sums of a column weighted with `G` and with `-G'`. The middle has weight 0 in the latter and is there so
/// that a bad sample in it is not overlooked.
#[inline(always)]
fn sum_down<V: Lanes, const N: usize>(
    centre: &[V::Scalar],
    pairs: &[RowPair<'_, V::Scalar>],
    weights: &Weights<V::Scalar>,
    x: usize,
    smooth: &mut [V::Scalar],
    slope: &mut [V::Scalar],
) {
    let middle = load::<V, N>(&centre[x..]);
    let (mut sums, mut differences) = ([V::zero(); N], [V::zero(); N]);
    for i in 0..N {
        sums[i] = middle[i] * V::splat(weights.gaussian[0]);
        differences[i] = middle[i] * V::zero();
    }
    for (k, (above, below)) in pairs.iter().enumerate() {
        let (g, d) = (V::splat(weights.gaussian[k + 1]), V::splat(weights.derivative[k + 1]));
        let (a, b) = (load::<V, N>(&above[x..]), load::<V, N>(&below[x..]));
        for i in 0..N {
            sums[i] = (a[i] + b[i]).mul_add(g, sums[i]);
            differences[i] = (b[i] - a[i]).mul_add(d, differences[i]);
        }
    }
    store::<V, N>(&sums, smooth);
    store::<V, N>(&differences, slope);
}

/// `out[x] = sum_k weights[k] (row[x + r + k] - row[x + r - k])`.
#[inline(always)]
fn sum_differences<V: Lanes, const N: usize>(row: &[V::Scalar], weights: &[V::Scalar], out: &mut [V::Scalar]) {
    let radius = weights.len() - 1;
    let middle = load::<V, N>(&row[radius..]);
    let mut sums = [V::zero(); N];
    for i in 0..N {
        sums[i] = middle[i] * V::zero();
    }
    for (k, &weight) in weights.iter().enumerate().skip(1) {
        let (a, b) = (load::<V, N>(&row[radius - k..]), load::<V, N>(&row[radius + k..]));
        for i in 0..N {
            sums[i] = (b[i] - a[i]).mul_add(V::splat(weight), sums[i]);
        }
    }
    store::<V, N>(&sums, out);
}

/// `out[x] = weights[0] row[x + r] + sum_k weights[k] (row[x + r - k] + row[x + r + k])`.
#[inline(always)]
fn sum_along<V: Lanes, const N: usize>(row: &[V::Scalar], weights: &[V::Scalar], out: &mut [V::Scalar]) {
    let radius = weights.len() - 1;
    let middle = load::<V, N>(&row[radius..]);
    let mut sums = [V::zero(); N];
    for i in 0..N {
        sums[i] = middle[i] * V::splat(weights[0]);
    }
    for (k, &weight) in weights.iter().enumerate().skip(1) {
        let (a, b) = (load::<V, N>(&row[radius - k..]), load::<V, N>(&row[radius + k..]));
        for i in 0..N {
            sums[i] = (a[i] + b[i]).mul_add(V::splat(weight), sums[i]);
        }
    }
    store::<V, N>(&sums, out);
}

/// `(xx, xy; xy, yy)`, the normal matrix of a translation (B. Lucas and T. Kanade, 1981).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructureTensor {
    /// Of the derivatives along x, squared.
    pub xx: f64,
    /// Of both derivatives.
    pub xy: f64,
    /// Of the derivatives along y, squared.
    pub yy: f64,
}

impl StructureTensor {
    /// Determinant.
    pub fn determinant(self) -> f64 {
        self.xx * self.yy - self.xy * self.xy
    }

    /// The larger eigenvalue; NaN where an entry is.
    pub fn larger_eigenvalue(self) -> f64 {
        0.5 * (self.xx + self.yy + self.eigenvalue_difference())
    }

    /// The smaller eigenvalue; NaN where an entry is.
    pub fn smaller_eigenvalue(self) -> f64 {
        0.5 * (self.xx + self.yy - self.eigenvalue_difference())
    }

    fn eigenvalue_difference(self) -> f64 {
        ((self.xx - self.yy).powi(2) + 4.0 * self.xy * self.xy).sqrt()
    }

    /// The step that solves `tensor step = right`; not finite where the tensor is singular.
    pub fn solve(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let determinant = self.determinant();
        [(self.yy * x - self.xy * y) / determinant, (self.xx * y - self.xy * x) / determinant]
    }
}
