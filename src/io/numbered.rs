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

    /// The name for the frame `index`: six digits, more where needed.
    pub fn path(&self, index: usize) -> PathBuf {
        self.folder.join(format!("{}_{index:06}.{}", self.stem, self.extension))
    }
}
