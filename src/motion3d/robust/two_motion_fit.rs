//! Points as those of two motions, where one of all leaves residuals that are no noise's.

use super::graduated_weights::GraduatedWeights;
use super::{INLIER, MIN_POINTS, cheaper_sign};
use crate::math::random::CounterRng;
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::solver::neighbours::{Neighbours, Tree};
use crate::motion3d::solver::refine::{StoppingCriteria, refine};

/// Neighbours that decide with a point which motion it has: moving objects are connected.
const NEAREST: usize = 8;

/// What a point counts at most: neighbours across the border of an object do not decide.
const MAX_SQUARE: f64 = INLIER * INLIER;

/// Times that points are given to the motion that they fit, and that both are searched again from all
/// directions.
const ROUNDS: usize = 8;
const SEARCHES: usize = 3;

/// Two motions, that of more points first, and what each point leaves with its own, summed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TwoMotionFit {
    pub motions: [Motion; 2],
    pub cost: f64,
}

/// The points that are to be divided.
pub(crate) struct Division {
    points: Observations,
    tree: Tree,
    near: Neighbours,
}

impl Division {
    /// Of more points than [`NEAREST`].
    pub fn of(points: Observations) -> Self {
        let tree = Tree::new(&points.site[..points.n]);
        let places: Vec<u32> = (0..points.n as u32).collect();
        let near = tree.nearest(&places, NEAREST);
        Self { points, tree, near }
    }

    /// The division that is reached from a `part` (by index) and the rest, both of which move as `start` or
    /// nearly so; `None` where one of both loses its points.
    pub fn from(&self, part: &[u32], start: &Motion, rng: CounterRng) -> Option<TwoMotionFit> {
        let mut second = vec![false; self.points.n];
        for &k in part {
            second[k as usize] = true;
        }
        let mut motions = [*start; 2];
        for round in 0..ROUNDS {
            for (own, motion) in motions.iter_mut().enumerate() {
                let members = self.points.subset(&chosen(&second, own == 1));
                if members.n <= MIN_POINTS.max(NEAREST) {
                    return None;
                }
                *motion = if round < SEARCHES {
                    GraduatedWeights::new(&members).motions(1, rng).pop()?
                } else {
                    refine(&members, *motion, StoppingCriteria::ROUGH).motion
                };
            }
            let next = self.nearer(&motions);
            if next == second && round >= SEARCHES {
                break;
            }
            second = next;
        }
        let members = [false, true].map(|own| self.points.subset(&chosen(&second, own)));
        if members.iter().any(|members| members.n <= MIN_POINTS) {
            return None;
        }
        let fitted: [_; 2] = std::array::from_fn(|own| refine(&members[own], motions[own], StoppingCriteria::FULL));
        let cost = fitted.iter().map(|minimum| minimum.equations.cost).sum();
        let signed: [Motion; 2] = std::array::from_fn(|own| cheaper_sign(&members[own], fitted[own].motion).0);
        let motions = if members[0].n < members[1].n { [signed[1], signed[0]] } else { signed };
        Some(TwoMotionFit { motions, cost })
    }

    /// Which points, with their neighbours, the second motion leaves less of.
    fn nearer(&self, motions: &[Motion; 2]) -> Vec<bool> {
        let [first, second] = motions.each_ref().map(|motion| depths(&self.points, motion).e);
        let order = self.tree.order();
        let gain = |place: u32| {
            let k = order[place as usize] as usize;
            first[k].powi(2).min(MAX_SQUARE) - second[k].powi(2).min(MAX_SQUARE)
        };
        let mut out = vec![false; self.points.n];
        for place in 0..self.points.n as u32 {
            let around: f64 = self.near.of(place as usize).iter().map(|&near| gain(near)).sum();
            out[order[place as usize] as usize] = gain(place) + around > 0.0;
        }
        out
    }
}

/// The indices of those that are `wanted`.
fn chosen(second: &[bool], wanted: bool) -> Vec<u32> {
    (0..second.len() as u32).filter(|&k| second[k as usize] == wanted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::tests::scenes::{Scene, W, oblique};

    #[test]
    fn both_motions_are_found_from_a_part_that_is_neither() {
        let object = Motion::new([-0.8, 0.1, 0.3], W.map(|w| 1.5 * w));
        for seed in 0..5 {
            let mut scene = Scene::new(oblique(), 400, 0.6, 0.05, seed, |_, _, r| 0.5 + r);
            let moved = Scene::new(object, 400, 0.6, 0.05, seed, |_, _, r| 0.5 + r);
            for k in (0..400).filter(|&k| scene.points[k][0] > 0.2) {
                scene.flow[k] = moved.flow[k];
            }
            let part: Vec<u32> = (0..400).filter(|&k| scene.points[k as usize][0] > 0.0).collect();
            let points = scene.observations();
            let one = refine(&points, oblique(), StoppingCriteria::FULL).equations.cost;
            let division = Division::of(points);
            let two = division.from(&part, &oblique(), CounterRng::new(seed)).unwrap();
            let off = [(0, oblique()), (1, object)].map(|(k, truth)| two.motions[k].angle_to(&truth).to_degrees());
            assert!(off[0] < 15.0 && off[1] < 15.0 && two.cost < 0.7 * one, "{seed}: {off:?} {} {one}", two.cost);
        }
    }

    #[test]
    fn points_that_move_as_one_have_no_second_motion_that_is_worth_it() {
        let points = Scene::oblique(300, 0.02, 1).observations();
        let one = refine(&points, oblique(), StoppingCriteria::FULL).equations.cost;
        let division = Division::of(points);
        let two = division.from(&(0..100).collect::<Vec<u32>>(), &oblique(), CounterRng::new(1));
        assert!(two.is_none_or(|two| two.cost > 0.75 * one));
    }
}
