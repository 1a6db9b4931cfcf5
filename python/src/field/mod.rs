//! `FlowField`: flow, Jacobian, covariance and status of one frame or of a stack, as arrays that share the
//! core's memory.

mod advect;
mod derived;
mod measurement;
mod measures;
mod packed;
mod properties;
mod state;

use super::arrays;
use crate::errors::Outcome;
use jacoflow::error::Error;
use jacoflow::math::Real;
use jacoflow::types::{AnyField, FieldLayout, FlowField as CoreField, MOTION_NAMES, SamplingGrid};
use numpy::Element;
use pyo3::prelude::*;
use std::sync::Arc;

pub use derived::quantities;
pub use measurement::Measurement;
pub use measurement::restore_measurement;
pub use packed::{Note, Packed};
pub use state::{restore_field, status_names};

/// Both precisions.
#[derive(Clone)]
pub enum Store {
    /// f32 planes.
    Single(Arc<Packed<f32>>),
    /// f64 planes.
    Double(Arc<Packed<f64>>),
}

/// Runs `$body` with `$packed` bound to the packed planes of either precision.
macro_rules! each {
    ($store:expr, $packed:ident => $body:expr) => {
        match &$store {
            Store::Single($packed) => $body,
            Store::Double($packed) => $body,
        }
    };
}
pub(super) use each;

/// A precision that a store can hold.
pub trait Stored: Real + Element {
    /// Wraps the planes.
    fn store(packed: Packed<Self>) -> Store;
}
impl Stored for f32 {
    fn store(packed: Packed<f32>) -> Store {
        Store::Single(Arc::new(packed))
    }
}
impl Stored for f64 {
    fn store(packed: Packed<f64>) -> Store {
        Store::Double(Arc::new(packed))
    }
}

/// Flow with its Jacobian, covariance and status: the result of every estimator.
///
/// Arrays have the site axes (H, W), (N,) for points, with a leading T for a stack; `field[t]` is one field
/// of a stack. Flow in px/frame, derivatives in 1/frame (or in units of `pixel_pitch`). NaN where `status`
/// says why. Most arrays are read-only views that share memory.
#[pyclass(name = "FlowField", module = "jacoflow", frozen)]
pub struct FlowField {
    store: Store,
    start: usize,
    count: usize,
    /// Whether arrays have a leading time axis.
    stack: bool,
}

/// The part of a plane-wise quantity that a view shows.
struct Slice<'a, U> {
    data: &'a [U],
    /// Planes of one field.
    planes: usize,
    /// First plane shown.
    first: usize,
    /// Trailing axes: length and step in planes.
    tail: &'a [(usize, usize)],
}

impl FlowField {
    /// The result for a single triple or pair of frames.
    pub fn single<T: Stored>(field: CoreField<T>) -> Self {
        Self { store: T::store(Packed::one(field)), start: 0, count: 1, stack: false }
    }

    /// The result for a single triple or pair of frames, in its precision.
    pub fn any(field: AnyField) -> Self {
        match field {
            AnyField::Single(field) => Self::single(field),
            AnyField::Double(field) => Self::single(field),
        }
    }

    /// The result for a stack.
    pub fn stack<T: Stored>(packed: Packed<T>) -> Self {
        let count = packed.count;
        Self { store: T::store(packed), start: 0, count, stack: true }
    }

    fn layout(&self) -> &FieldLayout {
        each!(self.store, packed => &packed.layout)
    }

    fn size(&self) -> (usize, usize) {
        each!(self.store, packed => (packed.width, packed.height))
    }

    /// Leading axes of every array: `(T,)` for stacks, then `(H, W)` or, for points, `(N,)`.
    fn shape(&self) -> Vec<usize> {
        let (width, height) = self.size();
        let mut shape = if self.stack { vec![self.count] } else { vec![] };
        if matches!(self.layout().sites, SamplingGrid::Points(_)) {
            shape.push(width);
        } else {
            shape.extend([height, width]);
        }
        shape
    }

