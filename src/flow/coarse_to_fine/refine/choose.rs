//! Which windows a site uses: O. V. Lepski's comparison of scales, softened.
//!
//! Source: O. V. Lepski, "On a problem of adaptive estimation in Gaussian white noise" (1991): climb to wider windows as long as the estimate changes by no more than noise
//! explains.

use super::Options;
use super::ladder::{Ladder, difference_variance};
use super::region::Layout;
use crate::flow::coarse_to_fine::grid::{LEFT, Planes};
use crate::flow::coarse_to_fine::memory::Space;
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Weights below this count as none, so that whole rows can pass a window by.
const NONE: f64 = 1e-2;
/// Least noise density, px^4: below what frames of any kind show.
const QUIET: f64 = 1e-9;
/// Added to the determinant of the information, (grey^2/px^2)^2.
const FLAT: f64 = 1e-6;

/// Planes of the choice, for `windows` windows: weights (of sum 1, or less where the field vanishes) of the plain fits, of the edge fits, of the misfits; then the noise density and the mean sigma of
/// either kind, px.
pub(super) struct Choice<T> {
    pub planes: Planes<T>,
    pub windows: usize,
}

impl<T: SimdReal> Choice<T> {
    pub fn edge(&self, l: usize) -> usize {
        self.windows + l
    }
    pub fn misfit(&self, l: usize) -> usize {
        2 * self.windows + l
    }
    pub fn density(&self) -> usize {
        3 * self.windows
    }
    pub fn sigma(&self, edge: bool) -> usize {
        3 * self.windows + 1 + usize::from(edge)
    }

    /// Whether any site uses the edge fits of window `l`.
    pub fn wants_edges(&self, l: usize) -> bool {
        let zero = T::from_f64(0.0);
        (0..self.planes.height).any(|y| self.planes.line(self.edge(l), y).iter().any(|w| *w > zero))
    }
}

/// The choice at the sites of the regional `means`.
pub(super) fn choose<T: SimdReal>(
    simd: Level,
    space: &Space<T>,
    options: &Options,
    ladder: &Ladder<T>,
    means: &Planes<T>,
) -> Choice<T> {
    let windows = ladder.scales.len();
    let sigmas: Vec<f64> = ladder.scales.iter().map(|s| s.sigma).collect();
    let wider = sigmas.iter().skip(1).copied().chain(options.may_vanish.then_some(f64::INFINITY));
    let noise: Vec<f64> = sigmas.iter().zip(wider).map(|(&s, wider)| difference_variance(s, wider)).collect();
    let mut planes = space.planes(means.width, means.height, 3 * windows + 3);
    let len = planes.row_len();
    for_each_band(planes.data_mut(), len, |_, rows, out| {
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            dispatch(simd, Weights { means, options, sigmas: &sigmas, noise: &noise, y, out });
        }
    });
    Choice { planes, windows }
}

struct Weights<'a, T> {
    means: &'a Planes<T>,
    options: &'a Options,
    sigmas: &'a [f64],
    noise: &'a [f64],
    y: usize,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Weights<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { means, options, sigmas, noise, y, out } = self;
        let (row, stride, windows) = (means.row(y), means.stride(), sigmas.len());
        let layout = Layout::new(options);
        for x in (0..means.padded()).step_by(V::LANES) {
            let means = &row[LEFT + x..];
            let out = &mut out[LEFT + x..];
            let density = density::<V>(means, stride);
            let mut sum = [V::zero(); 2];
            for (kind, sum) in sum.iter_mut().enumerate() {
                let kappa = if kind == 0 { options.kappa } else { options.kappa_edge };
                let (mut accepted, mut sigma) = (V::constant(1.0), V::zero());
                for l in 0..windows {
                    let mut next = V::zero();
                    if l < layout.steps {
                        let change = if kind == 0 {
                            power4(V::load(&means[Layout::change(l) * stride..]))
                        } else {
                            V::constant(1.0) / power4(V::load(&means[layout.calm(l) * stride..]))
                        };
                        let kappa = if l + 1 < windows { kappa } else { options.kappa_nothing };
                        let ratio = change / (density * V::constant(noise[l] * kappa));
                        next = accepted / (V::constant(1.0) + power4(ratio));
                    }
                    let weight = (accepted - next - V::constant(NONE)).max(V::zero());
                    accepted = next;
                    sigma = weight.mul_add(V::constant(sigmas[l]), sigma);
                    *sum = *sum + weight;
                    weight.store(&mut out[(kind * windows + l) * stride..]);
                }
                // What goes on beyond the widest window is nothing at all.
                *sum = *sum + accepted;
                (sigma / *sum).store(&mut out[(3 * windows + 1 + kind) * stride..]);
            }
            density.store(&mut out[3 * windows * stride..]);
            for l in 0..windows {
                let weight = &mut out[l * stride..];
                let plain = V::load(weight) / sum[0];
                plain.store(weight);
                let weight = &mut out[(windows + l) * stride..];
                (V::load(weight) / sum[1]).store(weight);
                let misfit = plain * power4(V::load(&means[layout.misfit(l) * stride..]));
                misfit.store(&mut out[(2 * windows + l) * stride..]);
            }
        }
        // The last site goes on, for those finer ones that lie beyond it.
        for line in out.chunks_exact_mut(stride) {
            let end = LEFT + means.width;
            line[end] = line[end - 1];
        }
    }
}

#[inline(always)]
fn power4<V: Lanes>(value: V) -> V {
    let square = value * value;
    square * square
}

/// Noise density of the flow, px^2 per px^-2: the residual energy over the information, averaged over directions (trace of its inverse).
#[inline(always)]
fn density<V: Lanes>(means: &[V::Scalar], stride: usize) -> V {
    let (uu, uv, vv) = (V::load(means), V::load(&means[stride..]), V::load(&means[2 * stride..]));
    let energy = power4(V::load(&means[Layout::ENERGY * stride..]));
    let determinant = uv.neg_mul_add(uv, uu * vv).max(V::zero()) + V::constant(FLAT);
    (energy * (uu + vv) / determinant).max(V::constant(QUIET))
}
