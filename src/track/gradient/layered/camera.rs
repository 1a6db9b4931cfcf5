//! What moves and brightens the whole picture: the camera and the light.

use super::layers::{Background, grown, holds};
use super::patch::{cubic, smooth};
use crate::track::gradient::local_flow::{MAD, median, shifted};
use crate::types::{Frame, TargetBox};

/// Pictures are reduced by these factors, one after the other.
const FACTORS: [usize; 3] = [4, 2, 1];
/// Around the target nothing is used, px.
const AROUND: f64 = 14.0;
/// Gaussian after the reduction, reduced px.
const SIGMA: f64 = 1.0;
/// Steps at a level.
const STEPS: usize = 8;
/// Shortest motion that is believed, px.
const LEAST_MOTION: f64 = 0.05;
/// By how much the capped residual must fall.
const LESS: f64 = 0.9;
/// Pixels used at a level, at most.
const SAMPLES: usize = 4096;
/// Residual that all larger ones count as, grey levels.
const CAP: f64 = 25.0;
/// Smallest information of a step, grey^2/px^2 per pixel.
const LEAST_INFORMATION: f64 = 0.05;
/// Brightness ratios nearer to 1 are none.
const LEAST_LIGHT: f64 = 0.01;

/// Translation of the still scene from one frame to the next, px; zero unless it explains the frames better.
pub(super) fn camera_motion(previous: &Frame<f64>, frame: &Frame<f64>, target: TargetBox, noise: f64) -> [f64; 2] {
    let mut motion = [0.0; 2];
    for factor in FACTORS {
        let (a, b) = (reduced(previous, factor), reduced(frame, factor));
        let hidden = shrunk(grown(target, (0.0, AROUND)), factor);
        let Some(found) = refine(&a, &b, &hidden, motion.map(|m| m / factor as f64), noise) else { return [0.0; 2] };
        motion = found.map(|m| m * factor as f64);
        if factor == FACTORS[0] && motion[0].hypot(motion[1]) < LEAST_MOTION {
            return [0.0; 2];
        }
    }
    let hidden = grown(target, (0.0, AROUND));
    let residual = |motion: [f64; 2]| {
        let sizes: Vec<f64> = samples(previous, &hidden)
            .filter_map(|(x, y)| Some((read(frame, x, y, motion)? - previous.get(x, y)).abs().min(CAP)))
            .collect();
        sizes.iter().sum::<f64>() / sizes.len().max(1) as f64
    };
    let far = motion[0].hypot(motion[1]) > LEAST_MOTION;
    if far && residual(motion) < LESS * residual([0.0; 2]) { motion } else { [0.0; 2] }
}

/// Means over squares of `factor` px, then a Gaussian.
fn reduced(frame: &Frame<f64>, factor: usize) -> Frame<f64> {
    if factor == 1 {
        return frame.clone();
    }
    let size = [frame.width() / factor, frame.height() / factor];
    let small = Frame::from_fn(size[0], size[1], |x, y| {
        let rows = factor * y..factor * (y + 1);
        let sum: f64 = rows.map(|j| frame.row(j)[factor * x..factor * (x + 1)].iter().sum::<f64>()).sum();
        sum / (factor * factor) as f64
    });
    smooth(&small, SIGMA)
}

fn shrunk(bounds: TargetBox, factor: usize) -> TargetBox {
    let f = factor as f64;
    // Centres of squares lie (f - 1) / 2 px after their first pixels.
    let to = |at: f64| (at - (f - 1.0) / 2.0) / f;
    TargetBox { x: to(bounds.x), y: to(bounds.y), width: bounds.width / f, height: bounds.height / f }
}

/// Pixels outside the box, two from the border, spread evenly.
fn samples(frame: &Frame<f64>, hidden: &TargetBox) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = frame.size();
    let step = ((width * height) as f64 / SAMPLES as f64).sqrt().ceil().max(1.0) as usize;
    let hidden = *hidden;
    (2..height.saturating_sub(2)).step_by(step).flat_map(move |y| {
        (2..width.saturating_sub(2)).step_by(step).filter(move |x| !holds(&hidden, *x, y)).map(move |x| (x, y))
    })
}