    /// A read-only view on planes.
    fn show<'py, U: Element>(slf: &Bound<'py, Self>, slice: &Slice<'_, U>) -> Outcome<Bound<'py, PyAny>> {
        let this = slf.get();
        let (width, height) = this.size();
        let sites = width * height;
        let mut shape = this.shape();
        let mut strides = if this.stack { vec![slice.planes * sites] } else { vec![] };
        if matches!(this.layout().sites, SamplingGrid::Points(_)) {
            strides.push(1);
        } else {
            strides.extend([width, 1]);
        }
        for &(length, step) in slice.tail {
            shape.push(length);
            strides.push(step * sites);
        }
        let first = (this.start * slice.planes + slice.first) * sites;
        arrays::view(slf.as_any(), slice.data.get(first..).unwrap_or_default(), &shape, &strides)
    }

    /// The planes of the affine parameters `first + sum(tail)`: a view where the model has them, a new array
    /// where it assumes them.
    fn motion_slice<'py>(slf: &Bound<'py, Self>, first: usize, tail: &[(usize, usize)]) -> Outcome<Bound<'py, PyAny>> {
        let this = slf.get();
        let is_affine = this.layout().parameters.iter().map(String::as_str).eq(MOTION_NAMES);
        each!(this.store, packed => {
            if is_affine || (first == 0 && tail.iter().all(|&(length, step)| length * step <= 2)) {
                let planes = packed.layout.parameters.len();
                return Self::show(slf, &Slice { data: &packed.motion, planes, first, tail });
            }
            let data: Vec<_> = (this.start..this.start + this.count).flat_map(|t| packed.field(t).affine_planes()).collect();
            Self::arrange(slf, data, 6, first, tail)
        })
    }

    /// `tail` axes of freshly computed planes, as an array of its own.
    fn arrange<'py, U: Element + Clone>(
        slf: &Bound<'py, Self>,
        data: Vec<U>,
        planes: usize,
        first: usize,
        tail: &[(usize, usize)],
    ) -> Outcome<Bound<'py, PyAny>> {
        use numpy::ndarray::{Array, ArrayView, IntoDimension, ShapeBuilder};
        let this = slf.get();
        let (width, height) = this.size();
        let sites = width * height;
        let mut shape = vec![this.count, height, width];
        let mut strides = vec![planes * sites, width, 1];
        for &(length, step) in tail {
            shape.push(length);
            strides.push(step * sites);
        }
        let shape_out: Vec<usize> = this.shape().into_iter().chain(tail.iter().map(|t| t.0)).collect();
        let array = if shape_out.contains(&0) {
            Array::from_shape_vec(shape_out.as_slice().into_dimension(), Vec::new())
        } else {
            ArrayView::from_shape(shape.into_dimension().strides(strides.into_dimension()), &data[first * sites..])
                .and_then(|view| {
                    Array::from_shape_vec(shape_out.as_slice().into_dimension(), view.iter().cloned().collect())
                })
        };
        let array = array.map_err(|e| Error::Numerical(e.to_string()))?;
        Ok(numpy::PyArrayDyn::from_owned_array(slf.py(), array).into_any())
    }

    /// Number of fields, and whether there is a time axis.
    pub fn count(&self) -> (usize, bool) {
        (self.count, self.stack)
    }

    /// The planes, with those of neighbouring fields.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Frame index of the first field.
    pub fn first_frame(&self) -> usize {
        self.note().map_or(0, |note| note.frame_index)
    }

    /// What the first field does not share with others of the stack.
    fn note(&self) -> Option<Note> {
        each!(self.store, packed => packed.notes.get(self.start).copied())
    }

    /// Field `index` of those shown, as the core takes it.
    pub fn core<T: Stored>(&self, packed: &Packed<T>, index: usize) -> CoreField<T> {
        packed.field(self.start + index)
    }
}
