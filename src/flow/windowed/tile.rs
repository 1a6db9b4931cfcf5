//! From frames to moments, one tile at a time, small enough for the processor's caches.

use super::combine::Combination;
use super::rows::{Jets, Plan, moments, products};
use super::support::Support;
use super::window::Window;
use crate::flow::moment_filter::{CHUNK, filter};
use crate::jet::{JetRows, Reach};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use crate::types::Frame;

/// Columns of a tile.
pub(super) const TILE_COLUMNS: usize = 128;
/// Rows whose moments are held at a time: while they are summed, the products they share stay in the nearest
/// cache.
pub(super) const GROUP_ROWS: usize = 8;

/// The images and how to take their jets.
pub(super) struct Source<'a, T> {
    /// Frames, oldest first, smoothed already where that was requested.
    pub frames: Vec<&'a Frame<T>>,
    /// How they are combined.
    pub combination: Combination,
    /// The stencil.
    pub jets: JetRows<T>,
    /// Its reach.
    pub reach: Reach,
    /// Usable pixels.
    pub support: &'a Support,
    /// Whether the second time difference is needed.
    pub second: bool,
}

/// Length of a buffer row that holds at least `n` samples, without a tail.
pub(super) const fn padded(n: usize) -> usize {
    n.div_ceil(CHUNK) * CHUNK
}

/// Jets of the three combinations over a rectangle, row by row.
pub(super) struct JetTile<T> {
    images: Vec<T>,
    scratch: Vec<T>,
    rows: Vec<T>,
    weight: Vec<T>,
    width: usize,
    image_width: usize,
    corner: (isize, isize),
    left: usize,
    up: usize,
    height: usize,
}

impl<T: SimdReal> JetTile<T> {
    pub fn new() -> Self {
        Self {
            images: Vec::new(),
            scratch: Vec::new(),
            rows: Vec::new(),
            weight: Vec::new(),
            width: 0,
            image_width: 0,
            corner: (0, 0),
            left: 0,
            up: 0,
            height: 0,
        }
    }

    /// Prepares jets of `height` rows of `width` pixels (a multiple of [`CHUNK`]) from pixel `corner` on,
    /// which may lie outside the frame.
    #[inline(always)]
    pub fn load(&mut self, source: &Source<'_, T>, corner: (isize, isize), width: usize, height: usize) {
        let Reach { left, right, up, down } = source.reach;
        self.image_width = width + left + right;
        (self.width, self.height, self.corner, self.left, self.up) = (width, height, corner, left, up);
        let n = self.image_width * (height + up + down);
        self.images.resize(3 * n, T::default());
        self.scratch.resize(source.jets.scratch_len(self.image_width), T::default());
        self.rows.resize(18 * self.image_width, T::default());
        self.weight.resize(width, T::default());
        let (coefficient, rest) = self.images.split_at_mut(n);
        let (first, second) = rest.split_at_mut(n);
        let start = (corner.0 - left as isize, corner.1 - up as isize);
        source.combination.apply(&source.frames, start, self.image_width, source.second, [coefficient, first, second]);
    }

    /// Computes the jets and weights of row `r` of the rectangle.
    pub fn row(&mut self, level: Level, source: &Source<'_, T>, r: usize) {
        let images = self.images.len() / 3;
        let w = self.image_width;
        for (k, rows) in self.rows.chunks_exact_mut(6 * w).enumerate() {
            if k < 2 || source.second {
                let image = &self.images[k * images..(k + 1) * images];
                let (jets, row, scratch) = (&source.jets, r + self.up, &mut self.scratch[..]);
                dispatch(level, JetRow { jets, image, width: w, row, scratch, rows });
            }
        }
        source.support.weights(self.corner.0, self.corner.1 + r as isize, &mut self.weight);
    }

    /// 1 for the usable pixels of the last row, 0 for others.
    pub fn weight(&self) -> &[T] {
        &self.weight
    }

    /// Jets of the last row at column `c`; zero where the pixel is not usable.
    #[inline(always)]
    pub fn jets<V: Lanes<Scalar = T>>(&self, c: usize, second: bool) -> Jets<V> {
        let usable = V::zero().lt(V::load(&self.weight[c..]));
        let load = |k: usize| V::select(usable, V::load(&self.rows[k * self.image_width + self.left + c..]), V::zero());
        let six = |k: usize| [load(k), load(k + 1), load(k + 2), load(k + 3), load(k + 4), load(k + 5)];
        Jets { coefficient: six(0), first: six(6), second: if second { six(12) } else { [V::zero(); 6] } }
    }
}

/// Product planes of a tile with a margin of the window's radius.
pub(super) struct Planes<T> {
    /// `count` planes of `height` rows of `width` samples.
    pub data: Vec<T>,
    /// Samples in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl<T: SimdReal> Planes<T> {
    pub fn new() -> Self {
        Self { data: Vec::new(), width: 0, height: 0 }
    }

