//! Acceleration in steady flow, whose velocity field is constant in time.

use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::resample::motion_at;
use crate::parallel::for_each_band;
use crate::simd::SimdReal;

/// Maximum rounds of [`refine_acceleration`]; each leaves a small part of the error before.
const MAX_ROUNDS: usize = 3;
/// Root-mean-square change, px, at which rounds end.
const ROUND_TOLERANCE: f64 = 0.004;

/// Half the acceleration of a slow steady flow, `M (u, v) / 2`, with derivatives by differences.
pub(super) fn half_acceleration<T: SimdReal>(space: &PlanePool<T>, motion: &Planes<T>) -> Planes<T> {
    let (width, height) = (motion.width, motion.height);
    let mut out = space.planes(width, height, MOTION);
    let half = T::from_f64(0.5);
    for y in 0..height {
        let [u, v, u_x, v_x, u_y, v_y] = std::array::from_fn(|k| motion.line(k, y));
        for (k, along, across) in [(0, u_x, u_y), (1, v_x, v_y)] {
            for (x, out) in out.line_mut(k, y).iter_mut().enumerate() {
                *out = half * (along[x] * u[x] + across[x] * v[x]);
            }
        }
    }
    derive(&mut out);
    out
}

/// Half the acceleration for flow of any speed, from that of slow flow and the `mean` of the steps.
///
/// With the mean step `d` and half acceleration `c`, a particle goes from `x + c - d(x)` over `x` to
/// `x + c + d(x)`. One that starts at either end follows the same path one step later or earlier, so the
/// difference of the steps there gives `2 c(x) = d(x + c + d) - d(x + c - d) - c(x + c + d) - c(x + c - d)`.
/// Each round removes half of this equation's error.
pub(super) fn refine_acceleration<T: SimdReal>(
    space: &PlanePool<T>,
    mean: &Planes<T>,
    mut acceleration: Planes<T>,
) -> Planes<T> {
    for _ in 0..MAX_ROUNDS {
        let better = round(space, mean, &acceleration);
        let change = distance(&better, &acceleration);
        space.keep(std::mem::replace(&mut acceleration, better));
        if change <= ROUND_TOLERANCE {
            break;
        }
    }
    acceleration
}

/// One round of [`refine_acceleration`]. Particles that were or will be outside the frame keep their value.
fn round<T: SimdReal>(space: &PlanePool<T>, mean: &Planes<T>, acceleration: &Planes<T>) -> Planes<T> {
    let far = [mean.width, mean.height].map(|sites| SITE_SPACING * sites as f64 - 1.0);
    let is_inside = |p: [f64; 2]| (0..2).all(|k| (-1.0..=far[k]).contains(&p[k]));
    let mut out = at_sites(space, mean, |x, y| {
        let c = [0, 1].map(|k| acceleration.at(k, x, y).to_f64());
        let middle = [SITE_SPACING * x as f64 + c[0], SITE_SPACING * y as f64 + c[1]];
        let d = flow_at(mean, middle);
        let ends = [1.0, -1.0].map(|way| [middle[0] + way * d[0], middle[1] + way * d[1]]);
        if !ends.into_iter().all(is_inside) {
            return c;
        }
        let [(ahead, c_ahead), (behind, c_behind)] = ends.map(|p| {
            let c = flow_at(acceleration, p);
            (flow_at(mean, [p[0] + c[0], p[1] + c[1]]), c)
        });
        std::array::from_fn(|k| 0.5 * c[k] + 0.25 * (ahead[k] - behind[k] - c_ahead[k] - c_behind[k]))
    });
    derive(&mut out);
    out
}

/// The step to the next frame, from the `mean` of both steps and half the acceleration.
///
/// Frames warped by `+m` and `-m` meet midway between the earlier and the later position: a particle at `x`
/// in the middle frame moves from `x + c - m` to `x + c + m` and is estimated at `x + c`. So the next step is
/// `c(x) + m(x + c(x))`; its Jacobian follows by the chain rule.
pub(super) fn next_step<T: SimdReal>(space: &PlanePool<T>, mean: &Planes<T>, acceleration: &Planes<T>) -> Planes<T> {
    at_sites(space, mean, |x, y| {
        let [u, v, u_x, v_x, u_y, v_y]: [f64; MOTION] = std::array::from_fn(|k| acceleration.at(k, x, y).to_f64());
        let m = motion_at(mean, SITE_SPACING, SITE_SPACING * x as f64 + u, SITE_SPACING * y as f64 + v);
        [
            u + m[0],
            v + m[1],
            u_x + m[2] * (1.0 + u_x) + m[4] * v_x,
            v_x + m[3] * (1.0 + u_x) + m[5] * v_x,
            u_y + m[2] * u_y + m[4] * (1.0 + v_y),
            v_y + m[3] * u_y + m[5] * (1.0 + v_y),
        ]
    })
}

/// The first planes of a motion, computed site by site.
fn at_sites<T: SimdReal, const N: usize>(
    space: &PlanePool<T>,
    like: &Planes<T>,
    site: impl Fn(usize, usize) -> [f64; N] + Sync,
) -> Planes<T> {
    let width = like.width;
    let mut out = space.planes(width, like.height, MOTION);
    let (len, stride) = (out.row_len().max(1), out.stride());
    for_each_band(out.data_mut(), len, |_, rows, out| {
        for (y, out) in rows.zip(out.chunks_exact_mut(len)) {
            for x in 0..width {
                let values = site(x, y);
                values.into_iter().enumerate().for_each(|(k, value)| out[k * stride + LEFT + x] = T::from_f64(value));
            }
        }
    });
    out
}

/// The first two planes at a position, px.
fn flow_at<T: SimdReal>(planes: &Planes<T>, [x, y]: [f64; 2]) -> [f64; 2] {
    let [u, v, ..] = motion_at(planes, SITE_SPACING, x, y);
    [u, v]
}

/// Root-mean-square distance of two flows, px.
fn distance<T: SimdReal>(a: &Planes<T>, b: &Planes<T>) -> f64 {
    let rows = (0..a.height).flat_map(|y| (0..2).map(move |k| (k, y)));
    let square: f64 = rows
        .map(|(k, y)| a.line(k, y).iter().zip(b.line(k, y)).map(|(&a, &b)| (a - b).to_f64().powi(2)).sum::<f64>())
        .sum();
    (square / (a.width * a.height).max(1) as f64).sqrt()
}

/// The slopes of the flow, by differences of neighbouring sites.
fn derive<T: SimdReal>(flow: &mut Planes<T>) {
    let (width, height) = (flow.width, flow.height);
    for y in 0..height {
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        for x in 0..width {
            let (left, right) = (x.saturating_sub(1), (x + 1).min(width - 1));
            for k in 0..2 {
                let along = slope(flow.at(k, left, y), flow.at(k, right, y), right - left);
                let across = slope(flow.at(k, x, above), flow.at(k, x, below), below - above);
                flow.line_mut(2 + k, y)[x] = along;
                flow.line_mut(4 + k, y)[x] = across;
            }
        }
    }
}

fn slope<T: SimdReal>(from: T, to: T, sites: usize) -> T {
    T::from_f64((to.to_f64() - from.to_f64()) / (SITE_SPACING * sites.max(1) as f64))
}
