//! Rows that a band keeps in memory.
//!
//! Every row of pixels is stored as two halves, the even and the odd columns: column `2X` is sample `X` of
//! the first half, column `2X + 1` sample `X` of the second. Motion on the sites is interpolated to such
//! rows, and windows on the sites read them, without moving a sample across lanes.

use crate::simd::SimdReal;

/// Zeros before the first sample of a half.
pub(super) const LEFT: usize = 16;
/// Window filters write this many sites at a time.
pub(super) const CHUNK: usize = 32;
pub(super) const RING: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Columns {
    /// Site column of sample 0 of a half.
    pub first: usize,
    /// Samples to compute in a half, a multiple of the lanes.
    pub count: usize,
    /// First site column to write, and the end of those columns.
    pub from: usize,
    pub to: usize,
    /// Columns of the level, in pixels.
    pub width: usize,
    /// Samples from a half to the next.
    pub half: usize,
}

impl Columns {
    /// Site columns `from..to` of a level of `width` pixels, with up to `halo` more on both sides.
    pub fn new(from: usize, to: usize, width: usize, halo: usize, lanes: usize) -> Self {
        let first = from.saturating_sub(halo);
        let count = ((to + halo).min(width.div_ceil(2)) - first).next_multiple_of(lanes);
        let end = (from - first + (to - from).next_multiple_of(CHUNK)).max(count.next_multiple_of(CHUNK));
        // An odd number of cache lines (of single precision): rows fall on different sets.
        let half = (LEFT + end + LEFT).next_multiple_of(16);
        Self { first, count, from, to, width, half: if (half / 16).is_multiple_of(2) { half + 16 } else { half } }
    }

    /// The samples of half `h` of plane `k` of a row.
    #[inline(always)]
    pub fn samples(&self, k: usize, h: usize) -> std::ops::Range<usize> {
        let start = (2 * k + h) * self.half + LEFT;
        start..start + self.count
    }

    /// Samples of `planes` planes of a row.
    pub fn row(&self, planes: usize) -> usize {
        2 * self.half * planes
    }
}

/// Rows that start on a cache line.
#[derive(Debug, Default)]
pub(super) struct Buffer<T> {
    data: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: SimdReal> Buffer<T> {
    fn clear(&mut self, len: usize) {
        let line = 64 / size_of::<T>();
        self.data.clear();
        self.data.resize(len + line, T::from_f64(0.0));
        // `align_offset` may decline; alignment is only speed.
        self.start = self.data.as_ptr().align_offset(64).min(line);
        self.len = len;
    }

    #[inline(always)]
    pub fn all(&mut self) -> &mut [T] {
        &mut self.data[self.start..self.start + self.len]
    }
}

/// Planes of an image row: `A`, `R`, `u`, `v`, validity.
pub(super) const IMAGE: usize = 5;
/// Planes of an image row in the order of its columns: `u, v, A, R`, validity.
pub(super) const IN_ORDER: usize = 5;
/// Planes of the vertical stencils: `A` by b, d, s and `R` by b, d.
pub(super) const STENCIL: usize = 5;
/// Planes of products: `P_uu, P_uv, P_vv, q_u, q_v, e`, validity.
pub(super) const PRODUCTS: usize = 7;
/// Maximum number of planes that the vertical filters make of one.
pub(super) const VERTICAL: usize = 3;

#[derive(Debug, Default)]
pub(super) struct Scratch<T> {
    columns: Columns,
    radius: usize,
    /// Column numbers, and 1 inside the border, 0 on it and beyond; in the order of the columns.
    pub frame: Buffer<T>,
    /// Planes of a row in the order of the columns.
    pub in_order: Buffer<T>,
    /// `u, u_x, v, v_x` on the site columns of a pixel row: halves, not rows.
    pub sites: Buffer<T>,
    pub images: Buffer<T>,
    pub stencil: Buffer<T>,
    pub products: Buffer<T>,
    pub vertical: Buffer<T>,
}

impl<T: SimdReal> Scratch<T> {
    /// Zeros beside everything that a tile of `columns` writes.
    pub fn prepare(&mut self, columns: Columns, radius: usize) {
        if (self.columns, self.radius) == (columns, radius) {
            return;
        }
        (self.columns, self.radius) = (columns, radius);
        self.frame.clear(columns.row(2));
        self.in_order.clear(columns.row(IN_ORDER));
        self.sites.clear(4 * columns.half);
        self.images.clear(RING * columns.row(IMAGE));
        self.stencil.clear(columns.row(STENCIL));
        self.products.clear((2 * radius + 1) * columns.row(PRODUCTS));
        self.vertical.clear(columns.row(VERTICAL));
        let (number, inside) = self.frame.all().split_at_mut(columns.row(1));
        for i in 0..2 * columns.count {
            let x = 2 * columns.first + i;
            number[i] = T::from_f64(x as f64);
            inside[i] = T::from_f64(f64::from(u8::from(x >= 1 && x + 1 < columns.width)));
        }
    }
}
