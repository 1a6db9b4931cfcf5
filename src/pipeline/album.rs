//! Where drawn pictures go: numbered files in a folder, or a film.

use crate::error::{Error, Result};
use crate::image::picture::Picture;
use crate::io::{FilmWriter, NumberedFiles, write_picture};
use crate::pipeline::output::{check_target, is_folder};
use crate::pipeline::sink::{Ending, TableTarget, end_table};
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
    Film(TableTarget, Option<FilmWriter>),
}

/// Whether a path names a film, and not a folder. Other files than films are not written, and a folder that looks like one is not made by mistake.
fn is_film(path: &Path, argument: &'static str) -> Result<bool> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("y4m")) {
        return Ok(true);
    }
    let wanted = "a folder for pictures, or a film by the name *.y4m";
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
    /// A folder for `stem_000012.png`, ..., which is made when it does not exist, or a film of `frame_rate` frames per second.
    ///
    /// Errors name `argument`.
    pub fn create(path: &Path, stem: &str, argument: &'static str, frame_rate: f64) -> Result<Self> {
        let place = if is_film(path, argument)? {
            Place::Film(TableTarget::File(path.to_path_buf()), Some(FilmWriter::create(path, frame_rate)?))
        } else {
            Place::Folder(NumberedFiles::create(path, stem, "png")?)
        };
        Ok(Self { place, written: 0, latest: None })
    }

    /// Refuses, naming `argument`, to replace a film, or to mix pictures with those of an earlier run.
    pub fn check(path: &Path, stem: &str, argument: &'static str) -> Result<()> {
        if is_film(path, argument)? {
            return check_target(path, false).map_err(|error| match error {
                Error::Argument { expected, got, .. } => Error::Argument { argument, expected, got },
                other => other,
            });
        }
        let entries = path.read_dir().into_iter().flatten().flatten();
        let ours = |path: &PathBuf| {
            let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let number = name.strip_prefix(stem).and_then(|rest| rest.strip_prefix('_'));
            path.extension().is_some_and(|e| e == "png")
                && number.is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()))
        };
        match entries.map(|entry| entry.path()).find(ours) {
            Some(path) => {
                let wanted = "a place without earlier results (--force replaces them)";
                Err(Error::argument(argument, wanted, path.display()))
            }
            None => Ok(()),
        }
    }

    /// Adds the picture of the frame `index`.
    pub fn add(&mut self, index: usize, picture: &Picture) -> Result<()> {
        match &mut self.place {
            Place::Folder(files) => {
                let file = files.path(index);
                write_picture(&file, picture)?;
                self.latest = Some(file);
            }
            Place::Film(_, writer) => writer.iter_mut().try_for_each(|film| film.write(picture))?,
        }
        self.written += 1;
        Ok(())
    }

    /// A film gets its name when the run is complete; what there is of one that was stopped is kept as `name.partial.y4m`.
    pub fn finish(&mut self, ending: Ending) -> Result<()> {
        let any = self.written > 0;
        if let Place::Film(target, writer) = &mut self.place
            && let Some(film) = writer.take()
        {
            self.latest = end_table(target, ending, any, |name| match name {
                None => film.finish(),
                Some(path) => film.finish_as(path),
            })?;
        }
        Ok(())
    }

    /// How many files there are, and the last of them.
    pub fn files(&self) -> (usize, Option<PathBuf>) {
        match &self.place {
            Place::Folder(_) => (self.written, self.latest.clone()),
            Place::Film(..) => (usize::from(self.latest.is_some()), self.latest.clone()),
        }
    }
}
