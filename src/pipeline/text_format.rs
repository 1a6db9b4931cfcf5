//! What the texts that a run can write have in common.

use crate::error::{Error, Result};

/// The kinds of text that one kind of result is written as; the first is the default.
pub trait TextFormat: Copy + PartialEq + 'static {
    /// Every format.
    const ALL: &'static [Self];

    /// The format's word.
    fn name(self) -> &'static str;

    /// The extension of its files.
    fn extension(self) -> &'static str;

    /// The format called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`] named `format`.
    fn parse(name: &str) -> Result<Self> {
        let known = Self::ALL.iter().copied().find(|format| format.name() == name);
        known.ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|format| format.name()).collect();
            Error::argument("format", names.join(" or "), name)
        })
    }
}
