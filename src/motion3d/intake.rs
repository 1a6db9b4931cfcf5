//! From what is given to whitened points.

use super::camera::Intrinsics;
use super::motion::{Rows, tangents};
use super::observations::{Observations, Row};
use super::options::{Flow, Noise, Placement};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Whitens the usable points; rows that are not finite or whose covariance is no covariance are left out. Unknown noise is taken to be 1 of the flow's unit.
pub(super) fn whiten(flow: &Flow<'_>, noise: &Noise<'_>, placement: Placement) -> Observations {
    let n = flow.len();
    let (mut rows, mut position, mut source) = (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
    let sigma = if let Noise::Sigma(sigma) = noise { *sigma } else { 1.0 };
    for k in 0..n {
        let row = match flow {
            Flow::Plane { points, flow, camera } => {
                let same = [sigma * sigma, 0.0, 0.0, sigma * sigma];
                let covariance: &[f64] = if let Noise::Covariances(c) = noise { &c[4 * k..4 * k + 4] } else { &same };
                let row = plane_row(points[k], flow[k], covariance, *camera, placement);
                let at = row.as_ref().map_or([f64::NAN; 2], |(_, at)| *at);
                position.push([at[0], at[1], 0.0]);
                row.map(|(row, _)| row)
            }
            Flow::Sphere { bearings, flow } => {
                let eta = Vector3::from(bearings[k]);
                let eta = eta / eta.norm();
                let axes = tangents(&eta);
                let covariance = match noise {
                    Noise::Covariances(c) => {
                        symmetric(axes * Matrix3::from_row_slice(&c[9 * k..9 * k + 9]) * axes.transpose())
                    }
                    _ => Matrix2::identity() * (sigma * sigma),
                };
                position.push(eta.into());
                Row::whitened(&Rows::sphere(&eta), axes * Vector3::from(flow[k]), &covariance)
            }
        };
        let usable = row.filter(|_| position.last().is_some_and(|p| p.iter().all(|value| value.is_finite())));
        if let Some(row) = usable {
            rows.push(row);
            source.push(k as u32);
        } else {
            position.pop();
        }
    }
    let spherical = matches!(flow, Flow::Sphere { .. });
    Observations::new(&rows, position, spherical, source)
}

/// A point of the picture, whitened, and its place on the plane at distance 1; `covariance`: 4 values, in squared units of the flow.
pub(super) fn plane_row(
    point: [f64; 2],
    flow: [f64; 2],
    covariance: &[f64],
    camera: Option<&Intrinsics>,
    placement: Placement,
) -> Option<(Row, [f64; 2])> {
    let half = if placement == Placement::Midpoint { 0.5 } else { 0.0 };
    let at = [point[0] + half * flow[0], point[1] + half * flow[1]];
    let scale = camera.map_or_else(Matrix2::identity, Intrinsics::scale);
    let at = camera.map_or(at, |camera| camera.to_plane(at));
    let covariance = scale * symmetric(Matrix2::from_row_slice(covariance)) * scale.transpose();
    Row::whitened(&Rows::plane(at), scale * Vector2::from(flow), &covariance).map(|row| (row, at))
}

fn symmetric(matrix: Matrix2<f64>) -> Matrix2<f64> {
    0.5 * (matrix + matrix.transpose())
}
