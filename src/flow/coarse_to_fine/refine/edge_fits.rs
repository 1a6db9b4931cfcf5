//! Edge fits: windows that keep to one side of a motion boundary.
//!
//! M. Kuwahara et al., "Processing of RI-angiocardiographic images" (1976) choose the window of least
//! variance among four beside a site. Here each of nine windows is an affine model and has a weight: larger,
//! the closer to affine the flow is in the window, and the closer the model is to the site's own flow.
//!
//! Slopes are taken from the best windows some steps wider: at a motion step, a window's fit has a slope that
//! no motion has, which reaches as far as the window.

use super::{choose::Choice, choose::Use, fit::FIT, plain_fits::any_positive, upsample::widen};
use crate::flow::coarse_to_fine::extended::{Field, RIM, chunk_of};
use crate::flow::coarse_to_fine::planes::{CHUNK, LEFT};
use crate::simd::{Lanes, SimdReal};

/// Distance of the eight windows from the site, in units of sigma; limited by the rim.
const WINDOW_OFFSET: f64 = 1.5;
/// Variance added to the misfit of a window, px^2.
const MIN_MISFIT: f64 = 1e-4;
/// Steps of the ladder from the windows of the flow to those of its slopes.
const SLOPE_STEPS: usize = 2;

pub(super) struct EdgeWindow {
    pub index: usize,
    /// The narrower windows whose slopes it provides.
    slopes_of: Vec<usize>,
}

/// The windows whose edge fits are used at any site; the widest also stands in for wider ones.
pub(super) fn used_windows<T: SimdReal>(choice: &Choice<T>) -> Vec<EdgeWindow> {
    let windows = choice.order.windows;
    let flow: Vec<bool> = (0..windows).map(|l| choice.wants_edges(l)).collect();
    let slopes_of = |l: usize| (0..windows).filter(|&m| flow[m] && (m + SLOPE_STEPS).min(windows - 1) == l).collect();
    let all = (0..windows).map(|index| EdgeWindow { index, slopes_of: slopes_of(index) });
    all.filter(|window| flow[window.index] || !window.slopes_of.is_empty()).collect()
}

struct OffsetWindow<T> {
    /// Samples from the site to the window's centre.
    offset: isize,
    /// The same, px.
    dx: T,
    dy: T,
}

pub(super) struct Edges<'a, T> {
    window: &'a EdgeWindow,
    /// Single fits at the finest sites.
    fits: &'a Field<T>,
    windows: [OffsetWindow<T>; 9],
}

/// Lines of weights: of the flow, then of the slopes; and two scratch lines.
pub(super) struct Lines<T> {
    flow: Vec<T>,
    slopes: Vec<T>,
    one: Vec<T>,
    down: Vec<T>,
}

impl<'a, T: SimdReal> Edges<'a, T> {
    /// For a window of `sigma` px, on sites `pitch` px apart.
    pub fn new(window: &'a EdgeWindow, sigma: f64, pitch: f64, fits: &'a Field<T>) -> Self {
        let aside = (WINDOW_OFFSET * sigma / pitch).min(RIM as f64);
        let (a, d) = (aside.round() as isize, (aside / std::f64::consts::SQRT_2).round() as isize);
        let around = [(0, 0), (a, 0), (-a, 0), (0, a), (0, -a), (d, d), (d, -d), (-d, d), (-d, -d)];
        let windows = around.map(|(dx, dy)| OffsetWindow {
            offset: dy * fits.row_len() as isize + dx,
            dx: T::from_f64(dx as f64 * pitch),
            dy: T::from_f64(dy as f64 * pitch),
        });
        Self { window, fits, windows }
    }
}

impl<T: SimdReal> Lines<T> {
    pub fn new(stride: usize) -> Self {
        let line = |n: usize| vec![T::from_f64(0.0); n * stride];
        Self { flow: line(2), slopes: line(2), one: line(2), down: line(1) }
    }
}

/// [`CHUNK`] sites of a row.
pub(super) struct Site<'a, T> {
    pub x: usize,
    pub y: usize,
    pub own: [&'a [T; CHUNK]; 2],
    /// Weight of the slopes of wider windows, 0 to 1.
    pub steps: &'a [T; CHUNK],
}

