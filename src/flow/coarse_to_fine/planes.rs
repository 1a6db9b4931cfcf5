//! Planes of values on the sites (every second pixel) of one pyramid level.

use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Distance of the sites, px of their level: every second pixel.
pub(super) const SITE_SPACING: f64 = 2.0;
/// Unused samples before each row, so that a kernel may read the left neighbour of its first site.
pub(super) const LEFT: usize = 16;
/// Row lengths are multiples of this many samples (plus [`LEFT`]), so that no kernel needs a tail.
pub(super) const CHUNK: usize = 32;

/// `count` planes of `width x height` values. The planes of one row lie together, row after row, since
/// kernels walk along rows and need all planes of a site.
///
/// Samples beside the sites of a row ([`LEFT`] before, at least one after) may hold any finite value.
#[derive(Debug, Clone, Default)]
pub(super) struct Planes<T> {
    pub width: usize,
    pub height: usize,
    pub count: usize,
    data: Vec<T>,
}

impl<T: SimdReal> Planes<T> {
    /// Zeros.
    pub fn new(width: usize, height: usize, count: usize) -> Self {
        let mut planes = Self { width, height, count, data: Vec::new() };
        planes.data.resize(planes.row_len() * height, T::from_f64(0.0));
        planes
    }

    /// Changes the size, in the same memory if large enough; the content is any finite value.
    pub fn reshape(&mut self, width: usize, height: usize, count: usize) {
        (self.width, self.height, self.count) = (width, height, count);
        let len = self.row_len() * height;
        if len > self.data.len() {
            // A new vector instead of a longer one: the content is not copied, and its size is exact.
            self.data = Vec::new();
            self.data = vec![T::from_f64(0.0); len];
        }
    }

    /// Planes of no size in the memory of `samples`.
    pub fn of_samples(samples: Vec<T>) -> Self {
        Self { data: samples, ..Self::default() }
    }

    pub fn into_samples(self) -> Vec<T> {
        self.data
    }

    pub fn copy_from(&mut self, other: &Self) {
        self.reshape(other.width, other.height, other.count);
        self.data_mut().copy_from_slice(other.data());
    }

    /// Capacity, samples.
    pub fn room(&self) -> usize {
        self.data.len()
    }

    /// Sites that a kernel may compute in a row: the width, rounded up to [`CHUNK`].
    pub fn padded(&self) -> usize {
        self.width.div_ceil(CHUNK) * CHUNK
    }

    /// Samples of `count` planes.
    pub fn len(width: usize, height: usize, count: usize) -> usize {
        (width.div_ceil(CHUNK) * CHUNK + 2 * LEFT) * count * height
    }

    /// Samples from a plane's row to the next plane's.
    pub fn stride(&self) -> usize {
        LEFT + self.padded() + LEFT
    }

    /// Samples from a row to the next.
    pub fn row_len(&self) -> usize {
        self.stride() * self.count
    }

    /// The row `y` of every plane; plane `k`, site `x` is at `k * stride() + LEFT + x`.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.row_len()..(y + 1) * self.row_len()]
    }

    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        let len = self.row_len();
        &mut self.data[y * len..(y + 1) * len]
    }

    pub fn data(&self) -> &[T] {
        &self.data[..self.row_len() * self.height]
    }

    /// All samples, to be cut into rows of [`Planes::row_len`].
    pub fn data_mut(&mut self) -> &mut [T] {
        let len = self.row_len() * self.height;
        &mut self.data[..len]
    }

    /// The sum of some rows, each times its weight, as planes of one row.
    pub fn weighted_rows(&self, simd: Level, rows: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut sum = Self::new(self.width, 1, self.count);
        for (y, weight) in rows {
            dispatch(simd, AddRow { row: self.row(y), weight, sum: sum.row_mut(0) });
        }
        sum
    }

    #[inline]
    pub fn line(&self, k: usize, y: usize) -> &[T] {
        let first = k * self.stride() + LEFT;
        &self.row(y)[first..first + self.width]
    }

    pub fn line_mut(&mut self, k: usize, y: usize) -> &mut [T] {
        let (first, width) = (k * self.stride() + LEFT, self.width);
        &mut self.row_mut(y)[first..first + width]
    }

    #[inline]
    pub fn at(&self, k: usize, x: usize, y: usize) -> T {
        self.line(k, y)[x]
    }
}

struct AddRow<'a, T> {
    row: &'a [T],
    weight: f64,
    sum: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for AddRow<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let weight = V::constant(self.weight);
        for (row, sum) in self.row.chunks_exact(V::LANES).zip(self.sum.chunks_exact_mut(V::LANES)) {
            V::load(row).mul_add(weight, V::load(sum)).store(sum);
        }
    }
}
