//! Change of exposure between two steps: gain and offset of brightness, common to the whole view.
//!
//! Lucas-Kanade assumes constant brightness: a gain error of 0.01 biases the motion by about 0.02 px. Both
//! views of a pair have the same exposure, so disparities are not affected.

use super::{cluster_motion::PlaneMotion, clusters::Clusters};
use crate::image::Interpolation;
use crate::math::{geman_mcclure, median, robust_std};
use crate::types::Frame;

/// Grey levels at which two exposures are compared.
const COMPARED_LEVELS: [f64; 2] = [64.0, 192.0];
/// Exposures that differ by less, grey levels, count as equal: noise of the estimate.
const ALIKE: f64 = 0.3;
/// Threshold of the change of the deciles, grey levels: smaller ones may be due to what enters the view.
const MIN_LARGE_CHANGE: f64 = 12.0;
/// Step of the pixels along x and y from which deciles are taken.
const SAMPLE_STEP: usize = 4;
/// Number of quantiles: deciles without the ends.
const QUANTILES: usize = 9;
/// Unsaturated brightness, grey levels.
const UNSATURATED: std::ops::Range<f64> = 2.0..253.0;
/// Smallest number of pixels for an estimate, and smallest standard deviation, grey levels.
const MIN_SAMPLES_AND_STD: (usize, f64) = (50, 4.0);
/// Largest number of pixels taken from a cluster.
const MAX_CLUSTER_SAMPLES: usize = 200;
/// Iterations of the weighted fit.
const ROUNDS: usize = 8;
/// Floor of the standard deviation of the residual, grey levels: frames are rounded.
const MIN_NOISE_STD: f64 = 0.3;

/// Brightness of the later view: `gain * before + offset`, grey levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exposure {
    pub gain: f64,
    pub offset: f64,
}

impl Exposure {
    /// No change.
    pub const SAME: Self = Self { gain: 1.0, offset: 0.0 };

    /// The view under this exposure.
    pub fn applied(&self, frame: &Frame<f32>) -> Frame<f32> {
        let (gain, offset) = (self.gain as f32, self.offset as f32);
        frame.map(|value| gain * value + offset)
    }

    fn difference(&self, other: &Self) -> f64 {
        let of = |level: f64| ((self.gain - other.gain) * level + self.offset - other.offset).abs();
        COMPARED_LEVELS.into_iter().map(of).fold(0.0, f64::max)
    }

    /// Whether the difference exceeds the noise of the estimate.
    pub fn differs(&self, other: &Self) -> bool {
        self.difference(other) > ALIKE
    }

    /// A large change, estimated from the deciles of both views before any motion is known: line by medians
    /// of slopes (Theil-Sen). Small changes are ignored, since what enters the view shifts the deciles too.
    pub fn large(before: &Frame<f32>, after: &Frame<f32>) -> Self {
        let fitted = || {
            let (x, y) = (deciles(before)?, deciles(after)?);
            let slope = |i: usize, j: usize| (x[j] - x[i] > 0.0).then(|| (y[j] - y[i]) / (x[j] - x[i]));
            let mut slopes: Vec<f64> =
                (0..QUANTILES).flat_map(|i| (i + 1..QUANTILES).filter_map(move |j| slope(i, j))).collect();
            let gain = median(&mut slopes).filter(|gain| *gain > 0.0)?;
            let offset = median(&mut std::array::from_fn::<f64, QUANTILES, _>(|i| y[i] - gain * x[i]))?;
            Some(Self { gain, offset })
        };
        fitted()
            .filter(|_| crate::ablation::keeps("stereo.exposure_levels"))
            .filter(|fitted| fitted.difference(&Self::SAME) > MIN_LARGE_CHANGE)
            .unwrap_or(Self::SAME)
    }

