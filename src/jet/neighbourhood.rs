//! Which pixels a jet is fitted to, and with which weights.

use crate::error::{Error, Result};

/// Longest side of a rectangle and largest offset of a point, px: sums of fourth powers lose digits.
const LARGEST: usize = 257;

/// The pixels around a site that its jet is fitted to.
///
/// With `sigma` a pixel at `(ex, ey)` px weighs `exp(-(ex^2 + ey^2) / (2 sigma^2))` in the fit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Neighbourhood {
    /// `width x height` pixels, each at least 3. An odd side is centred at the site. An even side `n` covers
    /// the offsets `-(n/2 - 1) ..= n/2`, one more to the right (below) than to the left (above); the
    /// quadratic is still expanded at the site itself, so that its jet belongs to the same point as any
    /// other's.
    Rectangle {
        /// Columns, px.
        width: usize,
        /// Rows, px.
        height: usize,
        /// Standard deviation of the Gaussian weight, px; `None`: equal weights.
        sigma: Option<f64>,
    },
    /// Any set of different offsets `(ex, ey)` that determines a quadratic: its design matrix has rank 6.
    Points {
        /// Offsets from the site, px, right and down.
        offsets: Vec<(i32, i32)>,
        /// Standard deviation of the Gaussian weight, px; `None`: equal weights.
        sigma: Option<f64>,
    },
}

impl Default for Neighbourhood {
    fn default() -> Self {
        Self::square(3)
    }
}

impl Neighbourhood {
    /// A square of `side x side` equally weighted pixels.
    pub fn square(side: usize) -> Self {
        Self::Rectangle { width: side, height: side, sigma: None }
    }

    /// The standard deviation of the weights, px.
    pub fn sigma(&self) -> Option<f64> {
        match self {
            Self::Rectangle { sigma, .. } | Self::Points { sigma, .. } => *sigma,
        }
    }

    /// The same pixels with Gaussian weights of standard deviation `sigma`, px; unchanged for `None`.
    pub fn weighted(mut self, sigma: Option<f64>) -> Self {
        let (Self::Rectangle { sigma: own, .. } | Self::Points { sigma: own, .. }) = &mut self;
        *own = sigma.or(*own);
        self
    }

    /// Root mean square distance along one axis of the (weighted) pixels from their mean, px.
    pub fn spread(&self) -> f64 {
        let weigh = |&(x, y): &(i32, i32)| {
            let squared = f64::from(x).powi(2) + f64::from(y).powi(2);
            (f64::from(x), f64::from(y), self.sigma().map_or(1.0, |sigma| (-0.5 * squared / (sigma * sigma)).exp()))
        };
        let pixels: Vec<_> = self.offsets().iter().map(weigh).collect();
        let total: f64 = pixels.iter().map(|p| p.2).sum();
        let mean = |value: &dyn Fn(&(f64, f64, f64)) -> f64| pixels.iter().map(|p| p.2 * value(p)).sum::<f64>() / total;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        (0.5 * mean(&|p| (p.0 - x).powi(2) + (p.1 - y).powi(2))).sqrt()
    }

    /// Offsets of the pixels, row by row for a rectangle.
    pub fn offsets(&self) -> Vec<(i32, i32)> {
        match self {
            Self::Rectangle { width, height, .. } => {
                side_offsets(*height).flat_map(|y| side_offsets(*width).map(move |x| (x, y))).collect()
            }
            Self::Points { offsets, .. } => offsets.clone(),
        }
    }

    /// Refuses sizes, offsets and weights that cannot be fitted to (the rank is checked later).
    pub(super) fn check(&self) -> Result<()> {
        if let Some(sigma) = self.sigma()
            && !(sigma.is_finite() && sigma > 0.0)
        {
            return Err(Error::argument("neighbourhood_sigma", "a positive, finite number of px", sigma));
        }
        match self {
            Self::Rectangle { width, height, .. } => {
                let sides = 3..=LARGEST;
                if !(sides.contains(width) && sides.contains(height)) {
                    let want = format!("a rectangle from 3 x 3 to {LARGEST} x {LARGEST} px");
                    return Err(Error::argument("neighbourhood", want, format!("{width} x {height}")));
                }
            }
            Self::Points { offsets, .. } => {
                let far = |v: i32| v.unsigned_abs() as usize > LARGEST / 2;
                if let Some(p) = offsets.iter().find(|p| far(p.0) || far(p.1)) {
                    let want = format!("offsets of at most {} px", LARGEST / 2);
                    return Err(Error::argument("neighbourhood", want, format!("{p:?}")));
                }
                let mut sorted = offsets.clone();
                sorted.sort_unstable();
                if let Some([twice, ..]) = sorted.windows(2).find(|p| p[0] == p[1]) {
                    return Err(Error::argument("neighbourhood", "different offsets", format!("{twice:?} twice")));
                }
            }
        }
        Ok(())
    }
}

/// Offsets along one side of a rectangle.
pub(super) fn side_offsets(side: usize) -> impl Iterator<Item = i32> + Clone {
    let first = -((side as i32 - 1) / 2);
    first..first + side as i32
}

/// Weight of a pixel at distance `e` px along one axis.
pub(super) fn weight(sigma: Option<f64>, e: f64) -> f64 {
    sigma.map_or(1.0, |s| (-0.5 * (e / s).powi(2)).exp())
}
