//! Options of the windowed estimator.

use crate::error::{Error, Result};
use crate::flow::RankPolicy;
use crate::jet::{Neighbourhood, TimeScheme};
use crate::types::choices;

/// Which of the twelve equations (31)/(34) of WO2010/098160 a window sums. All rows weigh the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum RowSet {
    /// Row 1: brightness constancy alone. The cheapest; biased by the stencils' different smoothing on fine
    /// texture.
    Brightness,
    /// Rows 1-3: brightness and gradient constancy.
    Gradient,
    /// Rows 1-6: `J(i) m = i'`, the whole 2-jet once.
    Jet,
    /// All twelve rows, `J(i) m = i'` and `J(i') m = i''`; needs three frames.
    #[default]
    All,
}

choices!(RowSet, "rows": Brightness "brightness", Gradient "gradient", Jet "jet", All "all");

impl RowSet {
    /// Number of equations a pixel contributes: 1, 3, 6 or 12.
    pub fn count(self) -> usize {
        match self {
            Self::Brightness => 1,
            Self::Gradient => 3,
            Self::Jet => 6,
            Self::All => 12,
        }
    }
}

/// Largest window radius, px.
const MAX_RADIUS: f64 = 256.0;

/// Options of the windowed estimate with transport.
#[derive(Debug, Clone, PartialEq)]
pub struct WindowedOptions {
    /// Standard deviation of the Gaussian window, px. Default 4; 2 to 6 are usual.
    pub sigma: f64,
    /// Where the window ends, in standard deviations. Default 3.
    pub truncate: f64,
    /// Which equations are summed. Default [`RowSet::All`]: with the smoothing below it has the least error
    /// on textures, particles and speckle alike (`docs/performance.md`, "Which rows, how much smoothing").
    pub rows: RowSet,
    /// Frames of one estimate: 3 (default), or 2 for a pair, which [`RowSet::All`] does not allow. A pair's
    /// flow belongs to the moment between its frames.
    pub frames: usize,
    /// How time derivatives are taken from three frames. Default central. A pair always takes the difference,
    /// and its mean as coefficients.
    pub scheme: TimeScheme,
    /// Pixels that each jet is fitted to. Default 3x3.
    pub neighbourhood: Neighbourhood,
    /// Standard deviation of a Gaussian that the estimator smooths the frames with first, px; the covariance
    /// holds it. Default 1.5: a 3x3 fit of a texture as fine as the pixels is no derivative, and halves the
    /// flow of sharp particles.
    pub presmooth: Option<f64>,
    /// What to report where the window does not determine every unknown. Default: NaN.
    pub rank_deficient: RankPolicy,
}

impl Default for WindowedOptions {
    fn default() -> Self {
        Self {
            sigma: 4.0,
            truncate: 3.0,
            rows: RowSet::default(),
            frames: 3,
            scheme: TimeScheme::default(),
            neighbourhood: Neighbourhood::default(),
            presmooth: Some(1.5),
            rank_deficient: RankPolicy::default(),
        }
    }
}

impl WindowedOptions {
    /// The default for two frames: rows of brightness and its gradient, since [`RowSet::All`] needs three.
    pub fn pair() -> Self {
        Self { rows: RowSet::Gradient, frames: 2, ..Self::default() }
    }

    /// Refuses values that no window can have.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        let lengths = [("sigma", Some(self.sigma)), ("truncate", Some(self.truncate)), ("presmooth", self.presmooth)];
        for (name, value) in lengths {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return Err(Error::argument(name, "a positive, finite number", value));
            }
        }
        if self.sigma < 0.5 || self.sigma * self.truncate > MAX_RADIUS || self.sigma * self.truncate < 1.0 {
            let want = format!("at least 0.5 px, and with truncate a radius of 1 to {MAX_RADIUS} px");
            return Err(Error::argument("sigma", want, format!("{:?} (truncate {:?})", self.sigma, self.truncate)));
        }
        if !(2..=3).contains(&self.frames) {
            return Err(Error::argument("frames", "2 or 3 for a windowed estimate", self.frames));
        }
        if self.frames == 2 && self.rows == RowSet::All {
            return Err(Error::argument("rows", "brightness, gradient or jet for a pair of frames", self.rows.name()));
        }
        Ok(())
    }

    /// Radius of the window, px: `truncate * sigma`, rounded.
    pub fn radius(&self) -> usize {
        (self.truncate * self.sigma + 0.5) as usize
    }
}
