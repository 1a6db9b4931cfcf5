//! Tracks as rows of text.

use super::{TrackSink, TrackStep};
use crate::error::Result;
use crate::io::{MotTable, TrackTable};
use crate::pipeline::sink::{Ending, TableTarget, end_table};
use crate::pipeline::text_format::TextFormat;
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
    fn create(path: &Path, format: TrackFormat) -> Result<Self> {
        Ok(match format {
            TrackFormat::Csv => Self::Csv(TrackTable::create(path)?),
            TrackFormat::Mot => Self::Mot(MotTable::create(path)?),
        })
    }
    fn write(&mut self, target: usize, (frame, time): (usize, Option<f64>), state: &TrackState) -> Result<()> {
        match self {
            Self::Csv(table) => table.write(target, (frame, time), state),
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

/// Writes a row for every target and frame. A file gets its name when the run is complete; the rows of a run that was stopped are kept beside it, as
/// `name.partial.csv`. Standard output gets the rows of each frame at once.
#[derive(Debug)]
pub struct TrackRows {
    target: TableTarget,
    writer: Option<Writer>,
    frames: usize,
    kept: Option<PathBuf>,
}

impl TrackRows {
    /// Begins the text.
    ///
    /// # Errors
    /// As [`TrackTable::create`].
    pub fn create(target: &TableTarget, format: TrackFormat) -> Result<Self> {
        let writer = Writer::create(target.path(), format)?;
        Ok(Self { target: target.clone(), writer: Some(writer), frames: 0, kept: None })
    }
}

impl TrackSink for TrackRows {
    fn accept(&mut self, step: &TrackStep<'_>) -> Result<()> {
        let Some(writer) = &mut self.writer else { return Ok(()) };
        for (index, state) in step.states.iter().enumerate() {
            writer.write(index + 1, (step.frame_index, step.time), state)?;
        }
        self.frames += 1;
        if self.target == TableTarget::StandardOutput { writer.flush() } else { Ok(()) }
    }

    fn finish(&mut self, ending: Ending) -> Result<()> {
        let Some(writer) = self.writer.take() else { return Ok(()) };
        self.kept = end_table(&self.target, ending, self.frames > 0, |name| writer.finish(name))?;
        Ok(())
    }

    fn files(&self) -> (usize, Option<PathBuf>) {
        (usize::from(self.kept.is_some()), self.kept.clone())
    }
}
