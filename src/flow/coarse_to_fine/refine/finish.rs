//! Final motion of the refinement: plain fits, and edge fits across motion boundaries.

use super::RefineOptions;
use super::choose::{Choice, Use};
use super::edge_fits::{Edges, Lines, Site};
use super::fit::FIT;
use super::plain_fits::any_positive;
use super::upsample::widen;
use crate::flow::coarse_to_fine::extended::{Field, chunk_of};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{CHUNK, LEFT, Planes};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Minimum weight of edge fits; smaller ones are set to 0, so that smooth areas skip them.
const MIN_EDGE_SHARE: f64 = 0.2;
/// Maximum relative misfit, at which only edge fits count: keeps sixth powers in single precision.
const MAX_MISFIT: f64 = 1e5;
/// Share of the Laplacian of flow and slopes, sites^2, that the fixed windows of data term and regularisation
/// smooth away (1 px^2); less for slopes, which would lose more at motion boundaries.
const SHARPENING: [f64; 2] = [0.25, 0.2];
const SUMS: usize = 6;
/// Planes of the result: the motion, the window's sigma, the noise density.
pub(super) const RESULT: usize = 8;

pub(super) struct FinishInputs<'a, T> {
    pub choice: &'a Choice<T>,
    /// The flow on the finest grid.
    pub grid: &'a Field<T>,
    pub plain: &'a Field<T>,
    pub options: &'a RefineOptions,
}

/// Weights of edge fits at [`CHUNK`] sites, and of the slopes of wider ones.
struct Gates<T> {
    shares: [T; CHUNK],
    steps: [T; CHUNK],
}

impl<T: SimdReal> FinishInputs<'_, T> {
    pub fn has_edges(&self) -> bool {
        // The relative misfit whose weight is [`MIN_EDGE_SHARE`].
        let threshold = T::from_f64(self.options.edge_misfit * (MIN_EDGE_SHARE / (1.0 - MIN_EDGE_SHARE)).cbrt());
        let misfits = |y: usize| &self.plain.line(FIT - 1, y as isize)[LEFT..LEFT + self.grid.width];
        (0..self.grid.height).any(|y| misfits(y).iter().any(|misfit| *misfit > threshold))
    }

    /// Weights from the relative misfit of the plain fits.
    #[inline(always)]
    fn gates<V: Lanes<Scalar = T>>(&self, x: usize, y: usize) -> Gates<T> {
        let cube = V::constant(self.options.edge_misfit.powi(3));
        let sixth = V::constant(self.options.step_misfit.powi(6));
        let misfits = &self.plain.line(FIT - 1, y as isize)[LEFT + x..];
        let mut gates = Gates { shares: [T::from_f64(0.0); CHUNK], steps: [T::from_f64(0.0); CHUNK] };
        for i in (0..CHUNK).step_by(V::LANES) {
            let misfit = V::load(&misfits[i..]).max(V::zero()).min(V::constant(MAX_MISFIT));
            let third = misfit * misfit * misfit;
            let share = ((third / (third + cube)) - V::constant(MIN_EDGE_SHARE)).max(V::zero());
            (share * V::constant(1.0 / (1.0 - MIN_EDGE_SHARE))).store(&mut gates.shares[i..]);
            (third * third / third.mul_add(third, sixth)).store(&mut gates.steps[i..]);
        }
        gates
    }

    /// Plane `k` of the plain estimate with the fixed smoothing removed, less where edge fits have weight:
    /// beside a step there is no smooth flow to restore.
    #[inline(always)]
    fn sharpened<V: Lanes<Scalar = T>>(&self, k: usize, (at, y): (usize, usize), share: V) -> V {
        let row = y as isize;
        // Written out: the optimiser does not inline a closure over the three.
        let (above, here, below) = (self.plain.line(k, row - 1), self.plain.line(k, row), self.plain.line(k, row + 1));
        let value = V::load(&here[at..]);
        let around =
            V::load(&here[at - 1..]) + V::load(&here[at + 1..]) + V::load(&above[at..]) + V::load(&below[at..]);
        let laplacian = value.mul_add(V::constant(-4.0), around);
        let smoothed = V::constant(SHARPENING[usize::from(k >= 2)]);
        ((V::constant(1.0) - share) * smoothed).neg_mul_add(laplacian, value)
    }
}

