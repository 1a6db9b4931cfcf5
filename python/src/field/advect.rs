//! What Python sees of a `FlowField`: points carried along.

use super::{FlowField, Store, each};
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::error::{Error, shape_text};
use jacoflow::flow::{PointCovariance, advect};
use jacoflow::types::Status;
use pyo3::prelude::*;

/// What covariances may be, for messages.
const MATRICES: &str = "symmetric matrices with variances of at least 0, shape (N, 2, 2), or (2, 2) for all points";

/// Asymmetry that rounding explains, relative to the variances.
const ROUNDING: f64 = 1e-9;

impl FlowField {
    /// Number of fields up to the last that has a next frame.
    fn steps(&self) -> usize {
        each!(self.store, packed => {
            let sites = packed.site_count();
            let is_missing = |index: &usize| {
                let codes = &packed.status[(self.start + index) * sites..(self.start + index + 1) * sites];
                sites > 0 && codes.iter().all(|&code| code == Status::MissingFrame as u8)
            };
            self.count - (0..self.count).rev().take_while(is_missing).count()
        })
    }
}

#[pymethods]
impl FlowField {
    /// Carries points along by one frame, p + flow(p): float64 array (N, 2), px; for a stack through all its
    /// fields, (T + 1, N, 2), beginning with `points`. Fields at the end without a next frame are left out:
    /// those of T frames give where the points are at each of them, (T, N, 2).
    ///
    /// `points` (N, 2), columns x and y, px, are where they are at the (first) field's frame. Between sites
    /// the flow is bilinear in what the four sites about a point say of it by flow and Jacobian: affine
    /// motion is exact. NaN outside the sites, where one of them has no estimate, and from then on.
    ///
    /// With `covariance`, (N, 2, 2) or (2, 2) for all points, px^2, a pair: the points, and their covariance
    /// (N, 2, 2), for a stack (T + 1, N, 2, 2). It becomes (I + M) C (I + M)^T with the Jacobian M, plus the
    /// covariance of the flow there where the field has one: errors of the flow are taken as independent of
    /// the point's and from field to field, and as alike at neighbouring sites. Zeros begin with certain
    /// points.
    ///
    /// ValueError for a field of points, for other shapes, and for matrices that are no covariance.
    #[pyo3(signature = (points, covariance=None))]
    fn advect<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        covariance: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let first = positions(points)?;
        let spread = covariance.map(|object| matrices(object, first.len())).transpose()?;
        let mut times = vec![(first, spread)];
        each!(self.store, packed => {
            for index in 0..self.steps() {
                let field = self.core(packed, index);
                let (points, spread) = &times[index];
                let moved = py.detach(|| advect(&field, points, spread.as_deref()))?;
                times.push((moved.points, moved.covariances));
            }
        });
        // A single field answers with the moved points alone.
        let kept = if self.stack { &times[..] } else { &times[1..] };
        let count = times[0].0.len();
        let shape = |tail: &[usize]| -> Vec<usize> {
            let leading = if self.stack { vec![kept.len(), count] } else { vec![count] };
            leading.into_iter().chain(tail.iter().copied()).collect()
        };
        let places = kept.iter().flat_map(|(points, _)| points.as_flattened().iter().copied()).collect();
        let places = arrays::owned(py, &shape(&[2]), places)?;
        if covariance.is_none() {
            return Ok(places);
        }
        let spreads = kept.iter().filter_map(|(_, spread)| spread.as_ref());
        let spreads = spreads.flat_map(|spread| spread.as_flattened().as_flattened().iter().copied()).collect();
        let spreads = arrays::owned(py, &shape(&[2, 2]), spreads)?;
        Ok((places, spreads).into_pyobject(py)?.into_any())
    }
}

/// `points`: an `(N, 2)` array of numbers.
fn positions(object: &Bound<'_, PyAny>) -> Outcome<Vec<[f64; 2]>> {
    let (shape, values) = arrays::doubles("points", object)?;
    if shape != [0] && !matches!(shape[..], [_, 2]) {
        return Err(Error::argument("points", "shape (N, 2), columns x and y, px", shape_text(&shape)).into());
    }
    Ok(values.as_chunks::<2>().0.to_vec())
}

/// `covariance`: a matrix for each of `count` points, or one for all.
fn matrices(object: &Bound<'_, PyAny>, count: usize) -> Outcome<Vec<PointCovariance>> {
    let (shape, values) = arrays::doubles("covariance", object)?;
    let each = values.as_chunks::<2>().0.as_chunks::<2>().0;
    let all = match shape[..] {
        [2, 2] => vec![each[0]; count],
        [n, 2, 2] if n == count => each.to_vec(),
        _ => {
            return Err(Error::argument(
                "covariance",
                MATRICES,
                format!("shape {} for {count} points", shape_text(&shape)),
            )
            .into());
        }
    };
    match all.iter().find(|matrix| !is_covariance(matrix)) {
        Some(odd) => Err(Error::argument("covariance", MATRICES, format!("{odd:?}")).into()),
        None => Ok(all),
    }
}

/// Symmetric and with a determinant of at least 0, but for rounding; NaN stands for what is not known.
fn is_covariance(&[[a, b], [c, d]]: &PointCovariance) -> bool {
    let rounding = ROUNDING * (a.abs() + d.abs());
    let wrong = a < 0.0 || d < 0.0 || (b - c).abs() > rounding || b * c - a * d > rounding * (a.abs() + d.abs());
    !wrong
}
