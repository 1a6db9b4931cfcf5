//! What Python sees of a `FlowField`: derived quantities.

use super::{FlowField, Measurement, Store, derived, each};
use crate::errors::Outcome;
use crate::{arrays, keywords::getters, options::named, region};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

getters! {
    FlowField;
    /// Divergence L_xx + L_yy of the rate L of the step, float64 array (..., H, W), 1/frame, or 1/s with a
    /// frame period.
    divergence(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "divergence");
    /// Curl L_yx - L_xy, float64 array (..., H, W), 1/frame, or 1/s with a frame period; positive turns
    /// clockwise on the screen.
    curl(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "curl");
    /// Shear sqrt((L_xx - L_yy)^2 + (L_xy + L_yx)^2), float64 array (..., H, W), 1/frame, or 1/s with a frame
    /// period.
    shear_magnitude(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "shear_magnitude");
    /// Direction of the greatest stretch, atan2(L_xy + L_yx, L_xx - L_yy) / 2, float64 array (..., H, W),
    /// rad in (-pi/2, pi/2], from x towards y.
    shear_axis(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "shear_axis");
    /// Stretch L_xx along x, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_xx(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "strain_xx");
    /// Stretch L_yy along y, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_yy(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "strain_yy");
    /// Shear strain (L_xy + L_yx) / 2, float64 array (..., H, W), 1/frame, or 1/s with a frame period.
    strain_xy(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "strain_xy");
    /// Angular velocity (L_yx - L_xy) / 2, float64 array (..., H, W), rad/frame, or rad/s with a frame
    /// period.
    angular_velocity(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "angular_velocity");
    /// Angular velocity, float64 array (..., H, W), revolutions per minute; ValueError without fps or
    /// frame_period.
    rpm(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "rpm");
    /// Distance of the point that does not move, float64 array (..., H, W), px, or units of the pixel pitch.
    centre_distance(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "centre_distance");
    /// Time from the field's frame to contact with a surface parallel to the image, float64 array (..., H,
    /// W), frames, or s with a frame period; negative while it recedes.
    time_to_contact(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "time_to_contact");
    /// Speed sqrt(u^2 + v^2), float64 array (..., H, W), px/frame, or px/s with a frame period.
    speed(this, slf) -> Outcome<Bound<'py, PyAny>> = this.plane(slf.py(), "speed");
    /// The point that does not move, p - M^-1 (u, v), float64 array (..., H, W, 2): (x, y) in px, or units of
    /// the pixel pitch.
    ///
    /// It need not be in the picture. NaN where there is none. `value` and `std` take its parts,
    /// rotation_centre_x and rotation_centre_y.
    rotation_centre(this, slf) -> Outcome<Bound<'py, PyAny>> = {
        let both = (this.plane(slf.py(), "rotation_centre_x")?, this.plane(slf.py(), "rotation_centre_y")?);
        Ok(slf.py().import("numpy")?.call_method1("stack", (both, -1))?)
    };
}

impl FlowField {
    /// The parameter or derived quantity `name` at every site.
    fn plane<'py>(&self, py: Python<'py>, name: &str) -> Outcome<Bound<'py, PyAny>> {
        each!(self.store, packed => {
            let mut data = Vec::new();
            for index in 0..self.count {
                let field = self.core(packed, index);
                data.extend(py.detach(|| derived::value(&field, name))?);
            }
            arrays::owned(py, &self.shape(), data)
        })
    }
}

