//! One band of site rows, tile by tile and row by row, so that the rows above stay in the processor's caches.

use super::View;
use super::dense::dense_row;
use super::moments::{ERROR, MEANS, horizontal, normal, right, vertical};
use super::products::{Weights, products_row, residuals, vertical_stencils};
use super::scratch::{CHUNK, Columns, IMAGE, PRODUCTS, RING, Scratch};
use super::warp::warp_row;
use crate::flow::coarse_to_fine::{planes::LEFT as GRID_LEFT, planes::Planes};
use crate::simd::{Kernel, Lanes, SimdReal};
use std::ops::Range;

/// Maximum site columns of a tile, so that its rows fit the second-level cache.
const TILE: usize = 320;

/// What a band sums up in the windows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Sums {
    /// The [`COUNT`](super::COUNT) planes of moments of the products, for the whole motion.
    Moments,
    /// The [`MEANS`] planes of their means, of normal equations for the flow that the motion leaves: `P_uu`,
    /// `P_uv`, `P_vv`, `q_u`, `q_v` and `e`, where `q` has `-R` on its right side.
    Means,
}

/// Inputs that all bands of a level share.
pub(super) struct Task<'a, T> {
    pub sums: Sums,
    /// Size of the level, pixels.
    pub size: (usize, usize),
    pub views: &'a [View<'a, T>],
    pub motion: &'a Planes<T>,
    /// Filters of the window.
    pub taps: &'a [[T; 3]],
    pub gradient: T,
    pub inverse: T,
    /// Samples from a plane of an output row to the next.
    pub stride: usize,
}

/// The site rows `rows`, written to the rows of `out`.
pub(super) struct Band<'a, T> {
    pub task: &'a Task<'a, T>,
    pub rows: Range<usize>,
    pub out: &'a mut [T],
    pub residuals: &'a mut Vec<T>,
    pub scratch: &'a mut Scratch<T>,
}

impl<T: SimdReal> Kernel<T> for Band<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(mut self) {
        let sites = self.task.size.0.div_ceil(2);
        let radius = self.task.taps.len() - 1;
        let width = sites.div_ceil(sites.div_ceil(TILE)).next_multiple_of(CHUNK);
        for from in (0..sites).step_by(width) {
            // The stencils read one pixel beyond the window, and the last odd column needs the site after it.
            let columns = Columns::new(from, (from + width).min(sites), self.task.size.0, radius / 2 + 2, V::LANES);
            self.scratch.prepare(columns, radius);
            self.tile::<V>(&columns);
        }
    }
}

