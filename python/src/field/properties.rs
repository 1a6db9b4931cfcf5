//! What Python sees of a `FlowField`.

use super::{FlowField, Slice, Store, each, state};
use crate::errors::Outcome;
use crate::{arrays, io, keywords::getters, options::Integer, options::named};
use jacoflow::types::{SamplingGrid, Status};
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice, PyTuple};
use std::path::PathBuf;

getters! {
    FlowField;
    /// Flow, array (..., H, W, 2): (u, v) along x (right) and y (down), in `unit("u")`: px/frame, lengths in
    /// `length_unit` with a pixel pitch, times in seconds with a frame period.
    ///
    /// NaN where `status` says why. A read-only view.
    flow(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 0, &[(2, 1)]);
    /// Jacobian of the flow, array (..., H, W, 2, 2) in 1/frame or 1/s: [[u_x, u_y], [v_x, v_y]].
    ///
    /// A read-only view; zeros where the model assumes no derivatives.
    jacobian(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 2, &[(2, 1), (2, 2)]);
    /// Flow along x (right), array (..., H, W), in `unit("u")`, px/frame by default.
    u(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 0, &[]);
    /// Flow along y (down), array (..., H, W), in `unit("u")`, px/frame by default.
    v(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 1, &[]);
    /// du/dx, array (..., H, W), 1/frame or 1/s.
    u_x(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 2, &[]);
    /// dv/dx, array (..., H, W), 1/frame or 1/s.
    v_x(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 3, &[]);
    /// du/dy, array (..., H, W), 1/frame or 1/s.
    u_y(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 4, &[]);
    /// dv/dy, array (..., H, W), 1/frame or 1/s.
    v_y(this, slf) -> Outcome<Bound<'py, PyAny>> = Self::motion_slice(slf, 5, &[]);
    /// Status code of each site, uint8 array (..., H, W), see `Status`.
    status(this, slf) -> Outcome<Bound<'py, PyAny>> = each!(this.store, packed => Self::show(slf, &Slice { data: &packed.status, planes: 1, first: 0, tail: &[] }));
    /// Where the estimate may be used, unique, complete and not contradicted, bool array (..., H, W).
    valid(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let (width, height) = this.size();
        let sites = width * height;
        let codes = each!(this.store, packed => &packed.status[this.start * sites..(this.start + this.count) * sites]);
        let valid = codes.iter().map(|&code| Status::from_code(code).is_some_and(Status::is_valid)).collect();
        arrays::owned::<bool>(slf.py(), &this.shape(), valid)
    };
    /// Root mean square residual of the equations, array (..., H, W), grey levels; None if the method has
    /// none.
    residual(this, slf) -> Outcome<Option<Bound<'py, PyAny>>> = each!(this.store, packed => packed.residual.as_ref().map(|data| Self::show(slf, &Slice { data, planes: 1, first: 0, tail: &[] })).transpose());
    /// Rank of the equations, uint8 array (..., H, W); None if the method has none.
    rank(this, slf) -> Outcome<Option<Bound<'py, PyAny>>> = each!(this.store, packed => packed.rank.as_ref().map(|data| Self::show(slf, &Slice { data, planes: 1, first: 0, tail: &[] })).transpose());
    /// Condition number of the equations (largest over smallest singular value), array (..., H, W); None if
    /// the method has none.
    condition(this, slf) -> Outcome<Option<Bound<'py, PyAny>>> = each!(this.store, packed => packed.condition.as_ref().map(|data| Self::show(slf, &Slice { data, planes: 1, first: 0, tail: &[] })).transpose());
    /// Standard deviation of the Gaussian window that the Jacobian rests on, mean of those weighed in at the
    /// pixel, array (..., H, W), px; None unless `method="coarse_to_fine"` with `diagnostics=True`.
    ///
    /// Windows are of fourth order: slopes have the noise of a plain least-squares fit in a window 0.66 times
    /// as wide, and bias of sixth order.
    window(this, slf) -> Outcome<Option<Bound<'py, PyAny>>> = each!(this.store, packed => packed.window.as_ref().map(|data| Self::show(slf, &Slice { data, planes: 1, first: 0, tail: &[] })).transpose());
    /// Pixel (x, y) of each site, int64 array (H, W, 2), for a list of points (N, 2).
    points(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let (width, height) = this.size();
        let pixels = (0..height).flat_map(|row| (0..width).map(move |col| (col, row)));
        let data = pixels.map(|(col, row)| this.layout().sites.pixel(col, row)).flat_map(|(x, y)| [x as i64, y as i64]);
        let shape = if matches!(this.layout().sites, SamplingGrid::Points(_)) {
            vec![width, 2]
        } else {
            vec![height, width, 2]
        };
        arrays::owned(slf.py(), &shape, data.collect())
    };
    /// Index of the frame the estimate belongs to, counted from 0 (no unit); of the first one for a stack.
    frame_index(this) -> usize = this.first_frame();
    /// Size (width, height) of the frames, px.
    frame_size(this) -> (usize, usize) = this.layout().frame_size;
    /// Seconds between frames, or None; of the first field of a stack.
    frame_period(this) -> Option<f64> = this.note().and_then(|note| note.period);
    /// Physical size (dx, dy) of a pixel, 1 px or any length unit.
    pixel_pitch(this) -> (f64, f64) = this.layout().units.pixel_pitch;
    /// Name of the unit of lengths, "px" unless there is a pixel pitch.
    length_unit(this) -> String = this.layout().units.length.clone();
    /// What the flow at frame t is: "forward", the step to frame t + 1; "central", the mean of the steps
    /// before and after; "instant", the velocity at frame t (no unit).
    interval(this) -> &'static str = this.layout().interval.name();
    /// How far errors of neighbouring estimates go together, px: about exp(-d^2 / (4 l^2)) at distance d; 0
    /// where they are independent or it is not known. Of a stack that of the first field.
    correlation_length(this) -> f64 = this.note().map_or(0.0, |note| note.correlation_length);
    /// Names of the model's parameters; `unit(name)` gives their units.
    parameters(this, slf) -> Outcome<Bound<'py, PyTuple>> = Ok(PyTuple::new(slf.py(), &this.layout().parameters)?);
}

