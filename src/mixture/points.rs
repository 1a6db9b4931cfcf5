//! Weighted points: as they come, and as kernels want them.

use crate::error::{Error, Result};

/// Points of one block of a kernel; a multiple of every lane count.
pub(super) const BLOCK: usize = 64;
/// Points of one task. Fixed, so that sums never depend on the number of threads.
pub(super) const BAND: usize = 1024;
/// Largest coordinate whose square, summed over points, is far from overflow.
pub(super) const LARGEST: f64 = 1e140;

/// N points of D coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Points<'a> {
    /// D, at least 1.
    pub dimensions: usize,
    /// Coordinates (N, D), row-major.
    pub values: &'a [f64],
    /// Weights (N), not negative; none: 1 each. A weight is evidence: 3 is the point three times.
    pub weights: Option<&'a [f64]>,
}

impl Points<'_> {
    /// N.
    pub fn count(&self) -> usize {
        self.values.len() / self.dimensions.max(1)
    }

    /// The weight of a point.
    pub(super) fn weight(&self, n: usize) -> f64 {
        self.weights.map_or(1.0, |weights| weights[n])
    }

    /// The coordinates of a point.
    pub(super) fn at(&self, n: usize) -> &[f64] {
        &self.values[n * self.dimensions..(n + 1) * self.dimensions]
    }

    /// Whether the coordinates can be used at all.
    ///
    /// # Errors
    /// [`Error::Argument`] named `X`: no point, no coordinate, or one that is not finite.
    pub(super) fn check_values(&self) -> Result<()> {
        if self.dimensions == 0 || self.values.is_empty() || !self.values.len().is_multiple_of(self.dimensions) {
            let got = format!("{} numbers in {} dimensions", self.values.len(), self.dimensions);
            return Err(Error::argument("X", "at least one point with at least one coordinate", got));
        }
        match self.values.iter().find(|x| !x.is_finite() || x.abs() > LARGEST) {
            Some(x) => Err(Error::argument("X", format!("finite coordinates up to {LARGEST:e}"), format!("{x:e}"))),
            None => Ok(()),
        }
    }

    /// Whether points and weights can be fitted.
    ///
    /// # Errors
    /// As [`Points::check_values`]; named `sample_weight`: another number of weights than points, one that is
    /// negative or not finite, nothing but zeros, or so large that sums of squares overflow.
    pub(super) fn check(&self) -> Result<()> {
        self.check_values()?;
        let Some(weights) = self.weights else { return Ok(()) };
        let wrong = |expected: &str, got: String| Err(Error::argument("sample_weight", expected, got));
        if weights.len() != self.count() {
            return wrong("one weight for each point", format!("{} for {} points", weights.len(), self.count()));
        }
        if let Some(weight) = weights.iter().find(|w| !w.is_finite() || **w < 0.0) {
            return wrong("finite weights that are not negative", weight.to_string());
        }
        let total: f64 = weights.iter().sum();
        if total <= 0.0 || !total.is_finite() {
            return wrong("weights that are not all zero, with a finite sum", format!("weights with the sum {total}"));
        }
        // No sum of weighted squares, about whatever mean, is greater.
        let largest = self.values.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        if !(4.0 * largest * largest * total).is_finite() {
            let got = format!("weights with the sum {total:e} and coordinates up to {largest:e}");
            return wrong("weights with which sums of squares are finite", got);
        }
        Ok(())
    }

    /// Weighted mean (D), summed about the heaviest point: that of equal ones is theirs to the last bit, so
    /// that they have no spread however large they are.
    pub(super) fn mean(&self) -> Vec<f64> {
        let about =
            self.at((0..self.count()).fold(0, |best, n| if self.weight(n) > self.weight(best) { n } else { best }));
        let mut sums = vec![0.0; self.dimensions];
        let mut total = 0.0;
        for n in 0..self.count() {
            let weight = self.weight(n);
            total += weight;
            for (sum, (x, about)) in sums.iter_mut().zip(self.at(n).iter().zip(about)) {
                *sum += weight * (x - about);
            }
        }
        sums.iter().zip(about).map(|(sum, about)| about + sum / total).collect()
    }
}

/// Points about a centre, coordinate by coordinate, filled up to whole blocks with points of no weight.
#[derive(Debug)]
pub(super) struct Planes {
    /// N, filled up to whole blocks.
    pub padded: usize,
    pub dimensions: usize,
    /// What was taken off the coordinates.
    pub centre: Vec<f64>,
    /// (D, padded).
    pub values: Vec<f64>,
    /// (padded).
    pub weights: Vec<f64>,
    /// Sum of the weights.
    pub total: f64,
}

impl Planes {
    /// Those of checked `points`.
    pub fn new(points: &Points, centre: Vec<f64>) -> Self {
        let (count, dimensions) = (points.count(), points.dimensions);
        let padded = count.next_multiple_of(BLOCK);
        let mut values = vec![0.0; dimensions * padded];
        let mut weights = vec![0.0; padded];
        for n in 0..count {
            weights[n] = points.weight(n);
            for (d, (x, c)) in points.at(n).iter().zip(&centre).enumerate() {
                values[d * padded + n] = x - c;
            }
        }
        let total = weights.iter().sum();
        Self { padded, dimensions, centre, values, weights, total }
    }

    /// One coordinate of all points.
    pub fn plane(&self, d: usize) -> &[f64] {
        &self.values[d * self.padded..(d + 1) * self.padded]
    }
}
