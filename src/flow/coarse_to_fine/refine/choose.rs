//! Weights of the windows at each site: climbs to wider ones while noise explains the change (O. V. Lepski,
//! "On a problem of adaptive estimation in Gaussian white noise", 1991), with soft decisions.

use super::RefineOptions;
use super::ladder::{Ladder, MAX_OCTAVE, difference_variance};
use super::regional_means::Layout;
use crate::flow::coarse_to_fine::{plane_pool::PlanePool, planes::LEFT, planes::Planes};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};

/// Minimum weight of a window; smaller ones are set to 0, so that whole rows can skip a window.
const MIN_WEIGHT: f64 = 1e-2;
/// Minimum noise density, px^4: below that of any real frame.
const MIN_NOISE_DENSITY: f64 = 1e-9;
/// Step of the ladder from which unrest is measured: wider than what regularisation smooths.
const UNREST_WINDOW: usize = 2;
/// Share of the measured change that counts as unrest.
const UNREST_SHARE: f64 = 0.8;
/// Added to the determinant of the information, (grey^2/px^2)^2.
const MIN_DETERMINANT: f64 = 1e-6;

/// Parts of the motion that windows are chosen for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// The flow of the plain fits.
    Flow,
    /// The slopes of the plain fits.
    Slopes,
    Edges,
}

impl Use {
    const ALL: [Self; 3] = [Self::Flow, Self::Slopes, Self::Edges];

    /// Accepted change over that explained by noise.
    fn kappa(self, options: &RefineOptions) -> f64 {
        match self {
            Self::Flow => options.kappa,
            Self::Slopes => options.kappa_slopes,
            Self::Edges => options.kappa_edge,
        }
    }
}

/// Order of the planes of a choice: per [`Use`] the weights of the windows, per grid the sum of those on
/// coarser grids, and the mean sigma, px; then the flow's weights over regional misfits, and the noise
/// density.
#[derive(Debug, Clone, Copy)]
pub(super) struct Order {
    pub windows: usize,
}

impl Order {
    pub fn weight(self, of: Use, l: usize) -> usize {
        of as usize * self.each() + l
    }
    pub fn coarser(self, of: Use, octave: usize) -> usize {
        self.weight(of, self.windows + octave)
    }
    pub fn sigma(self, of: Use) -> usize {
        self.weight(of, self.windows + MAX_OCTAVE)
    }
    pub fn misfit(self, l: usize) -> usize {
        Use::ALL.len() * self.each() + l
    }
    fn each(self) -> usize {
        self.windows + MAX_OCTAVE + 1
    }
    pub fn density(self) -> usize {
        self.misfit(self.windows)
    }
    fn count(self) -> usize {
        self.density() + 1
    }
}

/// Weights of the windows, of sum 1 (less where the field vanishes), and derived planes.
pub(super) struct Choice<T> {
    pub planes: Planes<T>,
    pub order: Order,
}

impl<T: SimdReal> Choice<T> {
    pub fn wants_edges(&self, l: usize) -> bool {
        let (zero, plane) = (T::from_f64(0.0), self.order.weight(Use::Edges, l));
        (0..self.planes.height).any(|y| self.planes.line(plane, y).iter().any(|w| *w > zero))
    }
}

pub(super) fn choose<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    options: &RefineOptions,
    ladder: &Ladder<T>,
    means: &Planes<T>,
) -> Choice<T> {
    let order = Order { windows: ladder.scales.len() };
    let sigmas: Vec<f64> = ladder.scales.iter().map(|s| s.sigma).collect();
    let wider = sigmas.iter().skip(1).copied().chain(options.may_vanish.then_some(f64::INFINITY));
    let noise: Vec<f64> = sigmas.iter().zip(wider).map(|(&s, wider)| difference_variance(s, wider)).collect();
    let mut planes = space.planes(means.width, means.height, order.count());
    let len = planes.row_len();
    let octaves = ladder.scales.iter().map(|s| s.octave).collect();
    let climb = Climb { means, options, sigmas, octaves, noise, order };
    for_each_band(planes.data_mut(), len, |_, rows, out| {
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            dispatch(simd, Weights { climb: &climb, y, out });
        }
    });
    Choice { planes, order }
}

struct Climb<'a, T> {
    means: &'a Planes<T>,
    options: &'a RefineOptions,
    /// Standard deviations of the windows, px.
    sigmas: Vec<f64>,
    octaves: Vec<usize>,
    /// Variance of the step from each window to the next, for noise of unit density.
    noise: Vec<f64>,
    order: Order,
}

struct Weights<'a, T> {
    climb: &'a Climb<'a, T>,
    y: usize,
    out: &'a mut [T],
}

