//! A target that vanishes soon after it was seen less or became smaller: something had begun to cover it, and what was measured meanwhile was the rest of it.
//!
//! The edge of what covers a target stands for the target's own; a similarity that follows it shrinks and stays behind, and a filter that believed it leads the search away from where the target comes out
//! again. The last state before that is therefore kept, and what vanishes goes on from there.

use super::Layered;
use super::find::{DROP, Finding};
use super::pose::Pose;
use crate::track::gradient::gauss_markov::GaussMarkovFilter;
use crate::types::TargetBox;

/// Frames after which the state from before is too old to go on from.
const LATELY: usize = 6;
/// Part of the acceleration that is kept, as where something known covers the target.
pub(super) const DAMPED: f64 = 0.3;

/// The target when it was last seen whole.
#[derive(Debug, Clone)]
pub(super) struct Sound {
    filter: GaussMarkovFilter,
    pose: Pose,
    /// Angle turned, not wrapped, rad.
    turned: f64,
    /// Frames since then.
    frames: usize,
    /// Whether what was measured since was taken for all of the target.
    followed: bool,
}

impl Layered {
    /// After a measurement: keeps the state if the target was seen whole; `smaller`: it shrank by what cover makes of it.
    pub(super) fn remember(&mut self, found: &Finding, smaller: bool) {
        let whole = !found.occluded && !smaller && found.look.visibility >= self.usual - DROP;
        if whole {
            self.sound = Some(Sound {
                filter: self.filter.clone(),
                pose: self.pose,
                turned: self.turned,
                frames: 0,
                followed: false,
            });
        } else if let Some(sound) = &mut self.sound {
            sound.frames += 1;
            sound.followed |= !found.occluded;
        }
    }

    /// At the first frame in which the target is not seen any more: goes on from before it began to vanish, where that was not noticed. What leaves the picture is not covered: what was measured of it is right.
    pub(super) fn recall(&mut self) {
        let TargetBox { x, y, width, height } = self.reached(&self.pose);
        let (columns, rows) = self.previous.frame.size();
        let inside = x >= -0.5 && y >= -0.5 && x + width <= columns as f64 - 0.5 && y + height <= rows as f64 - 0.5;
        if self.missed > 0 || !inside {
            return;
        }
        let Some(sound) = self.sound.take().filter(|sound| sound.followed && sound.frames <= LATELY) else { return };
        self.filter = sound.filter;
        self.filter.x.iter_mut().for_each(|x| x[2] *= DAMPED);
        (0..=sound.frames).for_each(|_| self.filter.predict());
        (self.pose.a, self.turned) = (sound.pose.a, sound.turned);
    }
}
