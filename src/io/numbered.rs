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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_padded_and_the_folder_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let files = NumberedFiles::create(folder.path().join("a/b"), "flow", "flo").unwrap();
        assert_eq!(files.path(123), folder.path().join("a/b/flow_000123.flo"));
        assert_eq!(files.path(12_345_678), folder.path().join("a/b/flow_12345678.flo"));
        std::fs::write(folder.path().join("file"), "").unwrap();
        assert!(matches!(NumberedFiles::create(folder.path().join("file"), "x", "y"), Err(Error::Io { .. })));
    }
}