struct Add<'a, T> {
    inputs: &'a FinishInputs<'a, T>,
    edges: &'a Edges<'a, T>,
    rows: Range<usize>,
    sums: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Add<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { inputs, edges, rows, sums } = self;
        let stride = inputs.grid.stride();
        let mut lines = Lines::new(stride);
        for (y, sums) in rows.zip(sums.chunks_exact_mut(SUMS * stride)) {
            edges.widen::<V>(inputs.choice, y, &mut lines);
            for x in (0..inputs.grid.width).step_by(CHUNK) {
                let gates = inputs.gates::<V>(x, y);
                if any_positive(&gates.shares) {
                    let own = [0, 1].map(|k| chunk_of(&inputs.grid.line(k, y as isize)[LEFT + x..]));
                    edges.add::<V>(&Site { x, y, own, steps: &gates.steps }, &lines, sums);
                }
            }
        }
    }
}

pub(super) fn no_sums<T: SimdReal>(space: &PlanePool<T>, grid: &Field<T>) -> Planes<T> {
    let mut sums = space.planes(grid.width, grid.height, SUMS);
    sums.data_mut().fill(T::from_f64(0.0));
    sums
}

pub(super) fn add<T: SimdReal>(simd: Level, inputs: &FinishInputs<'_, T>, edges: &Edges<'_, T>, sums: &mut Planes<T>) {
    let len = sums.row_len();
    for_each_band(sums.data_mut(), len, |_, rows, sums| dispatch(simd, Add { inputs, edges, rows, sums }));
}

struct Finish<'a, T> {
    inputs: &'a FinishInputs<'a, T>,
    sums: Option<&'a Planes<T>>,
    base: &'a [f64; 6],
    pitch: f64,
    rows: Range<usize>,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Finish<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { inputs, sums, base, pitch, rows, out } = self;
        let (stride, order) = (inputs.grid.stride(), inputs.choice.order);
        let slope = [base[2], base[3], base[4], base[5]].map(|b| b * pitch);
        let mut lines = [0; 3].map(|_| vec![T::from_f64(0.0); 2 * stride]);
        let mut down = vec![T::from_f64(0.0); stride];
        for (y, out) in rows.zip(out.chunks_exact_mut(RESULT * stride)) {
            let planes = [order.density(), order.sigma(Use::Flow), order.sigma(Use::Edges)];
            for (plane, line) in planes.into_iter().zip(&mut lines) {
                widen::<V>(inputs.choice, plane, 0, y, &mut down, line);
            }
            let sums = sums.map(|sums| sums.row(y));
            for x in (0..inputs.grid.width).step_by(CHUNK) {
                let mut shares = [T::from_f64(0.0); CHUNK];
                if sums.is_some() {
                    shares = inputs.gates::<V>(x, y).shares;
                }
                for i in (0..CHUNK).step_by(V::LANES) {
                    let at = LEFT + x + i;
                    let share = V::load(&shares[i..]);
                    for (k, base) in base.iter().enumerate() {
                        let mut value = inputs.sharpened(k, (at, y), share);
                        if let Some(sums) = sums {
                            value = (V::load(&sums[k * stride + at..]) - value).mul_add(share, value);
                        }
                        let mut here = V::constant(*base);
                        if k < 2 {
                            let first = *base + slope[k] * (x + i) as f64 + slope[2 + k] * y as f64;
                            here = V::constant(slope[k]).mul_add(V::load(&ramp::<T>()[..]), V::constant(first));
                        }
                        (value + here).store(&mut out[k * stride + at..]);
                    }
                    let [density, narrow, wide] = [0, 1, 2].map(|n: usize| V::load(&lines[n][x + i..]));
                    (wide - narrow).mul_add(share, narrow).store(&mut out[6 * stride + at..]);
                    density.store(&mut out[7 * stride + at..]);
                }
            }
        }
    }
}

/// 0, 1, 2, ...
#[inline(always)]
fn ramp<T: SimdReal>() -> [T; CHUNK] {
    std::array::from_fn(|i| T::from_f64(i as f64))
}

/// The refined motion, with the window's sigma and the noise density: planes of [`RESULT`]. `base` (u, v,
/// then the slopes, about site (0, 0)) is added; sites are `pitch` px apart.
pub(super) fn finish<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    inputs: &FinishInputs<'_, T>,
    sums: Option<&Planes<T>>,
    (base, pitch): (&[f64; 6], f64),
) -> Planes<T> {
    let mut out = space.planes(inputs.grid.width, inputs.grid.height, RESULT);
    let len = out.row_len();
    for_each_band(out.data_mut(), len, |_, rows, out| {
        dispatch(simd, Finish { inputs, sums, base, pitch, rows, out });
    });
    out
}
