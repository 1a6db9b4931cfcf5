//! Tables as CSV, written row by row.

use super::write::Output;
use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FieldLayout, FlowField};
use std::path::{Path, PathBuf};

/// A CSV table with a header (RFC 4180, lines end in `\n`): to a file, which appears under its name when the
/// table is finished, or to standard output.
pub struct TableWriter {
    csv: csv::Writer<Output>,
    path: PathBuf,
    columns: usize,
}

impl std::fmt::Debug for TableWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TableWriter").field("path", &self.path).field("columns", &self.columns).finish_non_exhaustive()
    }
}

impl TableWriter {
    /// Begins a table in a file, or on standard output for `-`.
    pub fn create<S: AsRef<str>>(path: impl AsRef<Path>, header: &[S]) -> Result<Self> {
        let mut table = Self::create_without_header(path, header.len())?;
        table.row(header.iter().map(AsRef::as_ref))?;
        Ok(table)
    }

    /// The same without a header, for rows of so many columns.
    pub fn create_without_header(path: impl AsRef<Path>, columns: usize) -> Result<Self> {
        let (output, path) = Output::open(path.as_ref())?;
        Ok(Self { csv: csv::WriterBuilder::new().flexible(true).from_writer(output), path, columns })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// [`Error::Argument`] named `row` for another number of cells than the header has; [`Error::Io`] when it
    /// cannot be written.
    pub fn row<S: AsRef<str>>(&mut self, cells: impl IntoIterator<Item = S>) -> Result<()> {
        let cells: Vec<S> = cells.into_iter().collect();
        if cells.len() != self.columns {
            return Err(Error::argument("row", format!("{} cells", self.columns), cells.len()));
        }
        self.csv
            .write_record(cells.iter().map(|c| c.as_ref().as_bytes()))
            .map_err(|e| Error::io(&self.path, system_error(e)))
    }

    /// Pushes the rows so far to where they go: for a reader that follows a stream.
    ///
    /// # Errors
    /// [`Error::Io`] when they cannot be written.
    pub fn flush(&mut self) -> Result<()> {
        self.csv.flush().map_err(|e| Error::io(&self.path, e))
    }

    /// Ends the table and gives the file its name.
    ///
    /// # Errors
    /// [`Error::Io`] when the rest cannot be written.
    pub fn finish(self) -> Result<()> {
        self.end(None)
    }

    /// As [`TableWriter::finish`], under another name in the same folder: for an interrupted run.
    pub fn finish_as(self, path: impl AsRef<Path>) -> Result<()> {
        self.end(Some(path.as_ref()))
    }

    fn end(self, other: Option<&Path>) -> Result<()> {
        let output =
            self.csv.into_inner().map_err(|e| Error::io(&self.path, std::io::Error::from(e.error().kind())))?;
        match (output, other) {
            (Output::File(file), Some(path)) => file.commit_as(path),
            (output, _) => output.finish(),
        }
    }
}

/// The system's own error, whose kind (a closed pipe, a full disk) callers look at.
fn system_error(error: csv::Error) -> std::io::Error {
    let words = error.to_string();
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        _ => std::io::Error::other(words),
    }
}

/// A number as a table cell: the shortest digits that read back; `nan`, `inf` and `-inf` as numpy.
pub fn cell<T: Real>(value: T) -> String {
    let wide = value.to_f64();
    if wide.is_nan() { "nan".into() } else { value.to_string() }
}

/// How tables that wrap a [`TableWriter`] in their field `table` end.
macro_rules! table_endings {
    ($table:ty) => {
        impl $table {
            /// As [`TableWriter::flush`](crate::io::TableWriter::flush).
            pub fn flush(&mut self) -> Result<()> {
                self.table.flush()
            }

            /// Ends the table and gives the file its name, as
            /// [`TableWriter::finish`](crate::io::TableWriter::finish).
            pub fn finish(self) -> Result<()> {
                self.table.finish()
            }

            /// As [`TableWriter::finish_as`](crate::io::TableWriter::finish_as).
            pub fn finish_as(self, path: impl AsRef<Path>) -> Result<()> {
                self.table.finish_as(path)
            }
        }
    };
}
pub(in crate::io) use table_endings;

/// One row a site: frame, time_s (empty where it is not known), x, y, status, parameters, and standard
/// deviations if there is covariance.
#[derive(Debug)]
pub struct FieldTable {
    table: TableWriter,
    covariance: bool,
    parameters: usize,
}

impl FieldTable {
    /// Begins a table for fields of this layout.
    pub fn create(path: impl AsRef<Path>, layout: &FieldLayout, covariance: bool) -> Result<Self> {
        let mut header: Vec<String> = ["frame", "time_s", "x", "y", "status"].map(String::from).to_vec();
        header.extend(layout.parameters.iter().cloned());
        if covariance {
            header.extend(layout.parameters.iter().map(|p| format!("std_{p}")));
        }
        Ok(Self { table: TableWriter::create(path, &header)?, covariance, parameters: layout.parameters.len() })
    }

    /// Adds the sites of a field, in their order; `time`: that of its frame, s.
    ///
    /// # Errors
    /// [`Error::Argument`] when the field has other columns than the table; [`Error::Io`] when the rows
    /// cannot be written.
    pub fn write<T: Real>(&mut self, field: &FlowField<T>, time: Option<f64>) -> Result<()> {
        let (n, p) = (field.len(), field.layout.parameters.len());
        if p != self.parameters || field.covariance.is_some() != self.covariance {
            return Err(Error::argument(
                "field",
                "the columns that the table began with",
                "another model or covariance",
            ));
        }
        let frame = field.layout.frame_index.to_string();
        let time = time.map(cell).unwrap_or_default();
        let mut cells: Vec<String> = Vec::new();
        for i in 0..n {
            let (x, y) = field.layout.sites.pixel(i % field.width, i / field.width);
            cells.clear();
            let status = field.status[i].name().to_string();
            cells.extend([frame.clone(), time.clone(), x.to_string(), y.to_string(), status]);
            cells.extend((0..p).map(|k| cell(field.motion[k * n + i])));
            if let Some(covariance) = &field.covariance {
                // Plane of the variance (k, k) in the upper triangle, row by row.
                let plane = |k: usize| k * p - k * k.saturating_sub(1) / 2;
                cells.extend((0..p).map(|k| cell(covariance[plane(k) * n + i].to_f64().sqrt())));
            }
            self.table.row(&cells)?;
        }
        Ok(())
    }
}

table_endings!(FieldTable);
