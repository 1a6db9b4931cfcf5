//! Options of the recursive fusion.

use crate::error::{Error, Result};

/// Options of [`RecursiveFusion`](super::RecursiveFusion).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecursiveOptions {
    /// Factor of the past information each frame, above 0 and at most 1 (no unit). The memory is `1 / (1 -
    /// forgetting)` frames; 1 never forgets, which suits only motion that is steady for ever. Default 0.95:
    /// 20 frames.
    pub forgetting: f64,
}

impl Default for RecursiveOptions {
    fn default() -> Self {
        Self { forgetting: 0.95 }
    }
}

impl RecursiveOptions {
    /// The options from words: `temporal` is `none` (the default) or `recursive`, `forgetting` its factor.
    ///
    /// # Errors [`Error::Argument`] naming `temporal` for another word, and `forgetting` without recursion or
    /// out of range.
    pub fn parse(temporal: Option<&str>, forgetting: Option<f64>) -> Result<Option<Self>> {
        match temporal.unwrap_or("none") {
            "none" => match forgetting {
                Some(factor) => Err(Error::argument("forgetting", "temporal=recursive beside it", factor)),
                None => Ok(None),
            },
            "recursive" => {
                let options = Self { forgetting: forgetting.unwrap_or(Self::default().forgetting) };
                options.check()?;
                Ok(Some(options))
            }
            other => Err(Error::argument("temporal", "none or recursive", other)),
        }
    }

    /// Checks the range.
    ///
    /// # Errors [`Error::Argument`] naming `forgetting`.
    pub fn check(&self) -> Result<()> {
        if self.forgetting > 0.0 && self.forgetting <= 1.0 {
            return Ok(());
        }
        Err(Error::argument("forgetting", "a factor above 0 and at most 1", self.forgetting))
    }
}
