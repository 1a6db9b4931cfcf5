//! The working precision of a computation.

use super::{FlowField, Sample};
use crate::error::{Error, Result};

/// The working precision of a computation on frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// That of the frames: float64 for float64, float32 for all others.
    #[default]
    Auto,
    /// float32.
    Single,
    /// float64.
    Double,
}

impl Precision {
    /// Every precision with its name.
    pub const NAMES: [(&'static str, Self); 3] =
        [("auto", Self::Auto), (f32::DTYPE, Self::Single), (f64::DTYPE, Self::Double)];

    /// The precision called `name`: `auto`, `float32` or `float64`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `precision` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        let found = Self::NAMES.into_iter().find(|(known, _)| *known == name);
        found
            .map(|(_, precision)| precision)
            .ok_or_else(|| Error::argument("precision", "\"float32\", \"float64\" or \"auto\"", format!("{name:?}")))
    }

    /// Whether a sequence of samples of type `dtype` is computed in double precision.
    pub fn is_double(self, dtype: &str) -> bool {
        match self {
            Self::Auto => dtype == f64::DTYPE,
            Self::Single => false,
            Self::Double => true,
        }
    }
}

/// A field of either precision.
#[derive(Debug, Clone)]
pub enum AnyField {
    /// float32.
    Single(FlowField<f32>),
    /// float64.
    Double(FlowField<f64>),
}

impl AnyField {
    /// Index of the frame that the field belongs to.
    pub fn frame_index(&self) -> usize {
        match self {
            Self::Single(field) => field.layout.frame_index,
            Self::Double(field) => field.layout.frame_index,
        }
    }
}
