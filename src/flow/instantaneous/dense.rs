//! The affine model over rows of pixels, in lanes.

use super::{detail::RatesRow, normal::LaneRates, normal::noise_square, normal::solve_affine};
use crate::jet::{JetRows, TimeScheme, starts};
use crate::simd::{Kernel, Lanes, SimdReal};
use crate::types::Frame;
use std::ops::Range;

/// Where the lanes' jets come from.
pub(super) enum Source<T> {
    /// The 3x3 stencil (32), (33), fused with the time differences.
    Three,
    /// Any other neighbourhood, by rows of jets.
    Rows(JetRows<T>),
}

/// One row's estimates: columns `columns` of row `y`, all of whose neighbourhoods fit.
pub(super) struct RowKernel<'a, T> {
    pub source: &'a Source<T>,
    pub scheme: TimeScheme,
    pub frames: [&'a Frame<T>; 3],
    pub y: usize,
    pub columns: Range<usize>,
    /// Working memory, [`scratch_len`] values.
    pub scratch: &'a mut [T],
    pub target: Target<'a, T>,
}

/// What a row is computed for.
pub(super) enum Target<'a, T> {
    /// The estimate: a slice a parameter, and one for the trust, each as long as the row's columns.
    Motion([&'a mut [T]; 6], &'a mut [T]),
    /// The equations' coefficients, for the kernel of covariance and diagnostics.
    Rates(RatesRow<&'a mut [T]>),
}

impl<T: SimdReal> Target<'_, T> {
    /// Takes what belongs to the lanes from `x` on.
    #[inline(always)]
    fn put<V: Lanes<Scalar = T>>(&mut self, x: usize, rates: &LaneRates<V>, brightness: V) {
        match self {
            Self::Motion(motion, trust) => {
                let noise = V::constant(noise_square::<T>());
                let solution = solve_affine::<T, V>(rates, brightness * brightness * noise);
                for (out, m) in motion.iter_mut().zip(solution.motion) {
                    m.store(&mut out[x..]);
                }
                solution.trust.store(&mut trust[x..]);
            }
            Self::Rates(row) => row.put(x, rates, brightness),
        }
    }
}

/// Values of working memory for frames of this width.
pub(super) fn scratch_len<T: SimdReal>(source: &Source<T>, width: usize) -> usize {
    match source {
        Source::Three => 9 * width,
        Source::Rows(rows) => 18 * width + rows.scratch_len(width),
    }
}

impl<T: SimdReal> Kernel<T> for RowKernel<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        if self.columns.len() >= V::LANES {
            self.lanes::<V>();
        } else {
            self.lanes::<T>();
        }
    }
}

