//! A target whose outline changes as no turning and no change of size makes it: one that breathes, bends or
//! turns out of the plane.
//!
//! A similarity that follows such a target becomes smaller from frame to frame, for it gives up what goes
//! beyond its outline on two sides for what is missing on the other two, or it stays at one of the edges.
//! What looks like the target goes on beyond its outline then. Where an affine map from the expected pose
//! explains nearly all of it, that is the pose; from there on similarities are tried again.

use super::align::{Freedom, Silence};
use super::find::{DOUBT, DROP, Finding, LEAK, PRIOR, WELL};
use super::{Layered, SURE};
use crate::types::Frame;

/// Part of the target's area in which its support is not what the picture tells, from which on its outline is
/// doubted.
const OFF: f64 = 0.2;
/// Part of the target's area beside it that looks like it, from which on it is taken for the target's own.
const BEYOND: f64 = 0.03;
/// How far that lies on one side, from which on it may be something else, and the map must be where the
/// target is expected.
const ASIDE: f64 = 0.5;
/// What an affine map may leave of the area that is not explained, share.
const BETTER: f64 = 0.8;
/// Least size over that of the frame before: what shrinks faster is covered.
const SHRUNK: f64 = 0.95;

impl Layered {
    /// The target under an affine map, where that explains an outline that a similarity, `plain`, does not.
    pub(super) fn reshaped(&self, frame: &Frame<f64>, plain: &Finding, levels: &[f64]) -> Option<Finding> {
        let [width, height] = self.target.extent();
        let doubted = plain.look.mismatch > OFF * width * height && plain.look.leak > BEYOND;
        // Of what comes out again, the rest is hidden still.
        let returns = self.missed > 0 || self.returning > 0;
        if self.freedom != Freedom::Similarity || returns || !doubted {
            return None;
        }
        let guess = self.expected(!self.hidden);
        let mut found = self.try_at(frame, &guess, (Freedom::Affine, Silence::None, PRIOR, levels))?;
        // Which way a stretched outline is turned is told by the similarity, if at all.
        found.aligned.rotation_told = plain.aligned.rotation_told;
        let farthest = if plain.look.one_sided < ASIDE { DOUBT } else { SURE };
        let expected = found.nis < farthest && found.aligned.pose.scale() > SHRUNK * self.pose.scale();
        let seen = found.look.visibility >= WELL && found.look.visibility > plain.look.visibility - DROP;
        let explained = found.look.leak < LEAK && found.look.mismatch < BETTER * plain.look.mismatch;
        (expected && seen && explained).then_some(found)
    }
}
