//! Gaps: places without texture, where motion is that of what lies around them.
//!
//! The motion of a level comes from the level above, and what its data correct of that reaches a few sites into a gap in the few sweeps that the coupling is given. Further in, the motion would stay that
//! of a level on which the gap was smaller, with that level's errors. So the correction itself is continued into gaps from the sites around them.

use super::data::{MOTION, normal};
use super::grid::Planes;
use crate::image::fill_holes;
use crate::simd::SimdReal;
use crate::types::Frame;

/// Information about motion in all directions together, over the noise, px^-2, from which on a site is no gap: noise alone has about as much. With twice as much
/// motion in gaps is still better, but recordings lose at weak texture that does tell something.
const TEXTURED: f64 = 7.0;

/// Which sites are gaps, row by row; `None` if none or all are. `data`: a level's equations; `noise`: their typical energy, grey^2.
pub(super) fn gaps<T: SimdReal>(data: &Planes<T>, noise: T) -> Option<Vec<bool>> {
    let least = T::from_f64(TEXTURED) * noise;
    let texture = |y: usize| data.line(normal(0, 0), y).iter().zip(data.line(normal(1, 1), y));
    let gaps: Vec<bool> = (0..data.height).flat_map(|y| texture(y).map(|(uu, vv)| *uu + *vv < least)).collect();
    let count = gaps.iter().filter(|gap| **gap).count();
    (count > 0 && count < gaps.len()).then_some(gaps)
}

/// Continues what was corrected `from` the motion that a level began with into the `gaps` of `motion`.
pub(super) fn continue_corrections<T: SimdReal>(gaps: &[bool], from: &Planes<T>, motion: &mut Planes<T>) {
    let (width, height) = (motion.width, motion.height);
    let gap = |x: usize, y: usize| gaps[y * width + x];
    for k in 0..MOTION {
        let correction =
            Frame::from_fn(
                width,
                height,
                |x, y| {
                    if gap(x, y) { T::nan() } else { motion.at(k, x, y) - from.at(k, x, y) }
                },
            );
        let correction = fill_holes(&correction, None);
        for y in 0..height {
            for (x, value) in motion.line_mut(k, y).iter_mut().enumerate().filter(|(x, _)| gap(*x, y)) {
                *value = from.at(k, x, y) + correction.get(x, y);
            }
        }
    }
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
        assert!(gaps(&data, 2.0).is_none(), "there is nothing to continue");
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                // One direction is enough: the coupling carries the other along the edge.
                data.line_mut(normal(1, 1), y)[x] = if in_hole(x, y) { 1.9 * TEXTURED as f32 } else { 1e3 };
            }
        }
        let found = gaps(&data, 2.0).unwrap();
        assert!(found.iter().enumerate().all(|(n, gap)| *gap == in_hole(n % SIZE.0, n / SIZE.0)));
        assert!(gaps(&data, 1.8).is_none(), "with less noise everything is texture");
    }

    #[test]
    fn corrections_go_on_in_gaps_and_nothing_else_changes() {
        let holes: Vec<bool> = (0..SIZE.0 * SIZE.1).map(|n| in_hole(n % SIZE.0, n / SIZE.0)).collect();
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
        continue_corrections(&holes, &from, &mut motion);
        for (k, y) in (0..MOTION).flat_map(|k| (0..SIZE.1).map(move |y| (k, y))) {
            for x in 0..SIZE.0 {
                let left = motion.at(k, x, y) - from.at(k, x, y) - correction(k, y);
                assert!(left.abs() < if in_hole(x, y) { 0.06 } else { 1e-12 }, "{k} {x} {y}: {left}");
                assert!(in_hole(x, y) || motion.at(k, x, y) == before.at(k, x, y));
            }
        }
    }
}