#[pymethods]
impl FlowField {
    /// Covariance of (u, v, u_x, v_x, u_y, v_y), array (..., H, W, 6, 6), in squares of their units; None
    /// if it was not requested.
    ///
    /// Rows and columns of parameters that the model lacks are zero. A new array at every access.
    #[getter]
    fn covariance<'py>(slf: &Bound<'py, Self>) -> Outcome<Option<Bound<'py, PyAny>>> {
        let this = slf.get();
        each!(this.store, packed => {
            if packed.covariance.is_none() {
                return Ok(None);
            }
            let data: Vec<_> = (0..this.count).filter_map(|t| this.core(packed, t).covariance_matrices()).flatten().collect();
            let shape: Vec<usize> = this.shape().into_iter().chain([6, 6]).collect();
            Ok(Some(arrays::owned(slf.py(), &shape, data)?))
        })
    }

    /// Name of the motion model (no unit).
    #[getter]
    fn model(&self) -> &str {
        &self.layout().model
    }

    /// Shape of the site axes: (H, W), (N,) for points, with a leading T for a stack.
    #[getter]
    #[pyo3(name = "shape")]
    fn python_shape<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyTuple>> {
        Ok(PyTuple::new(py, self.shape())?)
    }

    /// Writes the field; the extension of `path` chooses the format: .npz (everything, in its units), .flo,
    /// .png (KITTI) or .pfm (flow in px/frame only).
    ///
    /// A stack goes to a folder (`path` without extension) as flow_000001.npz, ... by frame index; files of
    /// these names after its first frame that it does not replace are removed, as they are of a longer run.
    /// `options` is free text kept in .npz. OSError when the file cannot be written, ValueError for another
    /// extension.
    #[pyo3(signature = (path, *, options=""))]
    fn save(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = named::path)] path: PathBuf,
        #[pyo3(from_py_with = named::options)] options: &str,
    ) -> Outcome<()> {
        io::save_field(py, self, &path, options)
    }

    /// The field of flow from elsewhere, px/frame: `std`, `advect`, `region_mean` and motion from flow then
    /// work on it: (u, v) of shape (H, W, 2), their Jacobian (H, W, 2, 2), [[u_x, u_y], [v_x, v_y]], and the
    /// covariance of (u, v), (H, W, 2, 2), or with a Jacobian of (u, v, u_x, v_x, u_y, v_y), (H, W, 6, 6).
    ///
    /// NaN, or masked, where the flow is unknown. Without a Jacobian derivatives read as zero, and
    /// quantities of them (`divergence`, ...) are refused. `interval` is the time over which the flow is
    /// taken: "forward" (default), from the field's frame to the next, "central", half the displacement from
    /// the frame before to the one after, or "instant", the velocity. ValueError for other shapes or names,
    /// and for covariances that are not symmetric, have a negative eigenvalue, or are unknown where the flow
    /// is known.
    #[staticmethod]
    #[pyo3(signature = (flow, covariance = None, jacobian = None, *, interval = None))]
    fn from_arrays(
        flow: &Bound<'_, PyAny>,
        covariance: Option<&Bound<'_, PyAny>>,
        jacobian: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named::interval)] interval: Option<&str>,
    ) -> Outcome<Self> {
        state::from_arrays(flow, covariance, jacobian, interval)
    }

    /// Reads a field (H, W) from .npz, .flo, .png (KITTI) or .pfm, flow in px/frame. OSError, or FormatError
    /// for a damaged file.
    #[staticmethod]
    fn load(py: Python<'_>, #[pyo3(from_py_with = named::path)] path: PathBuf) -> Outcome<Self> {
        io::load_field(py, &path)
    }

    /// Number of fields of a stack. TypeError for a single field.
    fn __len__(&self) -> Outcome<usize> {
        if self.stack {
            Ok(self.count)
        } else {
            Err(PyTypeError::new_err("a single field has no length; its arrays are (H, W, ...)").into())
        }
    }

    /// True for any content: a field is there. (An estimator that has none yet returns None.)
    #[allow(clippy::unused_self, reason = "Python's signature")]
    fn __bool__(&self) -> bool {
        true
    }

    /// Field `index` of a stack, or the stack of a slice of step 1, sharing its memory. IndexError outside,
    /// TypeError for a single field.
    fn __getitem__(&self, index: &Bound<'_, PyAny>) -> Outcome<Self> {
        if !self.stack {
            let message = "index: expected a stack of fields, got a single field; its arrays are (H, W, ...)";
            return Err(PyTypeError::new_err(message).into());
        }
        let count = self.count;
        if let Ok(slice) = index.cast::<PySlice>() {
            let range = slice.indices(count as isize)?;
            if range.step != 1 {
                return Err(
                    PyIndexError::new_err(format!("a slice of a stack: expected step 1, got {}", range.step)).into()
                );
            }
            let (first, length) = (range.start as usize, range.slicelength);
            return Ok(Self { store: self.store.clone(), start: self.start + first, count: length, stack: true });
        }
        let wrong = |error: PyErr| {
            let said = || format!("index: expected an integer or a slice, got {}", arrays::kind_of(index));
            if error.is_instance_of::<PyTypeError>(index.py()) { PyTypeError::new_err(said()) } else { error }
        };
        let index: Integer = index.extract().map_err(wrong)?;
        let place = if index.0 < 0 { index.0 + count as i128 } else { index.0 };
        let Some(place) = usize::try_from(place).ok().filter(|&place| place < count) else {
            return Err(PyIndexError::new_err(format!("index {index}: the stack has {count} fields")).into());
        };
        Ok(Self { store: self.store.clone(), start: self.start + place, count: 1, stack: false })
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        let layout = self.layout();
        let known = each!(self.store, packed => {
            let sites = packed.site_count();
            packed.status[self.start * sites..(self.start + self.count) * sites]
                .iter()
                .filter(|&&code| Status::from_code(code).is_some_and(Status::is_valid))
                .count()
        });
        let total = self.count * width * height;
        let dtype = match self.store {
            Store::Single(_) => "float32",
            Store::Double(_) => "float64",
        };
        let share = 100.0 * known as f64 / total.max(1) as f64;
        let shape: Vec<String> = self.shape().iter().map(ToString::to_string).collect();
        let shape = if shape.len() == 1 { format!("{},", shape[0]) } else { shape.join(", ") };
        format!(
            "FlowField(shape=({shape}), model={:?}, dtype={dtype}, frame_index={}, valid={share:.1}%)",
            layout.model,
            self.first_frame()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let restore = slf.py().import("jacoflow._jacoflow")?.getattr("_restore_field")?;
        Ok((restore, (state::save(slf.get(), slf.py())?,)))
    }
}
