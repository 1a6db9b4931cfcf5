//! Gaussian-weighted moments of planes: separable sums with `g`, `x g` and `x^2 g`.
//!
//! The normal equations of a window need sums of products weighted by `w`, `w x`, `w y`, `w x^2`, `w x y` and
//! `w y^2`, with `w = g(x) g(y)`: three one-dimensional filters down the columns, and along the rows those of
//! each result that are still needed.

use crate::flow::moment_filter::weights;
use crate::simd::SimdReal;

/// Filters of one axis: `taps[k] = [g, g k/s, g (k/s)^2]` for the distances k = 0 ..= radius, s the unit of
/// length.
#[derive(Debug, Clone)]
pub(super) struct Window<T> {
    pub taps: Vec<[T; 3]>,
}

impl<T: SimdReal> Window<T> {
    /// The Gaussian of `sigma` px cut off at `radius`, normalised to a sum of 1; lengths in units of `sigma`.
    pub fn gaussian(sigma: f64, radius: usize) -> Self {
        Self { taps: cast(&weights(sigma, radius), sigma) }
    }

    /// Squares of the weights with which a window of `sigma` px sees the noise of samples that were smoothed
    /// by a Gaussian of `smooth` px, cut where they are as small as the Gaussian at `radius`.
    ///
    /// `g_sigma(p) g_smooth(q - p)` is `g(q)`, wider by the smoothing, times a kernel about `p = a q`, `a =
    /// sigma^2 / (sigma^2 + smooth^2)`; the weights are those at p, their squares summed over q. Lengths are
    /// in units of `sigma`.
    pub fn squared(sigma: f64, radius: usize, smooth: f64) -> Self {
        let narrow = sigma * sigma / sigma.hypot(smooth);
        let share = (narrow / sigma).powi(2);
        let reach = (radius as f64 / std::f64::consts::SQRT_2 * narrow / sigma).ceil() as usize;
        let g: Vec<f64> = weights(narrow, radius.max(reach)).iter().map(|w| share * w * w).collect();
        Self { taps: cast(&g[..=reach.min(radius)], sigma) }
    }

    /// A smoothing kernel from its weights at distance 0, 1, ...
    pub fn smoothing(half: &[f64]) -> Self {
        Self { taps: cast(half, 1.0) }
    }

    /// Largest distance, px.
    pub fn radius(&self) -> usize {
        self.taps.len() - 1
    }

    /// Sums of `g`, `x g` and `x^2 g` over the part of the axis `from .. to` around `at`.
    pub fn partial(&self, at: usize, from: usize, to: usize) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (k, tap) in self.taps.iter().enumerate() {
            let [g, g1, g2] = tap.map(crate::math::Real::to_f64);
            let right = (from..to).contains(&(at + k));
            let left = k > 0 && at >= k && (from..to).contains(&(at - k));
            let (sum, difference) = (f64::from(right) + f64::from(left), f64::from(right) - f64::from(left));
            sums[0] += sum * g;
            sums[1] += difference * g1;
            sums[2] += sum * g2;
        }
        sums
    }
}

fn cast<T: SimdReal>(half: &[f64], unit: f64) -> Vec<[T; 3]> {
    half.iter()
        .enumerate()
        .map(|(k, g)| {
            let x = k as f64 / unit;
            [T::from_f64(*g), T::from_f64(g * x), T::from_f64(g * x * x)]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partial_sums_are_those_of_the_taps_inside() {
        let window = Window::<f64>::gaussian(2.0, 6);
        let whole = window.partial(20, 0, 100);
        assert!((whole[0] - 1.0).abs() < 1e-14 && whole[1].abs() < 1e-15 && whole[2] > 0.9 && whole[2] < 1.0);
        let edge = window.partial(1, 1, 100);
        assert!((edge[0] - 0.5 - 0.5 * window.taps[0][0]).abs() < 1e-14 && edge[1] > 0.0);
    }
}
