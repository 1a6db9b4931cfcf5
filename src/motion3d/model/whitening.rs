//! From what is given to whitened points.

use super::camera::Intrinsics;
use super::covariance_floor::Belief;
use super::derotation::HalfTurn;
use super::motion::{Rows, tangents};
use super::observations::{Observations, Row};
use super::options::{Flow, Noise, Placement};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rayon::prelude::*;

/// Fewest points that a task whitens.
const TOGETHER: usize = 1024;

/// What was given, to be whitened as often as another rotation is taken out of its displacements.
#[derive(Clone, Copy)]
pub(crate) struct Intake<'a> {
    pub flow: &'a Flow<'a>,
    pub noise: &'a Noise<'a>,
    pub placement: Placement,
    /// Which covariances are.
    belief: Belief,
}

impl<'a> Intake<'a> {
    pub fn new(flow: &'a Flow<'a>, noise: &'a Noise<'a>, placement: Placement) -> Self {
        let mut intake = Self { flow, noise, placement, belief: Belief::default() };
        if matches!(noise, Noise::Covariances(_)) {
            intake.belief = Belief::new((0..flow.len()).map(|k| intake.told(k)));
        }
        intake
    }
}

impl Intake<'_> {
    /// The covariance of a point's flow as it was given, in screen axes, in squared units of the flow.
    fn told(&self, k: usize) -> Matrix2<f64> {
        match (self.flow, self.noise) {
            (Flow::Plane { .. }, Noise::Covariances(c)) => symmetric(Matrix2::from_row_slice(&c[4 * k..4 * k + 4])),
            (Flow::Sphere { bearings, .. }, Noise::Covariances(c)) => {
                let axes = tangents(&Vector3::from(bearings[k]).normalize());
                symmetric(axes * Matrix3::from_row_slice(&c[9 * k..9 * k + 9]) * axes.transpose())
            }
            (_, Noise::Sigma(sigma)) => Matrix2::identity() * (sigma * sigma),
            (_, Noise::Unknown) => Matrix2::identity(),
        }
    }

    /// The usable points in the order given; rows that are not finite or whose covariance is no covariance
    /// are left out. Unknown noise is taken to be 1 of the flow's unit.
    pub fn whitened(&self) -> Observations {
        let sources: Vec<u32> = (0..self.flow.len() as u32).collect();
        let rows = self.rows(&sources);
        let usable = |(row, at): &(Option<Row>, [f64; 3])| row.is_some() && at.iter().all(|value| value.is_finite());
        let kept = || rows.iter().zip(&sources).filter(|(row, _)| usable(row));
        let whitened: Vec<Row> = kept().filter_map(|((row, _), _)| *row).collect();
        let position = kept().map(|((_, at), _)| *at).collect();
        let source = kept().map(|(_, source)| *source).collect();
        let mut out = Observations::new(&whitened, position, matches!(self.flow, Flow::Sphere { .. }), source);
        out.displaced = self.displaced();
        out.site = self.sites(&out);
        out
    }

    /// Where points were given: bearings, or places on the plane at distance 1.
    fn sites(&self, points: &Observations) -> Vec<[f64; 3]> {
        let Flow::Plane { points: given, camera, .. } = self.flow else { return points.position.clone() };
        let place = |&k: &u32| {
            let at = given[k as usize];
            let [x, y] = camera.map_or(at, |camera| camera.to_plane(at));
            [x, y, 0.0]
        };
        points.source.iter().map(place).collect()
    }

    /// Whether flow is a displacement from a place that is given.
    pub fn displaced(&self) -> bool {
        self.placement == Placement::Midpoint && matches!(self.flow, Flow::Plane { .. })
    }

    /// The same points in the same units, with the rotation of a motion taken out of their displacements; a
    /// point that this leads behind the camera gets weight 0.
    pub fn turned(&self, points: &Observations, turn: HalfTurn) -> Observations {
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

    /// Whitened points with their places; without a row where they are not usable.
    fn rows(&self, sources: &[u32]) -> Vec<(Option<Row>, [f64; 3])> {
        sources.par_iter().with_min_len(TOGETHER).map(|&k| self.row(k as usize, None)).collect()
    }

    fn row(&self, k: usize, turn: Option<&HalfTurn>) -> (Option<Row>, [f64; 3]) {
        let covariance = self.belief.of(self.told(k));
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
    turn: &HalfTurn,
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