/// The frame at a moved pixel, if that is in it.
fn read(frame: &Frame<f64>, x: usize, y: usize, motion: [f64; 2]) -> Option<f64> {
    let (x, y) = (x as f64 + motion[0], y as f64 + motion[1]);
    let inside = x >= 0.0 && y >= 0.0 && x <= frame.width() as f64 - 1.0 && y <= frame.height() as f64 - 1.0;
    inside.then(|| cubic(frame, x, y))
}

/// Gradient steps on all samples (5); `None` where the scene has no texture.
fn refine(a: &Frame<f64>, b: &Frame<f64>, hidden: &TargetBox, mut motion: [f64; 2], noise: f64) -> Option<[f64; 2]> {
    for _ in 0..STEPS {
        let rows: Vec<[f64; 3]> = samples(a, hidden)
            .filter_map(|(x, y)| {
                let gradient = [0.5 * (a.get(x + 1, y) - a.get(x - 1, y)), 0.5 * (a.get(x, y + 1) - a.get(x, y - 1))];
                Some([gradient[0], gradient[1], read(b, x, y, motion)? - a.get(x, y)])
            })
            .collect();
        let mut sizes: Vec<f64> = rows.iter().map(|row| row[2].abs()).collect();
        let s = (MAD * median(&mut sizes)).max(noise);
        let mut sums = [0.0; 5];
        for [gx, gy, r] in &rows {
            let weight = (1.0 + (r / (3.0 * s)).powi(2)).powi(-2);
            for (sum, product) in sums.iter_mut().zip([gx * gx, gx * gy, gy * gy, gx * r, gy * r]) {
                *sum += weight * product;
            }
        }
        let [xx, xy, yy, xr, yr] = sums;
        let determinant = xx * yy - xy * xy;
        let least = (LEAST_INFORMATION * rows.len() as f64).powi(2);
        if determinant.is_nan() || determinant <= least {
            return None;
        }
        let step = [-(yy * xr - xy * yr) / determinant, -(xx * yr - xy * xr) / determinant];
        motion = [motion[0] + step[0], motion[1] + step[1]];
        if step[0].hypot(step[1]) < 0.005 {
            break;
        }
    }
    motion.iter().all(|m| m.abs() < a.width().max(a.height()) as f64 / 4.0).then_some(motion)
}

/// Brightness of the frame over that of the background, where both are known: a robust ratio; 1 unless it explains the frame better.
pub(super) fn light(frame: &Frame<f64>, background: &Background, target: TargetBox) -> f64 {
    let hidden = grown(target, (0.0, AROUND));
    let pairs: Vec<[f64; 2]> = samples(frame, &hidden)
        .filter(|(x, y)| background.known.get(*x, *y))
        .map(|(x, y)| [frame.get(x, y), background.picture.get(x, y)])
        .collect();
    let mut ratios: Vec<f64> = pairs.iter().filter(|[_, b]| *b > 1.0).map(|[e, b]| e / b).collect();
    if ratios.is_empty() {
        return 1.0;
    }
    let ratio = median(&mut ratios);
    if !(0.1..10.0).contains(&ratio) || (ratio - 1.0).abs() < LEAST_LIGHT {
        return 1.0;
    }
    let residual = |ratio: f64| pairs.iter().map(|[e, b]| (e / ratio - b).abs().min(CAP)).sum::<f64>();
    if residual(ratio) < LESS * residual(1.0) { ratio } else { 1.0 }
}

impl Background {
    /// The scene moved by so many px in the picture.
    pub(super) fn moved(&mut self, by: [f64; 2], frame: &Frame<f64>) {
        let back = by.map(|b| -b);
        let picture = shifted(&self.picture, back);
        let known = Frame::from_fn(self.known.width(), self.known.height(), |x, y| {
            let from = [x as f64 + back[0], y as f64 + back[1]];
            let inside = (0..2).all(|k| from[k] >= 0.0 && from[k] <= [frame.width(), frame.height()][k] as f64 - 1.0);
            inside && self.is_known(from) && picture.get(x, y).is_finite()
        });
        // What comes into view is taken as it is seen, but does not count as known.
        let data = picture.data().iter().zip(frame.data());
        let data = data.map(|(b, e)| if b.is_finite() { *b } else { *e }).collect();
        self.picture = Frame::new(frame.width(), frame.height(), data).unwrap_or_default();
        self.known = known;
    }
}
