//! Files that appear whole or not at all.

use crate::error::{Error, Result};
use crate::parallel::PerProcess;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::{NamedTempFile, TempDir};

/// A file under a temporary name in its target's folder until [`AtomicFile::commit`] renames it.
///
/// Devices and named pipes are written directly; a symbolic link keeps pointing where it points.
#[derive(Debug)]
pub struct AtomicFile {
    target: PathBuf,
    inner: BufWriter<Inner>,
}

#[derive(Debug)]
enum Inner {
    Temporary(Temporary),
    Direct(File),
}

/// A temporary file that [`remove_temporaries`] knows of as long as it has its temporary name.
#[derive(Debug)]
struct Temporary(Option<NamedTempFile>);

/// A temporary folder for files that are to appear together; removed with what is left in it on drop.
#[derive(Debug)]
pub(crate) struct TemporaryFolder(TempDir);

impl TemporaryFolder {
    pub fn inside(folder: &Path) -> Result<Self> {
        let mut names = temporaries();
        let made = tempfile::Builder::new().prefix(".jacoflow-").suffix(".part").tempdir_in(folder);
        let made = made.map_err(|error| Error::io(folder, error))?;
        names.push(made.path().to_path_buf());
        Ok(Self(made))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        temporaries().retain(|name| name != self.0.path());
    }
}

/// Names of this process's temporary files and folders, not those of the process it was forked from.
static TEMPORARIES: PerProcess<Mutex<Vec<PathBuf>>> = PerProcess::new();

fn temporaries() -> MutexGuard<'static, Vec<PathBuf>> {
    TEMPORARIES.get().lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes every temporary file and folder of this process (a second Ctrl-C does not unwind). While the
/// returned guard lives no other thread can begin or name a file: keep it to the end.
#[must_use = "files made after the guard is dropped are not removed"]
pub(crate) fn remove_temporaries() -> impl Drop {
    let mut names = temporaries();
    for name in names.drain(..) {
        // What cannot be removed cannot be helped any more.
        let _ = std::fs::remove_file(&name).or_else(|_| std::fs::remove_dir_all(&name));
    }
    names
}

impl Temporary {
    fn beside(target: &Path) -> io::Result<Self> {
        let mut names = temporaries();
        let file = temporary_beside(target)?;
        names.push(file.path().to_path_buf());
        Ok(Self(Some(file)))
    }

    /// Its errors are the system's, with their code; those of the named file hold its temporary name instead.
    fn file(&mut self) -> io::Result<&mut File> {
        self.0.as_mut().map(NamedTempFile::as_file_mut).ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn persist(mut self, target: &Path) -> io::Result<()> {
        self.end(|file| file.persist(target).map(drop).map_err(|e| e.error))
    }

    /// Ends the life under the temporary name by `how`.
    fn end(&mut self, how: impl FnOnce(NamedTempFile) -> io::Result<()>) -> io::Result<()> {
        let Some(file) = self.0.take() else { return Ok(()) };
        let mut names = temporaries();
        names.retain(|name| name != file.path());
        how(file)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        // Dropping removes the file.
        let _ = self.end(|file| {
            drop(file);
            Ok(())
        });
    }
}

impl AtomicFile {
    /// Opens a temporary file beside `path`.
    ///
    /// # Errors
    /// [`Error::Io`] with `path` when its folder does not exist or may not be written, or `path` is a folder
    /// or a link in a loop of links.
    pub fn create(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let target = link_target(path);
        let inner = match target.metadata() {
            Err(error) if target.is_symlink() => return Err(Error::io(path, error)),
            Ok(meta) if meta.is_dir() => {
                return Err(Error::io(path, io::Error::from(io::ErrorKind::IsADirectory)));
            }
            Ok(meta) if !meta.is_file() => {
                Inner::Direct(File::options().write(true).open(&target).map_err(|e| Error::io(path, e))?)
            }
            _ => Inner::Temporary(Temporary::beside(&target).map_err(|e| Error::io(path, e))?),
        };
        Ok(Self { target, inner: BufWriter::with_capacity(1 << 16, inner) })
    }

