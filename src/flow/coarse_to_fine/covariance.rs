//! How far the refined motion can be trusted.
//!
//! A window of standard deviation `s` averages the flow's noise. With `P` the information and `e` the residual energy around a site, white noise leaves the
//! flow with the density `D = e P^-1` (variance times area); twiced Gaussian means and slopes of it (transfer function `H = 2 G - G^2`, `G` that of the window) have the covariances
//!
//! `C(u, v) = D integral H^2 / (2 pi)^2 = 11/6 D / (4 pi s^2)`, `C(u_x, v_x) = C(u_y, v_y) = D integral w_x^2 H^2 / (2 pi)^2 = 89/36 D / (8 pi s^4)`.
//!
//! What the windows changed of the motion that they were given is added: it holds what they smoothed away.

use super::data::ERROR;
use super::grid::Planes;
use super::refine::{DENSITY, SIGMA};
use super::run::Estimate;
use crate::image::GaussianSmoother;
use crate::simd::{Level, SimdReal};
use crate::types::Frame;
use std::f64::consts::PI;

/// Region of the information and of the energy, sites.
const REGION: f64 = 4.0;
/// Entries of the upper triangle of a 6x6 matrix.
pub(super) const ENTRIES: usize = 21;

/// Covariance of `(u, v, u_x, v_x, u_y, v_y)` at every site: the upper triangle, row by row.
pub(super) fn covariance<T: SimdReal>(simd: Level, estimate: &Estimate<T>) -> Planes<T> {
    let data = &estimate.data;
    let mean = |plane: usize, power: f64| regional(simd, data, plane, power);
    let (uu, uv, vv) = (mean(0, 1.0), mean(6, 1.0), mean(12, 1.0));
    let energy = mean(ERROR, 0.25);
    let mut out = Planes::new(data.width, data.height, ENTRIES);
    for y in 0..data.height {
        for x in 0..data.width {
            let at = |f: &Frame<T>| f.get(x, y).to_f64();
            let (a, b, c) = (at(&uu), at(&uv), at(&vv));
            let least = 1e-6 + 1e-4 * (a + c);
            let (a, c) = (a + least, c + least);
            let e = at(&energy) / (a * c - b * b);
            let density = [c * e, -b * e, a * e];
            let sigma = estimate.motion.at(SIGMA, x, y).to_f64();
            let flow = 11.0 / 6.0 / (4.0 * PI * sigma.powi(2));
            let slope = 89.0 / 36.0 / (8.0 * PI * sigma.powi(4));
            for block in 0..3 {
                let share = if block == 0 { flow } else { slope };
                for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
                    out.line_mut(upper(2 * block + i, 2 * block + j), y)[x] = T::from_f64(share * density[k]);
                }
            }
        }
    }
    let _ = DENSITY;
    out
}

/// Index of entry (i, j), i <= j, of the upper triangle of a 6x6 matrix.
const fn upper(i: usize, j: usize) -> usize {
    i * (11 - i) / 2 + j
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
