//! What every scene has: brightness, flow and Jacobian at any point and time.

use crate::error::{Error, Result};
use crate::parallel::for_each_band;
use crate::types::{AffineFlow, Frame};

/// A moving picture with exact truth.
///
/// Coordinates `(x, y)` are scene coordinates in px, x right and y down; pixel `(column, row)` of a frame
/// lies at `origin + (column, row)`. Time `t` is in frames.
pub trait Scene: Send + Sync {
    /// `(width, height)` of its frames, px.
    fn size(&self) -> (usize, usize);

    /// Scene coordinates of pixel (0, 0).
    fn origin(&self) -> (f64, f64) {
        (0.0, 0.0)
    }

    /// Brightness at a point and time, grey levels of an 8-bit scale (not quantised, not clipped).
    fn brightness(&self, x: f64, y: f64, t: f64) -> f64;

    /// Velocity and its Jacobian at a point and time, px/frame and 1/frame; `None` at motion edges.
    fn motion(&self, x: f64, y: f64, t: f64) -> Option<AffineFlow<f64>>;

    /// How far the matter at `(x, y)` at time `t` has gone `duration` frames later, px. It differs from
    /// `duration` times the velocity wherever paths are curved. `None` where the scene does not know.
    fn displacement(&self, x: f64, y: f64, t: f64, duration: f64) -> Option<(f64, f64)> {
        let _ = (x, y, t, duration);
        None
    }

    /// Longest time, frames, between 0 and the time of a frame, and longest duration of a displacement.
    fn max_duration(&self) -> f64 {
        f64::INFINITY
    }

    /// The frame of time `t`; rows are spread over the threads of the current pool.
    fn frame(&self, t: f64) -> Frame<f64> {
        let origin = self.origin();
        render(self.size(), |column, row| self.brightness(origin.0 + column as f64, origin.1 + row as f64, t))
    }
}

/// Refuses a time or a duration that is not finite or is too long for the paths of `scene`.
///
/// # Errors
/// [`Error::Argument`] naming `argument`.
pub fn check_time(scene: &dyn Scene, argument: &'static str, t: f64) -> Result<()> {
    if t.is_finite() && t.abs() <= scene.max_duration() {
        return Ok(());
    }
    Err(Error::argument(argument, time_range(scene, "a time"), t))
}

/// The times that `check_time` accepts, in words.
pub(super) fn time_range(scene: &dyn Scene, times: &str) -> String {
    let longest = scene.max_duration();
    let range = if longest.is_finite() { format!("within {longest} of 0") } else { "finite".into() };
    format!("{times} in frames, {range}")
}

/// A frame of `value(column, row)`, row bands in parallel.
pub(super) fn render((width, height): (usize, usize), value: impl Fn(usize, usize) -> f64 + Sync) -> Frame<f64> {
    let mut frame = Frame::filled(width, height, 0.0);
    for_each_band(frame.data_mut(), width, |_, rows, band| {
        for (row, samples) in rows.zip(band.chunks_exact_mut(width)) {
            for (column, sample) in samples.iter_mut().enumerate() {
                *sample = value(column, row);
            }
        }
    });
    frame
}
