//! Flow as a dense pair of planes in px/frame: what the exchange formats hold.

use crate::error::{Error, Result};
use crate::math::Real;
use crate::types::{FlowField, SamplingGrid};

/// Flow `(u, v)` of every pixel of a grid, px/frame; NaN where it is unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct FlowImage {
    width: usize,
    height: usize,
    u: Vec<f32>,
    v: Vec<f32>,
}

impl FlowImage {
    /// From row-major planes.
    ///
    /// # Errors
    /// [`Error::Argument`] named `u` or `v` when a plane does not hold `width * height` values.
    pub fn new(width: usize, height: usize, u: Vec<f32>, v: Vec<f32>) -> Result<Self> {
        for (name, plane) in [("u", &u), ("v", &v)] {
            if width.checked_mul(height) != Some(plane.len()) {
                return Err(Error::argument(
                    name,
                    format!("{width} x {height} values"),
                    format!("{} values", plane.len()),
                ));
            }
        }
        Ok(Self { width, height, u, v })
    }

    /// The flow of a field on a grid, one pixel a site, back in px/frame for any units of the field.
    ///
    /// # Errors
    /// [`Error::Argument`] named `sites` for a field of points, which is no picture.
    pub fn from_field<T: Real>(field: &FlowField<T>) -> Result<Self> {
        if matches!(field.layout.sites, SamplingGrid::Points(_)) {
            return Err(Error::argument(
                "sites",
                "a grid, for a picture of the flow (points go to CSV or .npz)",
                "a list of points",
            ));
        }
        let n = field.len();
        let plane = |p: usize, name: &str| {
            let scale = field.layout.units.scale(name);
            field.motion[p * n..(p + 1) * n].iter().map(|m| (m.to_f64() / scale) as f32).collect()
        };
        Self::new(field.width, field.height, plane(0, "u"), plane(1, "v"))
    }

    /// As a translational field: every pixel a site, status `Unobservable` where the flow is unknown.
    ///
    /// # Errors
    /// None for a well-formed image; passes on what [`FlowField::from_planes`] reports.
    pub fn to_field(&self) -> Result<FlowField<f32>> {
        FlowField::from_planes((self.width, self.height), [self.u.as_slice(), &self.v].concat(), None)
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }
    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }
    /// Flow along x, px/frame, row-major.
    pub fn u(&self) -> &[f32] {
        &self.u
    }
    /// Flow along y, px/frame, row-major.
    pub fn v(&self) -> &[f32] {
        &self.v
    }
    /// Share of the pixels whose flow is known, 0 to 1.
    pub fn valid_share(&self) -> f64 {
        let known = self.u.iter().zip(&self.v).filter(|(u, v)| u.is_finite() && v.is_finite()).count();
        known as f64 / self.u.len().max(1) as f64
    }
}
