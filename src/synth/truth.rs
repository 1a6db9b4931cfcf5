//! The truth of whole frames, as flow fields.

use super::Scene;
use super::scene::{check_time, time_range};
use crate::error::{Error, Result, numbers};
use crate::parallel::for_each_band;
use crate::types::{AffineFlow, FieldLayout, FlowField, Interval, MOTION_NAMES, SamplingGrid, Status, Units};

/// Half the step of the central differences of displacements, px: errors are near 1e-9.
const STEP: f64 = 1e-3;

/// The truth of a frame as a field: velocity and Jacobian at time `t`; [`Status::Masked`] without.
///
/// # Errors
/// [`Error::Argument`] naming `t` where it is not finite.
pub fn truth(scene: &dyn Scene, t: f64) -> Result<FlowField<f64>> {
    field(scene, t, Interval::Instant, |x, y| scene.motion(x, y, t).map(AffineFlow::to_array))
}

/// The motion that two frames determine: the mean velocity, between the times `t + from` and `t + to`, of
/// the matter that is at each pixel at time `t`.
///
/// With `d(t1)` the displacement since time `t` the flow is `(d(t + to) - d(t + from)) / (to - from)`,
/// px/frame; the Jacobian is its derivative with respect to the place at time `t`, by central differences
/// (good to 1e-8 /frame). `(0, 1)` is the displacement from a frame to the next, `(-1, 1)` the mean of the
/// displacements since the last frame and to the next, `(-0.5, 0.5)` with `t` in the middle of two frames
/// what joins them. It differs from [`truth`] wherever paths are curved. [`Status::Masked`] and NaN where the
/// scene does not know.
///
/// # Errors
/// [`Error::Argument`] naming `between` where its times are equal, not finite or beyond
/// [`Scene::max_duration`], and `t` where it is not finite.
pub fn mean_truth(scene: &dyn Scene, t: f64, (from, to): (f64, f64)) -> Result<FlowField<f64>> {
    let is_followed = |time| check_time(scene, "between", time).is_ok();
    if !(is_followed(from) && is_followed(to) && from != to) {
        return Err(Error::argument("between", time_range(scene, "two different times"), numbers(&[from, to])));
    }
    let since = |x: f64, y: f64, duration: f64| {
        if duration == 0.0 { scene.motion(x, y, t).map(|_| (0.0, 0.0)) } else { scene.displacement(x, y, t, duration) }
    };
    let mean = |x: f64, y: f64| {
        let (before, after) = (since(x, y, from)?, since(x, y, to)?);
        Some(((after.0 - before.0) / (to - from), (after.1 - before.1) / (to - from)))
    };
    let interval = match (from, to) {
        (0.0, 1.0) => Interval::Forward,
        (-1.0, 1.0) => Interval::Central,
        _ => Interval::Instant,
    };
    field(scene, t, interval, |x, y| {
        let (u, v) = mean(x, y)?;
        let (right, left, below, above) =
            (mean(x + STEP, y)?, mean(x - STEP, y)?, mean(x, y + STEP)?, mean(x, y - STEP)?);
        let slope = |ahead: f64, behind: f64| (ahead - behind) / (2.0 * STEP);
        let m =
            [u, v, slope(right.0, left.0), slope(right.1, left.1), slope(below.0, above.0), slope(below.1, above.1)];
        m.iter().all(|value| value.is_finite()).then_some(m)
    })
}

/// The field whose motion at scene point `(x, y)` is `motion(x, y)`.
fn field(
    scene: &dyn Scene,
    t: f64,
    interval: Interval,
    motion: impl Fn(f64, f64) -> Option<[f64; 6]> + Sync,
) -> Result<FlowField<f64>> {
    if !t.is_finite() {
        return Err(Error::argument("t", "a finite time in frames", t));
    }
    let layout = FieldLayout {
        frame_size: scene.size(),
        sites: SamplingGrid::default(),
        model: "truth".into(),
        parameters: MOTION_NAMES.map(String::from).to_vec(),
        units: Units::default(),
        interval,
        frame_index: t.max(0.0).round() as usize,
        correlation_length: 0.0,
    };
    let mut field = FlowField::<f64>::empty(layout, false)?;
    let (n, width, origin) = (field.len(), field.width, scene.origin());
    let mut motions = vec![None; n];
    for_each_band(&mut motions, width, |_, rows, band| {
        for (row, motions) in rows.zip(band.chunks_exact_mut(width)) {
            for (column, here) in motions.iter_mut().enumerate() {
                *here = motion(origin.0 + column as f64, origin.1 + row as f64);
            }
        }
    });
    for (index, motion) in motions.into_iter().enumerate() {
        field.status[index] = if motion.is_some() { Status::Ok } else { Status::Masked };
        for (p, value) in motion.into_iter().flatten().enumerate() {
            field.motion[p * n + index] = value;
        }
    }
    Ok(field)
}
