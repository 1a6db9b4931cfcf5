//! What Python sees of a `FlowField`: derived quantities.

use super::{FlowField, Store, derived, each};
use crate::errors::Outcome;
use crate::options::{self, Region};
use crate::{arrays, keywords::getters};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

getters! {
    FlowField;
    /// Divergence u_x + v_y, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    divergence(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "divergence");
    /// Curl v_x - u_y, float64 array (..., H, W), 1/frame, or 1/s with a frame period; positive turns
    /// clockwise on the screen.
    curl(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "curl");
    /// Shear sqrt((u_x - v_y)^2 + (u_y + v_x)^2), float64 array (..., H, W), 1/frame, or 1/s with a frame
    /// period.
    shear_magnitude(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "shear_magnitude");
    /// Direction of the greatest stretch, atan2(u_y + v_x, u_x - v_y) / 2, float64 array (..., H, W), rad in
    /// (-pi/2, pi/2], from x towards y.
    shear_axis(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "shear_axis");
    /// Stretch u_x along x, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_xx(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "strain_xx");
    /// Stretch v_y along y, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_yy(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "strain_yy");
    /// Shear strain (u_y + v_x) / 2, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_xy(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "strain_xy");
    /// Angular velocity (v_x - u_y) / 2, float64 array (..., H, W), rad/frame, or rad/s with a frame period.
    angular_velocity(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "angular_velocity");
    /// Angular velocity, float64 array (..., H, W), revolutions per minute; ValueError without fps or
    /// frame_period.
    rpm(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "rpm");
    /// Distance of the point that does not move, float64 array (..., H, W), px, or units of the pixel pitch.
    centre_distance(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "centre_distance");
    /// Time 2 / (u_x + v_y) until contact with a surface parallel to the image, float64 array (..., H, W),
    /// frames, or s with a frame period; negative while it recedes.
    time_to_contact(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "time_to_contact");
    /// Speed sqrt(u^2 + v^2), float64 array (..., H, W), px/frame, or px/s with a frame period.
    speed(this, slf) -> Outcome<Bound<'py, PyAny>> = this.value(slf.py(), "speed");
    /// The point that does not move, p - M^-1 (u, v), float64 array (..., H, W, 2): (x, y) in px, or units of
    /// the pixel pitch.
    ///
    /// It need not be in the picture. NaN where there is none. `value` and `std` take its parts,
    /// rotation_centre_x and rotation_centre_y.
    rotation_centre(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let both = (this.value(slf.py(), "rotation_centre_x")?, this.value(slf.py(), "rotation_centre_y")?);
        Ok(slf.py().import("numpy")?.call_method1("stack", (both, -1))?)
    };
}

#[pymethods]
impl FlowField {
    /// The parameter or derived quantity `name`, float64 array (..., H, W), in the unit that `unit(name)`
    /// gives.
    ///
    /// Names are those of `parameters` and of `quantities()`. ValueError for another name, and for rpm
    /// without a frame period.
    fn value<'py>(&self, py: Python<'py>, name: &str) -> Outcome<Bound<'py, PyAny>> {
        each!(self.store, packed => {
            let mut data = Vec::new();
            for index in 0..self.count {
                let field = self.core(packed, index);
                data.extend(py.detach(|| derived::value(&field, name))?);
            }
            arrays::owned(py, &self.shape(), data)
        })
    }

    /// Standard deviation of the parameter or derived quantity `name`, float64 array (..., H, W), in its
    /// unit: sqrt(g^T Cov g) with its gradient g.
    ///
    /// ValueError for another name and for a field without covariance.
    fn std<'py>(&self, py: Python<'py>, name: &str) -> Outcome<Bound<'py, PyAny>> {
        each!(self.store, packed => {
            let mut data = Vec::new();
            for index in 0..self.count {
                let field = self.core(packed, index);
                data.extend(py.detach(|| derived::std(&field, name))?);
            }
            arrays::owned(py, &self.shape(), data)
        })
    }

    /// One number for a region: (value, standard deviation, number of sites) of the parameter or derived
    /// quantity `name`, in its unit.
    ///
    /// `region` (x, y, width, height) px, None for every site; `aggregate` "inverse_variance" weighs by the
    /// covariance, "median" does without. The standard deviation allows for the correlation of neighbouring
    /// estimates, and for an error that they have in common: what they claim and do not scatter. A single
    /// field only. ValueError for unknown names and for "inverse_variance" without covariance.
    #[pyo3(signature = (name, region=None, aggregate=None))]
    fn region_mean(
        &self,
        py: Python<'_>,
        name: &str,
        region: Option<Region>,
        aggregate: Option<&str>,
    ) -> Outcome<(f64, f64, usize)> {
        if self.stack {
            return Err(
                PyTypeError::new_err("region_mean: expected a single field, got a stack; index it first").into()
            );
        }
        let region = options::region(region)?;
        each!(self.store, packed => {
            let field = self.core(packed, 0);
            Ok(py.detach(|| derived::region(&field, name, region, aggregate))?)
        })
    }

    /// Unit of the parameter or derived quantity `name` for a pixel pitch of 1 px. ValueError for another
    /// name.
    fn unit(&self, name: &str) -> Outcome<&'static str> {
        Ok(derived::unit(self.layout(), name)?)
    }
}
