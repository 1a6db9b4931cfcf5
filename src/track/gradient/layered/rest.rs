//! A faint target at rest: where the picture is as it was, the target is where it was.
//!
//! Of a target that differs little from what is behind it every frame tells the place only roughly, and
//! errors add up where template and background are learnt at a place that is a little wrong. Whether anything
//! changed at all is told much better. What a slow target changes adds up as well, for pictures are compared
//! with the last one in which it moved.

use super::Layered;
use super::align::Aligned;
use super::find::Finding;
use super::layers::grown;
use super::look::{look, view};
use super::patch::{Bounds, Patch, bounds_about};
use super::pose::Pose;
use crate::types::Frame;

/// Mean difference of a faint target from what is behind it, grey levels.
const FAINT: f64 = 60.0;
/// Around the target, px.
const AROUND: f64 = 2.0;
/// Deviations by which the mean square of the changes may exceed that of noise.
const CHANGED: f64 = 3.0;

/// The picture about the target when it last moved.
#[derive(Debug)]
pub(super) struct Rest {
    pose: Pose,
    cut: Bounds,
    was: Frame<f64>,
}

impl Rest {
    /// Whether the picture there is what it was, but for noise: the mean square of n independent differences
    /// scatters by the root of 2 / n of itself.
    fn lasts(&self, frame: &Frame<f64>, noise: f64) -> bool {
        let now = Patch::cut(frame, self.cut).frame;
        let changes = now.data().iter().zip(self.was.data()).map(|(now, was)| (now - was).powi(2));
        let count = now.data().len() as f64;
        changes.sum::<f64>() / count < 2.0 * noise * noise * (1.0 + CHANGED * (2.0 / count).sqrt())
    }
}

impl Layered {
    /// The picture about the target as it is now.
    pub(super) fn rest(&self, frame: &Frame<f64>) -> Rest {
        let around = grown(self.reached(&self.pose), (0.0, AROUND));
        let cut = bounds_about(around.centre(), [0.5 * around.width, 0.5 * around.height], frame.size());
        Rest { pose: self.pose, cut, was: Patch::cut(frame, cut).frame }
    }

    /// What was found, or the target where it was, if that is faint and nothing there changed since it was
    /// last seen.
    pub(super) fn unless_at_rest(&self, found: Finding, frame: &Frame<f64>) -> (Finding, bool) {
        let rest = self.resting.as_ref().filter(|rest| self.missed == 0 && rest.lasts(frame, self.noise));
        let Some(Rest { pose, .. }) = rest else { return (found, false) };
        let view = view(frame, &self.target, &self.background, pose);
        let look = look(&self.target, &view, found.aligned.gain, self.noise);
        if look.contrast >= FAINT {
            return (found, false);
        }
        let aligned = Aligned { pose: *pose, moved: [0.0; 6], ..found.aligned };
        (Finding { aligned, look, nis: self.nis(pose), occluded: false, reason: "" }, true)
    }
}
