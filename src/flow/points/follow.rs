//! One point followed from one pyramid into another.

use super::{options::PointFlowOptions, window::Window};
use crate::simd::Lanes;
use crate::types::Frame;

/// The flow of `point` (x, y) from the levels `before` to the levels `after`, px; `None` if the point is
/// lost.
///
/// Starts from the flow `guess` at the coarsest level. A level at which the window has too little structure,
/// touches bad pixels or leaves the picture is passed over, except for the full size, where the point is
/// lost.
#[inline(always)]
pub(super) fn follow<V: Lanes<Scalar = f32>>(
    window: &mut Window,
    (before, after): (&[Frame<f32>], &[Frame<f32>]),
    point: [f64; 2],
    guess: [f64; 2],
    options: &PointFlowOptions,
) -> Option<[f64; 2]> {
    let coarsest = before.len() - 1;
    let mut flow = guess.map(|g| g * 0.5f64.powi(coarsest as i32));
    for level in (0..=coarsest).rev() {
        let at = point.map(|p| p * 0.5f64.powi(level as i32));
        match refine::<V>(window, (&before[level], &after[level]), at, flow, options) {
            Some(refined) => flow = refined,
            None if level == 0 => return None,
            None => {}
        }
        if level > 0 {
            flow = flow.map(|f| 2.0 * f);
        }
    }
    Some(flow)
}

/// Whether `point` (x, y) lies in the picture: on the area of one of its pixels.
fn contains(frame: &Frame<f32>, [x, y]: [f64; 2]) -> bool {
    let within = |at: f64, size: usize| (-0.5..=size as f64 - 0.5).contains(&at);
    within(x, frame.width()) && within(y, frame.height())
}

/// Gradient steps at one level, from `flow` on. The slopes of the first frame serve for every step.
#[inline(always)]
fn refine<V: Lanes<Scalar = f32>>(
    window: &mut Window,
    (before, after): (&Frame<f32>, &Frame<f32>),
    point: [f64; 2],
    mut flow: [f64; 2],
    options: &PointFlowOptions,
) -> Option<[f64; 2]> {
    if !contains(before, point) {
        return None;
    }
    let tensor = window.take::<V>(before, point);
    let structure = tensor.smaller_eigenvalue();
    // Written so that NaN is refused, too.
    if !(structure > 0.0 && structure >= options.min_eigenvalue) {
        return None;
    }
    let mut last = [f64::INFINITY; 2];
    for _ in 0..options.max_steps {
        let centre = [point[0] + flow[0], point[1] + flow[1]];
        if !contains(after, centre) {
            return None;
        }
        let step = tensor.solve(window.compare::<V>(after, centre));
        if !(step[0].is_finite() && step[1].is_finite()) {
            return None;
        }
        flow = [flow[0] + step[0], flow[1] + step[1]];
        if step[0].hypot(step[1]) < options.min_step {
            break;
        }
        if (step[0] + last[0]).hypot(step[1] + last[1]) < options.min_step {
            // The steps go to and fro about a solution between them.
            flow = [flow[0] - 0.5 * step[0], flow[1] - 0.5 * step[1]];
            break;
        }
        last = step;
    }
    contains(after, [point[0] + flow[0], point[1] + flow[1]]).then_some(flow)
}
