//! Tracks as rows of text.

use super::TrackStep;
use crate::error::Result;
use crate::io::{MotTable, TrackTable};
use crate::pipeline::sink::{Ending, Sink, TableTarget, TextFormat, end_table, ends_as};
use crate::types::TrackState;
use std::path::{Path, PathBuf};

/// Texts that tracks are written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TrackFormat {
    /// Everything, as [`TrackTable`].
    Csv,
    /// Boxes in the form of the MOT challenge, as [`MotTable`].
    Mot,
}

impl TextFormat for TrackFormat {
    const ALL: &'static [Self] = &[Self::Csv, Self::Mot];

    fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Mot => "mot",
        }
    }

    fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Mot => "txt",
        }
    }
}

/// A text in the making.
#[derive(Debug)]
enum Writer {
    Csv(TrackTable),
    Mot(MotTable),
}

impl Writer {
    fn create(path: &Path, format: TrackFormat, further: &[&str]) -> Result<Self> {
        Ok(match format {
            TrackFormat::Csv => Self::Csv(TrackTable::create(path, further)?),
            TrackFormat::Mot => Self::Mot(MotTable::create(path)?),
        })
    }
    fn write(&mut self, (frame, time): (usize, Option<f64>), row: &Row<'_>) -> Result<()> {
        let Row { target, state, further } = row;
        let target = *target;
        match self {
            Self::Csv(table) => table.write(target, (frame, time), state, further),
            Self::Mot(table) => table.write(target, frame, state),
        }
    }
    fn flush(&mut self) -> Result<()> {
        match self {
            Self::Csv(table) => table.flush(),
            Self::Mot(table) => table.flush(),
        }
    }
    fn finish(self, other: Option<&Path>) -> Result<()> {
        match (self, other) {
            (Self::Csv(table), None) => table.finish(),
            (Self::Csv(table), Some(path)) => table.finish_as(path),
            (Self::Mot(table), None) => table.finish(),
            (Self::Mot(table), Some(path)) => table.finish_as(path),
        }
    }
}

/// A target at a frame: its number, its state and the cells of further columns, which only CSV has.
pub(in crate::pipeline) struct Row<'a> {
    pub target: usize,
    pub state: &'a TrackState,
    pub further: Vec<String>,
}

/// Rows that end as a run ends. A file gets its name when the run is complete; the rows of a run that was
/// stopped are kept beside it, as `name.partial.csv`. Standard output gets the rows of each frame at once.
#[derive(Debug)]
pub(in crate::pipeline) struct RowWriter {
    target: TableTarget,
    writer: Option<Writer>,
    frames: usize,
    kept: Option<PathBuf>,
}

impl RowWriter {
    /// Begins the text; CSV has `further` columns after those of [`TrackTable`].
    pub fn create(target: &TableTarget, format: TrackFormat, further: &[&str]) -> Result<Self> {
        let writer = Writer::create(target.path(), format, further)?;
        Ok(Self { target: target.clone(), writer: Some(writer), frames: 0, kept: None })
    }

    /// Adds the rows of a frame, with its index in the input and its time, s.
    pub fn write<'a>(&mut self, place: (usize, Option<f64>), rows: impl IntoIterator<Item = Row<'a>>) -> Result<()> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        rows.into_iter().try_for_each(|row| writer.write(place, &row))?;
        self.frames += 1;
        if self.target == TableTarget::StandardOutput { writer.flush() } else { Ok(()) }
    }

    /// Gives the text its name, or what there is of it the partial one.
    pub fn finish(&mut self, ending: Ending) -> Result<()> {
        let Some(writer) = self.writer.take() else { return Ok(()) };
        self.kept = end_table(&self.target, ending, self.frames > 0, |name| writer.finish(name))?;
        Ok(())
    }

    /// How many files are in place, and which.
    pub fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}

/// Writes a row for every target and frame. A file gets its name when the run is complete; the rows of a run
/// that was stopped are kept beside it, as `name.partial.csv`. Standard output gets the rows of each frame at
/// once.
#[derive(Debug)]
pub struct TrackRows {
    rows: RowWriter,
}

impl TrackRows {
    /// Begins the text.
    pub fn create(target: &TableTarget, format: TrackFormat) -> Result<Self> {
        Ok(Self { rows: RowWriter::create(target, format, &[])? })
    }
}

impl Sink<TrackStep<'_>> for TrackRows {
    fn accept(&mut self, step: &TrackStep<'_>) -> Result<()> {
        let row = |(index, state)| Row { target: index + 1, state, further: Vec::new() };
        self.rows.write((step.frame_index, step.time), step.states.iter().enumerate().map(row))
    }

    ends_as!(rows);
}
