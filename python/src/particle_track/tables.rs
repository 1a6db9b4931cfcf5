//! Steps of the particle tracker as text, as the command writes them.

use super::step::PyParticleStep;
use crate::errors::Outcome;
use crate::options::named;
use jacoflow::error::{Error, Result};
use jacoflow::io::{MotTable, TrackTable};
use jacoflow::pipeline::ParticleRows;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Writes steps to a file: "mot" or "csv".
#[pyfunction(name = "_write_particle_tracks")]
pub fn write_tables(
    py: Python<'_>,
    #[pyo3(from_py_with = named::path)] path: PathBuf,
    format: &str,
    steps: Vec<Py<PyParticleStep>>,
) -> Outcome<()> {
    let steps: Vec<&PyParticleStep> = steps.iter().map(Py::get).collect();
    Ok(py.detach(|| match format {
        "mot" => write_mot(&path, &steps),
        "csv" => write_csv(&path, &steps),
        other => Err(Error::argument("format", "\"mot\" or \"csv\"", format!("{other:?}"))),
    })?)
}

fn write_mot(path: &Path, steps: &[&PyParticleStep]) -> Result<()> {
    let mut table = MotTable::create(path)?;
    for step in steps.iter().map(|step| step.0.step()) {
        for target in &step.targets {
            table.write(target.id as usize, step.frame, &target.state)?;
        }
    }
    table.finish()
}

fn write_csv(path: &Path, steps: &[&PyParticleStep]) -> Result<()> {
    let mut table = TrackTable::create(path, &ParticleRows::COLUMNS)?;
    for step in steps.iter().map(|step| step.0.step()) {
        for target in &step.targets {
            table.write(target.id as usize, (step.frame, None), &target.state, &ParticleRows::cells(target))?;
        }
    }
    table.finish()
}
