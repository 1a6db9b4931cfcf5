//! Where the results of a run go, decided and checked before the run starts.

use super::sink::TableTarget;
use crate::error::{Error, Result};
use crate::io::{FieldFormat, NumberedFiles};
use crate::types::{SamplingGrid, choice_by_name, choices};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// A picture of one field, PNG.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureKind {
    /// Direction as hue, speed as saturation.
    Colour,
    /// Arrows over the frame.
    Quiver,
    /// `u_x + v_y`: red is expansion, blue contraction.
    Divergence,
    /// `v_x - u_y`: red is turning from x to y (clockwise on the screen), blue the other way.
    Curl,
}

choices!(PictureKind: Colour "colour", Quiver "quiver", Divergence "divergence", Curl "curl");

impl PictureKind {
    /// The kind called `name` (`color` is understood too).
    ///
    /// # Errors
    /// [`Error::Argument`] listing the known names.
    pub fn parse(name: &str) -> Result<Self> {
        let wanted = if name == "color" { "colour" } else { name };
        choice_by_name("picture", wanted, &Self::ALL, Self::name)
    }
}

/// What a user may ask for: field formats, and a table of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Field(FieldFormat),
    Table,
}

fn parse_format(name: &str) -> Result<Format> {
    if name == "csv" {
        return Ok(Format::Table);
    }
    FieldFormat::ALL.into_iter().find(|format| format.name() == name).map(Format::Field).ok_or_else(|| {
        let names = FieldFormat::ALL.map(FieldFormat::name).join(", ");
        Error::argument("format", format!("one of {names}, csv"), name)
    })
}

/// What an extension stands for.
fn format_of(path: &Path) -> Option<Format> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    if extension == "csv" {
        return Some(Format::Table);
    }
    FieldFormat::ALL.into_iter().find(|format| format.extension() == extension).map(Format::Field)
}

/// Where everything of a run goes.
///
/// A path is a **folder** when it exists as one, ends in a separator or has no extension; it then gets, for
/// every field, `000012.npz` (and `.flo`, `.png`, `.pfm`) and `000012_colour.png`, numbered by the frame that
/// the field belongs to, and for the run one `points.csv`. Any other path is a **file** whose extension gives
/// its format: `.csv` takes every field of the run; the others take exactly one field, and its pictures lie
/// beside it as `name_colour.png`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct OutputPlan {
    /// Formats written for each field.
    pub formats: Vec<FieldFormat>,
    /// Pictures written for each field.
    pub pictures: Vec<PictureKind>,
    /// Where rows go, if they are wanted.
    pub table: Option<TableTarget>,
    /// Where the files of fields lie.
    pub place: Place,
    /// Whether existing files may be replaced.
    pub replace: bool,
    /// In a folder: the first frame whose results of an earlier run are removed when this one is complete;
    /// `None`: none are.
    pub stale_from: Option<usize>,
}

/// Where the files of fields lie.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Place {
    /// No such file is written.
    #[default]
    Nowhere,
    /// Numbered files in a folder.
    Folder(PathBuf),
    /// One field only, with these folder and stem.
    Single(PathBuf),
}

/// What the user requested, in words.
#[derive(Debug, Clone, Default)]
pub struct OutputWish<'a> {
    /// The path given, `-` for standard output.
    pub path: Option<&'a Path>,
    /// Names of formats.
    pub formats: &'a [String],
    /// Names of pictures.
    pub pictures: &'a [String],
    /// Replace existing files.
    pub replace: bool,
    /// How many fields will come, where that is known.
    pub fields: Option<usize>,
}

impl OutputPlan {
    /// Decides from words where results go, and refuses what could only fail later. Nothing is made yet.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `output`, `format` or `picture`; [`Error::Io`] when the place cannot be
    /// written.
    pub fn decide(wish: &OutputWish<'_>) -> Result<Self> {
        let formats: Vec<Format> = wish.formats.iter().map(|name| parse_format(name)).collect::<Result<_>>()?;
        let pictures: Vec<PictureKind> =
            wish.pictures.iter().map(|name| PictureKind::parse(name)).collect::<Result<_>>()?;
        let plan = Self { pictures, replace: wish.replace, ..Self::default() };
        match wish.path {
            None if formats.is_empty() && plan.pictures.is_empty() => Ok(plan),
            None => Err(Error::argument("output", "a folder or a file for the formats and pictures asked for", "none")),
            Some(path) if path == Path::new("-") => plan.into_standard_output(&formats),
            Some(path) if is_folder(path) => plan.into_folder(path, &formats),
            Some(path) => plan.into_file(path, &formats, wish.fields),
        }
    }

