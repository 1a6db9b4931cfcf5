//! `Measurement`: a quantity of the motion that a region follows.

use super::derived::by_name;
use crate::arrays;
use crate::errors::Outcome;
use jacoflow::flow::derived::{Measured, RegionMotion, RegionStatus, fit_region};
use jacoflow::math::Real;
use jacoflow::types::{FlowField, Region};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyList;

/// A quantity of a region, in each field of a stack: numbers for a single field, arrays (T,) for a stack.
#[pyclass(module = "jacoflow", frozen)]
pub struct Measurement {
    name: String,
    unit: String,
    is_stack: bool,
    rows: Vec<Row>,
}

/// The measurement in one field.
struct Row {
    value: f64,
    std: f64,
    fit: RegionMotion,
}

/// A row as plain values: value and its standard deviation, motion and its covariance, centre, the numbers of
/// sites, and the status.
type Plain = ((f64, f64), ([f64; 6], [[f64; 6]; 6]), (f64, f64), [usize; 3], String);

impl From<&Row> for Plain {
    fn from(Row { value, std, fit }: &Row) -> Self {
        let counts = [fit.count, fit.valid, fit.sites];
        ((*value, *std), (fit.motion, fit.covariance), fit.centre, counts, fit.status.name().into())
    }
}

impl TryFrom<Plain> for Row {
    type Error = jacoflow::error::Error;

    fn try_from(
        ((value, std), (motion, covariance), centre, [count, valid, sites], status): Plain,
    ) -> Result<Self, Self::Error> {
        let status = RegionStatus::parse(&status)?;
        Ok(Self { value, std, fit: RegionMotion { motion, covariance, centre, count, valid, sites, status } })
    }
}

/// A measurement from what `Measurement.__reduce__` wrote.
#[pyfunction(name = "_restore_measurement")]
pub fn restore_measurement(name: String, unit: String, is_stack: bool, rows: Vec<Plain>) -> Outcome<Measurement> {
    let rows = rows.into_iter().map(Row::try_from).collect::<Result<_, _>>()?;
    Ok(Measurement { name, unit, is_stack, rows })
}

impl Measurement {
    /// For a quantity called `name`; without a row yet.
    pub fn new(name: &str, unit: String, is_stack: bool) -> Self {
        Self { name: name.into(), unit, is_stack, rows: Vec::new() }
    }

    /// Adds the measurement of the next field.
    pub fn add<T: Real>(
        &mut self,
        field: &FlowField<T>,
        measured: Measured,
        region: Option<&Region>,
        at: Option<(f64, f64)>,
    ) -> jacoflow::Result<()> {
        let fit = fit_region(field, region, at)?;
        let (value, std) = measured.of_region(field, &fit).map_err(by_name)?;
        self.rows.push(Row { value, std, fit });
        Ok(())
    }

    fn numbers<'py>(&self, py: Python<'py>, of: impl Fn(&Row) -> f64) -> Outcome<Bound<'py, PyAny>> {
        if self.is_stack {
            return arrays::owned(py, &[self.rows.len()], self.rows.iter().map(of).collect());
        }
        Ok(of(&self.rows[0]).into_bound_py_any(py)?)
    }

    fn counts<'py>(&self, py: Python<'py>, of: impl Fn(&Row) -> usize) -> Outcome<Bound<'py, PyAny>> {
        if self.is_stack {
            return arrays::owned(py, &[self.rows.len()], self.rows.iter().map(|row| of(row) as i64).collect());
        }
        Ok(of(&self.rows[0]).into_bound_py_any(py)?)
    }
}

#[pymethods]
impl Measurement {
    /// Name of the quantity (no unit).
    #[getter]
    fn quantity(&self) -> &str {
        &self.name
    }

    /// Unit of `value` and `std`.
    #[getter]
    fn unit(&self) -> &str {
        &self.unit
    }

    /// The value, float or float64 array (T,), in `unit`; NaN unless the status is "ok".
    #[getter]
    fn value<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.numbers(py, |row| row.value)
    }

    /// Its standard deviation, float or float64 array (T,), in `unit`.
    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.numbers(py, |row| row.std)
    }

    /// Share of the region's valid sites that follow the motion, float or float64 array (T,), 0 to 1.
    #[getter]
    fn share<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.numbers(py, |row| row.fit.share())
    }

    /// Share of the region's sites that are valid, float or float64 array (T,), 0 to 1.
    #[getter]
    fn valid_share<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.numbers(py, |row| row.fit.valid_share())
    }

    /// Sites that the motion was fitted to, int or int64 array (T,).
    #[getter]
    fn count<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        self.counts(py, |row| row.fit.count)
    }

    /// "ok", "no_dominant_motion" or "too_few_sites" (no unit), str or list (T,) of them.
    #[getter]
    fn status<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let names = self.rows.iter().map(|row| RegionStatus::name(row.fit.status));
        if self.is_stack {
            return Ok(PyList::new(py, names.collect::<Vec<_>>())?.into_any());
        }
        Ok(RegionStatus::name(self.rows[0].fit.status).into_bound_py_any(py)?)
    }

    /// The motion (u, v, u_x, v_x, u_y, v_y) at `centre`, float64 array (6,) or (T, 6), in the field's units.
    #[getter]
    fn motion<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let shape = if self.is_stack { vec![self.rows.len(), 6] } else { vec![6] };
        arrays::owned(py, &shape, self.rows.iter().flat_map(|row| row.fit.motion).collect())
    }

    /// Its covariance, float64 array (6, 6) or (T, 6, 6), in squares of the field's units.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let shape = if self.is_stack { vec![self.rows.len(), 6, 6] } else { vec![6, 6] };
        arrays::owned(py, &shape, self.rows.iter().flat_map(|row| row.fit.covariance.into_iter().flatten()).collect())
    }

    /// Centre (x, y) of the region's sites, or the pixel `at`, float64 array (2,) or (T, 2), px.
    #[getter]
    fn centre<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let shape = if self.is_stack { vec![self.rows.len(), 2] } else { vec![2] };
        arrays::owned(py, &shape, self.rows.iter().flat_map(|row| [row.fit.centre.0, row.fit.centre.1]).collect())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Outcome<(Bound<'py, PyAny>, (String, String, bool, Vec<Plain>))> {
        let this = slf.get();
        let restore = slf.py().import("jacoflow._jacoflow")?.getattr("_restore_measurement")?;
        let rows = this.rows.iter().map(Plain::from).collect();
        Ok((restore, (this.name.clone(), this.unit.clone(), this.is_stack, rows)))
    }

    fn __repr__(&self) -> String {
        let Self { name, unit, rows, .. } = self;
        let found = rows.iter().filter(|row| row.fit.status == RegionStatus::Ok).count();
        match &rows[..] {
            [row] if !self.is_stack => {
                let (status, share) = (RegionStatus::name(row.fit.status), row.fit.share());
                // Two digits of the standard deviation, and the value to the same place.
                let places = if row.std > 0.0 { (1.0 - row.std.log10().floor()).clamp(0.0, 12.0) as usize } else { 6 };
                let number = format!("{:.places$} +- {:.places$}", row.value, row.std);
                format!("Measurement({name}={number} {unit}, share={share:.2}, status={status:?})")
            }
            _ => format!("Measurement({name} in {unit}, {} fields, {found} ok)", rows.len()),
        }
    }
}
