//! Where drawn pictures go: numbered files in a folder, or a sequence.

use crate::error::{Error, Result};
use crate::image::{picture::Picture, picture::grey_picture};
use crate::io::write::TemporaryFolder;
use crate::io::{NumberedFiles, SequenceWriter, write_frame_png, write_picture};
use crate::pipeline::output::{check_target, is_folder};
use crate::pipeline::sink::{Ending, TableTarget, end_table};
use crate::types::{AnyFrame, Frame};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Takes pictures one after the other.
#[derive(Debug)]
pub(super) struct Album {
    place: Place,
    written: usize,
    latest: Option<PathBuf>,
}

#[derive(Debug)]
enum Place {
    Folder(NumberedFiles),
    /// A folder that holds pictures of an earlier run, until this one is complete.
    Replaced(Replacement),
    Sequence(TableTarget, Option<SequenceWriter>),
}

/// Whether a path names a sequence, and not a folder. Other files than sequences are not written, and a
/// folder that looks like one is not made by mistake.
fn is_sequence(path: &Path, argument: &'static str) -> Result<bool> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("y4m")) {
        return Ok(true);
    }
    let wanted = "a folder for pictures, or a sequence by the name *.y4m";
    if path == Path::new("-") {
        return Err(Error::argument(argument, wanted, "- (standard output)"));
    }
    if path.exists() && !path.is_dir() {
        return Err(Error::argument(argument, wanted, path.display()));
    }
    if !is_folder(path) {
        let got = format!("{0}; for a new folder of this name write {0}/", path.display());
        return Err(Error::argument(argument, wanted, got));
    }
    Ok(false)
}

impl Album {
    /// A folder for `stem_000012.png`, ..., which is made when it does not exist, or a sequence of
    /// `frame_rate` frames per second.
    ///
    /// Errors name `argument`.
    pub fn create(path: &Path, stem: &str, argument: &'static str, frame_rate: f64) -> Result<Self> {
        let place = if is_sequence(path, argument)? {
            Place::Sequence(TableTarget::File(path.to_path_buf()), Some(SequenceWriter::create(path, frame_rate)?))
        } else if earlier(path, stem).is_empty() {
            Place::Folder(NumberedFiles::create(path, stem, "png")?)
        } else {
            Place::Replaced(Replacement::new(path, stem)?)
        };
        Ok(Self { place, written: 0, latest: None })
    }

    /// Refuses, naming `argument`, to replace a sequence, or to mix pictures with those of an earlier run.
    pub fn check(path: &Path, stem: &str, argument: &'static str) -> Result<()> {
        if is_sequence(path, argument)? {
            return check_target(path, false).map_err(|error| error.about(argument));
        }
        match earlier(path, stem).into_iter().next() {
            Some(path) => {
                let wanted = "a place without earlier results (--force replaces them)";
                Err(Error::argument(argument, wanted, path.display()))
            }
            None => Ok(()),
        }
    }

    /// Adds the picture of the frame `index`.
    pub fn add(&mut self, index: usize, picture: &Picture) -> Result<()> {
        self.add_by(index, |file| write_picture(file, picture), |sequence| sequence.write(picture))
    }

    /// As [`Album::add`], of grey levels: files have one channel.
    pub fn add_grey(&mut self, index: usize, levels: Frame<u8>) -> Result<()> {
        let frame = AnyFrame::U8(levels);
        self.add_by(index, |file| write_frame_png(file, &frame), |sequence| sequence.write(&grey_picture(&frame)))
    }

    fn add_by(
        &mut self,
        index: usize,
        to_file: impl FnOnce(&Path) -> Result<()>,
        to_sequence: impl FnOnce(&mut SequenceWriter) -> Result<()>,
    ) -> Result<()> {
        match &mut self.place {
            Place::Folder(files) => {
                let file = files.path(index);
                to_file(&file)?;
                self.latest = Some(file);
            }
            Place::Replaced(new) => {
                to_file(&new.files.path(index))?;
                self.latest = Some(new.in_place.path(index));
            }
            Place::Sequence(_, Some(sequence)) => to_sequence(sequence)?,
            Place::Sequence(_, None) => {}
        }
        self.written += 1;
        Ok(())
    }

