//! Local flow refined by warping, (9), and from coarse pictures to fine ones.

use super::equations::Equations;
use super::kernels::{REACH, kernels_of};
use super::local_flow::LocalFlow;
use super::options::LocalFlowOptions;
use crate::image::Spline;
use crate::simd::Level;
use crate::track::gradient::noise::median;
use crate::types::Frame;

/// How flow is refined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// The single steps.
    pub local: LocalFlowOptions,
    /// Most steps at a level.
    pub steps: usize,
    /// Sides of the square windows that both frames are smoothed with, one level after the other, px; 1
    /// leaves them as they are.
    pub levels: [usize; 3],
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self { local: LocalFlowOptions::default(), steps: 6, levels: [9, 5, 1] }
    }
}

/// Side of the square that the median of the field is taken over between levels, px.
const MEDIAN: usize = 5;

/// Flow of single pixels from the first frame to the second, refined by warping with cubic splines (9)(10),
/// coarse to fine; motions up to about 3 px.
///
/// At a level a pixel goes on as long as the residual of its window strictly falls. Pixels without a solution
/// keep what the level before found.
pub fn refine_flow(first: &Frame<f64>, second: &Frame<f64>, options: &RefineOptions) -> LocalFlow {
    let (width, height) = first.size();
    let mut field = Frame::filled(width, height, [0.0; 2]);
    let mut accepted = Frame::filled(width, height, false);
    for (n, &side) in options.levels.iter().enumerate() {
        let (a, b) = (box_mean(first, side), box_mean(second, side));
        let window = options.local.window.max(if side > 1 { 2 * side + 1 } else { 0 });
        let local = LocalFlowOptions { window, ..options.local };
        accepted = refine_level(&a, &b, &local, options.steps, &mut field);
        if n + 1 < options.levels.len() {
            // Of the mean, the masks, the window, and of what the median takes from beyond.
            let margin = side / 2 + REACH + window / 2 + MEDIAN / 2;
            field = continued(&median_field(&field), margin + REACH);
        }
    }
    LocalFlow { flow: field, accepted }
}

/// Steps (9) at one level; returns which pixels were accepted at their last one.
fn refine_level(
    first: &Frame<f64>,
    second: &Frame<f64>,
    options: &LocalFlowOptions,
    steps: usize,
    field: &mut Frame<[f64; 2]>,
) -> Frame<bool> {
    let (width, height) = first.size();
    // Frames that are far apart differ by motion: their difference says nothing of noise.
    let (kernels, least) = (kernels_of(options.order), options.min_sigma);
    let mut best = Frame::filled(width, height, f64::INFINITY);
    let mut active = Frame::filled(width, height, true);
    let mut accepted = Frame::filled(width, height, false);
    let mut trial = field.clone();
    let second = Between::new(second);
    for step in 0..=steps {
        let equations = Equations::new(first, &second.warped(&trial), kernels, options.window);
        for at in 0..width * height {
            if !active.data()[at] {
                continue;
            }
            let residual = equations.residual(at);
            // Strictly: at a fixed point it would never fail (10).
            if residual >= best.data()[at] {
                active.data_mut()[at] = false;
                trial.data_mut()[at] = field.data()[at];
                continue;
            }
            (best.data_mut()[at], field.data_mut()[at]) = (residual, trial.data()[at]);
            let Some((delta, sound)) = equations.step(at, options, least).filter(|_| step < steps) else {
                continue;
            };
            accepted.data_mut()[at] = sound;
            if sound {
                let now = &mut trial.data_mut()[at];
                *now = [now[0] + delta[0], now[1] + delta[1]];
            }
        }
    }
    accepted
}

/// A frame that is read between its pixels: as a cubic spline, whose error is far below that of cubic
/// convolution on fine texture.
struct Between<'a> {
    frame: &'a Frame<f64>,
    spline: Spline<f64>,
    whole: bool,
}

impl<'a> Between<'a> {
    fn new(frame: &'a Frame<f64>) -> Self {
        let known: Vec<f64> = frame.data().iter().copied().filter(|v| v.is_finite()).collect();
        // What is not known must not spread over the spline.
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        let mut spline = Spline::default();
        spline.refill(Level::detect(), &frame.map(|v| if v.is_finite() { *v } else { mean }));
        Self { frame, spline, whole: known.len() == frame.data().len() }
    }

