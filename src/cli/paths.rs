//! The paths that a command reads and writes: no path may be both, and no two options may write one file.

use crate::error::{Error, Result};
use crate::io::write::{NewFolders, link_target};
use crate::io::{NumberedFiles, files_read};
use crate::pipeline::{is_device, is_folder};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Every path that a command reads or writes. Devices, pipes and standard streams are left out, as they may
/// be read and written.
#[derive(Debug, Default)]
pub struct CommandPaths {
    read: HashSet<PathBuf>,
    /// Folders around the input, where not even `--force` is meant for results.
    around_input: HashSet<PathBuf>,
    written: Vec<Written>,
}

/// What one option writes.
#[derive(Debug)]
struct Written {
    option: &'static str,
    given: PathBuf,
    /// The resolved path, of a file or a folder.
    place: PathBuf,
    files: HashSet<PathBuf>,
    numbered: Vec<NumberedFiles>,
}

impl CommandPaths {
    /// Paths of a command that reads the frames of `input`, with every file in a folder or a list or matched
    /// by a pattern.
    pub fn of_input(input: &[String]) -> Self {
        let mut paths = Self::default();
        for file in input.iter().flat_map(|spec| files_read(spec)).filter_map(|file| resolved(&file)) {
            paths.around_input.extend(file.parent().map(Path::to_path_buf));
            paths.read.insert(file);
        }
        paths
    }

    /// Adds files that other options read.
    pub fn reading<'a>(mut self, files: impl IntoIterator<Item = &'a Path>) -> Self {
        self.read.extend(files.into_iter().filter_map(resolved));
        self
    }

    /// Adds a file that `option` writes.
    pub fn writing(self, option: &'static str, file: Option<&Path>) -> Self {
        match file {
            Some(file) => self.writing_files(option, file, [file.to_path_buf()], []),
            None => self,
        }
    }

    /// Adds pictures that `option` writes: a sequence, or numbered files in a folder.
    pub fn writing_pictures(self, option: &'static str, path: Option<&Path>, stem: &str) -> Self {
        match path {
            Some(folder) if is_folder(folder) => self.writing_numbered(option, Some(folder), stem, &["png"]),
            file => self.writing(option, file),
        }
    }

    /// Adds files `stem_000012.extension` that `option` writes into a folder.
    pub fn writing_numbered(
        self,
        option: &'static str,
        folder: Option<&Path>,
        stem: &str,
        extensions: &[&str],
    ) -> Self {
        let Some(folder) = folder else { return self };
        let numbered = extensions.iter().map(|extension| NumberedFiles::named(folder, stem, extension));
        self.writing_files(option, folder, [], numbered)
    }

    /// Adds `files` and `numbered` files that `option` writes to `given`, a file or the folder of them all.
    pub fn writing_files(
        mut self,
        option: &'static str,
        given: &Path,
        files: impl IntoIterator<Item = PathBuf>,
        numbered: impl IntoIterator<Item = NumberedFiles>,
    ) -> Self {
        let Some(place) = resolved(given) else { return self };
        let files = files.into_iter().filter_map(|file| resolved(&file)).collect();
        let numbered = numbered.into_iter().map(|names| names.moved_to(place.clone())).collect();
        self.written.push(Written { option, given: given.to_path_buf(), place, files, numbered });
        self
    }

    /// Checks that nothing read is written, which not even `force` is meant for, and nothing written twice.
    /// Returns the folders that the command may make.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option that writes.
    pub fn check(&self, force: bool) -> Result<NewFolders> {
        for (number, written) in self.written.iter().enumerate() {
            let is_input = self.read.contains(&written.place);
            if is_input || force && self.around_input.contains(&written.place) {
                return Err(written.refused("another place than the input", &written.place));
            }
            if let Some(file) = self.read.iter().find(|file| written.has(file)) {
                return Err(written.refused("another place than the input", file));
            }
            for other in &self.written[..number] {
                if let Some(file) = written.common(other) {
                    return Err(written.refused(&format!("a file of its own, not that of {}", other.option), &file));
                }
            }
        }
        Ok(NewFolders::before(self.written.iter().map(|written| written.place.as_path())))
    }
}

impl Written {
    /// Whether a path is among those written.
    fn has(&self, path: &Path) -> bool {
        self.files.contains(path) || self.numbered.iter().any(|names| names.index(path).is_some())
    }

    /// A path that `other` writes too, or takes for a folder.
    fn common(&self, other: &Self) -> Option<PathBuf> {
        let numbered = self.numbered.iter().find(|names| other.numbered.contains(names));
        let mut theirs = other.files.iter().chain([&other.place]);
        let mut ours = self.files.iter().chain([&self.place]);
        let file = theirs.find(|file| self.has(file)).or_else(|| ours.find(|file| other.has(file)));
        file.cloned().or_else(|| numbered.map(|names| names.path(0)))
    }

    fn refused(&self, expected: &str, file: &Path) -> Error {
        let given = self.given.display();
        let got = if file == self.place {
            given.to_string()
        } else {
            format!("{given}, for files such as {}", file.display())
        };
        Error::argument(self.option, expected, got)
    }
}

/// Whether two paths lead to one file, which need not exist.
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    resolved(one).is_some_and(|path| resolved(other) == Some(path))
}

/// The path without links and dots, also where its end does not exist; `None` for what may be both read and
/// written.
fn resolved(path: &Path) -> Option<PathBuf> {
    if path == Path::new("-") || is_device(path) {
        return None;
    }
    let target = link_target(path);
    if target.exists() {
        return Some(target);
    }
    let absolute = std::path::absolute(target).ok()?;
    match (absolute.parent(), absolute.file_name()) {
        (Some(parent), Some(name)) => Some(resolved(parent)?.join(name)),
        _ => Some(absolute),
    }
}
