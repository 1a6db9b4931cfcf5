//! From the directions of the search to motions of many inliers, by graduated weights.

use super::{APART, INLIER, search};
use crate::math::random::CounterRng;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{LESS_ROUND, Observations};
use crate::motion3d::solver::refine::{StoppingCriteria, refine_cut};
use crate::motion3d::solver::starts::apart;
use rayon::prelude::*;
use std::iter::once;

/// The bound of the search in shares of the flow: the spacing of the directions itself leaves residuals.
const SPACING: f64 = 0.06;

/// What the cut of Tukey's weights is divided by from one refinement to the next.
const CUT_RATIO: f64 = 1.6;

/// The same points, with rounder noise first: where it is far from round minima are too graduated for the
/// search.
pub(crate) struct GraduatedWeights<'a> {
    rounder: Vec<Observations>,
    own: &'a Observations,
}

impl<'a> GraduatedWeights<'a> {
    pub fn new(own: &'a Observations) -> Self {
        Self { rounder: own.rounder(), own }
    }

    /// The most promising directions of the search, at most `count`, refined one by one.
    pub fn motions(&self, count: usize, rng: CounterRng) -> Vec<Motion> {
        let first = self.rounder.first().unwrap_or(self.own);
        let bound = INLIER.max(SPACING * first.median_flow());
        let starts = apart(search::search(first, INLIER, SPACING, rng), APART, count);
        starts.into_par_iter().map(|(start, _)| self.descended(start, bound)).collect()
    }

    fn descended(&self, start: Motion, bound: f64) -> Motion {
        let (mut motion, mut cut) = (start, bound);
        for points in self.rounder.iter().chain(once(self.own)) {
            motion = graduated(points, motion, cut);
            cut = INLIER * LESS_ROUND;
        }
        motion
    }
}

/// Refines with Tukey's weights, which graduated from `bound` to the inliers'.
pub(crate) fn graduated(observations: &Observations, start: Motion, bound: f64) -> Motion {
    let (mut motion, mut cut) = (start, bound);
    while cut > INLIER {
        motion = refine_cut(observations, motion, cut, StoppingCriteria::ROUGH).motion;
        cut /= CUT_RATIO;
    }
    refine_cut(observations, motion, INLIER, StoppingCriteria { steps: 30, tolerance: 1e-7, deviations: 0.0 }).motion
}
