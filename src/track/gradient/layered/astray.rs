//! A target that was found where it cannot have gone: in the first frames its speed is not known, and before
//! a rough background gradient steps from rest may lead to the wrong side.
//!
//! All that changed since the first frame is then explained by one displacement in whole pixels
//! ([`super::outset`]). Where the target was found elsewhere it is looked for there.

use super::Layered;
use super::align::Silence;
use super::find::{DROP, Finding, LEVELS, PRIOR, WELL};
use crate::types::Frame;

/// Distance of what was found from the displacement that explains the changes, px, that whole pixels and a
/// support that is still adapting make.
const ASTRAY: f64 = 2.0;
/// Deviation of that displacement, px.
const TOLD: f64 = 1.0;
/// Levels of a search about it: those that reach so far.
const NEAR: &[f64] = LEVELS.split_at(2).1;

impl Layered {
    /// The target where the changes since the first frame say that it is, if what was found is elsewhere.
    pub(super) fn instead_of_astray(&self, frame: &Frame<f64>, plain: Option<&Finding>) -> Option<Finding> {
        let outset = self.outset.as_ref()?;
        let (moved, first) = (outset.moved()?, outset.bounds.centre());
        let told = [first[0] + moved[0], first[1] + moved[1]];
        let apart = |found: &Finding| {
            let at = self.position(&found.aligned.pose);
            (at[0] - told[0]).hypot(at[1] - told[1])
        };
        if plain.is_some_and(|plain| apart(plain) <= ASTRAY) {
            return None;
        }
        let guess = self.placed(self.pose, told);
        let found = self.try_at(frame, &guess, (self.freedom, Silence::None, [TOLD, PRIOR[1]], NEAR))?;
        let least = plain.map_or(WELL, |plain| WELL.min(plain.look.visibility - DROP));
        (apart(&found) <= ASTRAY && found.look.visibility >= least).then_some(found)
    }
}
