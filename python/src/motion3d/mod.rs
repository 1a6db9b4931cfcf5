//! Rigid 3-D motion for Python; what a user meets is `jacoflow.motion3d`.

mod field;
mod flow;
mod given;
mod lateral;
mod options;
mod results;

pub use field::{motion3d_contact_map, motion3d_estimate_field, motion3d_field_points};
pub use flow::{motion3d_essential, motion3d_focus, motion3d_predict};
pub use lateral::{motion3d_lateral, motion3d_lateral_bound};

use crate::errors::Outcome;
use crate::interrupt::interruptible;
use given::{Given, GivenPatches, Layout, rows, triple};
use jacoflow::motion3d::{
    Motion, check_motion, estimate_motion, estimate_patch_motion, motion_bound, patch_motion_bound,
};
use options::Options;
use pyo3::prelude::*;
use results::{PyBound, PyEstimate};

#[pyfunction]
#[pyo3(name = "_motion3d_estimate")]
pub fn motion3d_estimate<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    flow: &Bound<'py, PyAny>,
    jacobian: Option<&Bound<'py, PyAny>>,
    layout: Layout<'py>,
    options: Options<'py>,
) -> Outcome<PyEstimate<'py>> {
    let options = options.core()?;
    if let Some(jacobian) = jacobian {
        let given = GivenPatches::new(points, Some((flow, jacobian)), &layout)?;
        let found = interruptible(py, || estimate_patch_motion(&given.patches(), &options))?;
        return PyEstimate::new(py, found);
    }
    let given = Given::new(points, Some(flow), &layout)?;
    let found = interruptible(py, || estimate_motion(&given.flow(), &given.noise(), &options))?;
    PyEstimate::new(py, found)
}

#[pyfunction]
#[pyo3(name = "_motion3d_bound")]
pub fn motion3d_bound<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    inverse_depth: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    rotation: &Bound<'py, PyAny>,
    jacobian: bool,
    layout: Layout<'py>,
) -> Outcome<PyBound<'py>> {
    let (translation, rotation) = (triple("translation", translation)?, triple("rotation", rotation)?);
    check_motion(&translation, &rotation)?;
    let motion = Motion::new(translation, rotation);
    let (shape, depths) = super::arrays::doubles("inv_depth", inverse_depth)?;
    if jacobian {
        let given = GivenPatches::new(points, None, &layout)?;
        let surfaces: Vec<[f64; 3]> = rows("inv_depth", &shape, &depths)?;
        let bound = interruptible(py, || patch_motion_bound(&given.patches(), &motion, &surfaces))?;
        return PyBound::new(py, &bound);
    }
    let given = Given::new(points, None, &layout)?;
    let bound = interruptible(py, || motion_bound(&given.flow(), &given.noise(), &motion, &depths))?;
    PyBound::new(py, &bound)
}
