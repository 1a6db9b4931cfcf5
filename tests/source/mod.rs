//! Reads the repository's source files for the tests of imports and of words.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders of Rust sources: the library with the binary, the Python binding.
pub const SOURCES: [&str; 2] = ["src", "python/src"];

/// The repository.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files below `folder` with the extension, sorted.
pub fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect(folder, extension, &mut found);
    found.sort();
    found
}

fn collect(folder: &Path, extension: &str, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, extension, into);
        } else if path.extension().is_some_and(|e| e == extension) {
            into.push(path);
        }
    }
}

/// Path below the repository, with slashes.
pub fn name_of(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).to_string_lossy().replace('\\', "/")
}

/// The files of [`SOURCES`].
pub fn rust_files() -> Vec<PathBuf> {
    SOURCES.iter().flat_map(|folder| files(&root().join(folder), "rs")).collect()
}
