//! What a frame says of the still scene first: light, camera motion, and whether it shows that scene.

use super::camera::{FramePyramid, camera_motion, scatter};
use super::layers::grown;
use super::learn;
use super::light::Light;
use super::samples::{SCATTER_SAMPLES, SCENE_MARGIN, spread};
use super::state::{MIN_NOISE, State};
use crate::track::gradient::{noise::scatter_of, options::CameraMotion};
use crate::types::{Frame, TargetBox};

/// Scatter of the still scene's change beyond which a frame is wild: times the noise, and grey levels.
const MAX_SCATTER: (f64, f64) = (6.0, 8.0);
/// Frames in a row that are passed over for that.
const MAX_WILD_FRAMES: usize = 10;

/// Contrast of the scene over that of the frame before, from which on down it is gone.
const MAX_CONTRAST_RATIO: f64 = 0.25;

/// Whether nothing of the scene is left in a frame before anything was measured. The noise is learned from
/// the first pair: it would hold all that such a frame differs by, and anything would look like the target.
pub(super) fn is_blank(state: &State, frame: &Frame<f64>) -> bool {
    if state.history.age > 0 {
        return false;
    }
    let even = |frame: &Frame<f64>| frame.data().windows(2).all(|pair| pair[0] == pair[1]);
    if even(frame) {
        return !even(&state.scene.previous.frame);
    }
    let hidden = state.reached(&state.motion.pose);
    let [before, now] = [&state.scene.previous.frame, frame].map(|frame| contrast(frame, hidden));
    now < MAX_CONTRAST_RATIO * before && before > MIN_NOISE && state.scene.gap <= MAX_WILD_FRAMES
}

pub(super) fn measure_camera_motion(state: &State, seen: &FramePyramid, bounds: TargetBox) -> [f64; 2] {
    let expected = state.scene.camera_velocity.map(|m| m * state.scene.gap as f64);
    match state.camera {
        CameraMotion::Auto => camera_motion(&state.scene.previous, seen, bounds, state.scene.noise, expected),
        CameraMotion::None => [0.0; 2],
    }
}

/// Whether a frame has little to do with the one before (too bright, or noise). It is skipped and the next
/// compared with the last good one, unless so many follow that the scene looks so now.
pub(super) fn is_wild(state: &mut State, frame: &Frame<f64>, bounds: TargetBox, motion: [f64; 2]) -> bool {
    if state.history.age == 0 {
        return false;
    }
    let changed = scatter(&state.scene.previous.frame, frame, bounds, motion);
    if changed <= MAX_SCATTER.0 * state.scene.noise + MAX_SCATTER.1 {
        return false;
    }
    let lasts = state.scene.gap > MAX_WILD_FRAMES;
    if lasts {
        // Differences have the noise of two frames.
        state.scene.noise = state.scene.noise.max(changed / std::f64::consts::SQRT_2);
    }
    !lasts
}

/// The frame, so bright as if the light were what it was at first.
pub(super) fn normalize_light(state: &mut State, frame: &Frame<f64>, light: Light) -> Frame<f64> {
    let mut data = std::mem::take(&mut state.scene.buffer);
    data.clear();
    if light == Light::USUAL {
        data.extend_from_slice(frame.data());
    } else {
        data.extend(frame.data().iter().map(|value| light.undone(*value)));
    }
    Frame::new(frame.width(), frame.height(), data).unwrap_or_default()
}

pub(super) fn follow_camera(state: &mut State, motion: [f64; 2], frame: &Frame<f64>) {
    if motion == [0.0; 2] {
        state.scene.noise = learn::learn_noise(
            (state.history.age > 0).then_some(state.scene.noise),
            &state.scene.previous.frame,
            frame,
        );
        return;
    }
    state.background.moved(motion, frame);
    shift(state, motion);
}

pub(super) fn shift(state: &mut State, motion: [f64; 2]) {
    state.motion.filter.shift(motion);
    let shifted = |at: [f64; 2]| [at[0] + motion[0], at[1] + motion[1]];
    state.motion.last_position = state.motion.last_position.map(shifted);
    state.motion.pose.p = shifted(state.motion.pose.p);
}

/// Contrast of the still scene, grey levels: the deviation of its brightness from the median, robustly.
fn contrast(frame: &Frame<f64>, target: TargetBox) -> f64 {
    let hidden = grown(target, (0.0, SCENE_MARGIN));
    scatter_of(spread(frame.size(), hidden, SCATTER_SAMPLES).map(|(x, y)| frame.get(x, y)).collect())
}
