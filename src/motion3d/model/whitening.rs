//! Whitens given points: rows with unit noise covariance.

use super::camera::Intrinsics;
use super::derotation::Derotation;
use super::input::{Flow, Noise, Placement};
use super::observations::{Observations, Row};
use super::rows::{Rows, tangents};
use crate::math::quantile;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, SymmetricEigen, Vector2, Vector3};
use rayon::prelude::*;

/// Fewest points that a task whitens.
const TOGETHER: usize = 1024;

/// What was given, to be whitened as often as another rotation is taken out of its displacements.
#[derive(Clone, Copy)]
pub(crate) struct Whitening<'a> {
    pub flow: &'a Flow<'a>,
    pub noise: &'a Noise<'a>,
    pub placement: Placement,
    /// Which covariances are.
    floor: CovarianceFloor,
}

impl<'a> Whitening<'a> {
    pub fn new(flow: &'a Flow<'a>, noise: &'a Noise<'a>, placement: Placement) -> Self {
        let mut whitening = Self { flow, noise, placement, floor: CovarianceFloor::default() };
        if matches!(noise, Noise::Covariances(_)) {
            whitening.floor = CovarianceFloor::new((0..flow.len()).map(|k| whitening.given_covariance(k)));
        }
        whitening
    }
}

impl Whitening<'_> {
    /// The covariance of a point's flow as it was given, in screen axes, in squared units of the flow.
    fn given_covariance(&self, k: usize) -> Matrix2<f64> {
        match (self.flow, self.noise) {
            (Flow::Plane { .. }, Noise::Covariances(c)) => symmetric(Matrix2::from_row_slice(&c[4 * k..4 * k + 4])),
            (Flow::Sphere { bearings, .. }, Noise::Covariances(c)) => {
                let axes = tangents(&Vector3::from(bearings[k]).normalize());
                symmetric(axes * Matrix3::from_row_slice(&c[9 * k..9 * k + 9]) * axes.transpose())
            }
            (_, Noise::StandardDeviation(noise_std)) => Matrix2::identity() * (noise_std * noise_std),
            (_, Noise::Unknown) => Matrix2::identity(),
        }
    }

    /// The usable points in the order given; rows that are not finite or whose covariance is no covariance
    /// are left out. Unknown noise is taken to be 1 of the flow's unit.
    pub fn whitened(&self) -> Observations {
        let sources: Vec<u32> = (0..self.flow.len() as u32).collect();
        let one = |&k: &u32| self.row(k as usize, None);
        let rows: Vec<_> = sources.par_iter().with_min_len(TOGETHER).map(one).collect();
        let usable = |(row, at): &(Option<Row>, [f64; 3])| row.filter(|_| at.iter().all(|value| value.is_finite()));
        let kept = || rows.iter().zip(&sources).filter_map(|(given, source)| Some((usable(given)?, given.1, *source)));
        let whitened: Vec<Row> = kept().map(|(row, ..)| row).collect();
        let (position, source) = kept().map(|(_, at, source)| (at, source)).unzip();
        let mut out = Observations::new(&whitened, position, matches!(self.flow, Flow::Sphere { .. }), source);
        out.displaced = self.has_displacements();
        out.site = self.given_positions(&out);
        out
    }

    /// Where points were given: bearings, or places on the plane at distance 1.
    fn given_positions(&self, points: &Observations) -> Vec<[f64; 3]> {
        let Flow::Plane { points: given, camera, .. } = self.flow else { return points.position.clone() };
        let place = |&k: &u32| {
            let at = given[k as usize];
            let [x, y] = camera.map_or(at, |camera| camera.to_plane(at));
            [x, y, 0.0]
        };
        points.source.iter().map(place).collect()
    }

    /// Whether flow is a displacement from a place that is given.
    pub fn has_displacements(&self) -> bool {
        self.placement == Placement::Midpoint && matches!(self.flow, Flow::Plane { .. })
    }

    /// The same points in the same units, with the rotation of a motion taken out of their displacements; a
    /// point that this leads behind the camera gets weight 0.
    pub fn derotated(&self, points: &Observations, turn: Derotation) -> Observations {
        let nothing = Row { g: nalgebra::Matrix2x3::zeros(), r: nalgebra::Matrix2x3::zeros(), f: Vector2::zeros() };
        let one = |(&k, &before): (&u32, &[f64; 3])| match self.row(k as usize, Some(&turn)) {
            (Some(row), at) => (row, at),
            (None, _) => (nothing, before),
        };
        let (mut whitened, mut position) = (Vec::new(), Vec::new());
        let given = points.source.par_iter().zip(&points.position).with_min_len(TOGETHER);
        given.map(one).unzip_into_vecs(&mut whitened, &mut position);
        let mut out = Observations::new(&whitened, position, false, points.source.clone());
        out.like(points);
        out.site.clone_from(&points.site);
        out.turn = Some(turn);
        out
    }

    fn row(&self, k: usize, turn: Option<&Derotation>) -> (Option<Row>, [f64; 3]) {
        let covariance = self.floor.of(self.given_covariance(k));
        match self.flow {
            Flow::Plane { points, flow, camera } => {
                let row = match turn {
                    Some(turn) => turned_row(points[k], flow[k], &covariance, *camera, turn),
                    None => plane_row(points[k], flow[k], &covariance, *camera, self.placement),
                };
                row.map_or((None, [f64::NAN; 3]), |(row, [x, y])| (Some(row), [x, y, 0.0]))
            }
            Flow::Sphere { bearings, flow } => {
                let eta = Vector3::from(bearings[k]);
                let eta = eta / eta.norm();
                let axes = tangents(&eta);
                (Row::whitened(&Rows::sphere(&eta), axes * Vector3::from(flow[k]), &covariance), eta.into())
            }
        }
    }
}

