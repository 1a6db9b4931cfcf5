//! What brightens the whole picture: the light, and a camera's black level.

use super::layers::{Background, grown};
use super::samples::{MAX_RESIDUAL, MAX_RESIDUAL_RATIO, SCENE_MARGIN, spread};
use crate::math::median;
use crate::types::{Frame, TargetBox};

/// Pixels that the light is measured on, at most.
const LIGHT_SAMPLES: usize = 1024;
/// Brightness ratios nearer to 1 are none.
const MIN_GAIN_CHANGE: f64 = 0.01;
/// Least jump of the whole scene's level that is taken for one, grey levels.
const MIN_LEVEL_JUMP: f64 = 64.0;

/// What the light made of the scene's brightness b: it is seen as `gain b + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Light {
    pub gain: f64,
    /// Grey levels.
    pub offset: f64,
}

impl Light {
    /// That of the first frame.
    pub const USUAL: Self = Self { gain: 1.0, offset: 0.0 };

    /// The brightness that it would have been in the usual light.
    #[inline(always)]
    pub fn undone(self, seen: f64) -> f64 {
        (seen - self.offset) / self.gain
    }
}

/// The light of the frame against that of the background, where both are known: a robust ratio where that
/// explains the frame better, or else a jump of the level, which no light makes but some cameras do.
pub(super) fn light(frame: &Frame<f64>, background: &Background, target: TargetBox) -> Light {
    let hidden = grown(target, (0.0, SCENE_MARGIN));
    let pairs: Vec<[f64; 2]> = spread(frame.size(), hidden, LIGHT_SAMPLES)
        .filter(|(x, y)| background.known.get(*x, *y))
        .map(|(x, y)| [frame.get(x, y), background.picture.get(x, y)])
        .collect();
    let residual =
        |light: Light| pairs.iter().map(|[e, b]| (light.undone(*e) - b).abs().min(MAX_RESIDUAL)).sum::<f64>();
    let better = |light: Light, than: Light| residual(light) < MAX_RESIDUAL_RATIO * residual(than);
    let mut ratios: Vec<f64> = pairs.iter().filter(|[_, b]| *b > 1.0).map(|[e, b]| e / b).collect();
    let gain = median(&mut ratios).unwrap_or(0.0);
    let possible = (0.1..10.0).contains(&gain) && (gain - 1.0).abs() >= MIN_GAIN_CHANGE;
    let brighter = Light { gain, ..Light::USUAL };
    let found = if crate::ablation::keeps("gradient.light_gain") && possible && better(brighter, Light::USUAL) {
        brighter
    } else {
        Light::USUAL
    };
    let mut differences: Vec<f64> = pairs.iter().map(|[e, b]| e - b).collect();
    let jumped = Light { offset: median(&mut differences).unwrap_or(0.0), ..Light::USUAL };
    if crate::ablation::keeps("gradient.light_offset") && jumped.offset.abs() > MIN_LEVEL_JUMP && better(jumped, found)
    {
        jumped
    } else {
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_is_distinguished_from_a_gain_and_small_ones_are_left_alone() {
        let still = Frame::from_fn(64, 48, |x, y| 60.0 + ((37 * x + 11 * y) % 80) as f64);
        let background = Background::new(&still, TargetBox::about([-1e6; 2], 0.0, 0.0));
        let told = |change: fn(f64) -> f64| {
            let seen = Frame::from_fn(64, 48, |x, y| change(still.get(x, y)));
            light(&seen, &background, TargetBox::about([20.0, 20.0], 5.0, 5.0))
        };
        assert_eq!(told(|b| b), Light::USUAL);
        assert_eq!(told(|b| b + 5000.0), Light { gain: 1.0, offset: 5000.0 });
        let dim = told(|b| 0.6 * b);
        assert!((dim.gain - 0.6).abs() < 1e-12 && dim.offset == 0.0);
        assert_eq!(told(|b| b + 20.0).offset, 0.0);
    }
}