impl<T: SimdReal> RowKernel<'_, T> {
    #[inline(always)]
    fn lanes<V: Lanes<Scalar = T>>(self) {
        match self.source {
            Source::Three => self.three::<V>(),
            Source::Rows(_) => self.rows::<V>(),
        }
    }

    /// 3x3: sums, differences and second differences down the columns of the three combinations in time, then
    /// across.
    #[inline(always)]
    fn three<V: Lanes<Scalar = T>>(mut self) {
        let w = self.frames[0].width();
        let (from, to) = (self.columns.start - 1, self.columns.end + 1);
        let span = to - from;
        let rows: [[&[T]; 3]; 3] =
            self.frames.map(|f| [0, 1, 2].map(|r| &f.data()[(self.y - 1 + r) * w + from..(self.y - 1 + r) * w + to]));
        let [old, middle, new] = rows;
        let central = self.scheme == TimeScheme::Central;
        let mut parts = self.scratch.chunks_exact_mut(w);
        let nine: [&mut [T]; 9] = std::array::from_fn(|_| &mut parts.next().unwrap_or_default()[..span]);
        for x in starts(0..span, V::LANES) {
            let mut still = [V::zero(); 3];
            let mut first = [V::zero(); 3];
            let mut second = [V::zero(); 3];
            for r in 0..3 {
                let (o, m, n) = (V::load(&old[r][x..]), V::load(&middle[r][x..]), V::load(&new[r][x..]));
                // Exactly zero where nothing changes: o + n = 2 m without rounding.
                second[r] = m.neg_mul_add(V::constant(2.0), o + n);
                still[r] = if central { m } else { n };
                first[r] = if central { o - n } else { m - n };
            }
            for (k, [t, m, b]) in [still, first, second].into_iter().enumerate() {
                let outer = t + b;
                (outer + m).store(&mut nine[3 * k][x..]);
                (b - t).store(&mut nine[3 * k + 1][x..]);
                m.neg_mul_add(V::constant(2.0), outer).store(&mut nine[3 * k + 2][x..]);
            }
        }
        let [s0, d0, c0, s1, d1, c1, s2, d2, c2] = nine;
        let centre = if central { middle[1] } else { new[1] };
        let half = V::constant(if central { 0.5 } else { 1.0 });
        for x in starts(0..span - 2, V::LANES) {
            let [_, ix, iy, ixx, ixy, iyy] = across::<T, V>(s0, d0, c0, x);
            let rates = LaneRates {
                jet: [ix, iy, ixx, ixy, iyy],
                minus_first: across::<T, V>(s1, d1, c1, x).map(|v| v * half),
                second: across::<T, V>(s2, d2, c2, x),
            };
            self.target.put(x, &rates, V::load(&centre[x + 1..]));
        }
    }

    /// Other neighbourhoods: rows of the three frames' jets, differenced in time.
    #[inline(always)]
    fn rows<V: Lanes<Scalar = T>>(mut self) {
        let Source::Rows(rows) = self.source else { return };
        let w = self.frames[0].width();
        let (jets, scratch) = self.scratch.split_at_mut(18 * w);
        for (frame, out) in self.frames.iter().zip(jets.chunks_exact_mut(6 * w)) {
            rows.row::<V>(frame.data(), w, self.y, scratch, out);
        }
        let central = self.scheme == TimeScheme::Central;
        let first = self.columns.start;
        for x in starts(0..self.columns.len(), V::LANES) {
            let load = |f: usize, k: usize| V::load(&jets[(6 * f + k) * w + first + x..]);
            let mut still = [V::zero(); 6];
            let mut minus_first = [V::zero(); 6];
            let mut second = [V::zero(); 6];
            for k in 0..6 {
                let (o, m, n) = (load(0, k), load(1, k), load(2, k));
                second[k] = m.neg_mul_add(V::constant(2.0), o + n);
                still[k] = if central { m } else { n };
                minus_first[k] = if central { (o - n) * V::constant(0.5) } else { m - n };
            }
            let [brightness, jet @ ..] = still;
            let rates = LaneRates { jet, minus_first, second };
            self.target.put(x, &rates, brightness);
        }
    }
}

/// The jet from column sums `s`, differences `d` and second differences `c` of three rows, for lanes whose
/// left neighbours start at `x`.
#[inline(always)]
fn across<T: SimdReal, V: Lanes<Scalar = T>>(s: &[T], d: &[T], c: &[T], x: usize) -> [V; 6] {
    let at = |row: &[T], k: usize| V::load(&row[x + k..]);
    let (sixth, third) = (V::constant(1.0 / 6.0), V::constant(1.0 / 3.0));
    let (left, mid, right) = (at(s, 0), at(s, 1), at(s, 2));
    let outer = left + right;
    let ixx = mid.neg_mul_add(V::constant(2.0), outer) * third;
    let ix = (right - left) * sixth;
    let (dl, dr) = (at(d, 0), at(d, 2));
    let iy = (dl + dr + at(d, 1)) * sixth;
    let ixy = (dr - dl) * V::constant(0.25);
    let iyy = (at(c, 0) + at(c, 2) + at(c, 1)) * third;
    let i = (outer + mid).mul_add(V::constant(1.0 / 9.0), (ixx + iyy) * V::constant(-1.0 / 3.0));
    [i, ix, iy, ixx, ixy, iyy]
}
