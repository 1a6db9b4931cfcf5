//! Takes the rotation of a motion out of displacements.
//!
//! Half way between both ends a displacement is the instantaneous flow to second order only. Rows with the
//! motion's own rotation taken out ([`Derotation`](crate::motion3d::model::rows::Derotation)) are exact.

use super::likelihood::different;
use super::refine::{Minimum, StoppingCriteria, refine};
use super::starts::at_most;
use crate::math::{random::CounterRng, tangents};
use crate::motion3d::kernels::{Depths, depths, slopes};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::motion3d::model::whitening::Whitening;
use crate::parallel;
use std::borrow::Cow;

/// Points whose residuals are compared.
const SAMPLED: usize = 256;

/// Most times that the rotation is taken out that was found the time before, and a change of it, rad, that is
/// rounding.
pub(crate) const ROUNDS: usize = 6;
pub(crate) const ROUNDING: f64 = 1e-12;

/// Root mean square change of residuals, in units of noise, that changes few inliers.
const MAX_CHANGE: f64 = 0.1;

/// Whether a motion has another rotation than the one that was taken out of displacements.
fn is_another_rotation(points: &Observations, motion: &Motion) -> bool {
    points.displaced && points.turn.is_none_or(|turn| (turn.rotation - motion.w()).norm() > ROUNDING)
}

/// By how much residuals would change if the points were derotated about the rotation of `motion`: a sample
/// of the points with their depths and those changes.
fn changes<'a>(
    whitening: &Whitening<'_>,
    points: &'a Observations,
    motion: &Motion,
) -> (Cow<'a, Observations>, Depths, Vec<f64>) {
    let few = at_most(points, SAMPLED, CounterRng::new(0));
    let (here, there) = (depths(&few, motion), depths(&whitening.derotated(&few, motion.derotation()), motion));
    let changes = there.e.iter().zip(&here.e).map(|(there, here)| there - here).take(few.n).collect();
    (few, here, changes)
}

/// Whether derotation about the rotation of `motion` would change which points are its inliers: it changes
/// residuals by more than [`MAX_CHANGE`], or was not done yet.
pub(crate) fn changes_inliers(whitening: &Whitening<'_>, inliers: &Observations, motion: &Motion) -> bool {
    if !is_another_rotation(inliers, motion) {
        return false;
    }
    if inliers.turn.is_none() {
        return true;
    }
    let (few, _, changes) = changes(whitening, inliers, motion);
    changes.iter().map(|change| change * change).sum::<f64>() > MAX_CHANGE * MAX_CHANGE * few.n as f64
}

/// The squared shift of an estimate, in its standard deviations, if the points were derotated about its
/// rotation: `g^t H^-1 g` of `g = sum D^t de` with the changes `de` of the residuals.
pub(crate) fn shift(whitening: &Whitening<'_>, points: &Observations, motion: &Motion) -> f64 {
    if !is_another_rotation(points, motion) {
        return 0.0;
    }
    let (few, here, changes) = changes(whitening, points, motion);
    let tangent = tangents(&motion.u());
    let (mut h, mut g) = (Matrix5::zeros(), Vector5::zeros());
    for (k, change) in changes.iter().enumerate() {
        let row = slopes(&few, motion, &tangent, here.nu[k], k);
        h += row * row.transpose();
        g += row * *change;
    }
    let share = points.n as f64 / few.n.max(1) as f64;
    // Without a solution the sum of squares is more.
    let most: f64 = changes.iter().map(|change| change * change).sum();
    share * h.cholesky().map_or(most, |factor| g.dot(&factor.solve(&g)).min(most))
}

/// Takes the rotation of a motion out of the points until it stays: the minimum that is reached from `start`.
pub(crate) fn with_own_rotation(whitening: &Whitening<'_>, points: &mut Observations, start: Motion) -> Minimum {
    let stopping = StoppingCriteria::of(points.n);
    let (mut motion, mut found) = (start, None);
    for _ in 0..ROUNDS {
        if !is_another_rotation(points, &motion) {
            break;
        }
        *points = whitening.derotated(points, motion.derotation());
        motion = found.insert(refine(points, motion, stopping)).motion;
    }
    found.unwrap_or_else(|| refine(points, motion, stopping))
}

/// Takes the rotation of the first of `found`, the minima of the points, out of them, and refines the others.
pub(crate) fn settle(whitening: &Whitening<'_>, points: &mut Observations, found: &mut Vec<Minimum>) {
    let Some(mut first) = found.first().copied() else { return };
    if is_another_rotation(points, &first.motion) {
        first = with_own_rotation(whitening, points, first.motion);
    }
    let again = |other: &Minimum| refine(points, other.motion, StoppingCriteria::ROUGH);
    let others: Vec<Minimum> = parallel::map(&found[1..], again);
    *found = different(std::iter::once(first).chain(others).collect());
}
