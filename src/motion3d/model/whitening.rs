//! Whitens given points: rows with unit noise covariance.

use super::input::{Flow, Noise, Placement, to_plane};
use super::observations::{CHUNK, Observations, Row};
use super::rows::{Derotation, Rows};
use crate::math::{quantile, tangents};
use crate::parallel;
use crate::types::Intrinsics;
use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, SVector, Vector2, Vector3};

/// What was given, to be whitened as often as another rotation is taken out of its displacements.
#[derive(Clone)]
pub(crate) struct Whitening<'a> {
    pub flow: &'a Flow<'a>,
    pub placement: Placement,
    /// In screen axes, in squared units of the flow: of each point, or one of all.
    covariances: Vec<Matrix2<f64>>,
}

impl<'a> Whitening<'a> {
    /// Unknown noise is taken to be 1 of the flow's unit.
    pub fn new(flow: &'a Flow<'a>, noise: &Noise<'_>, placement: Placement) -> Self {
        let covariances = match (flow, noise) {
            (Flow::Plane { .. }, Noise::Covariances(given)) => {
                floored(given.chunks_exact(4).map(Matrix2::from_row_slice).collect())
            }
            (Flow::Sphere { bearings, .. }, Noise::Covariances(given)) => {
                let across = |(bearing, given): (&[f64; 3], &[f64])| {
                    let axes = tangents(&Vector3::from(*bearing).normalize());
                    axes * Matrix3::from_row_slice(given) * axes.transpose()
                };
                floored(bearings.iter().zip(given.chunks_exact(9)).map(across).collect())
            }
            (_, Noise::StandardDeviation(noise_std)) => vec![Matrix2::identity() * (noise_std * noise_std)],
            (_, Noise::Unknown) => vec![Matrix2::identity()],
        };
        Self { flow, placement, covariances }
    }

    /// The usable points in the order given; rows that are not finite or whose covariance is no covariance
    /// are left out.
    pub fn whitened(&self) -> Observations {
        let one = |k: usize| Some((self.row(k, None)?, k as u32));
        let usable = parallel::map_range(self.flow.len(), CHUNK, one);
        let (rows, source): (Vec<(Row, [f64; 3])>, Vec<u32>) = usable.into_iter().flatten().unzip();
        let (rows, eta): (Vec<Row>, Vec<[f64; 3]>) = rows.into_iter().unzip();
        let spherical = matches!(self.flow, Flow::Sphere { .. });
        let mut out = Observations::new(&rows, eta, spherical, source);
        out.displaced = self.placement == Placement::Midpoint && !spherical;
        if let Flow::Plane { points, camera, .. } = self.flow {
            let given = out.source.iter().map(|&k| points[k as usize]);
            let place = given.map(|at| camera.map_or(at, |camera| camera.to_plane(at)));
            out.site = place.map(|[x, y]| [x, y, 0.0]).collect();
        } else {
            out.site.clone_from(&out.eta);
        }
        out
    }

    /// The same points in the same units, with the rotation of a motion taken out of their displacements; a
    /// point that this leads behind the camera gets weight 0.
    pub fn derotated(&self, points: &Observations, turn: Derotation) -> Observations {
        let nothing = Row { g: Matrix2x3::zeros(), r: Matrix2x3::zeros(), f: Vector2::zeros() };
        let one = |n: usize| self.row(points.source[n] as usize, Some(&turn)).unwrap_or((nothing, points.eta[n]));
        let turned = parallel::map_range(points.source.len(), CHUNK, one);
        let (rows, eta): (Vec<Row>, Vec<[f64; 3]>) = turned.into_iter().unzip();
        points.derotated(&rows, eta, turn)
    }

    fn row(&self, k: usize, turn: Option<&Derotation>) -> Option<(Row, [f64; 3])> {
        let covariance = self.covariances.get(k).unwrap_or(&self.covariances[0]);
        match self.flow {
            Flow::Plane { points, flow, camera } => {
                plane_row(points[k], flow[k], covariance, *camera, (self.placement, turn))
            }
            Flow::Sphere { bearings, flow } => {
                let eta = Vector3::from(bearings[k]).normalize();
                let row = Row::whitened(&Rows::sphere(&eta), tangents(&eta) * Vector3::from(flow[k]), covariance)?;
                Some((row, eta.into()))
            }
        }
    }
}