    /// Robust line through corresponding brightness; `None` for too few pixels or too little contrast.
    fn of_pairs(pairs: &[[f64; 2]]) -> Option<Self> {
        let inside = |pair: &&[f64; 2]| pair.iter().all(|value| UNSATURATED.contains(value));
        let pairs: Vec<[f64; 2]> = pairs.iter().filter(inside).copied().collect();
        if pairs.len() < MIN_SAMPLES_AND_STD.0 {
            return None;
        }
        let offset = median(&mut pairs.iter().map(|[x, y]| y - x).collect::<Vec<_>>())?;
        let mut line = Self { gain: 1.0, offset };
        for _ in 0..ROUNDS {
            let off = |[x, y]: &[f64; 2]| y - line.gain * x - line.offset;
            let spread = robust_std(&mut pairs.iter().map(|pair| off(pair).abs()).collect::<Vec<_>>())?;
            let weight = |pair: &[f64; 2]| geman_mcclure(off(pair), 2.0 * spread.max(MIN_NOISE_STD));
            line = weighted_line(&pairs, weight)?;
        }
        Some(line)
    }

    /// Estimates the exposure from the pixels of moved clusters, in views with the same smoothing.
    pub fn of_motions(
        clusters: &Clusters,
        planes: &[Option<PlaneMotion>],
        [before, after]: [&Frame<f32>; 2],
    ) -> Option<Self> {
        let mut pairs = Vec::new();
        for (pixels, plane) in clusters.pixels.iter().zip(planes) {
            let Some(plane) = plane else { continue };
            for &i in pixels.iter().step_by(pixels.len().div_ceil(MAX_CLUSTER_SAMPLES).max(1)) {
                let [x, y, _] = clusters.points.at(i as usize);
                let [to_x, to_y] = plane.moved(x, y);
                let value = f64::from(before.get(x as usize, y as usize));
                pairs.push([value, f64::from(Interpolation::Bilinear.at(after, to_x, to_y))]);
            }
        }
        Self::of_pairs(&pairs)
    }
}

/// Weighted total least squares line: both views are equally noisy, and ordinary least squares would
/// underestimate the gain. `None` without contrast.
fn weighted_line(pairs: &[[f64; 2]], weight: impl Fn(&[f64; 2]) -> f64) -> Option<Exposure> {
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(|pair| weight(pair) * of(pair)).sum::<f64>();
    let all = sum(&|_| 1.0);
    let (x, y) = (sum(&|pair| pair[0]) / all, sum(&|pair| pair[1]) / all);
    let of_x = sum(&|pair| (pair[0] - x).powi(2)) / all;
    let of_y = sum(&|pair| (pair[1] - y).powi(2)) / all;
    let both = sum(&|pair| (pair[0] - x) * (pair[1] - y)) / all;
    if both.is_nan() || both <= 0.0 || of_x < MIN_SAMPLES_AND_STD.1.powi(2) {
        return None;
    }
    let gain = (of_y - of_x + (of_y - of_x).hypot(2.0 * both)) / (2.0 * both);
    Some(Exposure { gain, offset: y - gain * x })
}

/// Deciles of the brightness; `None` for a view with too few finite pixels or too little contrast.
fn deciles(frame: &Frame<f32>) -> Option<[f64; QUANTILES]> {
    let rows = (0..frame.height()).step_by(SAMPLE_STEP).map(|y| frame.row(y));
    let mut values: Vec<f32> =
        rows.flat_map(|row| row.iter().step_by(SAMPLE_STEP).copied()).filter(|value| value.is_finite()).collect();
    if values.len() < MIN_SAMPLES_AND_STD.0 {
        return None;
    }
    values.sort_unstable_by(f32::total_cmp);
    let out: [f64; QUANTILES] = std::array::from_fn(|i| f64::from(values[(i + 1) * values.len() / (QUANTILES + 1)]));
    (out[QUANTILES - 1] - out[0] >= MIN_SAMPLES_AND_STD.1).then_some(out)
}