impl<T: SimdReal> Kernel<T> for Weights<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { climb, y, out } = self;
        let (means, order, stride) = (climb.means, climb.order, climb.means.stride());
        let layout = Layout::new(climb.options);
        for x in (0..means.padded()).step_by(V::LANES) {
            let means = &means.row(y)[LEFT + x..];
            let out = &mut out[LEFT + x..];
            let density = density::<V>(means, stride);
            density.store(&mut out[order.density() * stride..]);
            let unrest = climb.unrest::<V>(density, means);
            for of in Use::ALL {
                let noise = if of == Use::Slopes { density * unrest } else { density };
                climb.weights::<V>(of, noise, means, out);
            }
            for l in 0..order.windows {
                let weight = V::load(&out[order.weight(Use::Flow, l) * stride..]);
                let misfit = weight * power4(V::load(&means[layout.misfit(l) * stride..]));
                misfit.store(&mut out[order.misfit(l) * stride..]);
            }
        }
        // The last site is repeated for finer sites beyond it.
        for line in out.chunks_exact_mut(stride) {
            let end = LEFT + means.width;
            line[end] = line[end - 1];
        }
    }
}

impl<T: SimdReal> Climb<'_, T> {
    /// Unrest of the flow, at least 1: its change between narrow windows, over that of white noise.
    #[inline(always)]
    fn unrest<V: Lanes<Scalar = T>>(&self, density: V, means: &[T]) -> V {
        let one = V::constant(1.0);
        if self.options.max_unrest <= 1.0 || Layout::new(self.options).steps <= UNREST_WINDOW {
            return one;
        }
        let change = power4(V::load(&means[Layout::change(UNREST_WINDOW) * self.means.stride()..]));
        let ratio = change / (density * V::constant(self.noise[UNREST_WINDOW] / UNREST_SHARE));
        ratio.max(one).min(V::constant(self.options.max_unrest))
    }

    #[inline(always)]
    fn weights<V: Lanes<Scalar = T>>(&self, of: Use, density: V, means: &[T], out: &mut [T]) {
        let (stride, windows) = (self.means.stride(), self.order.windows);
        let layout = Layout::new(self.options);
        let (mut accepted, mut sigma, mut sum) = (V::constant(1.0), V::zero(), V::zero());
        for l in 0..windows {
            let mut next = V::zero();
            if l < layout.steps {
                let change = match of {
                    Use::Edges => V::constant(1.0) / power4(V::load(&means[layout.calm(l) * stride..])),
                    Use::Flow | Use::Slopes => power4(V::load(&means[Layout::change(l) * stride..])),
                };
                let kappa = if l + 1 < windows { of.kappa(self.options) } else { self.options.kappa_nothing };
                let ratio = change / (density * V::constant(self.noise[l] * kappa));
                next = accepted / (V::constant(1.0) + power4(ratio));
            }
            let weight = (accepted - next - V::constant(MIN_WEIGHT)).max(V::zero());
            accepted = next;
            sigma = weight.mul_add(V::constant(self.sigmas[l]), sigma);
            sum = sum + weight;
            weight.store(&mut out[self.order.weight(of, l) * stride..]);
        }
        // Beyond the widest window the field vanishes.
        let whole = V::constant(1.0) / (sum + accepted);
        (sigma * whole).store(&mut out[self.order.sigma(of) * stride..]);
        let mut coarser = [V::zero(); MAX_OCTAVE];
        for l in 0..windows {
            let line = &mut out[self.order.weight(of, l) * stride..];
            let weight = V::load(line) * whole;
            weight.store(line);
            for sum in &mut coarser[..self.octaves[l]] {
                *sum = *sum + weight;
            }
        }
        for (octave, sum) in coarser.into_iter().enumerate() {
            sum.store(&mut out[self.order.coarser(of, octave) * stride..]);
        }
    }
}

#[inline(always)]
fn power4<V: Lanes>(value: V) -> V {
    let square = value * value;
    square * square
}

/// Noise density of the flow, px^2 per px^-2: residual energy by the trace of inverse information.
#[inline(always)]
fn density<V: Lanes>(means: &[V::Scalar], stride: usize) -> V {
    let (uu, uv, vv) = (V::load(means), V::load(&means[stride..]), V::load(&means[2 * stride..]));
    let energy = power4(V::load(&means[Layout::ENERGY * stride..]));
    let determinant = uv.neg_mul_add(uv, uu * vv).max(V::zero()) + V::constant(MIN_DETERMINANT);
    (energy * (uu + vv) / determinant).max(V::constant(MIN_NOISE_DENSITY))
}
