//! Intermediate refinement: a level's motion is refined before the next finer level starts from it.

use crate::flow::coarse_to_fine::data_term::{MOTION, summary};
use crate::flow::coarse_to_fine::plane_pool::PlanePool;
use crate::flow::coarse_to_fine::planes::{LEFT, Planes};
use crate::flow::coarse_to_fine::refine::{RefineOptions, WindowStatistics, refine};
use crate::parallel::for_each_band;
use crate::simd::{Kernel, Lanes, Level, SimdReal, dispatch};
use std::ops::Range;

/// Distance, px of the level, at which refinement has half its weight: smaller changes remove noise, larger
/// ones would remove the own motion of small objects.
const HALF_WEIGHT_DISTANCE: f64 = 0.35;

/// Refines the `motion` of a level, given its `data` term: a site moves by the share `1 / (1 + (d / c)^4)` of
/// the distance `d` to its refined motion, `c` = 0.35 px.
pub(super) fn refine_intermediate<T: SimdReal>(
    simd: Level,
    space: &PlanePool<T>,
    motion: &mut Planes<T>,
    data: &Planes<T>,
) {
    let data = summary(space, data);
    let (refined, statistics) = refine(simd, space, &RefineOptions::intermediate(), motion, &data);
    blend_towards(simd, motion, &refined);
    statistics
        .into_iter()
        .flat_map(WindowStatistics::into_planes)
        .chain([data, refined])
        .for_each(|planes| space.keep(planes));
}

fn blend_towards<T: SimdReal>(simd: Level, motion: &mut Planes<T>, refined: &Planes<T>) {
    let (len, stride) = (motion.row_len(), motion.stride());
    for_each_band(motion.data_mut(), len, |_, rows, out| dispatch(simd, Blend { refined, rows, out, stride }));
}

struct Blend<'a, T> {
    refined: &'a Planes<T>,
    rows: Range<usize>,
    out: &'a mut [T],
    stride: usize,
}

impl<T: SimdReal> Kernel<T> for Blend<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = T>>(self) {
        let Self { refined, rows, out, stride } = self;
        let (one, scale) = (V::constant(1.0), V::constant(HALF_WEIGHT_DISTANCE.powi(-2)));
        for (y, own) in rows.zip(out.chunks_exact_mut(MOTION * stride)) {
            let goal = refined.row(y);
            for i in (LEFT..stride - LEFT).step_by(V::LANES) {
                let difference =
                    |own: &[T], k: usize| V::load(&goal[k * stride + i..]) - V::load(&own[k * stride + i..]);
                let (u, v) = (difference(own, 0), difference(own, 1));
                let ratio = u.mul_add(u, v * v) * scale;
                let share = one / ratio.mul_add(ratio, one);
                for k in 0..MOTION {
                    let value = difference(own, k).mul_add(share, V::load(&own[k * stride + i..]));
                    value.store(&mut own[k * stride + i..]);
                }
            }
        }
    }
}
