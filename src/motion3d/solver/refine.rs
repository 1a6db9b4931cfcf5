//! Levenberg-Marquardt on the five unknowns of a motion.

use crate::math::tangents;
use crate::motion3d::kernels::{Equations, equations};
use crate::motion3d::model::{motion::Motion, observations::Observations, rows::Vector5};
use nalgebra::{Matrix2x3, SMatrix};

/// Points from which on there are many: so that a search takes no longer, it begins with fewer of them.
pub(crate) const MANY: usize = 4000;
pub(crate) const FEWER: usize = 2000;

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoppingCriteria {
    /// Most steps.
    pub steps: usize,
    /// Length of a step `(psi, w)`, rad, that is not worth another.
    pub tolerance: f64,
    /// The same in standard deviations of what is found, estimated from its residuals.
    pub deviations: f64,
}

impl StoppingCriteria {
    /// To leave a motion as it is.
    pub const NONE: Self = Self { steps: 0, tolerance: 0.0, deviations: 0.0 };
    /// For a start that will be refined again.
    pub const ROUGH: Self = Self { steps: 15, tolerance: 1e-4, deviations: 0.0 };
    /// To the minimum.
    pub const FULL: Self = Self { steps: 60, tolerance: 1e-10, deviations: 0.0 };

    /// To the minimum of `n` points: of many a step costs much, and after one that is short beside the
    /// standard deviation little is left.
    pub const fn of(n: usize) -> Self {
        if n > MANY { Self { deviations: 1e-3, ..Self::FULL } } else { Self::FULL }
    }
}

/// A minimum with the equations there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Minimum {
    pub motion: Motion,
    pub tangent: Matrix2x3<f64>,
    pub equations: Equations,
}

impl Minimum {
    fn at(motion: Motion, sums: impl Fn(&Motion, &Matrix2x3<f64>) -> Equations) -> Self {
        let tangent = tangents(&motion.u());
        Self { motion, tangent, equations: sums(&motion, &tangent) }
    }

    /// The same with all depths of the other sign: `e` and `J` stay, `D` at the depths changes its sign with
    /// the axes.
    pub fn reversed(&self, observations: &Observations) -> Self {
        Self::at(self.motion.reversed(), |motion, tangent| equations(observations, motion, tangent, None))
    }
}

/// The step that solves the damped equations; `None` where they have no solution.
fn step(equations: &Equations, damping: f64) -> Option<Vector5> {
    let Equations { h, gradient, .. } = equations;
    // What nothing determines stays as it is.
    let added = h.diagonal().map(|own| if own > 0.0 { damping * own } else { h.trace() });
    let damped = h + SMatrix::from_diagonal(&added);
    let step = damped.cholesky()?.solve(gradient);
    step.iter().all(|value| value.is_finite()).then_some(step)
}

/// The square of a step in standard deviations of what is found, estimated from residuals of `n` points.
fn squared_deviations(equations: &Equations, step: &Vector5, n: usize) -> f64 {
    step.dot(&(equations.h * step)) * n as f64 / equations.cost
}

/// The minimum of `J` that is reached from `start`; the axes of `u` move along with it.
///
/// The slope of `e` is `-D(nu^)` exactly: these are Gauss-Newton steps.
pub(crate) fn refine(observations: &Observations, start: Motion, stopping: StoppingCriteria) -> Minimum {
    descend(start, stopping, observations.n, |motion, tangent| equations(observations, motion, tangent, None))
}

/// The same of Tukey's loss, which ends at `cut` units of noise.
pub(crate) fn refine_cut(observations: &Observations, start: Motion, cut: f64, stopping: StoppingCriteria) -> Minimum {
    descend(start, stopping, observations.n, |motion, tangent| equations(observations, motion, tangent, Some(cut)))
}

/// The minimum of a cost that is reached from `start`; `sums`: those of `n` measurements at a motion.
pub(crate) fn descend(
    start: Motion,
    stopping: StoppingCriteria,
    n: usize,
    sums: impl Fn(&Motion, &Matrix2x3<f64>) -> Equations,
) -> Minimum {
    let mut here = Minimum::at(start, &sums);
    let mut damping = 1e-4;
    for _ in 0..stopping.steps {
        let Some(change) = step(&here.equations, damping) else {
            damping = (damping * 10.0f64).max(1e-6);
            if damping > 1e12 {
                break;
            }
            continue;
        };
        let there = Minimum::at(here.motion.stepped(&here.tangent, &change), &sums);
        let deviations = squared_deviations(&here.equations, &change, n).sqrt();
        let settled = change.norm() < stopping.tolerance || deviations < stopping.deviations;
        if there.equations.cost <= here.equations.cost {
            here = there;
            damping *= 0.1;
        } else {
            damping *= 10.0;
        }
        if settled || damping > 1e12 {
            break;
        }
    }
    here
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::Scene;
    use nalgebra::Vector3;

    #[test]
    fn the_gradient_is_that_of_the_cost() {
        let scene = Scene::oblique(60, 0.05, 3);
        let observations = scene.observations();
        for cut in [None, Some(2.0)] {
            let at = Motion::new([0.5, 0.3, 0.8], [0.03, -0.02, 0.0]);
            let minimum =
                |motion: Motion| Minimum::at(motion, |motion, axes| equations(&observations, motion, axes, cut));
            let here = minimum(at);
            for axis in 0..5 {
                let h = 1e-6;
                let cost = |by: f64| {
                    let mut step = Vector5::zeros();
                    step[axis] = by;
                    minimum(at.stepped(&here.tangent, &step)).equations.cost
                };
                let slope = (cost(h) - cost(-h)) / (2.0 * h);
                let want = -2.0 * here.equations.gradient[axis];
                assert!((slope - want).abs() < 1e-4 * want.abs().max(1.0), "{cut:?} {axis}: {slope} {want}");
            }
        }
    }

    #[test]
    fn exact_flow_gives_the_exact_motion() {
        let scene = Scene::oblique(60, 0.0, 3);
        let near = Motion::of(&(scene.motion.u() + Vector3::new(0.05, -0.04, 0.02)).normalize(), &Vector3::zeros());
        let found = refine(&scene.observations(), near, StoppingCriteria::FULL);
        assert!(found.motion.angle_to(&scene.motion) < 1e-9);
        assert!((found.motion.w() - scene.motion.w()).norm() < 1e-9);
    }
}
