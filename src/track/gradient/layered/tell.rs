//! What the tracker says of the target.

use super::Layered;
use super::find::Finding;
use super::pose::Pose;
use super::slanted::Slanted;
use crate::types::{TargetBox, TrackState, TrackStatus};

/// Frames without a measurement after which the target is lost.
const LOST_AFTER: usize = 15;
/// Around the box, the scene may be hidden: share of its sides, and px. Limbs and what else is not in the
/// support must not be learnt as background, for the target would look like that a moment later.
const HIDES: (f64, f64) = (0.1, 4.0);

impl Layered {
    /// Upright box of the target at a pose.
    pub(super) fn bounds(&self, pose: &Pose) -> TargetBox {
        let [width, height] = self.target.extent();
        let [across, down] = pose.stretch();
        TargetBox::about(self.position(pose), width * across, height * down)
    }

    /// Where it hides the scene, with a margin.
    pub(super) fn hides(&self) -> Slanted {
        Slanted::about(self.position(&self.pose), &self.pose, self.target.extent(), HIDES)
    }

    /// Upright box around the target at a pose, its corners included.
    pub(super) fn reached(&self, pose: &Pose) -> TargetBox {
        let half = pose.reach(self.target.extent().map(|side| 0.5 * side));
        TargetBox::about(self.position(pose), 2.0 * half[0], 2.0 * half[1])
    }

    /// A target that has left the picture waits at its border.
    pub(super) fn hold_beyond_the_border(&mut self, state: &mut TrackState, (width, height): (usize, usize)) {
        if self.missed == 0 {
            return;
        }
        let bounds = self.bounds(&self.pose);
        let half = [0.5 * bounds.width, 0.5 * bounds.height];
        let lengths = [width as f64, height as f64];
        let position = self.filter.position();
        // One that waits there is still out.
        let outside = (0..2).any(|k| position[k] <= -half[k] || position[k] >= lengths[k] - 1.0 + half[k]);
        if !outside {
            return;
        }
        for k in 0..2 {
            self.filter.x[k][0] = position[k].clamp(-half[k], lengths[k] - 1.0 + half[k]);
            (self.filter.x[k][1], self.filter.x[k][2]) = (0.0, 0.0);
        }
        self.pose = self.placed(self.pose, self.filter.position());
        self.tell_motion(state);
        (state.status, state.reason) = if self.missed >= LOST_AFTER {
            (TrackStatus::Lost, "out of the picture for long")
        } else {
            (TrackStatus::Out, "out of the picture")
        };
    }

    pub(super) fn tell(&self, state: &mut TrackState, found: Option<&Finding>, motion: [f64; 2]) {
        (state.status, state.reason) = match found {
            Some(found) if found.occluded => (TrackStatus::Occluded, found.reason),
            Some(found) => (TrackStatus::Tracking, found.reason),
            None if self.missed >= LOST_AFTER => (TrackStatus::Lost, "not seen for long"),
            None => (TrackStatus::Coasting, "the target is not seen"),
        };
        state.camera_motion = motion;
        let measured = self.position(&self.pose);
        let before = state.bounds.centre();
        state.displacement = if found.is_some() { [0, 1].map(|k| measured[k] - before[k]) } else { [f64::NAN; 2] };
        self.tell_motion(state);
        (state.scale, state.rotation) = (self.pose.scale(), self.turned);
        state.rotation_observable = self.rotation_told;
        state.visibility = found.map_or(0.0, |found| found.look.visibility);
        state.innovation = found.map_or(f64::NAN, |found| found.nis);
        state.flow_count = 0;
    }

    /// What the filter says, and the box there.
    fn tell_motion(&self, state: &mut TrackState) {
        let (speed, motion) = (self.filter.speed(), state.camera_motion);
        // The filter's velocity is relative to the scene, or to the picture for a target that the camera
        // follows.
        (state.velocity, state.scene_velocity) = if self.with_camera {
            (speed, [0, 1].map(|k| speed[k] - motion[k]))
        } else {
            ([0, 1].map(|k| speed[k] + motion[k]), speed)
        };
        state.position = self.filter.position();
        state.line_of_sight = state.position;
        state.acceleration = self.filter.acceleration();
        state.covariance = self.covariance();
        state.bounds = self.bounds(&self.pose);
    }
}
