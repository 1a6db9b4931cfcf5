//! Where the frames do not agree with the motion that was found.

use super::super::data::{DataOptions, ENERGY, UU, VV};
use super::super::grid::Planes;
use super::super::run::Estimate;
use crate::simd::SimdReal;
use crate::types::Mask;

/// Residual energy, over that of the usual textured site, from which on frames contradict the motion.
const CONTRADICTION: f64 = 10.0;
/// Residual energy over information, px^2: where texture is strong, so are the errors of its interpolation, and a residual that a shift of this square explains is none.
const EXPLAINED: f64 = 0.01;
/// Share of the brightness' standard deviation that is never a residual.
const LEAST: f64 = 4e-3;

/// Residual energy over information, px^2, beyond which frames have nothing to do with each other, however usual that is; and the share of the brightness' standard deviation
/// that the residual then has at least, so that noise where there is no texture is no contradiction.
const UNRELATED: (f64, f64) = (0.5, 0.15);

/// The sites of the data whose residual, along the motion, stands out: what is seen in one frame is hidden in the other or has changed, or its motion was missed.
#[derive(Debug)]
pub(super) struct Consistency {
    contradicted: Mask,
    rows: Vec<bool>,
}

impl Consistency {
    pub fn of<T: SimdReal>(estimate: &Estimate<T>) -> Self {
        let (data, contrast) = (&estimate.data, estimate.range.contrast);
        let information = |x: usize, y: usize| data.at(UU, x, y).to_f64() + data.at(VV, x, y).to_f64();
        let energy = |x: usize, y: usize| data.at(ENERGY, x, y).to_f64();
        let usual = usual(data, &information, &energy).max((LEAST * contrast).powi(2));
        let rows = 1.0 + 2.0 * DataOptions::default().gradient.powi(2);
        let least = rows * (UNRELATED.1 * contrast).powi(2);
        let contradicted = Mask::from_fn(data.width, data.height, |x, y| {
            let (energy, information) = (energy(x, y), information(x, y));
            let stands_out = energy > CONTRADICTION * usual && energy > EXPLAINED * information;
            stands_out || (energy > UNRELATED.0 * information && energy > least)
        });
        let rows = (0..data.height).map(|y| contradicted.row(y).contains(&true)).collect();
        Self { contradicted, rows }
    }

    /// At a site.
    pub fn is_contradicted(&self, x: usize, y: usize) -> bool {
        self.contradicted.get(x, y)
    }

    /// At any site of a row.
    pub fn has_contradiction(&self, y: usize) -> bool {
        self.rows[y]
    }
}

/// Median of the energies of that half of the sites which has most information: untextured ones show no residual whatever the motion is.
fn usual<T: SimdReal>(
    data: &Planes<T>,
    information: &impl Fn(usize, usize) -> f64,
    energy: &impl Fn(usize, usize) -> f64,
) -> f64 {
    let sites = (0..data.height).flat_map(|y| (0..data.width).map(move |x| (x, y)));
    let mut known: Vec<[f64; 2]> = sites.map(|(x, y)| [information(x, y), energy(x, y)]).collect();
    if known.is_empty() {
        return 0.0;
    }
    let middle = known.len() / 2;
    known.select_nth_unstable_by(middle, |a, b| a[0].total_cmp(&b[0]));
    let textured = &mut known[middle..];
    let middle = textured.len() / 2;
    textured.select_nth_unstable_by(middle, |a, b| a[1].total_cmp(&b[1])).1[1]
}