/// A point of the picture, whitened, and its `eta = (x, y, 1)`; with a `turn` as a
/// displacement with that rotation taken out. `covariance` in squared units of the flow.
pub(crate) fn plane_row(
    point: [f64; 2],
    flow: [f64; 2],
    covariance: &Matrix2<f64>,
    camera: Option<&Intrinsics>,
    (placement, turn): (Placement, Option<&Derotation>),
) -> Option<(Row, [f64; 3])> {
    let at = |share: f64| {
        let at = [point[0] + share * flow[0], point[1] + share * flow[1]];
        camera.map_or(at, |camera| camera.to_plane(at))
    };
    let mut scale = to_plane(camera);
    let (rows, flow, [x, y]) = if let Some(turn) = turn {
        let turned = turn.out_of(at(0.0), at(1.0))?;
        scale = turned.spread * scale;
        (turned.rows, turned.flow, turned.from)
    } else {
        let at = at(if placement == Placement::Midpoint { 0.5 } else { 0.0 });
        (Rows::plane(at), scale * Vector2::from(flow), at)
    };
    let row = Row::whitened(&rows, flow, &(scale * covariance * scale.transpose()).symmetric_part())?;
    (x.is_finite() && y.is_finite()).then_some((row, [x, y, 1.0]))
}

/// Symmetric covariances. One that is a thousand times as precise as the better quarter is no measurement's:
/// the variances of that quarter are added.
pub(crate) fn floored<const N: usize>(mut covariances: Vec<SMatrix<f64, N, N>>) -> Vec<SMatrix<f64, N, N>> {
    let diagonal = |i: usize| {
        let mut own: Vec<f64> = covariances.iter().map(|c| c[(i, i)]).filter(|value| value.is_finite()).collect();
        quantile(&mut own, 0.25).unwrap_or(0.0)
    };
    let usual = SVector::<f64, N>::from_fn(|i, _| diagonal(i));
    for given in &mut covariances {
        *given = given.symmetric_part();
        let excess = *given - SMatrix::from_diagonal(&(usual * 1e-6));
        if excess.iter().all(|value| value.is_finite()) && excess.cholesky().is_none() {
            *given += SMatrix::from_diagonal(&usual);
        }
    }
    covariances
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variance_of_nothing_is_not_believed_and_a_quarter_of_small_ones_is() {
        let usual = Matrix2::new(0.04, 0.01, 0.01, 0.09);
        let nothing = Matrix2::identity() * 1e-20;
        // An edge is known well across and not at all along.
        let edge = Matrix2::new(1e4, 0.0, 0.0, 0.01);
        let given: Vec<_> = std::iter::repeat_n(usual, 9).chain([nothing, edge]).collect();
        let believed = floored(given);
        assert_eq!((believed[0], believed[10]), (usual, edge));
        assert!((believed[9] - Matrix2::new(0.04, 0.0, 0.0, 0.09)).norm() < 1e-12);
        let many: Vec<_> = std::iter::repeat_n(usual, 6).chain(std::iter::repeat_n(nothing, 3)).collect();
        assert_eq!(floored(many)[8], nothing);
    }

    #[test]
    fn numbers_of_a_patch_are_judged_in_their_own_units() {
        let diagonal = |scale: f64| Matrix2::new(scale, 0.0, 0.0, 1e-8 * scale);
        let believed = floored((0..8).map(|k| diagonal(if k == 3 { 1e-20 } else { 1.0 })).collect());
        assert_eq!(believed[..3], vec![diagonal(1.0); 3]);
        assert!((believed[3][(0, 0)] - 1.0).abs() < 1e-12 && (believed[3][(1, 1)] / 1e-8 - 1.0).abs() < 1e-12);
    }
}
