//! What is given: points with their flow, its noise, and where on its path a displacement is measured.

use super::camera::Intrinsics;
use super::motion::Projection;
use super::rows::tangents;
use crate::error::{Error, Result, numbers};
use crate::types::FlowField;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Points with their flow, N of each.
#[derive(Debug, Clone, Copy)]
pub enum Flow<'a> {
    /// On the picture.
    Plane {
        /// Where, px with a camera, else on the plane at distance 1.
        points: &'a [[f64; 2]],
        /// Displacement over one frame, in the same unit.
        flow: &'a [[f64; 2]],
        /// The camera; `None`: everything is on the plane at distance 1.
        camera: Option<&'a Intrinsics>,
    },
    /// On the unit sphere.
    Sphere {
        /// Bearings of length 1.
        bearings: &'a [[f64; 3]],
        /// Their rates of change, rad/frame; parts along the bearings do not count.
        flow: &'a [[f64; 3]],
    },
}

/// Noise of the flow.
#[derive(Debug, Clone, Copy, Default)]
pub enum Noise<'a> {
    /// The same everywhere; its size is estimated from the residuals.
    #[default]
    Unknown,
    /// Standard deviation of each component, in the unit of the flow.
    StandardDeviation(f64),
    /// A covariance for every point, row by row: 4 values on the plane, 9 on the sphere, in squared units of
    /// the flow. Points whose covariance is not finite are left out; others must be symmetric and positive
    /// definite, on the sphere across the bearing. A point whose smaller variance is below a millionth of the
    /// lower quartile of all has that quartile added: no measurement is so much better than others, and one
    /// that says so would decide alone.
    Covariances(&'a [f64]),
}

/// Where on its path a displacement is taken to be the instantaneous flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Placement {
    /// Half way: exact to second order.
    #[default]
    Midpoint,
    /// Where the point was: for flow that is instantaneous already.
    Start,
}

impl Flow<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Plane { points, .. } => points.len(),
            Self::Sphere { bearings, .. } => bearings.len(),
        }
    }
    /// No point at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Where point `k` lies, in the unit of the points.
    pub(crate) fn place(&self, k: usize) -> Vector3<f64> {
        match self {
            Self::Plane { points, .. } => Vector3::new(points[k][0], points[k][1], 0.0),
            Self::Sphere { bearings, .. } => bearings[k].into(),
        }
    }
    /// The camera that saw it.
    pub(crate) fn camera(&self) -> Option<&Intrinsics> {
        if let Self::Plane { camera, .. } = self { *camera } else { None }
    }
    /// The screen.
    pub fn projection(&self) -> Projection {
        match self {
            Self::Plane { .. } => Projection::Plane,
            Self::Sphere { .. } => Projection::Sphere,
        }
    }

    /// Whether all covariances that are finite are some; on the sphere only across the bearing, where the
    /// flow is.
    fn check_covariances(&self, covariances: &[f64], values: usize) -> Result<()> {
        for (k, given) in covariances.chunks_exact(values).enumerate() {
            let good = match self {
                Self::Plane { .. } => is_covariance(&DMatrix::from_row_slice(2, 2, given)),
                Self::Sphere { bearings, .. } => {
                    let axes = tangents(&Vector3::from(bearings[k]).normalize());
                    let given = Matrix3::from_row_slice(given);
                    let across = axes * given * axes.transpose();
                    symmetric(given.as_slice(), 3)
                        && is_covariance(&DMatrix::from_column_slice(2, 2, across.as_slice()))
                }
            };
            if !good {
                return Err(not_covariance(k, given));
            }
        }
        Ok(())
    }

    pub(crate) fn check(&self, noise: &Noise<'_>) -> Result<()> {
        let (points, flow, values) = match self {
            Self::Plane { points, flow, .. } => (points.len(), flow.len(), 4),
            Self::Sphere { bearings, flow } => (bearings.len(), flow.len(), 9),
        };
        if points != flow {
            return Err(Error::argument("flow", format!("{points} values, one for each point"), flow));
        }
        if let Self::Sphere { bearings, .. } = self {
            let off = |b: &&[f64; 3]| (b[0].hypot(b[1]).hypot(b[2]) - 1.0).abs() > 1e-3;
            if let Some(wrong) = bearings.iter().find(off) {
                return Err(Error::argument("points", "bearings of length 1", numbers(wrong)));
            }
        }
        match noise {
            Noise::StandardDeviation(noise_std) => check_noise_std(*noise_std),
            Noise::Covariances(c) if c.len() != values * points => {
                let expected = format!("{points} matrices of {values} values");
                Err(Error::argument("cov", expected, format!("{} values", c.len())))
            }
            Noise::Covariances(c) => self.check_covariances(c, values),
            Noise::Unknown => Ok(()),
        }
    }
}

/// Whether the fourth power of a standard deviation, which sums of squares hold, is a number.
pub(crate) fn check_noise_std(noise_std: f64) -> Result<()> {
    if noise_std > 0.0 && noise_std.powi(4).is_normal() {
        return Ok(());
    }
    Err(Error::argument("noise_std", "a positive number between 1e-75 and 1e75", noise_std))
}

/// Whether a field has covariances and is in px.
pub(crate) fn check_field<T>(field: &FlowField<T>) -> Result<()> {
    if field.covariance.is_none() {
        return Err(Error::argument("field", "one with a covariance", "one without"));
    }
    if field.layout.pixel_pitch != (1.0, 1.0) {
        let got = format!("the pixel pitch {:?}", field.layout.pixel_pitch);
        return Err(Error::argument("field", "flow in px", got));
    }
    Ok(())
}

/// Asymmetry of a covariance, in shares of its largest entry, that is rounding.
pub(crate) const ROUNDED: f64 = 1e-5;

pub(crate) fn symmetric(values: &[f64], size: usize) -> bool {
    let largest = values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    let off = |i: usize, j: usize| (values[size * i + j] - values[size * j + i]).abs();
    (0..size).all(|i| (0..i).all(|j| off(i, j) <= ROUNDED * largest))
}

/// Whether a matrix is symmetric and positive definite, or not finite: then its point is left out.
pub(crate) fn is_covariance(matrix: &DMatrix<f64>) -> bool {
    if !matrix.iter().all(|value| value.is_finite()) {
        return true;
    }
    let even = 0.5 * (matrix + matrix.transpose());
    symmetric(matrix.as_slice(), matrix.nrows()) && even.cholesky().is_some()
}

pub(crate) fn not_covariance(k: usize, got: &[f64]) -> Error {
    Error::argument("cov", "symmetric positive definite matrices", format!("at point {k} {}", numbers(got)))
}