impl<T: SimdReal> Edges<'_, T> {
    #[inline(always)]
    pub fn widen<V: Lanes<Scalar = T>>(&self, choice: &Choice<T>, y: usize, lines: &mut Lines<T>) {
        let plane = |l: usize| choice.order.weight(Use::Edges, l);
        widen::<V>(choice, plane(self.window.index), 0, y, &mut lines.down, &mut lines.flow);
        lines.slopes.fill(T::from_f64(0.0));
        for &narrow in &self.window.slopes_of {
            widen::<V>(choice, plane(narrow), 0, y, &mut lines.down, &mut lines.one);
            lines.slopes.iter_mut().zip(&lines.one).for_each(|(sum, weight)| *sum += *weight);
        }
    }

    /// Adds the fits of this window at [`CHUNK`] sites to a row of sums.
    #[inline(always)]
    pub fn add<V: Lanes<Scalar = T>>(&self, site: &Site<'_, T>, lines: &Lines<T>, sums: &mut [T]) {
        let flow = chunk_of(&lines.flow[site.x..]);
        let mut slopes = *chunk_of(&lines.slopes[site.x..]);
        for ((slope, flow), step) in slopes.iter_mut().zip(flow).zip(site.steps) {
            *slope = *flow + (*slope - *flow) * *step;
        }
        if any_positive(flow) || any_positive(&slopes) {
            self.add_fits::<V>(site, [flow, &slopes], &mut sums[LEFT + site.x..]);
        }
    }

    #[inline(always)]
    fn add_fits<V: Lanes<Scalar = T>>(&self, site: &Site<'_, T>, [flow, slopes]: [&[T; CHUNK]; 2], sums: &mut [T]) {
        let fits = self.fits;
        let at = fits.start(0, site.y as isize) + LEFT + site.x;
        // Slices of known length, so that the loop below checks no bounds.
        let windows: [[&[T; CHUNK]; FIT]; 9] = std::array::from_fn(|n| {
            let window = &fits.data()[at.wrapping_add_signed(self.windows[n].offset)..];
            std::array::from_fn(|k| chunk_of(&window[k * fits.stride()..]))
        });
        for i in (0..CHUNK).step_by(V::LANES) {
            let (own_u, own_v) = (V::load(&site.own[0][i..]), V::load(&site.own[1][i..]));
            let (mut total, mut sum) = ([V::zero(); 2], [V::zero(); 6]);
            for (fit, window) in windows.iter().zip(&self.windows) {
                let (back, up) = (V::splat(window.dx), V::splat(window.dy));
                let (u_x, v_x) = (V::load(&fit[2][i..]), V::load(&fit[3][i..]));
                let (u_y, v_y) = (V::load(&fit[4][i..]), V::load(&fit[5][i..]));
                let u = u_y.neg_mul_add(up, u_x.neg_mul_add(back, V::load(&fit[0][i..])));
                let v = v_y.neg_mul_add(up, v_x.neg_mul_add(back, V::load(&fit[1][i..])));
                let (du, dv) = (u - own_u, v - own_v);
                let misfit = V::load(&fit[6][i..]).max(V::zero()) + V::constant(MIN_MISFIT);
                let error = du.mul_add(du, dv.mul_add(dv, misfit));
                let weight = V::constant(1.0) / (error * error);
                let sharp = weight * weight;
                total = [total[0] + weight, total[1] + sharp];
                sum[0] = u.mul_add(weight, sum[0]);
                sum[1] = v.mul_add(weight, sum[1]);
                sum[2] = u_x.mul_add(sharp, sum[2]);
                sum[3] = v_x.mul_add(sharp, sum[3]);
                sum[4] = u_y.mul_add(sharp, sum[4]);
                sum[5] = v_y.mul_add(sharp, sum[5]);
            }
            let shares = [V::load(&flow[i..]) / total[0], V::load(&slopes[i..]) / total[1]];
            for k in 0..6 {
                let line = &mut sums[k * fits.stride() + i..];
                sum[k].mul_add(shares[usize::from(k >= 2)], V::load(line)).store(line);
            }
        }
    }
}
