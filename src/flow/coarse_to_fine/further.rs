//! What a level found, refined before the next finer one begins with it.

use super::data::{MOTION, summary};
use super::grid::Planes;
use super::memory::Space;
use super::refine::{Evidence, Options, refine};
use crate::simd::{Level, SimdReal};

/// Refinement that moves a site this far, px of the level, counts half: it takes noise away, while what it would move by more is a small object's own motion.
const CLOSE: f64 = 0.35;

/// Refines the `motion` of a level, given the `data` it was coupled with, for a finer one to begin with.
///
/// Each site goes the share `1 / (1 + (d / c)^4)` of the way `d` to its refined motion, `c` = 0.35 px.
pub(super) fn refine_further<T: SimdReal>(simd: Level, space: &Space<T>, motion: &mut Planes<T>, data: &Planes<T>) {
    let data = summary(space, data);
    let (refined, evidence) = refine(simd, space, &Options::further(), motion, &data);
    draw_near(motion, &refined);
    evidence.into_iter().flat_map(Evidence::into_planes).chain([data, refined]).for_each(|planes| space.keep(planes));
}

/// Moves `motion` towards what is `refined`, the less the further that is.
fn draw_near<T: SimdReal>(motion: &mut Planes<T>, refined: &Planes<T>) {
    let (one, scale) = (T::from_f64(1.0), T::from_f64(CLOSE.powi(-2)));
    let (width, height) = (motion.width, motion.height);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let [u, v] = [0, 1].map(|k| refined.at(k, x, y) - motion.at(k, x, y));
        let ratio = (u * u + v * v) * scale;
        let share = one / (one + ratio * ratio);
        for k in 0..MOTION {
            let value = &mut motion.line_mut(k, y)[x];
            *value += share * (refined.at(k, x, y) - *value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sites_go_to_near_motion_and_stay_before_far_one() {
        let (mut motion, mut refined) = (Planes::<f64>::new(3, 2, MOTION), Planes::<f64>::new(3, 2, MOTION + 2));
        for (x, u) in [0.01, CLOSE, 3.0].into_iter().enumerate() {
            refined.line_mut(0, 1)[x] = u;
            refined.line_mut(5, 1)[x] = 1.0;
        }
        draw_near(&mut motion, &refined);
        let [near, half, far] = [0, 1, 2].map(|x| motion.at(5, x, 1));
        assert!(near > 0.999_99 && (half - 0.5).abs() < 1e-12 && far < 2e-4, "{near} {half} {far}");
        assert_eq!(motion.at(0, 1, 1), half * CLOSE);
        assert!((0..3).all(|x| motion.at(0, x, 0) == 0.0));
    }
}
