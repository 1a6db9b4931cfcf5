//! Brightness of one step beside that of the next: what another exposure does to all of a picture alike.
//!
//! Motion is found from brightness that stays; a hundredth less of it is a fiftieth of a pixel of false
//! motion, a fifth less is worse than none. Both cameras of a pair are exposed alike, so disparities do not
//! suffer.

use super::clusters::Clusters;
use super::lucas_kanade::PlaneMotion;
use crate::image::Interpolation;
use crate::math::median;
use crate::types::Frame;

/// Grey levels at which exposures are compared.
const COMPARED: [f64; 2] = [64.0, 192.0];
/// Exposures that differ by less, grey levels, are one: the noise of what is measured.
const ALIKE: f64 = 0.3;
/// Smaller changes of the shares of bright and dark pixels may be those of what the picture shows, grey
/// levels; motion is found well enough without knowing them.
const LARGE: f64 = 12.0;
/// Every how many pixels along x and y one is looked at for these shares.
const SAMPLED: usize = 4;
/// How many shares.
const SHARES: usize = 9;
/// Brightness at which cameras cut off, grey levels: what is beyond says nothing.
const CUT_OFF: std::ops::Range<f64> = 2.0..253.0;
/// Fewest pixels that tell an exposure, and least deviation of their brightness, grey levels.
const ENOUGH: (usize, f64) = (50, 4.0);
/// Most pixels of a cluster that are asked.
const ASKED: usize = 200;
/// Rounds of weighting.
const ROUNDS: usize = 8;
/// Mean absolute deviation from the median, to the deviation of a normal distribution.
const MAD: f64 = 1.4826;
/// Least deviation of brightness from what the exposure says, grey levels: frames are rounded.
const LEAST_DEVIATION: f64 = 0.3;

/// Brightness later, from that before: `gain * before + offset`, grey levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exposure {
    pub gain: f64,
    pub offset: f64,
}

impl Exposure {
    /// That of a camera which changes nothing.
    pub const SAME: Self = Self { gain: 1.0, offset: 0.0 };

    /// A picture as it would be under this exposure.
    pub fn applied(&self, frame: &Frame<f32>) -> Frame<f32> {
        let (gain, offset) = (self.gain as f32, self.offset as f32);
        frame.map(|value| gain * value + offset)
    }

    /// By how much it differs from another one, grey levels.
    fn difference(&self, other: &Self) -> f64 {
        let of = |level: f64| ((self.gain - other.gain) * level + self.offset - other.offset).abs();
        COMPARED.into_iter().map(of).fold(0.0, f64::max)
    }

    /// Whether it differs from another one by more than is measured by chance.
    pub fn differs(&self, other: &Self) -> bool {
        self.difference(other) > ALIKE
    }

    /// A large change that the shares of bright and dark pixels of both pictures tell before any motion is
    /// known: the line through their deciles, by medians of slopes. What comes into the picture changes the
    /// shares, too; so small changes are not told.
    pub fn large(before: &Frame<f32>, after: &Frame<f32>) -> Self {
        let told = || {
            let (x, y) = (deciles(before)?, deciles(after)?);
            let slope = |i: usize, j: usize| (x[j] - x[i] > 0.0).then(|| (y[j] - y[i]) / (x[j] - x[i]));
            let mut slopes: Vec<f64> =
                (0..SHARES).flat_map(|i| (i + 1..SHARES).filter_map(move |j| slope(i, j))).collect();
            let gain = median(&mut slopes).filter(|gain| *gain > 0.0)?;
            let offset = median(&mut std::array::from_fn::<f64, SHARES, _>(|i| y[i] - gain * x[i]))?;
            Some(Self { gain, offset })
        };
        told()
            .filter(|_| crate::ablation::keeps("stereo.exposure_levels"))
            .filter(|told| told.difference(&Self::SAME) > LARGE)
            .unwrap_or(Self::SAME)
    }

    /// The exposure that pixels show which are known to be the same: a line through their brightness before
    /// and after, among outliers. `None` where they are too few or all alike.
    fn of_pairs(pairs: &[[f64; 2]]) -> Option<Self> {
        let inside = |pair: &&[f64; 2]| pair.iter().all(|value| CUT_OFF.contains(value));
        let pairs: Vec<[f64; 2]> = pairs.iter().filter(inside).copied().collect();
        if pairs.len() < ENOUGH.0 {
            return None;
        }
        let offset = median(&mut pairs.iter().map(|[x, y]| y - x).collect::<Vec<_>>())?;
        let mut line = Self { gain: 1.0, offset };
        for _ in 0..ROUNDS {
            let off = |[x, y]: &[f64; 2]| y - line.gain * x - line.offset;
            let spread = MAD * median(&mut pairs.iter().map(|pair| off(pair).abs()).collect::<Vec<_>>())?;
            let weight = |pair: &[f64; 2]| {
                let outlying = 1.0 + (off(pair) / (2.0 * spread.max(LEAST_DEVIATION))).powi(2);
                1.0 / (outlying * outlying)
            };
            line = weighted_line(&pairs, weight)?;
        }
        Some(line)
    }

