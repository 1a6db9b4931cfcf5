//! Why a pixel has, or lacks, an estimate.

use super::choices;

/// The state of one estimate. `Border`, `NonFinite`, `Masked`, `Unobservable` and `MissingFrame` come with
/// NaN values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
pub enum Status {
    /// A full estimate.
    #[default]
    Ok = 0,
    /// The neighbourhood reaches over the edge of the frame.
    Border = 1,
    /// The neighbourhood holds a NaN or infinite sample.
    NonFinite = 2,
    /// The pixel, or one its neighbourhood needs, is masked out.
    Masked = 3,
    /// The equations do not determine every unknown (theorem 1 of the patent fails here).
    Unobservable = 4,
    /// Unobservable, and `rank_deficient="min_norm"`: values are finite but not unique.
    MinNorm = 5,
    /// A filter lost its positive-definite covariance and was restarted here.
    Repaired = 6,
    /// No estimate at this time: the prediction from earlier ones, with a growing covariance.
    Predicted = 7,
    /// A full estimate that the frames contradict: brightness changes along it by far more than usual. The
    /// pixel is occluded in another frame, has changed, or moves differently; the covariance does not include
    /// this, and the estimate is not valid.
    Inconsistent = 8,
    /// The sequence has no frame before or after this one that the estimate needs.
    MissingFrame = 9,
}

choices!(Status:
    Ok "ok",
    Border "border",
    NonFinite "non_finite",
    Masked "masked",
    Unobservable "unobservable",
    MinNorm "min_norm",
    Repaired "repaired",
    Predicted "predicted",
    Inconsistent "inconsistent",
    MissingFrame "missing_frame",
);

impl Status {
    /// The status with this code.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(code as usize).copied()
    }

    /// Whether the estimate may be used: it is unique and complete, and the frames do not contradict it.
    pub fn is_valid(self) -> bool {
        self.has_estimate() && self != Self::Inconsistent
    }

    /// Whether there is a unique and complete estimate, even one that the frames contradict.
    pub fn has_estimate(self) -> bool {
        matches!(self, Self::Ok | Self::Repaired | Self::Predicted | Self::Inconsistent)
    }
}
