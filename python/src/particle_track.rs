//! The particle tracker for Python: colour frames in, plain values out; the classes a user meets are in
//! `jacoflow.track`.

mod options;
mod step;
mod tables;

pub use self::step::{PyParticleStep, restore_step};
pub use self::tables::write_tables;

use self::options::Given;
use super::arrays::{self, ColourRule};
use super::colour_arrays::tracked_colour_frame;
use crate::errors::Outcome;
use crate::interrupt::{Held, interruptible};
use jacoflow::error::Error;
use jacoflow::track::{GreyLevels, ParticleTracker};
use jacoflow::types::{AnyColourFrame, AnyFrame, Frame, TargetBox};
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

/// The compiled part of `jacoflow.track.ParticleTracker`.
#[pyclass(name = "_ParticleTracker", module = "jacoflow._jacoflow", frozen)]
pub struct PyParticleTracker {
    tracker: Held<ParticleTracker>,
    /// Whether frames (H, W) are taken as red = green = blue.
    takes_grey: bool,
}

#[pymethods]
impl PyParticleTracker {
    /// Begins with the first frame, the targets' numbers and boxes (left, top, width, height), and options.
    #[new]
    fn new(frame: &Bound<'_, PyAny>, boxes: Vec<(u64, [f64; 4])>, options: &Bound<'_, PyDict>) -> Outcome<Self> {
        let (options, takes_grey) = options.extract::<Given>()?.options()?;
        let py = frame.py();
        let frame = coloured(frame, takes_grey, GreyLevels::of_integers())?;
        let boxes: Vec<(u64, TargetBox)> = boxes.into_iter().map(|(id, sides)| (id, target_box(sides))).collect();
        let tracker = interruptible(py, || ParticleTracker::new(&frame, &boxes, &options))?;
        Ok(Self { tracker: Held::new(tracker), takes_grey })
    }

    /// The targets in the next frame; `camera`: the background's motion since the one before, where it is
    /// known.
    fn update(&self, frame: &Bound<'_, PyAny>, camera: Option<[[f64; 3]; 2]>) -> Outcome<PyParticleStep> {
        let py = frame.py();
        let levels = self.tracker.with(py, |tracker| tracker.grey_levels())?;
        let frame = coloured(frame, self.takes_grey, levels)?;
        let record = self.tracker.change(py, |tracker| {
            tracker.update_with_camera(&frame, camera)?;
            Ok::<_, Error>(tracker.record())
        })?;
        Ok(PyParticleStep(record))
    }

    /// Adds a target at the last frame; returns its number.
    #[pyo3(signature = (bounds, id))]
    fn add(&self, py: Python<'_>, bounds: [f64; 4], id: Option<u64>) -> Outcome<u64> {
        Ok(self.tracker.with(py, |tracker| tracker.add(id, target_box(bounds)))??)
    }

    /// Removes a target.
    fn remove(&self, py: Python<'_>, id: u64) -> Outcome<()> {
        Ok(self.tracker.with(py, |tracker| tracker.remove(id))??)
    }

    /// The targets at the last frame.
    fn step(&self, py: Python<'_>) -> Outcome<PyParticleStep> {
        Ok(PyParticleStep(self.tracker.with(py, |tracker| tracker.record())?))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyBytes>, bool))> {
        let (py, this) = (slf.py(), slf.get());
        let bytes = this.tracker.with(py, |tracker| tracker.to_bytes())?;
        let restore = py.import("jacoflow._jacoflow")?.getattr("_restore_particle_tracker")?;
        Ok((restore, (PyBytes::new(py, &bytes), this.takes_grey)))
    }
}

/// The inverse of `_ParticleTracker.__reduce__`.
#[pyfunction(name = "_restore_particle_tracker")]
pub fn restore_tracker(py: Python<'_>, state: &[u8], takes_grey: bool) -> Outcome<PyParticleTracker> {
    let tracker = py.detach(|| ParticleTracker::from_bytes(state))?;
    Ok(PyParticleTracker { tracker: Held::new(tracker), takes_grey })
}

fn target_box([x, y, width, height]: [f64; 4]) -> TargetBox {
    TargetBox { x, y, width, height }
}

/// A frame (H, W, 3), or (H, W) where grey is taken.
fn coloured(object: &Bound<'_, PyAny>, takes_grey: bool, levels: GreyLevels) -> Outcome<AnyColourFrame> {
    fn grey<T: Copy>(frame: &Frame<T>) -> Frame<[T; 3]> {
        frame.map(|&value| [value; 3])
    }
    if !(takes_grey && arrays::unmasked("frame", object, levels)?.ndim() == 2) {
        return tracked_colour_frame("frame", object, levels);
    }
    Ok(match arrays::tracked_frame("frame", object, ColourRule::Refuse, levels)? {
        AnyFrame::U8(frame) => AnyColourFrame::U8(grey(&frame)),
        AnyFrame::U16(frame) => AnyColourFrame::U16(grey(&frame)),
        AnyFrame::F32(frame) => AnyColourFrame::F32(grey(&frame)),
        AnyFrame::F64(frame) => AnyColourFrame::F64(grey(&frame)),
    })
}