    pub fn resize(&mut self, count: usize, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.data.resize(count * width * height, T::default());
    }

    /// Plane `p`.
    #[inline(always)]
    pub fn plane(&self, p: usize) -> &[T] {
        let n = self.width * self.height;
        &self.data[p * n..(p + 1) * n]
    }

    /// Place of the sample at row `r`, column `c` of plane `p`.
    #[inline(always)]
    pub fn at(&self, p: usize, r: usize, c: usize) -> usize {
        (p * self.height + r) * self.width + c
    }

    /// Fills the product planes of `rows` equations (1, 3, 6 or 12) a pixel from the jets, and after them the
    /// plane of weights where `weights` says so.
    pub fn fill(
        &mut self,
        (level, rows): (Level, usize),
        source: &Source<'_, T>,
        jets: &mut JetTile<T>,
        scale: T,
        weights: bool,
    ) {
        let count = Plan::new(rows).planes();
        let n = self.width * self.height;
        for r in 0..self.height {
            jets.row(level, source, r);
            match rows {
                1 => dispatch(level, Products::<T, 1> { planes: self, jets, row: r, scale }),
                3 => dispatch(level, Products::<T, 3> { planes: self, jets, row: r, scale }),
                6 => dispatch(level, Products::<T, 6> { planes: self, jets, row: r, scale }),
                _ => dispatch(level, Products::<T, 12> { planes: self, jets, row: r, scale }),
            }
            if weights {
                let at = count * n + r * self.width;
                self.data[at..at + self.width].copy_from_slice(jets.weight());
            }
        }
    }
}

// Each step is a kernel of its own, and what does not depend on the equations is not compiled again for each
// set of them.

/// Jets of one row.
struct JetRow<'a, T> {
    jets: &'a JetRows<T>,
    image: &'a [T],
    width: usize,
    row: usize,
    scratch: &'a mut [T],
    rows: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for JetRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        self.jets.row::<V>(self.image, self.width, self.row, self.scratch, self.rows);
    }
}

/// Product planes of one row.
struct Products<'a, T, const ROWS: usize> {
    planes: &'a mut Planes<T>,
    jets: &'a JetTile<T>,
    row: usize,
    scale: T,
}

impl<T: SimdReal, const ROWS: usize> Kernel<T> for Products<'_, T, ROWS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Planes { data, width, height } = self.planes;
        let (count, n, scale) = (Plan::new(ROWS).planes(), *width * *height, V::splat(self.scale));
        let mut c = 0;
        while c < *width {
            let values = products::<V, ROWS>(&self.jets.jets::<V>(c, ROWS == 12), scale);
            let at = self.row * *width + c;
            for (p, value) in values.into_iter().enumerate().take(count) {
                value.store(&mut data[p * n + at..]);
            }
            c += V::LANES;
        }
    }
}

/// Moments of a group of rows: moment `k` of row `j` is `data[(k * GROUP_ROWS + j) * TILE_COLUMNS ..][..
/// TILE_COLUMNS]`.
pub(super) struct Moments<T> {
    pub data: Vec<T>,
    column_sums: [Vec<T>; 3],
}

impl<T: SimdReal> Moments<T> {
    pub fn new() -> Self {
        Self { data: Vec::new(), column_sums: [const { Vec::new() }; 3] }
    }

    /// Sums plane `p` of `planes`, up to the power `order`, into the moments from `base` on, around rows
    /// `centres` (at most [`GROUP_ROWS`]) of the planes and columns `radius ..`.
    pub fn sum(
        &mut self,
        level: Level,
        window: &Window<T>,
        planes: &Planes<T>,
        place: (usize, usize, usize),
        centres: &[usize],
    ) {
        dispatch(level, Sum { moments: self, window, planes, place, centres });
    }
}

/// The sums of one plane.
struct Sum<'a, T> {
    moments: &'a mut Moments<T>,
    window: &'a Window<T>,
    planes: &'a Planes<T>,
    place: (usize, usize, usize),
    centres: &'a [usize],
}

impl<T: SimdReal> Kernel<T> for Sum<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { moments: sums, window, planes, place: (p, order, base), centres } = self;
        let (width, radius) = (planes.width, window.radius());
        let taps = &window.taps[..];
        let size = GROUP_ROWS * TILE_COLUMNS;
        sums.data.resize(sums.data.len().max((base + moments(order)) * size), T::default());
        for v in &mut sums.column_sums {
            v.resize(v.len().max(width), T::default());
        }
        let [v0, v1, v2] = &mut sums.column_sums;
        for (j, &row) in centres.iter().enumerate() {
            let plane = planes.plane(p);
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
