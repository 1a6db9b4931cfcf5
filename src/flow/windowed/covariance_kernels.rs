//! The steps of the covariance, each a kernel over one row of a tile.

use super::jet_matrix::columns;
use super::noise::pulled_back;
use super::noise_setting::NoiseSetting;
use super::rows::Plan;
use super::tile::{JetTile, Planes};
use crate::flow::moment_filter::filter;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::simd::{Kernel, Lanes, SimdReal};

/// Weights of the jet's components in `A^T r`, for one row of pixels; `ROWS` equations a pixel, of which
/// `BLOCK` in each block.
pub(super) struct Weigh<'a, T, const ROWS: usize, const BLOCK: usize> {
    pub setting: &'a NoiseSetting<T>,
    pub jets: &'a JetTile<T>,
    pub motion: &'a [T],
    pub wide: usize,
    pub weights: &'a mut [T],
}

impl<T: SimdReal, const ROWS: usize, const BLOCK: usize> Kernel<T> for Weigh<'_, T, ROWS, BLOCK> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { setting, jets, motion, wide, weights } = self;
        let unknowns = if ROWS == 1 { 2 } else { 6 };
        let mut c = 0;
        while c < wide {
            let m: [V; 6] = std::array::from_fn(|k| V::load(&motion[k * wide + c..]));
            let j = jets.jets::<V>(c, false);
            let scale = V::constant(setting.scale);
            let first = columns::<V, BLOCK>(&j.coefficient);
            let second = columns::<V, BLOCK>(&j.first);
            for a in 0..unknowns {
                let s = if a < 2 { V::constant(1.0) } else { scale };
                let own: [V; 6] = std::array::from_fn(|k| first[a][k] * s);
                let through_jet = pulled_back(&own, &m);
                let mut through_first = own;
                let mut through_second = [V::zero(); 6];
                if ROWS == 12 {
                    through_second = std::array::from_fn(|k| second[a][k] * s);
                    let more = pulled_back(&through_second, &m);
                    through_first = std::array::from_fn(|k| own[k] + more[k]);
                }
                for (q, mix) in setting.pixel.mixing.iter().enumerate() {
                    let [x, y, z] = mix.map(|v| V::constant(v));
                    for k in 0..6 {
                        let mut d = through_jet[k].mul_add(x, through_first[k] * y);
                        if ROWS == 12 {
                            d = through_second[k].mul_add(z, d);
                        }
                        d.store(&mut weights[((q * unknowns + a) * 6 + k) * wide + c..]);
                    }
                }
            }
            c += V::LANES;
        }
    }
}

/// One pass of a smoothing.
pub(super) struct Pass<'a, T> {
    pub source: &'a [T],
    pub centre: usize,
    pub stride: usize,
    pub len: usize,
    pub taps: &'a [[T; 3]],
    pub out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Pass<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        filter::<V, 1>(self.source, self.centre, self.stride, self.len, self.taps, [self.out]);
    }
}

/// Products `sum h h^T` of one row of the smoothed planes h.
pub(super) struct Outer<'a, T, const UNKNOWNS: usize> {
    pub plan: Plan,
    pub smoothed: &'a [T],
    pub planes: &'a mut Planes<T>,
    pub row: usize,
}

impl<T: SimdReal, const UNKNOWNS: usize> Kernel<T> for Outer<'_, T, UNKNOWNS> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { plan, smoothed, planes, row } = self;
        let width = planes.width;
        let ways = smoothed.len() / (UNKNOWNS * width);
        let mut c = 0;
        while c < width {
            let mut sums = [V::zero(); ENTRIES];
            for q in 0..ways {
                let h: [V; UNKNOWNS] = std::array::from_fn(|a| V::load(&smoothed[(q * UNKNOWNS + a) * width + c..]));
                for i in 0..UNKNOWNS {
                    for j in i..UNKNOWNS {
                        sums[upper(i, j)] = h[i].mul_add(h[j], sums[upper(i, j)]);
                    }
                }
            }
            for i in 0..UNKNOWNS {
                for j in i..UNKNOWNS {
                    if let Some(p) = plan.place(i, j) {
                        let at = planes.at(p, row, c);
                        sums[upper(i, j)].store(&mut planes.data[at..]);
                    }
                }
            }
            c += V::LANES;
        }
    }
}

/// Adds the adjoint stencil of one row of weights to the planes: `h(p + o) += sum_j L_j(o) d_j(p)`.
pub(super) struct Scatter<'a, T> {
    pub taps: &'a [((isize, isize), [T; 6])],
    pub weights: &'a [T],
    pub wide: usize,
    /// The row and the reach of the stencil.
    pub row: (usize, usize),
    pub scores: &'a mut Planes<T>,
}

impl<T: SimdReal> Kernel<T> for Scatter<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { taps, weights, wide, row: (r, reach), scores } = self;
        let (width, height) = (scores.width, scores.height);
        for (p, d) in weights.chunks_exact(6 * wide).enumerate() {
            for ((x, y), w) in taps {
                // Row r of the weights is row r - reach of the planes.
                let target = r as isize - reach as isize + y;
                if target < 0 || target >= height as isize {
                    continue;
                }
                let w: [V; 6] = std::array::from_fn(|k| V::splat(w[k]));
                let start = scores.at(p, target as usize, 0);
                let row = &mut scores.data[start..start + width];
                let shift = (reach as isize - x) as usize;
                let mut c = 0;
                while c < width {
                    let mut sum = V::load(&row[c..]);
                    for k in 0..6 {
                        sum = V::load(&d[k * wide + shift + c..]).mul_add(w[k], sum);
                    }
                    sum.store(&mut row[c..]);
                    c += V::LANES;
                }
            }
        }
    }
}