/// A displacement with a rotation taken out, whitened, and its place half way; `covariance` in squared units
/// of the flow.
pub(crate) fn turned_row(
    point: [f64; 2],
    flow: [f64; 2],
    covariance: &Matrix2<f64>,
    camera: Option<&Intrinsics>,
    turn: &Derotation,
) -> Option<(Row, [f64; 2])> {
    let to_plane = |at: [f64; 2]| camera.map_or(at, |camera| camera.to_plane(at));
    let turned = turn.out_of(to_plane(point), to_plane([point[0] + flow[0], point[1] + flow[1]]))?;
    let scale = turned.spread * camera.map_or_else(Matrix2::identity, Intrinsics::scale);
    let covariance = symmetric(scale * covariance * scale.transpose());
    Row::whitened(&turned.rows, turned.flow, &covariance).map(|row| (row, turned.middle))
}

/// A point of the picture, whitened, and its place on the plane at distance 1; `covariance` in squared units
/// of the flow.
pub(crate) fn plane_row(
    point: [f64; 2],
    flow: [f64; 2],
    covariance: &Matrix2<f64>,
    camera: Option<&Intrinsics>,
    placement: Placement,
) -> Option<(Row, [f64; 2])> {
    let half = if placement == Placement::Midpoint { 0.5 } else { 0.0 };
    let at = [point[0] + half * flow[0], point[1] + half * flow[1]];
    let scale = camera.map_or_else(Matrix2::identity, Intrinsics::scale);
    let at = camera.map_or(at, |camera| camera.to_plane(at));
    let covariance = symmetric(scale * covariance * scale.transpose());
    Row::whitened(&Rows::plane(at), scale * Vector2::from(flow), &covariance).map(|row| (row, at))
}

fn symmetric(matrix: Matrix2<f64>) -> Matrix2<f64> {
    0.5 * (matrix + matrix.transpose())
}

/// The share of a usual variance below which one is no measurement's.
pub(crate) const MIN_VARIANCE_RATIO: f64 = 1e-6;

