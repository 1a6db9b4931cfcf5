//! Options that are chosen by a word.

use crate::error::{Error, Result};

/// The words of an enumeration: the list of its choices, the word for each and, with the name of an
/// argument, the choice by its word.
macro_rules! choices {
    ($choice:ty, $argument:literal: $($variant:ident $word:expr),+ $(,)?) => {
        $crate::types::choices!($choice: $($variant $word),+);
        impl $choice {
            /// The choice called `name`.
            ///
            /// # Errors
            /// [`Error::Argument`](crate::Error::Argument) that lists the words.
            pub fn parse(name: &str) -> $crate::Result<Self> {
                $crate::types::choice_by_name($argument, name, &Self::ALL, Self::name)
            }
        }
    };
    ($choice:ty: $($variant:ident $word:expr),+ $(,)?) => {
        impl $choice {
            /// Every choice.
            pub const ALL: [Self; [$(Self::$variant),+].len()] = [$(Self::$variant),+];

            /// The word in files, on the command line and in Python.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }
    };
}
pub(crate) use choices;

/// The choice called `name`; an error of `argument` that lists the words for another one.
pub(crate) fn choice_by_name<C: Copy>(
    argument: &'static str,
    name: &str,
    all: &[C],
    name_of: fn(C) -> &'static str,
) -> Result<C> {
    all.iter().copied().find(|choice| name_of(*choice) == name).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|choice| name_of(*choice)).collect();
        Error::argument(argument, format!("one of {}", names.join(", ")), format!("{name:?}"))
    })
}
