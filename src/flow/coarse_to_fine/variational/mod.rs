//! Variational refinement: flow at every pixel, moved where that explains the frames better than windows do.
//!
//! Windows cover several pixels, and at motion boundaries two motions. From the field's flow `w` and Jacobian
//! `M`, the increment `d` at every pixel is taken from zero towards the minimum of the sum over the pixels
//! `p` of
//!
//! ```text
//! psi(r) + 2 psi(s) + 2 psi(D),   psi(x) = sqrt(x^2 + eps^2)
//! D(p)^2 = sum over the right and the lower neighbour q of |(w + d)(q) - (w + d)(p) - M (q - p)|^2
//! ```
//!
//! with the linearised residual `r` of brightness and the residuals `s` of its two derivatives, each over
//! the length of its gradient, so that all terms are in px (T. Brox, A. Bruhn, N. Papenberg and J. Weickert,
//! "High accuracy optical flow estimation based on a theory for warping", ECCV 2004; H. Zimmer, A. Bruhn and
//! J. Weickert, "Optic flow in harmony", IJCV 93, 2011). Unlike there, smoothness takes the change that the
//! Jacobian implies out of the difference `D`: affine motion costs nothing, and `d` is zero where the field
//! is right.
//!
//! A pixel takes the share of `d` that the fall of the mean linearised residual of brightness around it, in
//! grey levels, earns: noise, which windows average better, lets it fall by chance, but little. The Jacobian
//! stays that of the windows; the covariance of the flow gains the outer product of what the pixel moves by,
//! since two estimates differ by it.

mod increment;
mod layout;
#[cfg(test)]
mod tests;
mod tile;

use super::data_term::{MOTION, View};
use super::plane_pool::PlanePool;
use super::planes::{LEFT, Planes};
use super::resample::rows::RowReader;
use crate::parallel::{for_each_band, for_each_band_of};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use layout::TILE_ROWS;
use std::ops::Range;
use tile::TileRow;

/// Motion at every pixel.
#[derive(Debug)]
pub(super) struct PixelMotion<T> {
    /// That of the sites.
    pub unrefined: Planes<T>,
    /// What its flow moves by.
    pub moves: Planes<T>,
}

impl<T: SimdReal> PixelMotion<T> {
    /// At the pixels of frames of `size` px, from the motion of the sites and two `views` at its time, whose
    /// brightness has the standard deviation `contrast`.
    pub fn new(
        simd: Level,
        space: &PlanePool<T>,
        (views, contrast): (&[View<'_, T>], f64),
        motion: &Planes<T>,
        size: (usize, usize),
    ) -> Self {
        let mut unrefined = space.planes(size.0, size.1, MOTION);
        let (len, stride) = (unrefined.row_len(), unrefined.stride());
        for_each_band(unrefined.data_mut(), len, |_, rows, out| {
            dispatch(simd, Widen { motion, rows, stride, width: size.0, out });
        });
        let mut moves = space.planes(size.0, size.1, 2);
        let len = moves.row_len();
        for_each_band_of(TILE_ROWS, moves.data_mut(), len, |_, rows, out| {
            dispatch(simd, TileRow { space, views, contrast, start: &unrefined, rows, out });
        });
        Self { unrefined, moves }
    }

    /// Returns all planes.
    pub fn recycle(self, space: &PlanePool<T>) {
        space.keep(self.unrefined);
        space.keep(self.moves);
    }
}

/// Rows of the motion at every pixel.
struct Widen<'a, T> {
    motion: &'a Planes<T>,
    rows: Range<usize>,
    /// Samples from a plane of an output row to the next.
    stride: usize,
    width: usize,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Widen<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { motion, rows, stride, width, out } = self;
        let mut reader = RowReader::new(width);
        for (y, row) in rows.zip(out.chunks_exact_mut(MOTION * stride)) {
            reader.read_motion(motion, y);
            for (k, plane) in row.chunks_exact_mut(stride).enumerate() {
                plane[LEFT..][..width].copy_from_slice(reader.plane(k));
            }
        }
    }
}
