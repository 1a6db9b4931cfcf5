//! Gaps: places without texture, where motion is that of what lies around them.
//!
//! The motion of a level comes from the level above, and what its data correct of that reaches a few sites into a gap in the few sweeps that the coupling is given. Further in, the motion would stay that
//! of a level on which the gap was smaller, with that level's errors. So the correction itself is continued into gaps from the sites around them.

use super::data::{MOTION, normal};
use super::grid::Planes;
use crate::image::fill_holes;
use crate::simd::SimdReal;
use crate::types::Frame;
use std::ops::Range;

/// Information about motion in all directions together, over the noise, px^-2, from which on a site is no gap: noise alone has about as much. With twice as much
/// motion in gaps is still better, but recordings lose at weak texture that does tell something.
const TEXTURED: f64 = 7.0;

/// Sites along both axes of a block that must be without texture for there to be a gap: the coupling carries corrections across smaller ones.
const BLOCK: usize = 4;

/// The sites of a level that have no texture, where they are enough to matter.
pub(super) struct Gaps {
    /// Row by row.
    sites: Vec<bool>,
    /// All of them and their neighbours.
    columns: Range<usize>,
    rows: Range<usize>,
}

impl Gaps {
    /// By the equations of a level, `data`, and their typical energy, `noise`, grey^2. `None` where there is no gap, or nothing else.
    pub fn find<T: SimdReal>(data: &Planes<T>, noise: T) -> Option<Self> {
        let (width, height) = (data.width, data.height);
        let least = T::from_f64(TEXTURED) * noise;
        let mut sites = Vec::with_capacity(width * height);
        for y in 0..height {
            let texture = data.line(normal(0, 0), y).iter().zip(data.line(normal(1, 1), y));
            sites.extend(texture.map(|(uu, vv)| *uu + *vv < least));
        }
        if !has_block(&sites, width) {
            return None;
        }
        let is_gap = |row: &[bool]| row.contains(&true);
        let rows: Vec<usize> = (0..height).filter(|y| is_gap(&sites[y * width..][..width])).collect();
        let columns: Vec<usize> = (0..width).filter(|x| rows.iter().any(|y| sites[y * width + x])).collect();
        let with_neighbours = |of: &[usize], len: usize| of[0].saturating_sub(1)..(of[of.len() - 1] + 2).min(len);
        let (columns, rows) = (with_neighbours(&columns, width), with_neighbours(&rows, height));
        sites.contains(&false).then_some(Self { sites, columns, rows })
    }

    /// Continues what was corrected `from` the motion that a level began with into the gaps of `motion`.
    pub fn continue_corrections<T: SimdReal>(&self, from: &Planes<T>, motion: &mut Planes<T>) {
        let (columns, width) = (&self.columns, motion.width);
        let gaps = |y: usize| &self.sites[y * width..][columns.clone()];
        for k in 0..MOTION {
            let mut correction = Frame::filled(columns.len(), self.rows.len(), T::nan());
            for (row, y) in self.rows.clone().enumerate() {
                let pairs = motion.line(k, y)[columns.clone()].iter().zip(&from.line(k, y)[columns.clone()]);
                for ((out, (now, began)), gap) in correction.row_mut(row).iter_mut().zip(pairs).zip(gaps(y)) {
                    *out = if *gap { T::nan() } else { *now - *began };
                }
            }
            let correction = fill_holes(&correction, None);
            for (row, y) in self.rows.clone().enumerate() {
                let pairs = from.line(k, y)[columns.clone()].iter().zip(correction.row(row));
                let out = motion.line_mut(k, y)[columns.clone()].iter_mut();
                for ((out, (began, correction)), _) in out.zip(pairs).zip(gaps(y)).filter(|(_, gap)| **gap) {
                    *out = *began + *correction;
                }
            }
        }
    }
}

/// Whether there is a whole [`BLOCK`] of gaps.
fn has_block(sites: &[bool], width: usize) -> bool {
    sites.chunks_exact(BLOCK * width).any(|rows| {
        (0..width / BLOCK).any(|n| (0..BLOCK).all(|y| rows[y * width + BLOCK * n..][..BLOCK] == [true; BLOCK]))
    })
}

#[cfg(test)]
mod tests {
    use super::super::data::COUNT;
    use super::*;

    const SIZE: (usize, usize) = (30, 24);

    fn in_hole(x: usize, y: usize) -> bool {
        (8..20).contains(&x) && (6..18).contains(&y)
    }

    #[test]
    fn gaps_are_where_nothing_is_told_in_any_direction() {
        let mut data = Planes::<f32>::new(SIZE.0, SIZE.1, COUNT);
        assert!(Gaps::find(&data, 2.0).is_none(), "there is nothing to continue");
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                // One direction is enough: the coupling carries the other along the edge.
                data.line_mut(normal(1, 1), y)[x] = if in_hole(x, y) { 1.9 * TEXTURED as f32 } else { 1e3 };
            }
        }
        let found = Gaps::find(&data, 2.0).unwrap();
        assert!(found.sites.iter().enumerate().all(|(n, gap)| *gap == in_hole(n % SIZE.0, n / SIZE.0)));
        assert_eq!((found.columns, found.rows), (7..21, 5..19));
        assert!(Gaps::find(&data, 1.8).is_none(), "with less noise everything is texture");
        for y in (0..SIZE.1).filter(|y| y % BLOCK == 0) {
            data.line_mut(normal(1, 1), y).fill(1e3);
        }
        assert!(Gaps::find(&data, 2.0).is_none(), "rows in between are near");
    }

    #[test]
    fn corrections_go_on_in_gaps_and_nothing_else_changes() {
        let sites = (0..SIZE.0 * SIZE.1).map(|n| in_hole(n % SIZE.0, n / SIZE.0)).collect();
        let gaps = Gaps { sites, columns: 7..21, rows: 5..19 };
        let mut from = Planes::<f64>::new(SIZE.0, SIZE.1, MOTION);
        let mut motion = from.clone();
        let correction = |k: usize, y: usize| 0.3 + 0.1 * k as f64 - 0.01 * y as f64;
        for (k, y) in (0..MOTION).flat_map(|k| (0..SIZE.1).map(move |y| (k, y))) {
            for x in 0..SIZE.0 {
                let began = (0.3 * x as f64).sin();
                from.line_mut(k, y)[x] = began;
                motion.line_mut(k, y)[x] = began + if in_hole(x, y) { 0.0 } else { correction(k, y) };
            }
        }
        let before = motion.clone();
        gaps.continue_corrections(&from, &mut motion);
        for (k, y) in (0..MOTION).flat_map(|k| (0..SIZE.1).map(move |y| (k, y))) {
            for x in 0..SIZE.0 {
                let left = motion.at(k, x, y) - from.at(k, x, y) - correction(k, y);
                assert!(left.abs() < if in_hole(x, y) { 0.06 } else { 1e-12 }, "{k} {x} {y}: {left}");
                assert!(in_hole(x, y) || motion.at(k, x, y) == before.at(k, x, y));
            }
        }
    }
}
