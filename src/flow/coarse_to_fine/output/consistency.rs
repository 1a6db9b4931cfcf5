//! Sites where the frames contradict the motion.

use crate::flow::coarse_to_fine::brightness_scale::MIN_RESIDUAL_SHARE;
use crate::flow::coarse_to_fine::data_term::{DataOptions, ENERGY, UU, VV};
use crate::flow::coarse_to_fine::estimate::Estimate;
use crate::flow::coarse_to_fine::planes::Planes;
use crate::parallel;
use crate::simd::SimdReal;
use crate::types::Mask;

/// Approximate maximum number of sites in the median of the energy.
const MAX_SAMPLES: usize = 20_000;
/// Minimum rows of a parallel task.
const ROWS_PER_TASK: usize = 16;

/// Maximum residual energy over that of the typical textured site.
const MAX_ENERGY_RATIO: f64 = 10.0;
/// Residual energy over information, px^2, that interpolation may cause: with strong texture its errors are
/// large, and a residual explained by a shift of 0.1 px is no contradiction.
const MAX_EXPLAINED_SHIFT_SQUARE: f64 = 0.01;

/// Residual energy over information, px^2, beyond which frames are unrelated; and the minimum residual for
/// it, over the standard deviation of the brightness, since noise without texture is no contradiction.
const UNRELATED: (f64, f64) = (0.5, 0.15);

/// Sites with an outlying residual along the motion: occluded in one frame, changed, or wrongly matched.
#[derive(Debug)]
pub(super) struct Consistency {
    contradicted: Mask,
    rows: Vec<bool>,
}

impl Consistency {
    pub fn of<T: SimdReal>(estimate: &Estimate<T>) -> Self {
        let (data, contrast) = (&estimate.data, estimate.brightness.contrast);
        let typical_energy = typical_energy(data).max((MIN_RESIDUAL_SHARE * contrast).powi(2));
        let rows = 1.0 + 2.0 * DataOptions::default().gradient.powi(2);
        let least = rows * (UNRELATED.1 * contrast).powi(2);
        let is_contradicted = |[information, energy]: [f64; 2]| {
            let stands_out =
                energy > MAX_ENERGY_RATIO * typical_energy && energy > MAX_EXPLAINED_SHIFT_SQUARE * information;
            stands_out || (energy > UNRELATED.0 * information && energy > least)
        };
        let mut contradicted = Mask::filled(data.width, data.height, false);
        let width = data.width.max(1);
        let row = |(y, row): (usize, &mut [bool])| {
            row.iter_mut().zip(row_energies(data, y)).for_each(|(out, site)| *out = is_contradicted(site));
            row.contains(&true)
        };
        let rows =
            parallel::map(contradicted.data_mut().chunks_mut(ROWS_PER_TASK * width).enumerate(), |(task, rows)| {
                (task * ROWS_PER_TASK..).zip(rows.chunks_mut(width)).map(row).collect::<Vec<bool>>()
            });
        Self { contradicted, rows: rows.concat() }
    }

    pub fn is_contradicted(&self, x: usize, y: usize) -> bool {
        self.contradicted.get(x, y)
    }

    pub fn has_contradiction(&self, y: usize) -> bool {
        self.rows[y]
    }
}

/// Information, grey^2 px^-2, and residual energy, grey^2, of the sites of a row.
fn row_energies<T: SimdReal>(data: &Planes<T>, y: usize) -> impl Iterator<Item = [f64; 2]> {
    let [uu, vv, energy] = [UU, VV, ENERGY].map(|k| data.line(k, y));
    uu.iter().zip(vv).zip(energy).map(|((uu, vv), energy)| [uu.to_f64() + vv.to_f64(), energy.to_f64()])
}

/// Median energy of the half of the sites with most information: untextured ones have no residual.
fn typical_energy<T: SimdReal>(data: &Planes<T>) -> f64 {
    let stride = (data.width * data.height / MAX_SAMPLES).max(1);
    let mut known: Vec<_> = (0..data.height).flat_map(|y| row_energies(data, y)).step_by(stride).collect();
    if known.is_empty() {
        return 0.0;
    }
    let middle = known.len() / 2;
    known.select_nth_unstable_by(middle, |a, b| a[0].total_cmp(&b[0]));
    let textured = &mut known[middle..];
    let middle = textured.len() / 2;
    textured.select_nth_unstable_by(middle, |a, b| a[1].total_cmp(&b[1])).1[1]
}