#[pymethods]
impl FlowField {
    /// The parameter or derived quantity `name`, float64 array (..., H, W), in the unit that `unit(name)`
    /// gives.
    ///
    /// Names are those of `parameters` and of `quantities()`. ValueError for another name, and for rpm
    /// without a frame period.
    fn value<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::name)] name: String,
    ) -> Outcome<Bound<'py, PyAny>> {
        self.plane(py, &name)
    }

    /// Standard deviation of the parameter or derived quantity `name`, float64 array (..., H, W), in its
    /// unit: sqrt(g^T Cov g) with its gradient g.
    ///
    /// ValueError for another name and for a field without covariance.
    fn std<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named::name)] name: String,
    ) -> Outcome<Bound<'py, PyAny>> {
        each!(self.store, packed => {
            let mut data = Vec::new();
            for index in 0..self.count {
                let field = self.core(packed, index);
                data.extend(py.detach(|| derived::std(&field, &name))?);
            }
            arrays::owned(py, &self.shape(), data)
        })
    }

    /// Mean over a region: (value, standard deviation, number of sites) of the parameter or derived quantity
    /// `name`, in its unit.
    ///
    /// `region` None for every site, a rectangle (x, y, width, height), a disc (x, y, radius), a polygon of
    /// corners (N, 2), px, or a boolean mask (H, W); `aggregate` "inverse_variance" (default) weighs by the
    /// covariance, "median" does without. The mean motion stands at the centre of the sites (without slopes,
    /// that of an affine fit to the flow); derived quantities are its own: ratios, lengths and angles are
    /// formed after the mean is, and what noise adds to a length is taken off. The standard deviation allows
    /// for the correlation of neighbouring estimates, and for an error that they have in common: what they
    /// claim and do not scatter. A single field only; `measure` fits one motion instead, and takes stacks.
    /// ValueError for unknown names, regions that do not fit the frame, and for "inverse_variance" without
    /// covariance.
    #[pyo3(signature = (name, region=None, aggregate=None))]
    fn region_mean(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = named::name)] name: String,
        region: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named::aggregate)] aggregate: Option<&str>,
    ) -> Outcome<(f64, f64, usize)> {
        if self.stack {
            return Err(
                PyTypeError::new_err("region_mean: expected a single field, got a stack; index it first").into()
            );
        }
        let region = region::parse(region)?;
        each!(self.store, packed => {
            let field = self.core(packed, 0);
            Ok(py.detach(|| derived::region(&field, &name, region.as_ref(), aggregate))?)
        })
    }

    /// The parameter or derived quantity `name` of the one affine motion that a region follows, as
    /// `Measurement`; for a stack at each time.
    ///
    /// `region` as in `region_mean`. The motion is that of more than half of the valid sites, and of more
    /// than those whose estimates the frames contradict, else the status is "no_dominant_motion" and the
    /// value NaN; with `at`, a pixel (x, y), that of the sites around it, however few they are. u and v are
    /// those at the region's centre, or at `at`. A site follows the motion where its flow differs by no more
    /// than its standard deviation and .1 px/frame explain at 99 %: motions that differ by less are not
    /// separated, and `std` grows with what they leave. ValueError for unknown names, a region without a site
    /// of the field, a pixel outside the frame, and for a field without covariance.
    ///
    /// >>> import jacoflow
    /// >>> scene = jacoflow.scenes.Scene("affine", width=96, height=64, u_x=0.01, v_y=0.01)
    /// >>> field = jacoflow.flow(*scene.frames(2))
    /// >>> found = field.measure("time_to_contact", region=(20, 16, 56, 32))
    /// >>> round(found.value), found.unit, found.status
    /// (100, 'frame', 'ok')
    #[pyo3(signature = (name, region=None, *, at=None))]
    fn measure(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = named::name)] name: String,
        region: Option<&Bound<'_, PyAny>>,
        at: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Measurement> {
        let (measured, unit) = (derived::measured(self.layout(), &name)?, derived::unit(self.layout(), &name)?);
        let region = region::parse(region)?;
        let at = at.map(|at| arrays::pair("at", "a pixel (x, y)", at)).transpose()?;
        let mut measurement = Measurement::new(&name, unit, self.stack);
        each!(self.store, packed => {
            for index in 0..self.count {
                let field = self.core(packed, index);
                py.detach(|| measurement.add(&field, measured, region.as_ref(), at))?;
                py.check_signals()?;
            }
        });
        Ok(measurement)
    }

    /// Unit of the parameter or derived quantity `name`: lengths in px or `length_unit`, times in frames, or
    /// in seconds with a frame period. ValueError for another name.
    fn unit(&self, #[pyo3(from_py_with = named::name)] name: String) -> Outcome<String> {
        Ok(derived::unit(self.layout(), &name)?)
    }
}
