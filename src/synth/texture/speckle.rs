//! Sprayed blobs, as strain laboratories put on their specimens: points strewn at random over the whole plane
//! (a Poisson process), found again cell by cell.

use super::Texture;
use crate::error::{Error, Result};
use crate::math::random::CounterRng;

/// Round dark blobs strewn at random (Poisson) on a bright ground; overlaps merge smoothly.
///
/// `I = dark + (bright - dark) prod_k (1 - w_k)`, where `w_k` falls from 1 to 0 over the blob's edge (twice
/// continuously differentiable). Radii are spread evenly over 0.7 to 1.3 of `radius`. The pattern does not
/// repeat within 2^31 cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speckle {
    radius: f64,
    edge: f64,
    cell: f64,
    dark: f64,
    bright: f64,
    rng: CounterRng,
}

impl Speckle {
    /// Blobs of mean `radius` px on about the share `coverage` of the plane, their edge `edge` px wide.
    ///
    /// # Errors
    /// [`Error::Argument`] for a radius or an edge that is not positive, an edge wider than the radius, a
    /// coverage outside 0.05 to 0.95, or brightness that is not finite.
    pub fn new(radius: f64, coverage: f64, edge: f64, levels: (f64, f64), seed: u64) -> Result<Self> {
        if !(radius.is_finite() && radius > 0.0) {
            return Err(Error::argument("radius", "a positive number of px", radius));
        }
        if !(0.05..=0.95).contains(&coverage) {
            return Err(Error::argument("coverage", "0.05 to 0.95", coverage));
        }
        if !(edge > 0.0 && edge <= radius) {
            return Err(Error::argument("edge", format!("more than 0 and at most the radius, {radius} px"), edge));
        }
        if !(levels.0.is_finite() && levels.1.is_finite()) {
            return Err(Error::argument("levels", "finite grey levels", format!("{levels:?}")));
        }
        // Blobs strewn at random leave exp(-area / cell^2) free. Mean of the squared radius factor: 1.03.
        let cell = radius * (1.03 * std::f64::consts::PI / -(1.0 - coverage).ln()).sqrt();
        let rng = CounterRng::new(seed);
        Ok(Self { radius, edge, cell, dark: levels.0, bright: levels.1, rng })
    }
}

/// One number for each cell of the plane, for the random stream of that cell.
pub(crate) fn cell_index(column: i64, row: i64) -> u64 {
    u64::from(column as u32) | u64::from(row as u32) << 32
}

/// Number of points in a cell that holds one on average, from a uniform number in [0, 1).
pub(crate) fn poisson_of_mean_one(uniform: f64) -> u64 {
    let (mut count, mut term) = (0, (-1.0f64).exp());
    let mut sum = term;
    while uniform > sum && count < 16 {
        count += 1;
        term /= count as f64;
        sum += term;
    }
    count
}

/// From 0 to 1 for z from 0 to 1, with two continuous derivatives.
pub(crate) fn smooth_step(z: f64) -> f64 {
    let z = z.clamp(0.0, 1.0);
    z * z * z * (z * (6.0 * z - 15.0) + 10.0)
}

impl Texture for Speckle {
    fn value(&self, x: f64, y: f64) -> f64 {
        if !(x.is_finite() && y.is_finite()) {
            return f64::NAN;
        }
        let reach = ((1.3 * self.radius + self.edge) / self.cell).ceil() as i64;
        let (column, row) = ((x / self.cell).floor() as i64, (y / self.cell).floor() as i64);
        let mut free = 1.0;
        for j in row - reach..=row + reach {
            for i in column - reach..=column + reach {
                let cell = self.rng.stream(cell_index(i, j));
                for k in 0..poisson_of_mean_one(cell.uniform(0)) {
                    let dx = x - (i as f64 + cell.uniform(3 * k + 1)) * self.cell;
                    let dy = y - (j as f64 + cell.uniform(3 * k + 2)) * self.cell;
                    let radius = self.radius * (0.7 + 0.6 * cell.uniform(3 * k + 3));
                    free *= smooth_step((dx.hypot(dy) - radius) / self.edge + 0.5);
                }
            }
        }
        self.dark + (self.bright - self.dark) * free
    }
}
