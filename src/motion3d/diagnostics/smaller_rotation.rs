//! Whether displacements are explained as well by a motion that turns by much less, or otherwise.
//!
//! Rows that an estimate's rotation was taken out of are those of a linear model about it. Seen from a motion
//! that turns by a large angle, what nature did, with a small one, looks impossible: in a narrow field, where
//! a translation and a rotation do nearly the same, such motions leave hardly more than the true one. So the
//! other directions are asked with the rotation taken out that explains most of the flow by itself, and those
//! that might do each with its own.

use super::confidence_region::{Asked, CHANCE, COMPARED, Farther, PLAUSIBLE, as_likely, ask, fluctuation};
use crate::math::random::CounterRng;
use crate::motion3d::model::derotation::HalfTurn;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::whitening::Intake;
use crate::motion3d::solver::finite_rotation::{WANDERED, afresh};
use crate::motion3d::solver::likelihood::minima;
use crate::motion3d::solver::starts::{at_most, evaluate};
use rayon::prelude::*;

/// Times that a direction's own rotation is taken out.
const ROUNDS: usize = 4;

/// Whether, for `most` of the points, a direction that is `farther` from the estimate's is as plausible, each
/// with its own rotation taken out.
pub(crate) fn plausible_less_turned(
    intake: &Intake<'_>,
    inliers: &Observations,
    motion: &Motion,
    farther: Farther,
    most: usize,
    rng: CounterRng,
) -> bool {
    let own = &*at_most(inliers, most, rng.stream(0));
    if !own.displaced || own.turn.is_none() {
        return false;
    }
    let Some(fresh) = afresh(intake, own) else { return false };
    let wandered = fresh.turn.is_some_and(|turn| (turn.rotation - motion.w()).norm() > WANDERED);
    if !wandered {
        return false;
    }
    let u = motion.u();
    let Some(best) = ask(own, &u, &u) else { return false };
    let limit = |asked: &Asked| best.cost + PLAUSIBLE + CHANCE * fluctuation(own, motion, &asked.motion);
    let apart = |asked: &Asked| asked.motion.angle_to(motion).to_degrees() > farther.chance;
    let mut asked = evaluate(|u| ask(&fresh, u, u));
    asked.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    asked.retain(|asked| apart(asked) && asked.cost < limit(asked));
    asked.truncate(COMPARED);
    let found = minima(&fresh, true, rng.stream(1));
    asked.extend(found.iter().filter_map(|minimum| ask(&fresh, &minimum.motion.u(), &u)));
    let exact = asked.into_par_iter().filter_map(|asked| exactly(intake, &fresh, asked));
    let exact: Vec<(Observations, Asked)> =
        exact.filter(|(_, asked)| apart(asked) && asked.cost < limit(asked)).collect();
    let doubts: Vec<(&Observations, Asked)> = exact.iter().map(|(points, asked)| (points, *asked)).collect();
    as_likely(&[(own, best)], &doubts, rng.stream(2))
}

/// A direction with the rotation that suits it best, which is taken out of the points.
fn exactly(intake: &Intake<'_>, fresh: &Observations, mut asked: Asked) -> Option<(Observations, Asked)> {
    let u = asked.motion.u();
    let mut turned = None;
    for _ in 0..ROUNDS {
        let next = intake.turned(fresh, HalfTurn::of(&asked.motion));
        asked = ask(&next, &u, &u)?;
        turned = Some(next);
    }
    turned.filter(|turned| turned.unseen() <= fresh.unseen()).map(|turned| (turned, asked))
}