    /// Gives the file its final name, replacing what was there.
    ///
    /// # Errors
    /// [`Error::Io`] when the rest cannot be written or the name cannot be given; the temporary file is then
    /// gone.
    pub fn commit(self) -> Result<()> {
        let Self { target, inner } = self;
        let inner = inner.into_inner().map_err(|e| Error::io(&target, e.into_error()))?;
        match inner {
            Inner::Direct(_) => Ok(()),
            Inner::Temporary(file) => file.persist(&target).map_err(|e| Error::io(&target, e)),
        }
    }
}

impl AtomicFile {
    /// As [`AtomicFile::commit`], under another name in the same folder: for an interrupted run.
    pub fn commit_as(mut self, path: impl AsRef<Path>) -> Result<()> {
        self.target = path.as_ref().to_path_buf();
        self.commit()
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.inner.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

impl Write for Inner {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Temporary(file) => file.file()?.write(bytes),
            Self::Direct(file) => file.write(bytes),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Inner {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::Temporary(file) => file.file()?.seek(to),
            Self::Direct(file) => file.seek(to),
        }
    }
}

/// Longest chain of symbolic links, that of Linux.
const MAX_LINKS: usize = 40;

/// Where a path leads: symbolic links are followed, also to what does not exist yet. A link itself where they
/// form a loop.
pub(crate) fn link_target(path: &Path) -> PathBuf {
    let mut target = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        if let Ok(whole) = target.canonicalize() {
            return whole;
        }
        let Ok(next) = target.read_link() else { break };
        // Relative to the folder of the link.
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    target
}

/// Paths that did not exist before, the innermost first. On drop those that are empty folders are removed, so
/// that a run that failed leaves none.
#[must_use = "the folders are removed when this is dropped"]
#[derive(Debug)]
pub(crate) struct NewFolders(Vec<PathBuf>);

impl NewFolders {
    /// Those of `places`, and of the folders around them, that do not exist yet.
    pub fn before<'a>(places: impl IntoIterator<Item = &'a Path>) -> Self {
        let around = places.into_iter().flat_map(Path::ancestors);
        let mut new: Vec<PathBuf> = around.filter(|place| !place.exists()).map(Path::to_path_buf).collect();
        new.sort_by_key(|path| std::cmp::Reverse(path.components().count()));
        Self(new)
    }
}

impl Drop for NewFolders {
    fn drop(&mut self) {
        for path in &self.0 {
            // Fails for files and for folders that hold something, which stay.
            let _ = std::fs::remove_dir(path);
        }
    }
}

/// A file, or standard output.
#[derive(Debug)]
pub(super) enum Output {
    File(AtomicFile),
    Stream(BufWriter<io::Stdout>),
}

impl Output {
    /// The file at `path`, or standard output for `-`, and its name in messages.
    pub fn open(path: &Path) -> Result<(Self, PathBuf)> {
        if path == Path::new("-") {
            return Ok((Self::Stream(BufWriter::new(io::stdout())), "standard output".into()));
        }
        Ok((Self::File(AtomicFile::create(path)?), path.to_path_buf()))
    }

    /// Writes what is left, and gives a file its name.
    pub fn finish(self) -> Result<()> {
        match self {
            Self::File(file) => file.commit(),
            Self::Stream(mut stream) => stream.flush().map_err(|e| Error::io("standard output", e)),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Stream(stream) => stream.write(bytes),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Stream(stream) => stream.flush(),
        }
    }
}

/// Writes a whole file: `write` fills it, then it gets its name. An error keeps what was there.
pub fn atomic<R>(path: impl AsRef<Path>, write: impl FnOnce(&mut AtomicFile) -> Result<R>) -> Result<R> {
    let mut file = AtomicFile::create(path)?;
    let result = write(&mut file)?;
    file.commit()?;
    Ok(result)
}

/// As [`atomic`], for a `write` that fails only as the operating system does.
pub(crate) fn atomic_io(path: &Path, write: impl FnOnce(&mut AtomicFile) -> io::Result<()>) -> Result<()> {
    atomic(path, |file| write(file).map_err(|e| Error::io(path, e)))
}

fn temporary_beside(target: &Path) -> io::Result<NamedTempFile> {
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".jacoflow-").suffix(".part");
    #[cfg(unix)]
    {
        // As any other new file: the process's mask decides, not the private mode of temporary files.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
        builder.tempfile_in(folder)
    }
    #[cfg(not(unix))]
    builder.tempfile_in(folder)
}
