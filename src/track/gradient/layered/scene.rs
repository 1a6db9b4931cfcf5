//! What a frame says of the still scene before the target is looked for: light, motion of the camera, and
//! whether it is of that scene at all.

use super::camera::{self, AROUND, SCATTER_SAMPLES, Seen, spread};
use super::find::{DOUBT, Finding};
use super::layers::grown;
use super::light::Light;
use super::{Layered, SURE, learn};
use crate::math::robust_std;
use crate::track::gradient::local_flow::median;
use crate::track::gradient::options::CameraMotion;
use crate::types::{Frame, TargetBox};

/// Scatter of what changes in the still scene beyond which a frame is wild: so many times the noise, and grey
/// levels.
const OUTLYING: (f64, f64) = (6.0, 8.0);
/// Frames in a row that are passed over for that.
const WILD_FOR: usize = 10;

/// Contrast of the scene over that of the frame before, from which on down it is gone.
const GONE: f64 = 0.25;

impl Layered {
    /// Whether nothing of the scene is left in a frame before anything was measured: black, or another even
    /// picture. What noise there is, is learnt from the first pair, and would be all that such a frame
    /// differs by, so that anything would look like the target. Even frames say nothing however many there
    /// are.
    pub(super) fn is_blank(&self, frame: &Frame<f64>) -> bool {
        if self.age > 0 {
            return false;
        }
        let even = |frame: &Frame<f64>| frame.data().windows(2).all(|pair| pair[0] == pair[1]);
        if even(frame) {
            return !even(&self.previous.frame);
        }
        let hidden = self.reached(&self.pose);
        let [before, now] = [&self.previous.frame, frame].map(|frame| contrast(frame, hidden));
        now < GONE * before && before > learn::LEAST_NOISE && self.gap <= WILD_FOR
    }

    /// How far the scene moved since the last frame that said something.
    pub(super) fn camera_motion(&self, seen: &Seen, bounds: TargetBox) -> [f64; 2] {
        let expected = self.swung.map(|m| m * self.gap as f64);
        match self.camera {
            CameraMotion::Auto => camera::camera_motion(&self.previous, seen, bounds, self.noise, expected),
            CameraMotion::None => [0.0; 2],
        }
    }

    /// Whether a frame has little to do with the one before: far too bright, or noise. Nothing can be learnt
    /// from it, and the next one is compared with the last that was not so; unless there are so many of them
    /// that this is how the scene looks now.
    pub(super) fn is_wild(&mut self, frame: &Frame<f64>, bounds: TargetBox, motion: [f64; 2]) -> bool {
        if self.age == 0 {
            return false;
        }
        let scatter = camera::scatter(&self.previous.frame, frame, bounds, motion);
        if scatter <= OUTLYING.0 * self.noise + OUTLYING.1 {
            return false;
        }
        let lasts = self.gap > WILD_FOR;
        if lasts {
            // Differences have the noise of two frames.
            self.noise = self.noise.max(scatter / std::f64::consts::SQRT_2);
        }
        !lasts
    }

    /// The frame, so bright as if the light were what it was at first.
    pub(super) fn in_usual_light(&mut self, frame: &Frame<f64>, light: Light) -> Frame<f64> {
        let mut data = std::mem::take(&mut self.spare);
        data.clear();
        if light == Light::USUAL {
            data.extend_from_slice(frame.data());
        } else {
            data.extend(frame.data().iter().map(|value| light.undone(*value)));
        }
        Frame::new(frame.width(), frame.height(), data).unwrap_or_default()
    }

    pub(super) fn follow_camera(&mut self, motion: [f64; 2], frame: &Frame<f64>) {
        if motion == [0.0; 2] {
            self.noise = learn::learn_noise((self.age > 0).then_some(self.noise), &self.previous.frame, frame);
            return;
        }
        self.background.moved(motion, frame);
        self.shift(motion);
    }

    /// Usually the target stands in the scene and goes with it when the camera moves. It may also be that the
    /// camera follows the target: where one of the two is doubtful, the other is tried.
    pub(super) fn find_wherever_it_rides(&mut self, frame: &Frame<f64>, motion: [f64; 2]) -> Option<Finding> {
        let against = motion.map(|m| -m);
        if motion != [0.0; 2] && self.with_camera {
            self.shift(against);
        }
        let first = self.find(frame);
        let nis = |found: &Option<Finding>| found.map_or(f64::INFINITY, |f| if f.occluded { DOUBT } else { f.nis });
        if motion == [0.0; 2] || nis(&first) < SURE {
            return first;
        }
        let (there, back) = if self.with_camera { (motion, against) } else { (against, motion) };
        self.shift(there);
        let second = self.find(frame);
        if nis(&second) < nis(&first) {
            self.with_camera = !self.with_camera;
            return second;
        }
        self.shift(back);
        first
    }

    fn shift(&mut self, motion: [f64; 2]) {
        self.filter.shift(motion);
        let shifted = |at: [f64; 2]| [at[0] + motion[0], at[1] + motion[1]];
        self.before = self.before.map(shifted);
        self.pose.p = shifted(self.pose.p);
    }
}

/// Contrast of the still scene, grey levels: the deviation of its brightness from the median, robustly.
fn contrast(frame: &Frame<f64>, target: TargetBox) -> f64 {
    let hidden = grown(target, (0.0, AROUND));
    let mut off: Vec<f64> = spread(frame.size(), hidden, SCATTER_SAMPLES).map(|(x, y)| frame.get(x, y)).collect();
    let middle = median(&mut off);
    for value in &mut off {
        *value = (*value - middle).abs();
    }
    robust_std(&mut off).unwrap_or(0.0)
}
