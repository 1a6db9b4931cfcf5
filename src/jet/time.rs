//! Time differences of jets: the two schemes.

use crate::math::Real;
use crate::types::choices;

/// How the first and second time derivative are taken from three jets, and to which frame they belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TimeScheme {
    /// At the middle frame: `i' = (i(t0) - i(t0-2)) / 2`, `i'' = i(t0) - 2 i(t0-1) + i(t0-2)`.
    #[default]
    Central,
    /// At the newest frame (WO2010/098160, (33)): `i' = i(t0) - i(t0-1)`, the same `i''`, coefficients from
    /// `i(t0)`. First-order accurate.
    Backward,
}

/// A jet and its two time derivatives, per frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JetRates<T> {
    /// `i`, the coefficients.
    pub jet: [T; 6],
    /// `i'`.
    pub first: [T; 6],
    /// `i''`.
    pub second: [T; 6],
}

choices!(TimeScheme, "scheme": Central "central", Backward "backward");

impl TimeScheme {
    /// Which of three frames, oldest first, the estimate belongs to.
    pub fn frame(self) -> usize {
        match self {
            Self::Central => 1,
            Self::Backward => 2,
        }
    }

    /// Weights of the three frames, oldest first, in `i'`.
    pub fn first_weights(self) -> [f64; 3] {
        match self {
            Self::Central => [-0.5, 0.0, 0.5],
            Self::Backward => [0.0, -1.0, 1.0],
        }
    }

    /// `i`, `i'` and `i''` from the jets (or any linear samples) of three frames, oldest first.
    #[inline(always)]
    pub fn rates<T: Real>(self, old: [T; 6], middle: [T; 6], new: [T; 6]) -> JetRates<T> {
        let half = T::from_f64(0.5);
        let mut first = [T::default(); 6];
        let mut second = [T::default(); 6];
        for k in 0..6 {
            // Differences of neighbours first: what does not change cancels exactly.
            let (late, early) = (new[k] - middle[k], middle[k] - old[k]);
            second[k] = late - early;
            first[k] = match self {
                Self::Central => half * (new[k] - old[k]),
                Self::Backward => late,
            };
        }
        let jet = match self {
            Self::Central => middle,
            Self::Backward => new,
        };
        JetRates { jet, first, second }
    }
}
