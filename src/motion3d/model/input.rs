//! What is given: points with their flow, its noise, where on its path a displacement is measured, and the
//! camera.

use crate::error::{Error, Result, numbers};
use crate::math::{Real, tangents};
use crate::types::{FlowField, Intrinsics};
use nalgebra::{Matrix2, Matrix6, SMatrix, Vector2, Vector3};
use std::fmt::Display;

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
    /// definite, on the sphere across the bearing. A point with a variance below a millionth of the lower
    /// quartile of all has that quartile added: no measurement is so much better than others, and one that
    /// says so would decide alone.
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
    pub(crate) fn check(&self, noise: &Noise<'_>) -> Result<()> {
        let flow = match self {
            Self::Plane { flow, .. } => flow.len(),
            Self::Sphere { flow, .. } => flow.len(),
        };
        check_lengths(self.len(), flow)?;
        if let Self::Plane { points, camera: None, .. } = self {
            check_on_plane(points)?;
        }
        if let Self::Sphere { bearings, .. } = self {
            let off = |b: &&[f64; 3]| (b[0].hypot(b[1]).hypot(b[2]) - 1.0).abs() > 1e-3;
            let wrong = bearings.iter().find(off);
            refuse_if(wrong.is_some(), "points", "bearings of length 1", numbers(wrong.into_iter().flatten()))?;
        }
        match (noise, self) {
            (Noise::StandardDeviation(noise_std), _) => check_noise_std(*noise_std),
            (Noise::Covariances(given), Self::Plane { points, .. }) => {
                check_covariances::<2>(points.len(), given, |_, given| is_positive(given))
            }
            // Only across the bearing, where the flow is.
            (Noise::Covariances(given), Self::Sphere { bearings, .. }) => {
                check_covariances::<3>(bearings.len(), given, |k, given| {
                    let axes = tangents(&Vector3::from(bearings[k]).normalize());
                    is_positive(&(axes * given * axes.transpose()))
                })
            }
            (Noise::Unknown, _) => Ok(()),
        }
    }
}

/// An error that names an argument, if it is wrong.
pub(crate) fn refuse_if(wrong: bool, name: &'static str, expected: impl Into<String>, got: impl Display) -> Result<()> {
    if wrong { Err(Error::argument(name, expected, got)) } else { Ok(()) }
}

/// Largest coordinate of a point on the plane at distance 1: 84 degrees off the axis.
const MAX_ON_PLANE: f64 = 10.0;

/// Refuses points in px without the camera matrix that would bring them to the plane at distance 1.
pub(crate) fn check_on_plane(points: &[[f64; 2]]) -> Result<()> {
    let far = points.iter().find(|point| point.iter().any(|x| x.is_finite() && x.abs() > MAX_ON_PLANE));
    let expected = "the camera matrix for points in px; without it points lie on the plane at distance 1, within 10";
    let got = format!("none, and the point {}", numbers(far.into_iter().flatten()));
    refuse_if(far.is_some(), "K", expected, got)
}

pub(crate) fn check_lengths(points: usize, flow: usize) -> Result<()> {
    refuse_if(points != flow, "flow", format!("{points} values, one for each point"), flow)
}

/// Whether there is a matrix for every point, each symmetric and `positive`, or not finite: then its point is
/// left out.
pub(crate) fn check_covariances<const N: usize>(
    points: usize,
    covariances: &[f64],
    positive: impl Fn(usize, &SMatrix<f64, N, N>) -> bool,
) -> Result<()> {
    let values = N * N;
    let (expected, got) = (format!("{points} matrices of {values} values"), format!("{} values", covariances.len()));
    refuse_if(covariances.len() != values * points, "cov", expected, got)?;
    for (k, values) in covariances.chunks_exact(values).enumerate() {
        let given = SMatrix::<f64, N, N>::from_row_slice(values);
        let finite = values.iter().all(|value| value.is_finite());
        // Asymmetry, in shares of the largest entry, that is rounding.
        let symmetric = (given - given.transpose()).amax() <= 1e-5 * given.amax();
        if finite && !(symmetric && positive(k, &given)) {
            let got = format!("at point {k} {}", numbers(values));
            return Err(Error::argument("cov", "symmetric positive definite matrices", got));
        }
    }
    Ok(())
}

