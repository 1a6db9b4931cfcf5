//! Where fits begin: weighted k-means++ seeds and Lloyd's algorithm, or random numbers.

use super::points::Points;
use crate::math::random::CounterRng;
use std::cmp::Ordering;

/// Steps of Lloyd's algorithm.
const LLOYD_STEPS: usize = 10;

/// Random responsibilities (N, K), row-major; every row sums to 1.
pub(super) fn random(points: &Points, components: usize, rng: CounterRng) -> Vec<f64> {
    let mut shares = Vec::with_capacity(points.count() * components);
    for n in 0..points.count() {
        let row: Vec<f64> = (0..components).map(|k| 1.0 - rng.uniform((n * components + k) as u64)).collect();
        let sum: f64 = row.iter().sum();
        shares.extend(row.iter().map(|share| share / sum));
    }
    shares
}

/// The cluster of each point (N) that weighted k-means finds from k-means++ seeds (D. Arthur and S.
/// Vassilvitskii, 2007).
///
/// Seeds are drawn from the points in the order of their coordinates, so that the order in which they come
/// makes no difference, nor whether a point comes twice or has twice the weight.
pub(super) fn k_means(points: &Points, components: usize, rng: CounterRng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.count()).filter(|n| points.weight(*n) > 0.0).collect();
    order.sort_unstable_by(|a, b| {
        let pairs = points.at(*a).iter().zip(points.at(*b));
        pairs.map(|(a, b)| a.total_cmp(b)).find(|o| *o != Ordering::Equal).unwrap_or_else(|| a.cmp(b))
    });
    let mut centres = seeds(points, &order, components, rng);
    for _ in 0..LLOYD_STEPS {
        if !lloyd_step(points, &order, &mut centres) {
            break;
        }
    }
    (0..points.count()).map(|n| nearest(&centres, points.at(n)).0).collect()
}

/// K centres, row-major: the first by weight, the others by weight times the squared distance from those
/// before. Where no point is left apart, the last is repeated.
fn seeds(points: &Points, order: &[usize], components: usize, rng: CounterRng) -> Vec<f64> {
    let mut centres = Vec::with_capacity(components * points.dimensions);
    let mut distances = vec![1.0; points.count()];
    for k in 0..components {
        let chosen = drawn(points, order, &distances, rng.uniform(k as u64)).unwrap_or(order[0]);
        let centre = points.at(chosen).to_vec();
        for n in order {
            let distance = squared_distance(points.at(*n), &centre);
            distances[*n] = if k == 0 { distance } else { distances[*n].min(distance) };
        }
        centres.extend(centre);
    }
    centres
}

/// The point at a share `at` of the sum of weights times `distances`; none where that is 0.
fn drawn(points: &Points, order: &[usize], distances: &[f64], at: f64) -> Option<usize> {
    let total: f64 = order.iter().map(|n| points.weight(*n) * distances[*n]).sum();
    if total <= 0.0 {
        return None;
    }
    let mut sum = 0.0;
    let chosen = order.iter().find(|n| {
        sum += points.weight(**n) * distances[**n];
        sum > at * total
    });
    chosen.or(order.last()).copied()
}

/// Moves centres to the means of their nearest points; without points they stay. Whether any moved.
fn lloyd_step(points: &Points, order: &[usize], centres: &mut [f64]) -> bool {
    let d = points.dimensions;
    let mut sums = vec![0.0; centres.len()];
    let mut counts = vec![0.0; centres.len() / d];
    for n in order {
        let (k, weight) = (nearest(centres, points.at(*n)).0, points.weight(*n));
        counts[k] += weight;
        for (sum, x) in sums[k * d..].iter_mut().zip(points.at(*n)) {
            *sum += weight * x;
        }
    }
    let mut moved = false;
    for (k, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
        for i in k * d..(k + 1) * d {
            let mean = sums[i] / count;
            moved |= mean != centres[i];
            centres[i] = mean;
        }
    }
    moved
}

/// The nearest centre and the squared distance from it; the first of equally near ones.
fn nearest(centres: &[f64], x: &[f64]) -> (usize, f64) {
    let distances = centres.chunks_exact(x.len()).map(|centre| squared_distance(x, centre)).enumerate();
    distances.fold((0, f64::INFINITY), |best, now| if now.1 < best.1 { now } else { best })
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}
