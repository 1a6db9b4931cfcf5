//! How far the refined motion can be trusted.
//!
//! A window of standard deviation `s` averages the flow's noise. With `P` the information and `e` the residual energy around a site, white noise leaves the
//! flow with the density `D = e P^-1` (variance times area); twiced Gaussian means and slopes of it (transfer function `H = 2 G - G^2`, `G` that of the window) have the covariances
//!
//! `C(u, v) = D integral H^2 / (2 pi)^2 = 11/6 D / (4 pi s^2)`, `C(u_x, v_x) = C(u_y, v_y) = D integral w_x^2 H^2 / (2 pi)^2 = 89/36 D / (8 pi s^4)`.
//!
//! Coupling and edge windows make the noise of the flow less white than that; [`FLOW_NOISE`] and [`SLOPE_NOISE`] account for it.
//!
//! These factors and the share below were fitted to a few made scenes and are provisional: the covariance is not calibrated. That of a pair is told as it is midway, not
//! carried to the first frame as its motion is.
//!
//! What is no noise but a wrong place (aliasing of sharp particles, flow that bends within a pixel's reach) does not average out. It shows as
//! residual energy that grows with the texture: where the image is displaced by a misfit of variance `b` from where it should be, `e = e_0 + b tr P`. The
//! slope `b` of that line over all sites is the variance of the misfit, px^2, whatever the noise `e_0`; [`MISFIT_SHARE`] of it stays in each component of the flow.

use super::data::{ERROR, VALID};
use super::grid::Planes;
use super::refine::SIGMA;
use super::run::Estimate;
use crate::flow::windowed::solve::{ENTRIES, upper};
use crate::image::GaussianSmoother;
use crate::simd::{Level, SimdReal};
use crate::types::Frame;
use std::f64::consts::PI;

/// Variance of the flow over that of averaged white noise.
const FLOW_NOISE: f64 = 4.4;
/// Variance of its slopes over that of averaged white noise.
const SLOPE_NOISE: f64 = 6.0;
/// Share of the misfit's variance that stays in each component of the flow.
const MISFIT_SHARE: f64 = 0.45;
/// Region of the information and of the energy, sites.
const REGION: f64 = 4.0;

/// Covariance of `(u, v, u_x, v_x, u_y, v_y)` at every site: the upper triangle, row by row.
///
/// `energy`: the residual energy that the noise is known to leave; without it, it is read from the residuals.
pub(super) fn covariance<T: SimdReal>(simd: Level, estimate: &Estimate<T>, energy: Option<f64>) -> Planes<T> {
    let data = &estimate.data;
    let mean = |plane: usize, power: f64| regional(simd, data, plane, power);
    let (uu, uv, vv) = (mean(0, 1.0), mean(6, 1.0), mean(12, 1.0));
    let found = mean(ERROR, 0.25);
    let systematic = MISFIT_SHARE * misfit(data);
    let mut out = Planes::new(data.width, data.height, ENTRIES);
    for y in 0..data.height {
        for x in 0..data.width {
            let at = |f: &Frame<T>| f.get(x, y).to_f64();
            let (a, b, c) = (at(&uu), at(&uv), at(&vv));
            let least = 1e-6 + 1e-4 * (a + c);
            let (a, c) = (a + least, c + least);
            let e = energy.unwrap_or_else(|| at(&found)) / (a * c - b * b);
            let density = [c * e, -b * e, a * e];
            let sigma = estimate.motion.at(SIGMA, x, y).to_f64();
            let flow = FLOW_NOISE * 11.0 / 6.0 / (4.0 * PI * sigma.powi(2));
            let slope = SLOPE_NOISE * 89.0 / 36.0 / (8.0 * PI * sigma.powi(4));
            for block in 0..3 {
                let (share, wrong) =
                    if block == 0 { (flow, systematic) } else { (slope, systematic / misfit_length_squared(sigma)) };
                for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                    let value = share * density[k] + if i == j { wrong } else { 0.0 };
                    out.line_mut(upper(2 * block + i, 2 * block + j), y)[x] = T::from_f64(value);
                }
            }
        }
    }
    out
}

/// Variance of the displacement between the image and where it should be, px^2: the slope of the residual energy over the information, never negative.
fn misfit<T: SimdReal>(data: &Planes<T>) -> f64 {
    let sites = || {
        (0..data.height).flat_map(|y| {
            let [valid, uu, vv, energy] = [VALID, 0, 12, ERROR].map(|k| data.line(k, y));
            (0..data.width)
                .filter(|&x| valid[x].to_f64() > 0.5)
                .map(|x| (uu[x].to_f64() + vv[x].to_f64(), energy[x].to_f64()))
        })
    };
    let (count, sum) = sites().fold((0.0, [0.0; 2]), |(n, s), (p, e)| (n + 1.0, [s[0] + p, s[1] + e]));
    if count == 0.0 {
        return 0.0;
    }
    let mean = sum.map(|s| s / count);
    let (square, product) = sites().fold((0.0, 0.0), |(square, product), (p, e)| {
        (square + (p - mean[0]).powi(2), product + (p - mean[0]) * (e - mean[1]))
    });
    if square > 0.0 { (product / square).max(0.0) } else { 0.0 }
}

/// Over which length what stays of the misfit changes, px^2: windows smooth it too, but it has a scale of its own.
fn misfit_length_squared(sigma: f64) -> f64 {
    30.0 + 0.35 * sigma * sigma
}

/// Gaussian power mean of a plane.
fn regional<T: SimdReal>(simd: Level, planes: &Planes<T>, k: usize, power: f64) -> Frame<T> {
    let raised = Frame::from_fn(planes.width, planes.height, |x, y| {
        let value = planes.at(k, x, y).to_f64();
        T::from_f64(if power == 1.0 { value } else { value.max(0.0).powf(power) })
    });
    let smooth = GaussianSmoother { sigma: REGION, truncate: 3.0, border: crate::image::Border::Replicate };
    let mean = smooth.apply_at(simd, &raised);
    if power == 1.0 { mean } else { mean.map(|v| T::from_f64(v.to_f64().powf(1.0 / power))) }
}