    /// Whether a run would leave nothing behind.
    pub fn writes_nothing(&self) -> bool {
        self.formats.is_empty() && self.pictures.is_empty() && self.table.is_none()
    }

    /// Refuses what a list of points has no place in: formats and pictures of a whole grid.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `format` or `picture`.
    pub fn check_sites(&self, sites: &SamplingGrid) -> Result<()> {
        if !matches!(sites, SamplingGrid::Points(_)) {
            return Ok(());
        }
        if let Some(format) = self.formats.iter().find(|format| **format != FieldFormat::Npz) {
            return Err(Error::argument("format", "csv or npz for a list of points", format.name()));
        }
        match self.pictures.first() {
            Some(kind) => Err(Error::argument("picture", "none for a list of points", kind.name())),
            None => Ok(()),
        }
    }

    /// Refuses pictures of derivatives of a flow that comes without them.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `picture`.
    pub fn check_parameters<'a>(&self, mut parameters: impl Iterator<Item = &'a str>) -> Result<()> {
        let needs = |kind: &&PictureKind| matches!(kind, PictureKind::Divergence | PictureKind::Curl);
        match self.pictures.iter().find(needs) {
            Some(kind) if !parameters.any(|name| name == "u_x") => {
                Err(Error::argument("picture", "colour or quiver for a flow without Jacobian", kind.name()))
            }
            _ => Ok(()),
        }
    }

    fn into_standard_output(mut self, formats: &[Format]) -> Result<Self> {
        if !self.pictures.is_empty() || formats.iter().any(|format| *format != Format::Table) {
            return Err(Error::argument("output", "a folder or a file; standard output takes CSV only", "-"));
        }
        self.table = Some(TableTarget::StandardOutput);
        Ok(self)
    }

    fn into_folder(mut self, folder: &Path, formats: &[Format]) -> Result<Self> {
        self.formats = formats.iter().filter_map(|f| if let Format::Field(f) = f { Some(*f) } else { None }).collect();
        if formats.is_empty() {
            self.formats.push(FieldFormat::Npz);
        }
        if formats.contains(&Format::Table) {
            self.table = Some(TableTarget::File(folder.join("points.csv")));
        }
        self.place = Place::Folder(folder.to_path_buf());
        if !self.replace && folder.is_dir() {
            self.refuse_earlier_results(folder)?;
        }
        Ok(self)
    }

    fn into_file(mut self, path: &Path, formats: &[Format], fields: Option<usize>) -> Result<Self> {
        let Some(format) = format_of(path) else {
            let wanted = "a file ending in .npz, .flo, .png, .pfm or .csv, or a folder";
            let got = format!("{0}; for a new folder of this name write {0}/", path.display());
            return Err(Error::argument("output", wanted, got));
        };
        if formats.iter().any(|other| *other != format) {
            let got = format!("{} with another format beside it", path.display());
            return Err(Error::argument("output", "a folder for several formats", got));
        }
        let one_only = format != Format::Table || !self.pictures.is_empty();
        if let Some(fields) = fields.filter(|n| *n > 1 && one_only) {
            return Err(too_many(path, &fields.to_string()));
        }
        check_writable(parent(path))?;
        let stem = path.with_extension("");
        let mut targets = vec![path.to_path_buf()];
        targets.extend(self.pictures.iter().map(|kind| picture_beside(&stem, *kind)));
        if let Some(existing) = targets.iter().find(|target| !self.replace && is_file(target)) {
            return Err(exists(existing));
        }
        match format {
            Format::Table => self.table = Some(TableTarget::File(path.to_path_buf())),
            Format::Field(format) => self.formats.push(format),
        }
        if one_only {
            self.place = Place::Single(stem);
        }
        Ok(self)
    }

    /// A folder that holds results of an earlier run would end up with a mixture.
    fn refuse_earlier_results(&self, folder: &Path) -> Result<()> {
        let numbered: Vec<NumberedFiles> = self.field_files().into_iter().chain(self.picture_files()).collect();
        let entries = std::fs::read_dir(folder).map_err(|source| Error::io(folder, source))?;
        for entry in entries {
            let path = entry.map_err(|source| Error::io(folder, source))?.path();
            let in_table = self.table == Some(TableTarget::File(path.clone()));
            if in_table || numbered.iter().any(|files| files.index(&path).is_some()) {
                return Err(exists(&path));
            }
        }
        Ok(())
    }

    /// Names of the fields' files in a folder, one for each format.
    pub fn field_files(&self) -> Vec<NumberedFiles> {
        let Place::Folder(folder) = &self.place else { return Vec::new() };
        let files = |format: &FieldFormat| NumberedFiles::without_stem(folder, format!(".{}", format.extension()));
        self.formats.iter().map(files).collect()
    }

    /// Names of the pictures in a folder, one for each kind.
    pub fn picture_files(&self) -> Vec<NumberedFiles> {
        let Place::Folder(folder) = &self.place else { return Vec::new() };
        let files = |kind: &PictureKind| NumberedFiles::without_stem(folder, format!("_{}.png", kind.name()));
        self.pictures.iter().map(files).collect()
    }

    /// Files that are not numbered: the table, and the one field with its pictures.
    pub fn single_files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        if let Some(TableTarget::File(table)) = &self.table {
            files.push(table.clone());
        }
        if let Place::Single(_) = &self.place {
            files.extend(self.formats.iter().filter_map(|format| self.field_path(0, *format)));
            files.extend(self.pictures.iter().filter_map(|kind| self.picture_path(0, *kind)));
        }
        files
    }

    /// Removes what an earlier run left among `files`, numbered from `stale_from` on and not `written` by
    /// this run.
    pub(super) fn remove_stale(&self, files: &[NumberedFiles], written: &HashSet<usize>) -> Result<()> {
        let Some(first) = self.stale_from else { return Ok(()) };
        files.iter().try_for_each(|files| files.clear_except(|index| index < first || written.contains(&index)))
    }

    /// The file of the field of frame `index` in `format`.
    pub fn field_path(&self, index: usize, format: FieldFormat) -> Option<PathBuf> {
        match &self.place {
            Place::Nowhere => None,
            Place::Folder(folder) => Some(folder.join(format!("{index:06}.{}", format.extension()))),
            Place::Single(stem) => Some(with_ending(stem, &format!(".{}", format.extension()))),
        }
    }

    /// The file of a picture of the field of frame `index`.
    pub fn picture_path(&self, index: usize, kind: PictureKind) -> Option<PathBuf> {
        match &self.place {
            Place::Nowhere => None,
            Place::Folder(folder) => Some(picture_beside(&folder.join(format!("{index:06}")), kind)),
            Place::Single(stem) => Some(picture_beside(stem, kind)),
        }
    }
}

