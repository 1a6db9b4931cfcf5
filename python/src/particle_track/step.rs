//! A step of the particle tracker.

use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::Error;
use jacoflow::track::particle::{ParticleStep, ParticleTarget, StepRecord};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

/// The compiled part of `jacoflow.track.ParticleStep`.
#[pyclass(name = "_ParticleStep", module = "jacoflow._jacoflow", frozen)]
pub struct PyParticleStep(pub(super) StepRecord);

#[pymethods]
impl PyParticleStep {
    /// Everything, by the names of `jacoflow.track.ParticleStep`.
    fn as_dict<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        step_dict(py, self.0.step())
    }

    /// Particles (N, 6) and weights (N,) of a target; None where they were not kept.
    fn particles<'py>(&self, py: Python<'py>, id: u64) -> Outcome<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>> {
        let Some((particles, weights)) = self.0.particles(id)? else { return Ok(None) };
        let count = weights.len();
        let particles = arrays::owned(py, &[count, 6], particles.as_flattened().to_vec())?;
        Ok(Some((particles, arrays::owned(py, &[count], weights.clone())?)))
    }

    /// Foreground (H, W), 0 to 1.
    fn foreground<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        arrays::from_frame(py, py.detach(|| self.0.foreground())?)
    }

    /// Labels of the segments (H, W).
    fn segments<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let labels = py.detach(|| self.0.segments())?;
        arrays::owned(py, &[labels.height, labels.width], labels.labels)
    }

    /// Whether it keeps the frame.
    fn keeps_frame(&self) -> bool {
        self.0.keeps_frame()
    }

    /// The same without the frame, unless `frame`, and without the particles, unless `particles`.
    fn keeping(&self, frame: bool, particles: bool) -> Self {
        Self(self.0.clone().keeping(frame, particles))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let (py, this) = (slf.py(), slf.get());
        let bytes = py.detach(|| this.0.to_bytes());
        Ok((py.import("jacoflow._jacoflow")?.getattr("_restore_particle_step")?, (PyBytes::new(py, &bytes),)))
    }
}

/// The inverse of `_ParticleStep.__reduce__`.
#[pyfunction(name = "_restore_particle_step")]
pub fn restore_step(py: Python<'_>, state: &[u8]) -> Outcome<PyParticleStep> {
    Ok(PyParticleStep(py.detach(|| StepRecord::from_bytes(state))?))
}

/// A number of a target as Python's arrays hold it.
fn signed(id: u64) -> Outcome<i64> {
    Ok(i64::try_from(id).map_err(|_| Error::argument("id", "an integer below 2^63", id))?)
}

fn step_dict<'py>(py: Python<'py>, step: &ParticleStep) -> Outcome<Bound<'py, PyDict>> {
    let targets = &step.targets;
    let count = targets.len();
    let out = PyDict::new(py);
    out.set_item("frame", step.frame)?;
    let ids = targets.iter().map(|target| signed(target.id)).collect::<Outcome<_>>()?;
    out.set_item("ids", arrays::owned::<i64>(py, &[count], ids)?)?;
    let bounds = |target: &ParticleTarget| {
        let bounds = target.state.bounds;
        vec![bounds.x, bounds.y, bounds.width, bounds.height]
    };
    let columns: [(&str, &[usize], &dyn Fn(&ParticleTarget) -> Vec<f64>); 7] = [
        ("boxes", &[4], &bounds),
        ("position", &[2], &|target| target.state.position.to_vec()),
        ("velocity", &[2], &|target| target.state.scene_velocity.to_vec()),
        ("size", &[2], &|target| target.size.to_vec()),
        ("covariance", &[6, 6], &|target| target.covariance.as_flattened().to_vec()),
        ("effective_sample_size", &[], &|target| vec![target.effective_sample_size]),
        ("similarity", &[], &|target| vec![target.similarity]),
    ];
    for (name, shape, values) in columns {
        let shape = [&[count], shape].concat();
        out.set_item(name, arrays::owned::<f64>(py, &shape, targets.iter().flat_map(values).collect())?)?;
    }
    let n_tracks = targets.iter().map(|target| target.n_tracks as i64).collect();
    out.set_item("n_tracks", arrays::owned::<i64>(py, &[count], n_tracks)?)?;
    let degenerate = targets.iter().map(|target| target.degenerate).collect();
    out.set_item("degenerate", arrays::owned::<bool>(py, &[count], degenerate)?)?;
    out.set_item("near", arrays::owned::<bool>(py, &[count, count], step.near.clone())?)?;
    out.set_item("status", PyTuple::new(py, targets.iter().map(|target| target.state.status.name()))?)?;
    out.set_item("reason", PyTuple::new(py, targets.iter().map(|target| &*target.state.reason))?)?;
    out.set_item("camera", arrays::owned::<f64>(py, &[2, 3], step.camera.as_flattened().to_vec())?)?;
    out.set_item("tracks", tracks(py, step)?)?;
    Ok(out)
}

/// The corner tracks, by the names of `jacoflow.track.ParticleCorners`.
fn tracks<'py>(py: Python<'py>, step: &ParticleStep) -> Outcome<Bound<'py, PyDict>> {
    let (tracks, count) = (&step.tracks, step.tracks.len());
    let out = PyDict::new(py);
    let ids = tracks.iter().map(|track| signed(track.id)).collect::<Outcome<_>>()?;
    out.set_item("ids", arrays::owned::<i64>(py, &[count], ids)?)?;
    let pairs = |pair: fn(&jacoflow::track::particle::CornerTrack) -> [f64; 2]| {
        arrays::owned::<f64>(py, &[count, 2], tracks.iter().flat_map(pair).collect())
    };
    out.set_item("positions", pairs(|track| track.position)?)?;
    out.set_item("residuals", pairs(|track| track.residual)?)?;
    let foreground = tracks.iter().map(|track| track.foreground).collect();
    out.set_item("p", arrays::owned::<f64>(py, &[count], foreground)?)?;
    let owners = tracks.iter().map(|track| track.owner.map_or(Ok(-1), signed)).collect::<Outcome<_>>()?;
    out.set_item("owner", arrays::owned::<i64>(py, &[count], owners)?)?;
    Ok(out)
}
