//! For every direction the best rotation of many small samples, by a truncated cost; then from the best
//! directions to motions of many inliers, by graduated weights.

use super::{APART, INLIER};
use crate::math::random::CounterRng;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{ALIGN, LESS_ROUND, Observations};
use crate::motion3d::solver::{refine::StoppingCriteria, refine::refine_cut, starts::apart, starts::evaluate};
use crate::parallel;
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::{Matrix3, Vector3};
use std::iter::once;

/// Points that the search looks at, and samples of three of them.
const SEARCHED: usize = 400;
const SAMPLES: usize = 100;

/// Groups of points after which a sum is compared.
const PART: usize = 4;

/// `q_x, q_y, q_z, c` of the residuals `c - q . w` of a group of points.
type Group = [[f64; ALIGN]; 4];

/// Residuals of one direction, in units of their bounds.
struct TruncatedCost<'a> {
    groups: &'a [Group],
    rotations: &'a [Vector3<f64>],
}

impl Kernel<f64> for TruncatedCost<'_> {
    type Output = Option<(usize, f64)>;
    /// The rotation with the least `sum min(e^2, 1)`, and that.
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Option<(usize, f64)> {
        let cut2 = V::constant(1.0);
        let mut best: Option<(usize, f64)> = None;
        for (index, w) in self.rotations.iter().enumerate() {
            let (wx, wy, wz) = (V::splat(w.x), V::splat(w.y), V::splat(w.z));
            // Two sums, as one would wait for itself at every step.
            let (mut sums, mut cost) = ([V::zero(); 2], 0.0);
            // Sums only grow: those above the least are not completed.
            for part in self.groups.chunks(PART) {
                for [x, y, z, c] in part {
                    for both in (0..ALIGN).step_by(2 * V::LANES) {
                        for (half, sum) in sums.iter_mut().enumerate() {
                            let at = both + half * V::LANES;
                            let rest = V::load(&x[at..]).neg_mul_add(wx, V::load(&c[at..]));
                            let rest = V::load(&y[at..]).neg_mul_add(wy, rest);
                            let rest = V::load(&z[at..]).neg_mul_add(wz, rest);
                            *sum = *sum + (rest * rest).min(cut2);
                        }
                    }
                }
                let mut lanes = [0.0; ALIGN];
                (sums[0] + sums[1]).store(&mut lanes[..V::LANES]);
                cost = lanes[..V::LANES].iter().sum();
                if best.is_some_and(|(_, least)| cost >= least) {
                    break;
                }
            }
            if best.is_none_or(|(_, least)| cost < least) {
                best = Some((index, cost));
            }
        }
        best
    }
}

/// Every direction with its best rotation and cost `sum min((e / bound)^2, 1)`. The spacing of the directions
/// leaves residuals in proportion to flow: a point's bound is the share `spacing` of its flow, at least
/// `least`.
fn search(observations: &Observations, least: f64, spacing: f64, rng: CounterRng) -> Vec<(Motion, f64)> {
    let chosen = rng.stream(0).sample(observations.n, SEARCHED);
    let few: Vec<_> = chosen.iter().map(|&k| observations.row(k as usize)).collect();
    let draws = rng.stream(1);
    let triples: Vec<[usize; 3]> = (0..SAMPLES as u64).map(|i| draws.stream(i).three(few.len())).collect();
    let (floor, level) = (observations.floor, observations.level);
    let bounds: Vec<f64> = few.iter().map(|row| least.max(spacing * row.f.norm())).collect();
    evaluate(|u| {
        let mut groups: Vec<Group> = vec![[[0.0; ALIGN]; 4]; few.len().div_ceil(ALIGN)];
        for (k, row) in few.iter().enumerate() {
            let t = row.g * u;
            let s2 = t.norm_squared();
            if s2 > floor {
                let scale = 1.0 / (s2.sqrt() * bounds[k]);
                let [q @ .., c] = &mut groups[k / ALIGN];
                for (j, q) in q.iter_mut().enumerate() {
                    q[k % ALIGN] = (t.y * row.r[(0, j)] - t.x * row.r[(1, j)]) * scale;
                }
                c[k % ALIGN] = (t.y * row.f.x - t.x * row.f.y) * scale;
            }
        }
        let value = |j: usize, k: usize| groups[k / ALIGN][j][k % ALIGN];
        let rotation = |three: &[usize; 3]| {
            let a = Matrix3::from_fn(|i, j| value(j, three[i]));
            let b = Vector3::from_fn(|i, _| value(3, three[i]));
            let w = a.try_inverse()? * b;
            w.iter().all(|value| value.is_finite()).then_some(w)
        };
        let known = observations.prior.map(|known| known.rotation);
        let rotations: Vec<Vector3<f64>> = triples.iter().filter_map(rotation).chain(known).collect();
        let (best, cost) = dispatch(level, TruncatedCost { groups: &groups, rotations: &rotations })?;
        Some((Motion::of(u, &rotations[best]), cost))
    })
}

/// The bound of the search in shares of the flow: the spacing of the directions itself leaves residuals.
const SPACING: f64 = 0.06;

/// What the cut of Tukey's weights is divided by from one refinement to the next.
const CUT_RATIO: f64 = 1.6;

/// The most promising directions of the search, at most `count`, refined one by one: on the points in rounder
/// noise first, as where that is far from round minima are too narrow for the search.
pub(crate) fn robust_motions(own: &Observations, count: usize, rng: CounterRng) -> Vec<Motion> {
    let rounder = own.rounder();
    let first = rounder.first().unwrap_or(own);
    let bound = INLIER.max(SPACING * first.median_flow());
    let descended = |(start, _): (Motion, f64)| {
        let (mut motion, mut cut) = (start, bound);
        for points in rounder.iter().chain(once(own)) {
            motion = graduated(points, motion, cut);
            cut = INLIER * LESS_ROUND;
        }
        motion
    };
    parallel::map(apart(search(first, INLIER, SPACING, rng), APART, count), descended)
}

/// Refines with Tukey's weights, whose cut shrinks from `bound` to that of the inliers.
pub(crate) fn graduated(observations: &Observations, start: Motion, bound: f64) -> Motion {
    let (mut motion, mut cut) = (start, bound);
    while cut > INLIER {
        motion = refine_cut(observations, motion, cut, StoppingCriteria::ROUGH).motion;
        cut /= CUT_RATIO;
    }
    refine_cut(observations, motion, INLIER, StoppingCriteria { steps: 30, tolerance: 1e-7, deviations: 0.0 }).motion
}
