//! Jets of every pixel.

use super::{rows::JetRows, stencil::JetStencil};
use crate::math::Real;
use crate::parallel::{self, BAND_ROWS, Threads};
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch, same, same_mut};
use crate::types::Frame;

/// Six planes of the size of the frame: `I, Ix, Iy, Ixx, Ixy, Iyy`; NaN along the border.
#[derive(Debug, Clone, PartialEq)]
pub struct JetPlanes<T> {
    /// The planes, in the jet's order.
    pub planes: [Frame<T>; 6],
}

impl<T: Real> JetPlanes<T> {
    fn empty((width, height): (usize, usize)) -> Self {
        Self { planes: std::array::from_fn(|_| Frame::filled(width, height, T::nan())) }
    }

    /// The jet at pixel `(x, y)`.
    #[inline]
    pub fn get(&self, x: usize, y: usize) -> [T; 6] {
        std::array::from_fn(|k| self.planes[k].get(x, y))
    }
}

/// The rows of one band: six slices, one a component, each `rows * width` long.
struct Band<'a, T> {
    first: usize,
    planes: [&'a mut [T]; 6],
}

struct BandKernel<'a, T> {
    rows: &'a JetRows<T>,
    frame: &'a Frame<T>,
    inside: (std::ops::Range<usize>, std::ops::Range<usize>),
    band: Band<'a, T>,
}

impl<T: SimdReal> Kernel<T> for BandKernel<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let width = self.frame.width();
        let mut band = self.band;
        let mut scratch = vec![T::default(); self.rows.scratch_len(width)];
        let mut row = vec![T::nan(); 6 * width];
        let (columns, rows) = self.inside;
        for r in 0..band.planes[0].len() / width {
            let y = band.first + r;
            if rows.contains(&y) && !columns.is_empty() {
                self.rows.row::<V>(self.frame.data(), width, y, &mut scratch, &mut row);
                for (plane, jets) in band.planes.iter_mut().zip(row.chunks_exact(width)) {
                    plane[r * width..(r + 1) * width].copy_from_slice(jets);
                }
            }
        }
    }
}

impl JetStencil {
    /// Jets of every pixel, at the best instruction set of the processor.
    ///
    /// Results do not depend on the number of threads.
    pub fn planes<T: SimdReal>(&self, frame: &Frame<T>, threads: Threads) -> JetPlanes<T> {
        self.planes_with(frame, threads, Level::detect())
    }

    /// As [`JetStencil::planes`], at a given instruction set.
    pub fn planes_with<T: SimdReal>(&self, frame: &Frame<T>, threads: Threads, level: Level) -> JetPlanes<T> {
        let mut out = JetPlanes::empty(frame.size());
        if let (Some(frame), Some(out)) = (same::<_, Frame<f32>>(frame), same_mut(&mut out)) {
            self.planes_single(frame, threads, level, out);
        } else if let (Some(frame), Some(out)) = (same::<_, Frame<f64>>(frame), same_mut(&mut out)) {
            self.planes_double(frame, threads, level, out);
        }
        out
    }

    #[inline(never)]
    fn planes_single(&self, frame: &Frame<f32>, threads: Threads, level: Level, out: &mut JetPlanes<f32>) {
        planes_of(&JetRows::new(self), self, frame, threads, level, out);
    }

    #[inline(never)]
    fn planes_double(&self, frame: &Frame<f64>, threads: Threads, level: Level, out: &mut JetPlanes<f64>) {
        planes_of(&JetRows::new(self), self, frame, threads, level, out);
    }
}

fn planes_of<T: SimdReal>(
    rows: &JetRows<T>,
    stencil: &JetStencil,
    frame: &Frame<T>,
    threads: Threads,
    level: Level,
    JetPlanes { planes }: &mut JetPlanes<T>,
) {
    let (width, height) = frame.size();
    if width > 0 {
        let mut chunks = planes.each_mut().map(|p| p.data_mut().chunks_mut(BAND_ROWS * width));
        let bands: Vec<Band<'_, T>> = (0..height.div_ceil(BAND_ROWS))
            .map(|b| Band { first: b * BAND_ROWS, planes: chunks.each_mut().map(|c| c.next().unwrap_or_default()) })
            .collect();
        let inside = stencil.reach().inside(frame.size());
        threads.install(|| {
            parallel::for_each(bands, |band| {
                dispatch(level, BandKernel { rows, frame, inside: inside.clone(), band });
            });
        });
    }
}
