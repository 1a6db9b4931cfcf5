//! Targets followed by particle filters as rows of text.

use super::ParticleFrame;
use crate::error::Result;
use crate::io::cell;
use crate::pipeline::sink::{Sink, TableTarget, ends_as};
use crate::pipeline::track::{Row, RowWriter, TrackFormat};
use crate::track::particle::ParticleTarget;
use std::path::PathBuf;

/// Writes rows as [`TrackRows`](crate::pipeline::TrackRows). CSV has further columns:
///
/// | columns | unit |
/// |---|---|
/// | `effective_sample_size` | particles |
/// | `similarity` | of the colours to those of the first frame, 0 to 1 |
/// | `n_tracks` | corner tracks that belong to the target |
/// | `degenerate` | `true` if no particle had a weight, else `false` |
#[derive(Debug)]
pub struct ParticleRows {
    rows: RowWriter,
}

impl ParticleRows {
    /// Columns that [`TrackTable`](crate::io::TrackTable) does not have.
    pub const COLUMNS: [&str; 4] = ["effective_sample_size", "similarity", "n_tracks", "degenerate"];

    /// A target's cells of these columns.
    pub fn cells(target: &ParticleTarget) -> Vec<String> {
        vec![
            cell(target.effective_sample_size),
            cell(target.similarity),
            target.n_tracks.to_string(),
            target.degenerate.to_string(),
        ]
    }

    /// Begins the text.
    pub fn create(target: &TableTarget, format: TrackFormat) -> Result<Self> {
        Ok(Self { rows: RowWriter::create(target, format, &Self::COLUMNS)? })
    }
}

fn row(target: &ParticleTarget) -> Row<'_> {
    Row { target: target.id as usize, state: &target.state, further: ParticleRows::cells(target) }
}

impl Sink<ParticleFrame<'_>> for ParticleRows {
    fn accept(&mut self, step: &ParticleFrame<'_>) -> Result<()> {
        self.rows.write((step.frame_index, step.time), step.targets.iter().map(row))
    }

    ends_as!(rows);
}
