//! What smoothing takes away from bent flow.
//!
//! Motion that is smoothed once more, twiced as the windows are, loses `(1 - G)^2` of itself. Where flow bends on the scale of windows this goes the way of the error that is in it already: in
//! turbulence the two correlate by .7 to .85, flow and derivatives alike. Its outer product, averaged around a place, is the covariance.

use super::super::grid::Planes;
use super::super::refine::{PITCH, SPACING};
use super::Entries;
use crate::flow::windowed::solve::{ENTRIES, upper};
use crate::simd::SimdReal;
use rayon::prelude::*;

/// Standard deviation of the Gaussian, px: about twice that of the windows that bent flow is given.
const SIGMA: f64 = 6.0;
/// Planes of the motion.
const MOTION: usize = 6;

/// Sites and their weights that make one value of `2 G - G G`.
type Taps = Vec<(usize, f64)>;

/// The covariance at `size` places; `shares`: of the loss, in the flow and in the slopes.
pub(super) fn bending<T: SimdReal>(motion: &Planes<T>, size: (usize, usize), shares: [f64; 2]) -> Vec<Entries> {
    let lost = lost(motion, size);
    let mut products: Vec<Entries> = lost
        .iter()
        .map(|loss| {
            let scaled: [f64; MOTION] = std::array::from_fn(|k| loss[k] * shares[usize::from(k >= 2)]);
            let mut out = [0.0; ENTRIES];
            for i in 0..MOTION {
                for j in i..MOTION {
                    out[upper(i, j)] = scaled[i] * scaled[j];
                }
            }
            out
        })
        .collect();
    soften(&mut products, size);
    products
}

/// `(1 - G)^2` of the motion at the places.
fn lost<T: SimdReal>(motion: &Planes<T>, (width, height): (usize, usize)) -> Vec<[f64; MOTION]> {
    let sigma = SIGMA / PITCH;
    // G and G G.
    let kernels = [sigma, sigma * std::f64::consts::SQRT_2];
    let along = kernels.map(|s| taps(s, width, motion.width));
    let across = kernels.map(|s| taps(s, height, motion.height));
    let rows: Vec<Vec<[f64; MOTION]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut lost: Vec<[f64; MOTION]> = vec![[0.0; MOTION]; width];
            let mut down = vec![T::from_f64(0.0); motion.width];
            for k in 0..MOTION {
                for (factor, (across, along)) in [-2.0, 1.0].into_iter().zip(across.iter().zip(&along)) {
                    down.fill(T::from_f64(0.0));
                    for &(site, weight) in &across[y] {
                        let weight = T::from_f64(weight);
                        down.iter_mut().zip(motion.line(k, site)).for_each(|(d, m)| *d += weight * *m);
                    }
                    for (lost, taps) in lost.iter_mut().zip(along) {
                        let sum: f64 = taps.iter().map(|&(site, weight)| weight * down[site].to_f64()).sum();
                        lost[k] += factor * sum;
                    }
                }
                let row = motion.line(k, (SPACING * y).min(motion.height - 1));
                for (x, lost) in lost.iter_mut().enumerate() {
                    lost[k] += row[(SPACING * x).min(motion.width - 1)].to_f64();
                }
            }
            lost
        })
        .collect();
    rows.concat()
}

/// A Gaussian of `sigma` sites about each place; beyond the edges values go on by reflection at the point on the edge, so that affine motion is not bent.
fn taps(sigma: f64, places: usize, sites: usize) -> Vec<Taps> {
    let radius = (3.0 * sigma).ceil() as isize;
    let raw: Vec<f64> = (-radius..=radius).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let total: f64 = raw.iter().sum();
    let last = sites as isize - 1;
    (0..places)
        .map(|n| {
            let centre = ((SPACING * n) as isize).min(last);
            let mut weights = vec![0.0; sites];
            for (k, w) in (-radius..=radius).zip(&raw) {
                let (at, w) = (centre + k, w / total);
                let edge = at.clamp(0, last);
                if at == edge {
                    weights[at as usize] += w;
                } else {
                    weights[edge as usize] += 2.0 * w;
                    weights[(2 * edge - at).clamp(0, last) as usize] -= w;
                }
            }
            weights.into_iter().enumerate().filter(|(_, w)| *w != 0.0).collect()
        })
        .collect()
}

/// Binomial means over three by three places.
fn soften(places: &mut [Entries], (width, height): (usize, usize)) {
    let mean = |a: &Entries, b: &Entries, c: &Entries| std::array::from_fn(|k| 0.25 * (a[k] + c[k]) + 0.5 * b[k]);
    let around = |n: usize, count: usize| [n.saturating_sub(1), n, (n + 1).min(count - 1)];
    for row in places.chunks_exact_mut(width.max(1)) {
        let old = row.to_vec();
        for (x, out) in row.iter_mut().enumerate() {
            let [a, b, c] = around(x, width);
            *out = mean(&old[a], &old[b], &old[c]);
        }
    }
    let old = places.to_vec();
    for (n, out) in places.iter_mut().enumerate() {
        let (x, y) = (n % width, n / width);
        let [a, b, c] = around(y, height).map(|y| &old[y * width + x]);
        *out = mean(a, b, c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn affine_motion_loses_nothing_and_waves_lose_what_the_formula_says() {
        let (width, height) = (150, 120);
        let k = 0.3;
        let mut motion = Planes::<f64>::new(width, height, MOTION);
        for y in 0..height {
            for x in 0..width {
                let (px, py) = (PITCH * x as f64, PITCH * y as f64);
                motion.line_mut(0, y)[x] = 3.0 + 0.02 * px - 0.01 * py;
                motion.line_mut(1, y)[x] = (k * px).cos();
            }
        }
        let size = (width.div_ceil(SPACING), height.div_ceil(SPACING));
        let lost = lost(&motion, size);
        assert!(lost.iter().all(|l| l[0].abs() < 1e-12));
        let g = (-0.5 * (k * SIGMA).powi(2)).exp();
        for x in 8..size.0 - 8 {
            let want = (1.0 - g).powi(2) * (k * PITCH * (SPACING * x) as f64).cos();
            assert!((lost[15 * size.0 + x][1] - want).abs() < 0.01);
        }
    }
}