impl<T: SimdReal> Band<'_, T> {
    #[inline(always)]
    fn tile<V: Lanes<Scalar = T>>(&mut self, columns: &Columns) {
        let radius = self.task.taps.len() - 1;
        let len = self.out.len() / self.rows.len();
        // Rows are counted from one window above the frame, where nothing is negative.
        let mut next = 2 * self.rows.start;
        let mut warped = (2 * self.rows.start).saturating_sub(radius + 1);
        for site in self.rows.clone() {
            while next <= 2 * site + 2 * radius {
                self.pixel_row::<V>(columns, next, &mut warped);
                next += 1;
            }
            self.site_row::<V>(columns, site, len);
        }
    }

    /// The products of pixel row `counted - radius`.
    #[inline(always)]
    fn pixel_row<V: Lanes<Scalar = T>>(&mut self, columns: &Columns, counted: usize, warped: &mut usize) {
        let radius = self.task.taps.len() - 1;
        let slot = counted % (2 * radius + 1) * columns.row(PRODUCTS);
        let height = self.task.size.1;
        if counted < radius + 1 || counted + 1 >= radius + height {
            self.scratch.products.all()[slot..slot + columns.row(PRODUCTS)].fill(T::from_f64(0.0));
            return;
        }
        let y = counted - radius;
        while *warped <= y + 1 {
            self.image_row::<V>(columns, *warped);
            *warped += 1;
        }
        let row = columns.row(IMAGE);
        let images = self.scratch.images.all();
        let rows = [y - 1, y, y + 1].map(|y| &images[y % RING * row..(y % RING + 1) * row]);
        let stencil = self.scratch.stencil.all();
        vertical_stencils::<V>(columns, rows, stencil);
        let weights = Weights {
            gradient: V::splat(self.task.gradient),
            inverse: V::splat(self.task.inverse),
            motion: V::constant(f64::from(u8::from(self.task.sums == Sums::Moments))),
        };
        let products = &mut self.scratch.products.all()[slot..slot + columns.row(PRODUCTS)];
        products_row::<T, V>(columns, weights, stencil, rows[1], products);
        if y.is_multiple_of(4) && self.rows.contains(&(y / 2)) {
            residuals(columns, stencil, rows[1], self.residuals);
        }
    }

    /// Motion and warped views of pixel row `y`.
    #[inline(always)]
    fn image_row<V: Lanes<Scalar = T>>(&mut self, columns: &Columns, y: usize) {
        let row = columns.row(IMAGE);
        let image = &mut self.scratch.images.all()[y % RING * row..(y % RING + 1) * row];
        let uv = &mut image[columns.row(2)..columns.row(4)];
        dense_row::<V>(self.task.motion, y, columns, self.scratch.sites.all(), uv);
        let place = (self.task.size, y);
        let (number, inside) = self.scratch.frame.all().split_at(columns.row(1));
        let rows = (self.scratch.in_order.all(), image);
        warp_row::<T, V>(self.task.views, place, columns, [number, inside], rows);
    }

    #[inline(always)]
    fn site_row<V: Lanes<Scalar = T>>(&mut self, columns: &Columns, site: usize, len: usize) {
        let taps = self.task.taps;
        let ring = 2 * taps.len() - 1;
        let products = self.scratch.products.all();
        let planes = self.scratch.vertical.all();
        let row = columns.row(1);
        let out = &mut self.out[(site - self.rows.start) * len..(site + 1 - self.rows.start) * len];
        let at = |plane: usize| plane * self.task.stride + GRID_LEFT + columns.from;
        let mut starts = [0; 64];
        let count = if self.task.sums == Sums::Moments { PRODUCTS } else { MEANS };
        // Plane by plane: the output of one filter is still in the nearest cache when the other reads it.
        for plane in 0..count {
            for (k, start) in starts[..ring].iter_mut().enumerate() {
                *start = (2 * site + k) % ring * columns.row(PRODUCTS) + plane * row;
            }
            let rows = &starts[..ring];
            match plane {
                _ if self.task.sums == Sums::Means => {
                    vertical::<V, 1>(columns, products, rows, taps, planes);
                    horizontal::<V, 1>(columns, &planes[..row], taps, out, [at(plane)]);
                }
                0..3 => {
                    let first = normal(0, 0) + 6 * plane;
                    vertical::<V, 3>(columns, products, rows, taps, planes);
                    horizontal::<V, 3>(columns, &planes[..row], taps, out, [0, 1, 3].map(|k| at(first + k)));
                    horizontal::<V, 2>(columns, &planes[row..2 * row], taps, out, [2, 4].map(|k| at(first + k)));
                    horizontal::<V, 1>(columns, &planes[2 * row..], taps, out, [at(first + 5)]);
                }
                3..5 => {
                    let first = right(plane - 3);
                    vertical::<V, 2>(columns, products, rows, taps, planes);
                    horizontal::<V, 2>(columns, &planes[..row], taps, out, [0, 1].map(|k| at(first + k)));
                    horizontal::<V, 1>(columns, &planes[row..2 * row], taps, out, [at(first + 2)]);
                }
                _ => {
                    vertical::<V, 1>(columns, products, rows, taps, planes);
                    horizontal::<V, 1>(columns, &planes[..row], taps, out, [at(ERROR + plane - 5)]);
                }
            }
        }
    }
}
