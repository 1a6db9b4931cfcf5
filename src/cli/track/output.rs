//! Where tracks go.

use crate::error::{Error, Result};
use crate::pipeline::{TableTarget, TextFormat, check_target, is_device, is_folder};
use clap::Args;
use std::path::{Path, PathBuf};

/// Frames per second of a drawn sequence where the input has no rate.
const DEFAULT_FRAME_RATE: f64 = 25.0;

/// Texts and pictures.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub struct TrackOutputArguments {
    /// A folder (for tracks.csv, ...), a file by the extension of its format, or - for standard output
    /// [default: -, but none with --json or pictures]
    #[arg(long, short, value_name = "OUT")]
    pub output: Option<PathBuf>,
    /// Formats. gradient, particle: csv (everything), mot (boxes, .txt); stereo: csv (a row a cluster), json
    /// (the graph) [default: by the file's name, else csv]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub format: Vec<String>,
    /// Draw the targets, or clusters, over every frame: a folder for track_000000.png, ..., or a sequence by
    /// the name *.y4m
    #[arg(long, value_name = "FOLDER|Y4M")]
    pub overlay: Option<PathBuf>,
    /// Enlarge the drawn pictures N times, for small targets
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=16))]
    pub enlarge: usize,
    /// Replace files that exist
    #[arg(long)]
    pub force: bool,
}

/// A text that is to be written.
pub type Wanted<F> = (TableTarget, F);

impl TrackOutputArguments {
    /// Frames per second of sequences.
    pub fn frame_rate(rate: Option<f64>) -> f64 {
        rate.unwrap_or(DEFAULT_FRAME_RATE)
    }

    /// Makes the folder that texts go to.
    pub fn make_folder(&self) -> Result<()> {
        match self.output.as_deref().filter(|path| *path != Path::new("-") && is_folder(path)) {
            Some(folder) => std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, source)),
            None => Ok(()),
        }
    }

    /// Whether a file is to lie in the folder that texts go to, and that folder is not there yet: it is made
    /// before anything is written, and nothing is in the way there.
    pub fn is_in_new_folder(&self, path: &Path) -> bool {
        let folder = self.output.as_deref().filter(|folder| is_folder(folder) && !folder.exists());
        folder.is_some_and(|folder| path.parent() == Some(folder))
    }

    /// The files of texts at `output`; formats of unknown names are left out.
    pub fn files<F: TextFormat>(&self, output: &Path) -> Vec<PathBuf> {
        if !is_folder(output) {
            return vec![output.to_path_buf()];
        }
        let formats: Vec<F> = self.format.iter().filter_map(|name| F::parse(name).ok()).collect();
        let formats = if formats.is_empty() { &F::ALL[..1] } else { &formats };
        formats.iter().map(|format| in_folder(output, *format)).collect()
    }

    /// The texts to write, checked before any work is done. `has_other`: the summary or pictures are wanted,
    /// so that no text is needed; `json`: standard output is for the summary.
    pub fn wanted<F: TextFormat>(&self, json: bool, has_other: bool) -> Result<Vec<Wanted<F>>> {
        let formats: Vec<F> = self.format.iter().map(|name| F::parse(name)).collect::<Result<_>>()?;
        let path = match &self.output {
            Some(path) => path,
            None if (json || has_other) && formats.is_empty() => return Ok(Vec::new()),
            None => Path::new("-"),
        };
        if path == Path::new("-") {
            on_standard_output(&formats, json)
        } else if is_folder(path) {
            self.in_folder(path, &formats)
        } else {
            self.in_file(path, &formats)
        }
    }

    fn in_folder<F: TextFormat>(&self, folder: &Path, formats: &[F]) -> Result<Vec<Wanted<F>>> {
        let formats = if formats.is_empty() { &F::ALL[..1] } else { formats };
        if folder.is_dir() {
            formats.iter().try_for_each(|format| check_target(&in_folder(folder, *format), self.force))?;
        }
        Ok(formats.iter().map(|format| (TableTarget::File(in_folder(folder, *format)), *format)).collect())
    }

    fn in_file<F: TextFormat>(&self, path: &Path, formats: &[F]) -> Result<Vec<Wanted<F>>> {
        if is_device(path) {
            let formats = if formats.is_empty() { &F::ALL[..1] } else { formats };
            let [format] = formats else {
                return Err(Error::argument("output", "a folder for several formats", path.display()));
            };
            return Ok(vec![(TableTarget::File(path.to_path_buf()), *format)]);
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let endings: Vec<String> = F::ALL.iter().map(|format| format!(".{}", format.extension())).collect();
        let Some(by_name) = F::ALL.iter().copied().find(|format| format.extension() == extension) else {
            let wanted = format!("a {} file, a folder, or - for standard output", endings.join(" or "));
            let got = format!("{0}; for a new folder of this name write {0}/", path.display());
            return Err(Error::argument("output", wanted, got));
        };
        if let Some(other) = formats.iter().find(|format| **format != by_name) {
            let got = format!("{} for {}", path.display(), other.name());
            let wanted = format!("a folder, or a file named by its format ({})", endings.join(", "));
            return Err(Error::argument("output", wanted, got));
        }
        check_target(path, self.force)?;
        Ok(vec![(TableTarget::File(path.to_path_buf()), by_name)])
    }

    /// The place that a summary names: the requested one, or the partial file of a stopped run.
    pub fn place<'a>(&'a self, latest: Option<&'a PathBuf>) -> Option<&'a PathBuf> {
        match (latest, &self.output) {
            (Some(file), Some(asked)) if !is_folder(asked) && file.extension() == asked.extension() => Some(file),
            (_, asked) => asked.as_ref(),
        }
    }
}

/// The file of a format in a folder.
fn in_folder<F: TextFormat>(folder: &Path, format: F) -> PathBuf {
    folder.join(format!("tracks.{}", format.extension()))
}

fn on_standard_output<F: TextFormat>(formats: &[F], json: bool) -> Result<Vec<Wanted<F>>> {
    if json {
        return Err(Error::argument("output", "a file or folder, as --json needs standard output", "-"));
    }
    match formats {
        [] => Ok(vec![(TableTarget::StandardOutput, F::ALL[0])]),
        [format] => Ok(vec![(TableTarget::StandardOutput, *format)]),
        _ => Err(Error::argument("output", "a folder for several formats", "standard output")),
    }
}

/// The words about files that a summary ends with, where there are any.
pub fn files_in_words(files: usize, place: Option<&Path>) -> Option<String> {
    let place = place.filter(|place| files > 0 && *place != Path::new("-"))?;
    Some(format!("{files} {}: {}", if files == 1 { "file" } else { "files" }, place.display()))
}
