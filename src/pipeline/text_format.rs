//! What the texts that a run can write have in common.

use crate::error::Result;
use crate::types::choice_by_name;

/// The kinds of text that one kind of result is written as; the first is the default.
pub trait TextFormat: Copy + PartialEq + 'static {
    /// Every format.
    const ALL: &'static [Self];

    /// The format's word.
    fn name(self) -> &'static str;

    /// The extension of its files.
    fn extension(self) -> &'static str {
        self.name()
    }

    /// The format called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::error::Error::Argument) named `format`.
    fn parse(name: &str) -> Result<Self> {
        choice_by_name("format", name, Self::ALL, Self::name)
    }
}