pub(crate) fn is_positive<const N: usize>(matrix: &SMatrix<f64, N, N>) -> bool {
    (matrix + matrix.transpose()).cholesky().is_some()
}

/// Whether the fourth power of a standard deviation, which sums of squares hold, is a number.
pub(crate) fn check_noise_std(noise_std: f64) -> Result<()> {
    let is_usable = noise_std > 0.0 && noise_std.powi(4).is_normal();
    refuse_if(!is_usable, "noise_std", "a positive number between 1e-75 and 1e75", noise_std)
}

/// Whether a field has covariances.
pub(crate) fn check_field<T>(field: &FlowField<T>) -> Result<()> {
    refuse_if(field.covariance.is_none(), "field", "one with a covariance", "one without")
}

/// The flow and its covariance at a valid site.
pub(crate) fn measurement<T: Real>(field: &FlowField<T>, site: usize) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let [[uu, uv, ..], [vu, vv, ..], ..] = field.covariance_at(site).filter(|_| field.status[site].is_valid())?;
    let [u, v, ..] = field.affine(site).to_array().map(Real::to_f64);
    let uv = 0.5 * (uv + vu);
    Some((Vector2::new(u, v), Matrix2::new(uu, uv, uv, vv)))
}

/// What maps flow to the plane at distance 1, where it lies already without a camera.
pub(crate) fn to_plane(camera: Option<&Intrinsics>) -> Matrix2<f64> {
    camera.map_or_else(Matrix2::identity, Intrinsics::scale)
}

/// `blockdiag(D_2, kron(D_1^-T, D_2))`, which maps `(u, v, u_x, v_x, u_y, v_y)` where flow is mapped by `D_2`
/// and its place by `D_1`, that is invertible; covariances map as `B C B^t`.
pub(crate) fn affine_map(flow: &Matrix2<f64>, place: &Matrix2<f64>) -> Matrix6<f64> {
    let back = place.try_inverse().unwrap_or_else(Matrix2::zeros);
    let mut map = Matrix6::zeros();
    map.fixed_view_mut::<2, 2>(0, 0).copy_from(flow);
    // vec(A M B) = kron(B^T, A) vec(M), columns first: (u_x, v_x), (u_y, v_y).
    map.fixed_view_mut::<4, 4>(2, 2).copy_from(&back.transpose().kronecker(flow));
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    #[test]
    fn affine_flow_maps_as_its_parts_do() {
        let camera = Intrinsics::new([[500.0, 3.0, 310.0], [0.0, 420.0, 245.0], [0.0, 0.0, 1.0]]).unwrap();
        let jacobian = Matrix2::new(0.01, -0.02, 0.03, 0.005);
        let m = Vector6::new(1.5, -0.7, 0.01, 0.03, -0.02, 0.005);
        let mapped = affine_map(&camera.scale(), &camera.scale()) * m;
        let flow = camera.scale() * nalgebra::Vector2::new(1.5, -0.7);
        let slopes = camera.scale() * jacobian * camera.unscale();
        let want = [flow.x, flow.y, slopes[(0, 0)], slopes[(1, 0)], slopes[(0, 1)], slopes[(1, 1)]];
        for (got, want) in mapped.iter().zip(want) {
            assert!((got - want).abs() < 1e-15, "{got} {want}");
        }
        let there = camera.to_pixel(camera.to_plane([17.0, 400.0]));
        assert!((there[0] - 17.0).abs() < 1e-10 && (there[1] - 400.0).abs() < 1e-10);
    }
}
