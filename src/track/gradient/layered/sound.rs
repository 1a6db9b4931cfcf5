//! A target that vanishes soon after it was seen less or became smaller: something had begun to cover it, and what was measured meanwhile was the rest of it.
//!
//! The edge of what covers a target stands for the target's own; a similarity that follows it shrinks and stays behind, and a filter that believed it leads the search away from where the target comes out
//! again. The last state before that is therefore kept, and what vanishes goes on from there.

use super::Layered;
use super::find::{DROP, Finding};
use super::pose::Pose;
use crate::track::gradient::gauss_markov::GaussMarkovFilter;

/// Frames after which the state from before is too old to go on from.
const LATELY: usize = 6;
/// Part of the acceleration that is kept, as where something known covers the target.
pub(super) const DAMPED: f64 = 0.3;

/// The target when it was last seen whole.
#[derive(Debug, Clone)]
pub(super) struct Sound {
    filter: GaussMarkovFilter,
    pose: Pose,
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
            self.sound = Some(Sound { filter: self.filter.clone(), pose: self.pose, frames: 0, followed: false });
        } else if let Some(sound) = &mut self.sound {
            sound.frames += 1;
            sound.followed |= !found.occluded;
        }
    }

    /// At the first frame without a measurement: goes on from before the target began to vanish, where that was not noticed.
    pub(super) fn recall(&mut self) {
        let Some(sound) = self.sound.take().filter(|sound| sound.followed && sound.frames <= LATELY) else { return };
        self.filter = sound.filter;
        self.filter.x.iter_mut().for_each(|x| x[2] *= DAMPED);
        (0..=sound.frames).for_each(|_| self.filter.predict());
        self.pose.a = sound.pose.a;
    }
}
