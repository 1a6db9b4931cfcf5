//! What moves the whole picture: the camera.

use super::layers::{grown, is_inside};
use super::nearby::nearby;
use super::patch::smooth;
use super::samples::{SCATTER_SAMPLES, SCENE_MARGIN, Samples, spread};
use crate::image::cubic_at;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use crate::track::gradient::noise::scatter_of;
use crate::types::{Frame, TargetBox};
use std::cell::OnceCell;

/// Pictures are reduced by these factors, one after the other.
const FACTORS: [usize; 3] = [4, 2, 1];
/// Gaussian after the reduction, reduced px.
const SIGMA: f64 = 1.0;
/// Shortest motion that is believed, px.
const MIN_MOTION: f64 = 0.05;
/// A frame and its reductions, made when they are first needed: the next frame needs them again.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct FramePyramid {
    pub frame: Frame<f64>,
    #[serde(skip)]
    quarter: OnceCell<Frame<f64>>,
    #[serde(skip)]
    half: OnceCell<Frame<f64>>,
}

impl FramePyramid {
    pub fn new(frame: Frame<f64>) -> Self {
        Self { frame, ..Self::default() }
    }

    fn reduced(&self, factor: usize) -> &Frame<f64> {
        match factor {
            1 => &self.frame,
            2 => self.half.get_or_init(|| reduced(&self.frame, 2)),
            _ => self.quarter.get_or_init(|| reduced(&self.frame, 4)),
        }
    }
}

/// Translation of the still scene between frames, px; zero unless it explains the frames better. `before`:
/// the previous one. Where the scene does not move as one: that around the target.
pub(super) fn camera_motion(
    previous: &FramePyramid,
    now: &FramePyramid,
    target: TargetBox,
    noise: f64,
    before: [f64; 2],
) -> [f64; 2] {
    let scene = scene_motion(previous, now, target, noise, before);
    if scene == [0.0; 2] && before == scene || !crate::ablation::keeps("gradient.nearby_motion") {
        return scene;
    }
    nearby((&previous.frame, &now.frame), target, (scene, before), noise)
}

fn scene_motion(
    previous: &FramePyramid,
    now: &FramePyramid,
    target: TargetBox,
    noise: f64,
    before: [f64; 2],
) -> [f64; 2] {
    let hidden = grown(target, (0.0, SCENE_MARGIN));
    let swinging = before != [0.0; 2];
    let mut motion = [0.0; 2];
    for factor in FACTORS {
        let (f, next) = (factor as f64, now.reduced(factor));
        let samples = Samples::of(previous.reduced(factor), &shrunk(hidden, factor));
        let reduced = |m: f64| m / f;
        let found = samples.refine(next, motion.map(reduced), noise);
        let finest = factor == 1;
        let believed = |m: [f64; 2]| m[0].hypot(m[1]) > MIN_MOTION / f && samples.explain(next, m);
        // Most cameras stand still: the coarsest pictures, which have the least noise, decide it already.
        let asked = finest || factor == FACTORS[0] && !swinging;
        match found.filter(|m| !asked || believed(*m)) {
            Some(found) => motion = found.map(|m| m * f),
            None if finest || !swinging => return [0.0; 2],
            None => {}
        }
    }
    motion
}

/// Scatter of the still scene's change since the previous frame, grey levels: robust standard deviation about
/// the median, which removes a uniform change of light.
pub(super) fn scatter(previous: &Frame<f64>, now: &Frame<f64>, target: TargetBox, motion: [f64; 2]) -> f64 {
    let hidden = grown(target, (0.0, SCENE_MARGIN));
    let still = motion == [0.0; 2];
    let change = |(x, y): (usize, usize)| {
        let place = [x as f64 + motion[0], y as f64 + motion[1]];
        let there = if still { now.get(x, y) } else { cubic_at(now, place[0], place[1]) };
        (still || is_inside(place, now)).then(|| there - previous.get(x, y))
    };
    scatter_of(spread(previous.size(), hidden, SCATTER_SAMPLES).filter_map(change).collect())
}

fn reduced(frame: &Frame<f64>, factor: usize) -> Frame<f64> {
    let (width, height) = (frame.width() / factor, frame.height() / factor);
    let mut small = Frame::filled(width, height, 0.0);
    dispatch(Level::detect(), Squares { frame, factor, small: &mut small });
    smooth(&small, SIGMA)
}

/// Means over squares: rows are added first, which lanes like.
struct Squares<'a> {
    frame: &'a Frame<f64>,
    factor: usize,
    small: &'a mut Frame<f64>,
}

impl Kernel<f64> for Squares<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let Self { frame, factor, small } = self;
        let mut line = vec![0.0; frame.width()];
        for y in 0..small.height() {
            line.copy_from_slice(frame.row(factor * y));
            for j in factor * y + 1..factor * (y + 1) {
                line.iter_mut().zip(frame.row(j)).for_each(|(sum, value)| *sum += value);
            }
            for (mean, square) in small.row_mut(y).iter_mut().zip(line.chunks_exact(factor)) {
                *mean = square.iter().sum::<f64>() / (factor * factor) as f64;
            }
        }
    }
}

fn shrunk(bounds: TargetBox, factor: usize) -> TargetBox {
    let f = factor as f64;
    // Centres of squares lie (f - 1) / 2 px after their first pixels.
    let to = |at: f64| (at - (f - 1.0) / 2.0) / f;
    TargetBox { x: to(bounds.x), y: to(bounds.y), width: bounds.width / f, height: bounds.height / f }
}
