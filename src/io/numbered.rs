//! One file a frame: names for outputs of streams of any length.
//!
//! A stream's results go to numbered files, each written whole. A single archive would have to know the
//! number of frames before its first byte (the shape stands in front of an array) and would be lost as a
//! whole when a long run is stopped.

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Names `folder/stem_000123.extension`, or `folder/000123` with an ending.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NumberedFiles {
    folder: PathBuf,
    prefix: String,
    ending: String,
}

impl NumberedFiles {
    /// Names in `folder`, which is made (with those above it) when it does not exist.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be made or is a file.
    pub fn create(folder: impl AsRef<Path>, stem: &str, extension: &str) -> Result<Self> {
        let folder = folder.as_ref();
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        Ok(Self::named(folder, stem, extension))
    }

    /// As [`NumberedFiles::create`], of a folder that is not made.
    pub fn named(folder: impl Into<PathBuf>, stem: &str, extension: &str) -> Self {
        Self { folder: folder.into(), prefix: format!("{stem}_"), ending: format!(".{extension}") }
    }

    /// Names without a stem: `folder/000123` and `ending`, such as `.npz` or `_curl.png`. The folder is not
    /// made.
    pub fn without_stem(folder: impl Into<PathBuf>, ending: impl Into<String>) -> Self {
        Self { folder: folder.into(), prefix: String::new(), ending: ending.into() }
    }

    /// The same names in another folder.
    pub fn moved_to(self, folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), ..self }
    }

    /// Removes the files of an earlier run, which would be read as part of this one: those with these names,
    /// of any number.
    ///
    /// # Errors
    /// [`Error::Io`] when the folder cannot be read or a file not removed.
    pub fn clear(&self) -> Result<()> {
        self.clear_except(|_| false)
    }

    /// As [`NumberedFiles::clear`], without the numbers that `is_kept`.
    ///
    /// # Errors
    /// [`Error::Io`] when the folder cannot be read or a file not removed.
    pub fn clear_except(&self, is_kept: impl Fn(usize) -> bool) -> Result<()> {
        if !self.folder.exists() {
            return Ok(());
        }
        let entries = std::fs::read_dir(&self.folder).map_err(|e| Error::io(&self.folder, e))?;
        for entry in entries {
            let path = entry.map_err(|e| Error::io(&self.folder, e))?.path();
            if self.index(&path).is_some_and(|index| !is_kept(index)) && path.is_file() {
                std::fs::remove_file(&path).map_err(|e| Error::io(&path, e))?;
            }
        }
        Ok(())
    }

    /// The frame that [`NumberedFiles::path`] gives this path to, if any.
    pub fn index(&self, path: &Path) -> Option<usize> {
        let name = path.file_name()?.to_str()?;
        let number = name.strip_prefix(&self.prefix)?.strip_suffix(&self.ending)?;
        let is_number = number.len() >= 6 && number.bytes().all(|digit| digit.is_ascii_digit());
        if is_number && path.parent() == Some(&self.folder) { number.parse().ok() } else { None }
    }

    /// The name for the frame `index`: six digits, more where needed.
    pub fn path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}{index:06}{}", self.prefix, self.ending))
    }
}