/// The error for a second field where one file was named.
pub(super) fn too_many(path: &Path, fields: &str) -> Error {
    let got = format!("the file {} for {fields} fields", path.display());
    Error::argument("output", "a folder when there is more than one field", got)
}

fn picture_beside(stem: &Path, kind: PictureKind) -> PathBuf {
    with_ending(stem, &format!("_{}.png", kind.name()))
}

/// `stem` with `ending` put behind it; not `with_extension`, which would eat a dot in the stem.
fn with_ending(stem: &Path, ending: &str) -> PathBuf {
    let mut name = stem.as_os_str().to_os_string();
    name.push(ending);
    PathBuf::from(name)
}

/// Whether a path means a folder: one exists, it ends in a separator, or has no extension.
pub fn is_folder(path: &Path) -> bool {
    let ends_in_separator = path.to_string_lossy().ends_with(std::path::is_separator);
    path.is_dir() || ends_in_separator || path.extension().is_none() && !is_device(path)
}

/// Whether a path is neither a folder nor a regular file (a device, a pipe).
pub fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|meta| !meta.is_dir() && !meta.is_file())
}

/// A regular file; devices and pipes may be written without being replaced.
fn is_file(path: &Path) -> bool {
    path.metadata().is_ok_and(|meta| meta.is_file())
}

fn parent(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn exists(path: &Path) -> Error {
    Error::argument("output", "a place without earlier results (--force replaces them)", path.display())
}

/// Refuses a single file that exists (unless `replace`) or whose folder cannot be written.
///
/// # Errors
/// [`Error::Argument`] naming `output`; [`Error::Io`].
pub fn check_target(path: &Path, replace: bool) -> Result<()> {
    if !replace && is_file(path) {
        return Err(exists(path));
    }
    check_writable(parent(path))
}

/// Makes sure that files can be made in `folder`, by making one.
pub(super) fn check_writable(folder: &Path) -> Result<()> {
    tempfile::tempfile_in(folder).map(drop).map_err(|source| Error::io(folder, source))
}