    /// A sequence gets its name when the run is complete; what there is of one that was stopped is kept as
    /// `name.partial.y4m`. Pictures of an earlier run are replaced, all of them, when the run is complete;
    /// those of one that was stopped are kept in `name.partial` beside them.
    pub fn finish(&mut self, ending: Ending) -> Result<()> {
        let any = self.written > 0;
        match &mut self.place {
            Place::Folder(_) => {}
            Place::Replaced(new) => self.latest = new.finish(ending, self.latest.as_ref())?,
            Place::Sequence(target, writer) => {
                if let Some(sequence) = writer.take() {
                    self.latest = end_table(target, ending, any, |name| match name {
                        None => sequence.finish(),
                        Some(path) => sequence.finish_as(path),
                    })?;
                }
            }
        }
        Ok(())
    }

    /// How many files there are, and the last of them.
    pub fn files(&self) -> (usize, Option<PathBuf>) {
        match &self.place {
            Place::Folder(_) | Place::Replaced(_) => (self.written, self.latest.clone()),
            Place::Sequence(..) => (usize::from(self.latest.is_some()), self.latest.clone()),
        }
    }
}

/// Pictures `stem_000012.png` in a folder.
fn earlier(folder: &Path, stem: &str) -> Vec<PathBuf> {
    let ours = |path: &PathBuf| {
        let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let number = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('_'));
        path.extension().is_some_and(|e| e == "png") && number.is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()))
    };
    let entries = folder.read_dir().into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(ours).collect()
}

/// Pictures that take the place of earlier ones: they wait in a temporary folder inside the other.
#[derive(Debug)]
struct Replacement {
    folder: PathBuf,
    stem: String,
    waiting: TemporaryFolder,
    files: NumberedFiles,
    in_place: NumberedFiles,
}

impl Replacement {
    fn new(folder: &Path, stem: &str) -> Result<Self> {
        let waiting = TemporaryFolder::inside(folder)?;
        let files = NumberedFiles::create(waiting.path(), stem, "png")?;
        let in_place = NumberedFiles::create(folder, stem, "png")?;
        Ok(Self { folder: folder.to_path_buf(), stem: stem.into(), waiting, files, in_place })
    }

    /// Replaces the earlier pictures, or keeps the new ones beside them; returns the new path of `latest`.
    fn finish(&self, ending: Ending, latest: Option<&PathBuf>) -> Result<Option<PathBuf>> {
        let (to, stale) = match ending {
            Ending::Complete => (self.folder.clone(), earlier(&self.folder, &self.stem)),
            Ending::Partial if latest.is_none() => return Ok(None),
            Ending::Partial => {
                let beside = self.partial();
                std::fs::create_dir_all(&beside).map_err(|error| Error::io(&beside, error))?;
                let stale = earlier(&beside, &self.stem);
                (beside, stale)
            }
        };
        let new = earlier(self.waiting.path(), &self.stem);
        let place = |picture: &PathBuf| picture.file_name().map(|name| to.join(name));
        let kept: HashSet<PathBuf> = new.iter().filter_map(place).collect();
        for picture in stale.into_iter().filter(|picture| !kept.contains(picture)) {
            std::fs::remove_file(&picture).map_err(|error| Error::io(&picture, error))?;
        }
        for picture in &new {
            let Some(target) = place(picture) else { continue };
            std::fs::rename(picture, &target).map_err(|error| Error::io(&target, error))?;
        }
        Ok(latest.and_then(place))
    }

    /// Where the pictures of a run that was stopped go: `pictures` has `pictures.partial` beside it.
    fn partial(&self) -> PathBuf {
        // A folder such as `.` has no name of its own.
        let folder = self.folder.canonicalize().unwrap_or_else(|_| self.folder.clone());
        let mut name = folder.file_name().unwrap_or_default().to_os_string();
        name.push(".partial");
        folder.with_file_name(name)
    }
}