/// The share of the points that are more precise than the usual one.
pub(crate) const PRECISE: f64 = 0.25;

/// Usual variances, and which ones are too small beside them.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct CovarianceFloor {
    usual: f64,
}

impl CovarianceFloor {
    /// From the covariances of all points; those that are not finite do not count.
    pub fn new(covariances: impl Iterator<Item = Matrix2<f64>>) -> Self {
        let mut least: Vec<f64> = covariances.map(|given| smallest(&given)).filter(|v| v.is_finite()).collect();
        Self { usual: quantile(&mut least, PRECISE).unwrap_or(0.0) }
    }

    /// The covariance that a point counts with.
    pub fn of(self, given: Matrix2<f64>) -> Matrix2<f64> {
        if smallest(&given) < MIN_VARIANCE_RATIO * self.usual {
            given + Matrix2::identity() * self.usual
        } else {
            given
        }
    }
}

/// The smaller eigenvalue.
pub(crate) fn smallest(given: &Matrix2<f64>) -> f64 {
    let (mean, half) = (0.5 * given.trace(), 0.5 * (given[(0, 0)] - given[(1, 1)]));
    // The determinant keeps digits that the difference would lose.
    given.determinant() / (mean + half.hypot(0.5 * (given[(0, 1)] + given[(1, 0)])))
}

/// The same for several numbers a point, each with a unit of its own: `size * size` values a matrix, row by
/// row.
pub(crate) fn floored_covariances(covariances: &[f64], size: usize) -> Vec<f64> {
    let diagonal = |i: usize| {
        let mut own: Vec<f64> = covariances.iter().skip(i * (size + 1)).step_by(size * size).copied().collect();
        own.retain(|value| value.is_finite());
        quantile(&mut own, PRECISE).unwrap_or(0.0)
    };
    let usual = DVector::from_fn(size, |i, _| diagonal(i));
    let one = |given: &[f64]| {
        let given = DMatrix::from_row_slice(size, size, given);
        let relative = DMatrix::from_fn(size, size, |i, j| given[(i, j)] / (usual[i] * usual[j]).sqrt());
        let finite = relative.iter().all(|value| value.is_finite());
        let small = finite && SymmetricEigen::new(relative).eigenvalues.min() < MIN_VARIANCE_RATIO;
        if small { given + DMatrix::from_diagonal(&usual) } else { given }
    };
    covariances.chunks_exact(size * size).flat_map(|given| one(given).as_slice().to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variance_of_nothing_is_not_believed_and_a_quarter_of_small_ones_is() {
        let usual = Matrix2::new(0.04, 0.01, 0.01, 0.09);
        let nothing = Matrix2::identity() * 1e-20;
        let floor = CovarianceFloor::new(std::iter::repeat_n(usual, 9).chain([nothing]));
        assert_eq!(floor.of(usual), usual);
        assert!((smallest(&floor.of(nothing)) / smallest(&usual) - 1.0).abs() < 1e-12);
        // An edge is known well across and not at all along.
        let edge = Matrix2::new(1e4, 0.0, 0.0, 0.01);
        assert_eq!(floor.of(edge), edge);
        let floor = CovarianceFloor::new(std::iter::repeat_n(usual, 6).chain(std::iter::repeat_n(nothing, 3)));
        assert_eq!(floor.of(nothing), nothing);
    }

    #[test]
    fn numbers_of_a_patch_are_judged_in_their_own_units() {
        let diagonal = |scale: f64| DMatrix::from_diagonal(&DVector::from_vec(vec![scale, 1e-8 * scale]));
        let all: Vec<f64> =
            (0..8).flat_map(|k| diagonal(if k == 3 { 1e-20 } else { 1.0 }).as_slice().to_vec()).collect();
        let believed = floored_covariances(&all, 2);
        assert_eq!(believed[..12], all[..12]);
        assert!((believed[12] - 1.0).abs() < 1e-12 && (believed[15] / 1e-8 - 1.0).abs() < 1e-12);
    }
}
