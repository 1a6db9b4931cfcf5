//! Signed quantities (divergence, curl) as a diverging map: blue below zero, white at zero, red above.

use super::{Picture, Rgb, check_plane, percentile};
use crate::error::Result;
use crate::math::Real;

/// Colours at -1, -1/2, 0, 1/2, 1 of the range; straight lines between them.
const STOPS: [Rgb; 5] = [[22, 56, 132], [102, 158, 214], [247, 247, 247], [228, 134, 96], [140, 20, 34]];

/// The symmetric range of a plane: the `percentile` of its finite absolute values, so that a few outliers do
/// not wash out the rest; 1 where all of it is zero or unknown.
pub fn symmetric_range<T: Real>(plane: &[T], at_percentile: f64) -> f64 {
    let range = percentile(plane.iter().map(|v| v.to_f64().abs()), at_percentile);
    if range > 0.0 { range } else { 1.0 }
}

/// A diverging map with a range symmetric about zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignedMap {
    /// Value of the strongest red and, negated, blue; `None` (the default): [`symmetric_range`].
    pub range: Option<f64>,
    /// Percentile of the automatic range; default 98.
    pub percentile: f64,
    /// Colour of unknown (NaN or infinite) values; default mid-grey.
    pub unknown: Rgb,
}

impl Default for SignedMap {
    fn default() -> Self {
        Self { range: None, percentile: 98.0, unknown: [110, 110, 110] }
    }
}

impl SignedMap {
    /// A map with a fixed (`Some`) or automatic range.
    pub fn new(range: Option<f64>) -> Self {
        Self { range, ..Self::default() }
    }

    /// The value shown in the strongest colour for this plane.
    pub fn resolve_range<T: Real>(&self, plane: &[T]) -> f64 {
        self.range.filter(|r| *r > 0.0 && r.is_finite()).unwrap_or_else(|| symmetric_range(plane, self.percentile))
    }

    /// The colour of one value by the fixed range (1 without one); none of what is unknown.
    pub fn colour_of(&self, value: f64) -> Option<Rgb> {
        let range = self.range.filter(|r| *r > 0.0 && r.is_finite()).unwrap_or(1.0);
        value.is_finite().then(|| colour(value / range))
    }

    /// A picture of `plane` (row-major, `width x height`).
    ///
    /// # Errors
    /// [`Error::Argument`](crate::Error::Argument) when the plane has another size.
    pub fn picture<T: Real>(&self, plane: &[T], width: usize, height: usize) -> Result<Picture> {
        check_plane("plane", plane, width, height)?;
        let range = self.resolve_range(plane);
        Ok(Picture::from_fn(width, height, |x, y| {
            let value = plane[y * width + x].to_f64();
            if value.is_finite() { colour(value / range) } else { self.unknown }
        }))
    }
}

/// Colour of a value in units of the range.
fn colour(value: f64) -> Rgb {
    let place = (1.0 + value.clamp(-1.0, 1.0)) * (STOPS.len() / 2) as f64;
    let first = (place as usize).min(STOPS.len() - 2);
    let part = place - first as f64;
    let (a, b) = (STOPS[first], STOPS[first + 1]);
    std::array::from_fn(|c| (f64::from(a[c]) * (1.0 - part) + f64::from(b[c]) * part).round() as u8)
}