    /// `frame(p + flow(p))`; NaN beyond the border and where any of the sixteen pixels around is not known.
    fn warped(&self, field: &Frame<[f64; 2]>) -> Frame<f64> {
        let (width, height) = self.frame.size();
        let mut out = Frame::filled(width, height, f64::NAN);
        for y in 0..height {
            let along: Vec<f64> = field.row(y).iter().enumerate().map(|(x, w)| x as f64 + w[0]).collect();
            let down: Vec<f64> = field.row(y).iter().map(|w| y as f64 + w[1]).collect();
            self.spline.sample_row(Level::detect(), &along, &down, out.row_mut(y));
            for (value, (x, y)) in out.row_mut(y).iter_mut().zip(along.iter().zip(&down)) {
                if !self.is_known(*x, *y) {
                    *value = f64::NAN;
                }
            }
        }
        out
    }

    fn is_known(&self, x: f64, y: f64) -> bool {
        let (width, height) = self.frame.size();
        let inside = x >= 0.0 && y >= 0.0 && x <= width as f64 - 1.0 && y <= height as f64 - 1.0;
        let near = |at: f64, length: usize| (at as usize).saturating_sub(1)..(at as usize + 3).min(length);
        inside
            && (self.whole || near(y, height).all(|j| self.frame.row(j)[near(x, width)].iter().all(|v| v.is_finite())))
    }
}

/// The field goes on towards the border, where windows reach over it, as it is `margin` px from there: what
/// stayed at rest there would pull its neighbours back.
fn continued(field: &Frame<[f64; 2]>, margin: usize) -> Frame<[f64; 2]> {
    let (width, height) = field.size();
    if width <= 2 * margin || height <= 2 * margin {
        return field.clone();
    }
    let within = |at: usize, length: usize| at.clamp(margin, length - 1 - margin);
    Frame::from_fn(width, height, |x, y| field.get(within(x, width), within(y, height)))
}

/// Mean over a square of `side` px (odd); NaN where it reaches over the border.
fn box_mean(frame: &Frame<f64>, side: usize) -> Frame<f64> {
    if side <= 1 {
        return frame.clone();
    }
    let reach = side / 2;
    let (width, height) = frame.size();
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / side as f64;
    let inside = |at: usize, length: usize| at >= reach && at + reach < length;
    let along = Frame::from_fn(width, height, |x, y| {
        if inside(x, width) { mean(&mut frame.row(y)[x - reach..=x + reach].iter().copied()) } else { f64::NAN }
    });
    Frame::from_fn(width, height, |x, y| {
        if inside(y, height) { mean(&mut (y - reach..=y + reach).map(|j| along.get(x, j))) } else { f64::NAN }
    })
}

/// Median of each component over a square; beyond the border there is nothing.
fn median_field(field: &Frame<[f64; 2]>) -> Frame<[f64; 2]> {
    let reach = MEDIAN / 2;
    Frame::from_fn(field.width(), field.height(), |x, y| {
        let (columns, rows) = (
            x.saturating_sub(reach)..(x + reach + 1).min(field.width()),
            y.saturating_sub(reach)..(y + reach + 1).min(field.height()),
        );
        [0, 1].map(|k| {
            let mut values: Vec<f64> =
                rows.clone().flat_map(|j| field.row(j)[columns.clone()].iter().map(|w| w[k])).collect();
            median(&mut values)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(shift: [f64; 2]) -> Frame<f64> {
        Frame::from_fn(72, 64, |x, y| {
            let (x, y) = (x as f64 - shift[0], y as f64 - shift[1]);
            128.0 + 40.0 * (0.3 * x + 0.1 * y).sin() + 35.0 * (0.23 * y - 0.17 * x).cos()
        })
    }

    #[test]
    fn motions_up_to_three_pixels_are_found() {
        for shift in [[0.5, -0.25], [2.5, 1.0]] {
            let found = refine_flow(&texture([0.0; 2]), &texture(shift), &RefineOptions::default());
            for (x, y) in [(30, 30), (40, 25)] {
                let w = found.flow.get(x, y);
                assert!((w[0] - shift[0]).hypot(w[1] - shift[1]) < 0.01 * (1.0 + shift[0]), "{shift:?}: {w:?}");
                assert!(found.accepted.get(x, y), "{shift:?} {x} {y}");
            }
        }
    }

    #[test]
    fn frames_without_texture_stay_where_they_are() {
        let flat = Frame::filled(40, 40, 7.0);
        let found = refine_flow(&flat, &flat, &RefineOptions::default());
        assert!(found.flow.data().iter().all(|w| *w == [0.0; 2]) && found.accepted.data().iter().all(|a| !a));
    }
}
