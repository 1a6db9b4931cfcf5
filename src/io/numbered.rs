//! One file a frame: names for outputs of streams of any length.
//!
//! A stream's results go to numbered files, each written whole. A single archive would have to know the
//! number of frames before its first byte (the shape stands in front of an array) and would be lost as a
//! whole when a long run is stopped.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Names `folder/stem_000123.extension`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NumberedFiles {
    folder: PathBuf,
    stem: String,
    extension: String,
}

impl NumberedFiles {
    /// Names in `folder`, which is made (with those above it) when it does not exist.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be made or is a file.
    pub fn create(folder: impl AsRef<Path>, stem: &str, extension: &str) -> Result<Self> {
        let folder = folder.as_ref();
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        Ok(Self { folder: folder.to_path_buf(), stem: stem.into(), extension: extension.into() })
    }

    /// Removes the files of an earlier run, which would be read as part of this one: those with these names,
    /// of any number.
    ///
    /// # Errors
    /// [`Error::Io`] when the folder cannot be read or a file not removed.
    pub fn clear(&self) -> Result<()> {
        let entries = std::fs::read_dir(&self.folder).map_err(|e| Error::io(&self.folder, e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::io(&self.folder, e))?.path();
            if path.file_name().and_then(|name| name.to_str()).is_some_and(|name| self.is_own(name)) && path.is_file() {
                std::fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
            }
        }
        Ok(())
    }

    /// Whether [`NumberedFiles::path`] gives this name to a frame.
    fn is_own(&self, name: &str) -> bool {
        let ending = format!(".{}", self.extension);
        let rest = name.strip_prefix(&self.stem).and_then(|rest| rest.strip_prefix('_'));
        let number = rest.and_then(|rest| rest.strip_suffix(&ending)).unwrap_or_default();
        number.len() >= 6 && number.bytes().all(|digit| digit.is_ascii_digit())
    }

    /// The name for the frame `index`: six digits, more where needed.
    pub fn path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}_{index:06}.{}", self.stem, self.extension))
    }
}
