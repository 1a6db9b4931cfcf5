//! How surely the depths tell the sign of a translation.
//!
//! A motion and its opposite explain the parts of the flow across the epipolar lines equally well: only
//! depths, which must be positive, decide. In a narrow field a rotation adds nearly the same to all depths,
//! and turns them round at hardly any cost. So each sign is given the rotation and the direction that suit it
//! best.

use crate::math::random::CounterRng;
use crate::motion3d::kernels::{FrontEquations, front_equations};
use crate::motion3d::model::motion::{Motion, tangents};
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::starts::{SEARCHED, sample};
use std::borrow::Cow;

/// Most steps, and the length of one that is not worth another, rad.
const STEPS: usize = 30;
const STEP: f64 = 1e-7;

/// Squared deviations by which the opposite must be worse to be excluded: a chance of about 1 in 100.
const SURE: f64 = 9.0;

/// The most likely motion near `start` that has no depth behind the camera, and its cost.
fn in_front(observations: &Observations, start: &Motion) -> (Motion, f64) {
    let equations = |motion: &Motion| front_equations(observations, motion, &tangents(&motion.u()));
    let (mut motion, mut damping) = (*start, 1e-4);
    let mut here: FrontEquations = equations(&motion);
    for _ in 0..STEPS {
        let mut h = here.h;
        // The last term keeps directions that no point tells of where they are.
        let floor = 1e-12 * h.trace();
        for i in 0..5 {
            h[(i, i)] += damping * h[(i, i)] + floor;
        }
        let Some(step) = h.cholesky().map(|factor| factor.solve(&here.gradient)) else { break };
        if !step.iter().all(|value| value.is_finite()) {
            break;
        }
        let next = motion.stepped(&tangents(&motion.u()), &step);
        let there = equations(&next);
        if there.cost <= here.cost {
            (motion, here) = (next, there);
            damping *= 0.1;
        } else {
            damping *= 10.0;
        }
        if step.norm() < STEP || damping > 1e9 {
            break;
        }
    }
    (motion, here.cost)
}

/// The opposite of a motion, with the rotation that suits it best and how much less likely it is, in squared
/// units of noise; `None` where the depths exclude it.
pub(crate) fn opposite(observations: &Observations, motion: &Motion, rng: CounterRng) -> Option<(Motion, f64)> {
    let searched = if observations.n > SEARCHED {
        Cow::Owned(observations.subset(&sample(observations.n, SEARCHED, rng)))
    } else {
        Cow::Borrowed(observations)
    };
    let (_, cost) = in_front(&searched, motion);
    let (opposite, other) = in_front(&searched, &motion.reversed());
    // One that turned back is no other motion.
    let turned = opposite.u().dot(&motion.u()) < 0.0;
    let excess = (other - cost) * observations.n as f64 / searched.n as f64;
    (turned && excess < SURE).then_some((opposite, excess))
}
