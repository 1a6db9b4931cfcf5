//! What the first M step is made from: labels or responsibilities.

use super::{expectation::Expected, moments::Moments, points::Points};
use crate::error::{Error, Result};

/// How far from 1 the responsibilities of a point may sum up.
const SUM_TOLERANCE: f64 = 1e-6;

/// What an E step would have left that gave every point to one component.
pub(super) fn from_labels(points: &Points, centre: &[f64], components: usize, labels: &[usize]) -> Expected {
    let moments = Moments::of(points, centre, components, |n, take| take(labels[n], 1.0));
    Expected { moments, negentropy: 0.0 }
}

/// What an E step with these responsibilities would have left.
///
/// # Errors
/// [`Error::Argument`] named `resp` for shares that are not (N, K), not finite, negative, or of rows that do
/// not sum to 1.
pub(super) fn from_shares(points: &Points, centre: &[f64], components: usize, shares: &[f64]) -> Result<Expected> {
    if shares.len() != points.count() * components {
        let expected = format!("responsibilities ({}, {components})", points.count());
        return Err(Error::argument("resp", expected, format!("{} numbers", shares.len())));
    }
    if let Some(share) = shares.iter().find(|r| !(r.is_finite() && **r >= 0.0)) {
        return Err(Error::argument("resp", "finite responsibilities that are not negative", share));
    }
    let sums = shares.chunks_exact(components).map(|row| row.iter().sum::<f64>());
    if let Some((n, sum)) = sums.enumerate().find(|(_, sum)| (sum - 1.0).abs() > SUM_TOLERANCE) {
        return Err(Error::argument("resp", "rows that sum to 1", format!("{sum} in row {n}")));
    }
    let entropy = |row: &[f64]| row.iter().filter(|r| **r > 0.0).map(|r| r * r.ln()).sum::<f64>();
    let rows = shares.chunks_exact(components).enumerate();
    let negentropy = rows.map(|(n, row)| points.weight(n) * entropy(row)).sum();
    let moments = Moments::of(points, centre, components, |n, take| {
        let row = &shares[n * components..(n + 1) * components];
        row.iter().enumerate().filter(|(_, share)| **share > 0.0).for_each(|(k, share)| take(k, *share));
    });
    Ok(Expected { moments, negentropy })
}
