//! Whole refinements; the oracles of the pieces are in [`pieces`].

mod pieces;

use super::*;
use crate::flow::coarse_to_fine::data_term::{ENERGY, SEEN, SUMMARY, UU, VV};

/// Evenly distributed between -1 and 1, the same for the same number.
pub(super) fn noise(n: usize) -> f64 {
    let mut z = (n as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// Motion (px) from its value at (x, y) px.
pub(super) fn field<T: SimdReal>(width: usize, height: usize, f: impl Fn(usize, f64, f64) -> f64) -> Planes<T> {
    let mut m = Planes::new(width, height, 6);
    for k in 0..2 {
        for y in 0..height {
            for (x, value) in m.line_mut(k, y).iter_mut().enumerate() {
                *value = T::from_f64(f(k, SITE_SPACING * x as f64, SITE_SPACING * y as f64));
            }
        }
    }
    m
}

/// Seven windows, for which the figures below were worked out.
pub(super) fn seven() -> RefineOptions {
    RefineOptions { ladder: &[1.5, 2.5, 4.0, 6.0, 9.0, 13.0, 18.0], kappa: 7.0, ..RefineOptions::default() }
}

/// A data term with the same information everywhere, whose noise density is `density`.
pub(super) fn statistics<T: SimdReal>(width: usize, height: usize, density: f64) -> Planes<T> {
    let mut d = Planes::new(width, height, SUMMARY);
    for (k, value) in [(UU, 100.0), (VV, 100.0), (ENERGY, density * 50.0), (SEEN, 1.0)] {
        for y in 0..height {
            d.line_mut(k, y).fill(T::from_f64(value));
        }
    }
    d
}
