//! Descent with a given flow, which competes with the flow that the frames alone give.

use super::comparison::Comparison;
use super::iteration::{JOINT_ITERATIONS, MIN_MOTION_DIFFERENCE};
use super::{DescentPlan, DescentResult, coarsened, site_counts};
use crate::flow::coarse_to_fine::data_term::MOTION;
use crate::flow::coarse_to_fine::planes::{Planes, SITE_SPACING};
use crate::flow::coarse_to_fine::pyramid::ComparedFrames;
use crate::flow::coarse_to_fine::workspace::Workspace;
use crate::flow::options::InitialFlow;
use crate::image::{Interpolation, fill_holes};
use crate::simd::SimdReal;
use crate::types::Frame;

/// Steps of the iteration that carries a pair's flow to the time midway between its frames.
const MIDWAY_STEPS: usize = 3;

impl DescentPlan {
    /// The `own` result on the coarse level, with the `given` flow where the frames agree better with it; and
    /// the number of iterations that both need together. `midway`: motion is estimated midway between two
    /// frames, the flow given at the first.
    pub fn with_given<T: SimdReal>(
        &self,
        workspace: &mut Workspace<T>,
        given: &InitialFlow,
        midway: bool,
        mut own: DescentResult<T>,
    ) -> (DescentResult<T>, usize) {
        let (all, levels) = (ComparedFrames::All, workspace.pyramid.levels());
        let first = self.coarse_level(workspace);
        let size = site_counts(levels[first].size);
        let mut start = workspace.space.planes(size.0, size.1, MOTION);
        sample(given, first, levels[first].size, midway, &mut start);
        let mut schedules = self.schedules(levels);
        schedules.truncate(first + 1);
        let refined = self.without_levels().descend(workspace, all, (start, None), (&schedules, first));
        let Workspace { pyramid, pool, space, .. } = &*workspace;
        let level = &pyramid.levels()[first];
        let (simd, residual_std, follows_majority) = (self.simd, own.residual_std, true);
        let comparison = Comparison { simd, level, compared: all, residual_std, follows_majority, pool, space };
        let is_used = comparison.replace_where_better(&mut own.motion, &refined.motion, MIN_MOTION_DIFFERENCE);
        if is_used {
            for (k, level) in (first + 1..).zip(&mut own.coarser) {
                space.keep(std::mem::replace(&mut level.motion, coarsened(workspace, &own.motion, first..=k)));
            }
        }
        refined.recycle(space);
        (own, if is_used { JOINT_ITERATIONS } else { 0 })
    }
}

/// The given flow on the sites of a level of `size` pixels, without Jacobian. Unknown flow, and flow longer
/// than the frame, continues that around it.
fn sample<T: SimdReal>(given: &InitialFlow, level: usize, size: (usize, usize), midway: bool, motion: &mut Planes<T>) {
    let farthest = (given.u.width() + given.u.height()) as f32;
    let known = [&given.u, &given.v].map(|plane| plane.map(|&v| if v.abs() <= farthest { v } else { f32::NAN }));
    let filled = [fill_holes(&known[0], None), fill_holes(&known[1], None)];
    let (width, height) = site_counts(size);
    motion.reshape(width, height, MOTION);
    motion.data_mut().fill(T::from_f64(0.0));
    let scale = f64::from(1u32 << level);
    let at = |plane: &Frame<f32>, x: f64, y: f64| {
        let inside = |at: f64, len: usize| at.clamp(0.0, (len - 1) as f64);
        f64::from(Interpolation::Bilinear.at(plane, inside(x, plane.width()), inside(y, plane.height())))
    };
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (column, row) = (SITE_SPACING * scale * x as f64, SITE_SPACING * scale * y as f64);
        let (mut u, mut v) = (0.0, 0.0);
        for _ in 0..if midway { MIDWAY_STEPS } else { 1 } {
            let back = if midway { 0.5 } else { 0.0 };
            let from = (column - back * u, row - back * v);
            (u, v) = (at(&filled[0], from.0, from.1), at(&filled[1], from.0, from.1));
        }
        motion.line_mut(0, y)[x] = T::from_f64(u / scale);
        motion.line_mut(1, y)[x] = T::from_f64(v / scale);
    }
}