    /// What the pixels of clusters show that move as found, in pictures smoothed alike.
    pub fn of_motions(
        clusters: &Clusters,
        planes: &[Option<PlaneMotion>],
        [before, after]: [&Frame<f32>; 2],
    ) -> Option<Self> {
        let mut pairs = Vec::new();
        for (pixels, plane) in clusters.pixels.iter().zip(planes) {
            let Some(plane) = plane else { continue };
            for &i in pixels.iter().step_by(pixels.len().div_ceil(ASKED).max(1)) {
                let [x, y, _] = clusters.points.at(i as usize);
                let [to_x, to_y] = plane.moved(x, y);
                let value = f64::from(before.get(x as usize, y as usize));
                pairs.push([value, f64::from(Interpolation::Bilinear.at(after, to_x, to_y))]);
            }
        }
        Self::of_pairs(&pairs)
    }
}

/// The line of least weighted squares of the distances from it: both pictures are equally noisy, and least
/// squares of the later brightness alone would tell too small a gain. `None` where what it goes through is
/// all alike.
fn weighted_line(pairs: &[[f64; 2]], weight: impl Fn(&[f64; 2]) -> f64) -> Option<Exposure> {
    let sum = |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(|pair| weight(pair) * of(pair)).sum::<f64>();
    let all = sum(&|_| 1.0);
    let (x, y) = (sum(&|pair| pair[0]) / all, sum(&|pair| pair[1]) / all);
    let of_x = sum(&|pair| (pair[0] - x).powi(2)) / all;
    let of_y = sum(&|pair| (pair[1] - y).powi(2)) / all;
    let both = sum(&|pair| (pair[0] - x) * (pair[1] - y)) / all;
    if both.is_nan() || both <= 0.0 || of_x < ENOUGH.1.powi(2) {
        return None;
    }
    let gain = (of_y - of_x + (of_y - of_x).hypot(2.0 * both)) / (2.0 * both);
    Some(Exposure { gain, offset: y - gain * x })
}

/// Brightness below which one to nine tenths of a picture's pixels are; `None` of one that shows hardly
/// anything.
fn deciles(frame: &Frame<f32>) -> Option<[f64; SHARES]> {
    let rows = (0..frame.height()).step_by(SAMPLED).map(|y| frame.row(y));
    let mut values: Vec<f32> =
        rows.flat_map(|row| row.iter().step_by(SAMPLED).copied()).filter(|value| value.is_finite()).collect();
    if values.len() < ENOUGH.0 {
        return None;
    }
    values.sort_unstable_by(f32::total_cmp);
    let out: [f64; SHARES] = std::array::from_fn(|i| f64::from(values[(i + 1) * values.len() / (SHARES + 1)]));
    (out[SHARES - 1] - out[0] >= ENOUGH.1).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(told: Exposure, want: Exposure) -> bool {
        told.difference(&want) < 0.1
    }

    #[test]
    fn a_line_among_outliers_is_found() {
        let want = Exposure { gain: 0.9, offset: 4.0 };
        let pair = |i: usize| {
            let x = 40.0 + 1.7 * (i % 100) as f64;
            // A fifth shows something else.
            [x, if i.is_multiple_of(5) { 220.0 - 0.5 * x } else { 0.9 * x + 4.0 + (i as f64).sin() }]
        };
        let pairs: Vec<[f64; 2]> = (0..500).map(pair).collect();
        assert!(near(Exposure::of_pairs(&pairs).unwrap(), want), "{:?}", Exposure::of_pairs(&pairs));
        // What is cut off at white does not bend it.
        let cut: Vec<[f64; 2]> =
            (0..500).map(|i| [f64::from(i) / 2.0, (1.5 * f64::from(i) / 2.0).min(255.0)]).collect();
        assert!(near(Exposure::of_pairs(&cut).unwrap(), Exposure { gain: 1.5, offset: 0.0 }));
    }

    #[test]
    fn too_little_tells_nothing() {
        assert_eq!(Exposure::of_pairs(&[[100.0, 90.0]; 49]), None);
        assert_eq!(Exposure::of_pairs(&[[100.0, 90.0]; 500]), None);
        assert_eq!(Exposure::of_pairs(&[[f64::NAN; 2]; 500]), None);
        let (flat, waves) = (Frame::filled(64, 48, 90.0), Frame::from_fn(64, 48, |x, y| (3 * x + y) as f32));
        for (before, after) in [(&flat, &waves), (&waves, &flat), (&waves, &Frame::filled(64, 48, f32::NAN))] {
            assert_eq!(Exposure::large(before, after), Exposure::SAME);
        }
    }

    #[test]
    fn large_changes_are_seen_before_motion_and_small_ones_are_left() {
        let view = |shift: usize, gain: f32, offset: f32| {
            Frame::from_fn(160, 120, |x, y| gain * ((x + shift) * 7 % 90 + y) as f32 + offset)
        };
        let told = Exposure::large(&view(0, 1.0, 10.0), &view(5, 0.8, 10.0));
        assert!(told.difference(&Exposure { gain: 0.8, offset: 2.0 }) < 2.0, "{told:?}");
        assert_eq!(Exposure::large(&view(0, 1.0, 10.0), &view(5, 0.97, 10.0)), Exposure::SAME);
        assert!(Exposure { gain: 0.99, offset: 0.0 }.differs(&Exposure::SAME));
        assert!(!Exposure { gain: 0.999, offset: 0.1 }.differs(&Exposure::SAME));
        assert_eq!(Exposure { gain: 0.5, offset: 3.0 }.applied(&Frame::filled(2, 2, 8.0)).data(), [7.0; 4]);
    }
}
