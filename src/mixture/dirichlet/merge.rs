//! Pooling of pairs of components while that raises the score.
//!
//! The mode of the sticks cannot empty a component, so a large Gaussian stays divided among several. The idea
//! of N. Ueda, R. Nakano, Z. Ghahramani and G. Hinton, "SMEM algorithm for mixture models" (2000), with F as
//! the judge.

use super::{em::Problem, em::Run};
use crate::error::Result;
use crate::mixture::moments::Moments;

/// Components with less weight of points are not pooled.
const MIN_COUNT: f64 = 1e-3;
/// Number of pairs that are tried before it ends.
const TRIALS: usize = 3;
/// Least gain of F, responsibilities held, with which a pair is tried.
const MIN_GAIN: f64 = -20.0;

/// Smallest responsibility that counts for entropy: quotients by smaller ones overflow.
const MIN_SHARE: f64 = 1e-280;

/// A pair of components.
type Pair = (usize, usize);

/// Pools pairs until none of the best raises F.
///
/// # Errors
/// [`Error::Numerical`](crate::Error::Numerical) for a covariance without a factor.
pub(super) fn pool_pairs(problem: &Problem, mut run: Run) -> Result<Run> {
    'pooled: loop {
        for (_, pair) in candidates(problem, &run)? {
            let mut moments = run.expected.moments.clone();
            pool(&mut moments, pair);
            let mut other = problem.run(moments)?;
            if other.score > run.score {
                other.rounds += run.rounds;
                run = other;
                continue 'pooled;
            }
        }
        return Ok(run);
    }
}

/// Puts the points of the second component of a pair to the first.
fn pool(moments: &mut Moments, (i, j): Pair) {
    let pooled = moments.reordered(&[i]).merged(&moments.reordered(&[j]));
    moments.replace(i, &pooled);
    moments.replace(j, &Moments::none(1, moments.dimensions));
}

/// Gain of F with the responsibilities held, of the pairs where it is largest; the largest first.
pub(super) fn candidates(problem: &Problem, run: &Run) -> Result<Vec<(f64, Pair)>> {
    let mut bounds = bounds(problem, &run.expected.moments)?;
    bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut shares = None;
    let mut best: Vec<(f64, Pair)> = Vec::new();
    for (bound, pair) in bounds {
        let enough = best.get(TRIALS - 1).map_or(MIN_GAIN, |third| third.0);
        if bound < enough {
            break;
        }
        let shares = shares.get_or_insert_with(|| shares_of(problem, run));
        let gain = bound - entropy_lost(&problem.planes.weights, shares, pair);
        if gain >= enough {
            let at = best.partition_point(|other| other.0 >= gain);
            best.insert(at, (gain, pair));
            best.truncate(TRIALS);
        }
    }
    Ok(best)
}

/// For every pair the gain of F without the change of entropy, which only lowers it.
fn bounds(problem: &Problem, moments: &Moments) -> Result<Vec<(f64, Pair)>> {
    let counts = &moments.counts;
    let scorer = &problem.scorer;
    let large: Vec<usize> = (0..counts.len()).filter(|k| counts[*k] > MIN_COUNT).collect();
    let single: Vec<Moments> = large.iter().map(|k| moments.reordered(&[*k])).collect();
    let own = single.iter().map(|one| scorer.gaussians(one)).collect::<Result<Vec<f64>>>()?;
    let sticks = scorer.sticks(counts.clone());
    let mut bounds = Vec::with_capacity(large.len() * large.len() / 2);
    for a in 0..large.len() {
        for b in a + 1..large.len() {
            let gaussian = scorer.gaussians(&single[a].merged(&single[b]))? - own[a] - own[b];
            let mut pooled = counts.clone();
            pooled[large[a]] += pooled[large[b]];
            pooled[large[b]] = 0.0;
            bounds.push((gaussian + scorer.sticks(pooled) - sticks, (large[a], large[b])));
        }
    }
    Ok(bounds)
}

/// Responsibilities of the last E step, component by component (K, padded); zeros for those without a share.
fn shares_of(problem: &Problem, run: &Run) -> Vec<Vec<f64>> {
    let planes = &problem.planes;
    let mut shares = vec![Vec::new(); run.components.count()];
    run.used.iter().for_each(|k| shares[*k] = vec![0.0; planes.padded]);
    let mut x = vec![0.0; planes.dimensions];
    let mut row = vec![0.0; run.used.len()];
    for n in 0..planes.padded {
        x.iter_mut().enumerate().for_each(|(d, x)| *x = planes.plane(d)[n]);
        run.densities.share(&x, &mut row);
        row.iter().zip(&run.used).for_each(|(share, k)| shares[*k][n] = *share);
    }
    shares
}

/// `sum_n w_n [(a + b) ln (a + b) - a ln a - b ln b]` of the responsibilities of a pair, never negative.
fn entropy_lost(weights: &[f64], shares: &[Vec<f64>], (i, j): Pair) -> f64 {
    let points = weights.iter().zip(shares[i].iter().zip(&shares[j]));
    let shared = points.filter(|(w, (a, b))| **w > 0.0 && a.min(**b) > MIN_SHARE);
    shared.map(|(w, (a, b))| w * (a * ((a + b) / a).ln() + b * ((a + b) / b).ln())).sum()
}
