//! Rows of CSV tables that grow while a run lasts, and the names of formats of text.
//!
//! A file gets its name only when the run is complete. The rows of a run that was stopped are kept beside it,
//! as `name.partial.csv`: nothing is lost, and nothing half is taken for whole. Standard output gets the rows
//! of each frame at once.

use super::{Ending, Sink, Step};
use crate::error::Result;
use crate::io::{FieldTable, TableWriter};
use crate::math::Real;
use crate::types::choice_by_name;
use std::path::{Path, PathBuf};

/// Where a table of rows goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TableTarget {
    /// Standard output.
    StandardOutput,
    /// A file.
    File(PathBuf),
}

impl TableTarget {
    /// As a writer of tables takes it.
    pub(in crate::pipeline) fn path(&self) -> &Path {
        match self {
            Self::StandardOutput => Path::new("-"),
            Self::File(path) => path,
        }
    }

    /// The name for the rows of a run that was stopped: `points.csv` becomes `points.partial.csv`.
    fn partial(&self) -> PathBuf {
        let extension = self.path().extension().map_or_else(|| "csv".into(), |e| e.to_string_lossy());
        self.path().with_extension(format!("partial.{extension}"))
    }
}

/// The kinds of text that one kind of result is written as; the first is the default.
pub trait TextFormat: Copy + PartialEq + 'static {
    /// Every format.
    const ALL: &'static [Self];

    /// The format's word.
    fn name(self) -> &'static str;

    /// The extension of its files.
    fn extension(self) -> &'static str {
        self.name()
    }

    /// The format called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`](crate::error::Error::Argument) named `format`.
    fn parse(name: &str) -> Result<Self> {
        choice_by_name("format", name, Self::ALL, Self::name)
    }
}

/// A table that ends as a run ends. On standard output its header comes with the first row.
#[derive(Debug)]
pub struct Table {
    target: TableTarget,
    header: Vec<String>,
    writer: Option<TableWriter>,
    rows: usize,
    kept: Option<PathBuf>,
}

impl Table {
    /// Begins the table.
    pub fn create(target: &TableTarget, header: &[&str]) -> Result<Self> {
        let writer = TableWriter::create_without_header(target.path(), header.len())?;
        let header = header.iter().map(ToString::to_string).collect();
        let mut table = Self { target: target.clone(), header, writer: Some(writer), rows: 0, kept: None };
        if *target != TableTarget::StandardOutput {
            table.begin()?;
        }
        Ok(table)
    }

    /// Writes the header, once.
    fn begin(&mut self) -> Result<()> {
        let header = std::mem::take(&mut self.header);
        match &mut self.writer {
            Some(writer) if !header.is_empty() => writer.row(header),
            _ => Ok(()),
        }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) -> Result<()> {
        self.begin()?;
        self.rows += 1;
        self.writer.as_mut().map_or(Ok(()), |writer| writer.row(cells))
    }

    /// Shows the rows so far to a reader of standard output.
    pub fn flush(&mut self) -> Result<()> {
        match (&self.target, &mut self.writer) {
            (TableTarget::StandardOutput, Some(writer)) => writer.flush(),
            _ => Ok(()),
        }
    }

    /// Gives the table its name, or what there is of it the partial one.
    pub fn finish(&mut self, ending: Ending) -> Result<()> {
        if ending == Ending::Complete {
            self.begin()?;
        }
        let Some(writer) = self.writer.take() else { return Ok(()) };
        self.kept = end_table(&self.target, ending, self.rows > 0, |name| match name {
            Some(name) => writer.finish_as(name),
            None => writer.finish(),
        })?;
        Ok(())
    }

    /// As [`Sink::files`].
    pub fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}

/// Ends a table by `finish(None)` under its own name, by `finish(Some(name))` under the partial one, or,
/// without rows, by dropping it. The file that is in place then.
pub(in crate::pipeline) fn end_table(
    target: &TableTarget,
    ending: Ending,
    any: bool,
    finish: impl FnOnce(Option<&Path>) -> Result<()>,
) -> Result<Option<PathBuf>> {
    match (target, ending) {
        (TableTarget::StandardOutput, _) => finish(None).map(|()| None),
        (TableTarget::File(path), Ending::Complete) => finish(None).map(|()| Some(path.clone())),
        (TableTarget::File(_), Ending::Partial) if any => {
            let partial = target.partial();
            finish(Some(&partial)).map(|()| Some(partial))
        }
        (TableTarget::File(_), Ending::Partial) => Ok(None),
    }
}

/// One row for every site and frame: see [`FieldTable`] for the columns.
#[derive(Debug)]
pub struct Rows {
    target: TableTarget,
    table: Option<FieldTable>,
    kept: Option<PathBuf>,
}

impl Rows {
    /// Rows to `target`; the table begins with the first field.
    pub fn new(target: TableTarget) -> Self {
        Self { target, table: None, kept: None }
    }
}

impl<T: Real> Sink<Step<'_, T>> for Rows {
    fn accept(&mut self, step: &Step<'_, T>) -> Result<()> {
        let field = step.field;
        let table = match &mut self.table {
            Some(table) => table,
            empty => empty.insert(FieldTable::create(self.target.path(), &field.layout, field.covariance.is_some())?),
        };
        table.write(field, step.time)?;
        if self.target == TableTarget::StandardOutput { table.flush() } else { Ok(()) }
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        let Some(table) = self.table.take() else { return Ok(()) };
        self.kept = end_table(&self.target, ending, true, |name| match name {
            Some(name) => table.finish_as(name),
            None => table.finish(),
        })?;
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}
