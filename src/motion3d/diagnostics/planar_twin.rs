//! The flow of one plane under any motion, and the second motion that explains it.
//!
//! Points of a plane `nu = n . eta` have the flow `f = G A eta`, `A = u n^t + [w]x` up to a multiple of the
//! unit matrix: eight numbers (H. Longuet-Higgins 1984). Over a whole frame it is `G A eta / (1 + a_3 .
//! eta)`, with the last row `a_3` of `A`: a homography. The test uses the flow itself, as depths depart from
//! a plane's by the error of the motion, too.

use crate::math::random::CounterRng;
use crate::math::{RARE_STDS, by_chance, chi2_deviation};
use crate::motion3d::kernels::{Depths, depths};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, Row};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::Rows;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::DETERMINED;
use crate::motion3d::solver::refine::{StoppingCriteria, refine};
use crate::motion3d::solver::starts::at_most;
use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, SymmetricEigen, Vector2, Vector3};
use std::borrow::Cow;

/// Numbers of a plane's flow.
const NUMBERS: usize = 8;

/// Steps towards a homography; the flow of a plane is linear in its numbers.
const STEPS: usize = 5;

/// The likeliest flow of a plane.
pub(crate) struct PlaneFlow {
    /// What it leaves of every point's flow, in units of noise.
    pub rest: Vec<Vector2<f64>>,
    /// Its square.
    pub chi2: f64,
    /// Measurements less the numbers that they determine.
    pub free: f64,
}

/// A point as a plane's flow has it.
struct Point {
    g: SMatrix<f64, 2, 3>,
    eta: Vector3<f64>,
    flow: Vector2<f64>,
}

impl Point {
    /// Without the rotation that was taken out, between both ends where there are two.
    fn new(points: &Observations, k: usize, back: Option<&Matrix3<f64>>) -> Option<Self> {
        let (row, [x, y, z]): (Row, _) = (points.row(k), points.position[k]);
        if points.spherical {
            return Some(Self { g: row.g, eta: Vector3::new(x, y, z), flow: row.f });
        }
        let (Some(back), Some(turn)) = (back, &points.turn) else {
            return Some(Self { g: row.g, eta: Vector3::new(x, y, 1.0), flow: row.f });
        };
        let (g, flow) = (row.g * back, row.f - row.r * turn.rotation);
        // The first columns of G are the unit matrix: what is left of them is the whitening.
        let left = g.fixed_columns::<2>(0).try_inverse()? * flow;
        Some(Self { g, eta: Vector3::new(x - 0.5 * left.x, y - 0.5 * left.y, 1.0), flow })
    }

    /// What the flow of the plane `a` is here, and its slopes by the eight numbers.
    fn flow_of(&self, a: &Matrix3<f64>, ends: bool) -> (Vector2<f64>, SMatrix<f64, 2, NUMBERS>) {
        let nearer = if ends { 1.0 / (1.0 + (a.row(2) * self.eta).x) } else { 1.0 };
        let flow = self.g * (a * self.eta) * nearer;
        let g = if ends { (self.g - flow * RowVector3::new(0.0, 0.0, 1.0)) * nearer } else { self.g };
        (flow, SMatrix::from_fn(|i, j| g[(i, j / 3)] * self.eta[j % 3]))
    }
}

impl PlaneFlow {
    /// `None` of fewer points than four, or where no plane has such a flow.
    pub fn fit(points: &Observations) -> Option<Self> {
        let back = match &points.turn {
            Some(turn) => Some(turn.mean.try_inverse()?),
            None => None,
        };
        let ends = points.turn.is_some();
        let counts = |k: &usize| points.row(*k).g.norm_squared() > 0.0;
        let used: Option<Vec<Point>> =
            (0..points.n).filter(counts).map(|k| Point::new(points, k, back.as_ref())).collect();
        let used = used?;
        if 2 * used.len() < NUMBERS {
            return None;
        }
        let (mut a, mut rank) = (Matrix3::zeros(), 0);
        for _ in 0..if ends { STEPS } else { 1 } {
            let (change, determined) = step(&used, &a, ends);
            a += change;
            rank = determined;
        }
        let mut rest = vec![Vector2::zeros(); points.n];
        for (k, point) in (0..points.n).filter(counts).zip(&used) {
            rest[k] = point.flow - point.flow_of(&a, ends).0;
        }
        let chi2: f64 = rest.iter().map(Vector2::norm_squared).sum();
        let free = (2 * used.len() - rank) as f64;
        (chi2.is_finite() && free > 0.0).then_some(Self { rest, chi2, free })
    }
}

/// One step of least squares, and how many numbers the points determine.
fn step(points: &[Point], a: &Matrix3<f64>, ends: bool) -> (Matrix3<f64>, usize) {
    let mut normal = SMatrix::<f64, NUMBERS, NUMBERS>::zeros();
    let mut right = SVector::<f64, NUMBERS>::zeros();
    for point in points {
        let (flow, slopes) = point.flow_of(a, ends);
        normal += slopes.transpose() * slopes;
        right += slopes.transpose() * (point.flow - flow);
    }
    // In units of each number's own information; points on a line or at few places do not determine all.
    let scale = normal.diagonal().map(|own| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 });
    let scaled = SMatrix::<f64, NUMBERS, NUMBERS>::from_fn(|i, j| normal[(i, j)] * scale[i] * scale[j]);
    let eigen = SymmetricEigen::<f64, nalgebra::Const<NUMBERS>>::new(scaled);
    let (mut change, mut rank) = (SVector::<f64, NUMBERS>::zeros(), 0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > DETERMINED {
            change += vector * (vector.dot(&right.component_mul(&scale)) / value);
            rank += 1;
        }
    }
    let change = change.component_mul(&scale);
    (Matrix3::from_fn(|i, j| if i == 2 && j == 2 { 0.0 } else { change[3 * i + j] }), rank)
}

/// Times that a plane's other rotation is taken out of displacements.
pub(crate) const TURNS: usize = 5;

/// Points that are tested first for a plane.
pub(crate) const FEW: usize = 1000;

/// The other motion `(n / |n|, w + n x u)` of a scene that is one plane `nu = n . eta`, with the squared
/// depths behind the camera, in units of their standard deviation, that it has, and how far it is from a
/// known rotation; `None` where the flow is not that of a plane within its noise, or where both motions are
/// the same.
///
/// `distinct`: least angle between both directions, rad, that is no mere error of the estimate; `unknown`:
/// the noise is what the motion leaves.
pub(crate) fn planar_twin(
    whitening: &Whitening<'_>,
    observations: &Observations,
    motion: &Motion,
    distinct: f64,
    unknown: bool,
) -> Option<Alternative> {
    // The ratio of two independent variances, one of twice as many numbers as the other, deviates by so much
    // more than one alone.
    let usual = if unknown { 3.0f64.sqrt() } else { 1.0 };
    let fits = |plane: &PlaneFlow| {
        chi2_deviation(plane.chi2, plane.free / observations.points_per_independent_sample) < usual * RARE_STDS
    };
    // What is far from a plane is so for few points already.
    if observations.n > FEW {
        PlaneFlow::fit(&at_most(observations, FEW, CounterRng::new(0))).filter(fits)?;
    }
    let plane = PlaneFlow::fit(observations).filter(fits)?;
    let Depths { mut nu, s2, .. } = depths(observations, motion);
    if let Some(turn) = &observations.turn {
        let middle = turn.middle(&motion.u());
        for nu in &mut nu {
            *nu = middle.depth(*nu);
        }
    }
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for k in (0..observations.n).filter(|&k| s2[k] > 0.0) {
        let eta = place(observations, motion, k, nu[k]);
        normal += s2[k] * eta * eta.transpose();
        right += s2[k] * nu[k] * eta;
    }
    let n = normal.cholesky()?.solve(&right);
    let u = motion.u();
    // What a plane leaves of each depth.
    let rest = |k: usize| (observations.row(k).g * u).dot(&plane.rest[k]) / s2[k];
    if n.norm() <= 0.0 || bent(observations, &s2, rest) {
        return None;
    }
    let (other, seen) = other_motion(whitening, observations, motion, &n)?;
    let behind = |motion: Motion| {
        let at = depths(&seen, &motion);
        let behind: f64 = (0..seen.n).map(|k| at.nu[k].min(0.0).powi(2) * at.s2[k]).sum();
        Alternative { motion, excess: behind + seen.pulled(&motion.w()) }
    };
    let angle = other.u().cross(&u).norm().atan2(other.u().dot(&u).abs());
    let [own, opposite] = [other, other.reversed()].map(behind);
    (angle > distinct).then_some(if opposite.excess < own.excess { opposite } else { own })
}

/// A point's `eta`, where `nu = n . eta` holds for a plane. Half way along a displacement it is the picture
/// of the point half way, which a displacement that changes the depth has at `m + nu^2 t_z / 4 G(m) t`.
pub(crate) fn place(observations: &Observations, motion: &Motion, k: usize, nu: f64) -> Vector3<f64> {
    let [x, y, z] = observations.position[k];
    if observations.spherical {
        return Vector3::new(x, y, z);
    }
    let Some(turn) = observations.turn else { return Vector3::new(x, y, 1.0) };
    let t = turn.mean * motion.u();
    let along = Rows::plane([x, y]).g * t * (0.25 * nu * nu * t.z);
    Vector3::new(x + along.x, y + along.y, 1.0)
}

/// The other motion of a plane, and the points as it sees them: displacements with its own rotation taken
/// out, where another one was.
pub(crate) fn other_motion<'a>(
    whitening: &Whitening<'_>,
    observations: &'a Observations,
    motion: &Motion,
    n: &Vector3<f64>,
) -> Option<(Motion, Cow<'a, Observations>)> {
    let Some(turn) = observations.turn else {
        let other = Motion::of(&n.normalize(), &(motion.w() + n.cross(&motion.u())));
        // What the estimate is off by is in the plane, too.
        let other = refine(observations, other, StoppingCriteria::FULL).motion;
        return Some((other, Cow::Borrowed(observations)));
    };
    // In the axes half way the translation is V' u and rotations are V' w.
    let back = turn.mean.try_inverse()?;
    let w = motion.w() + back * n.cross(&(turn.mean * motion.u()));
    let mut other = Motion::of(&(back * n).normalize(), &w);
    let mut seen = observations.clone();
    for _ in 0..TURNS {
        seen = whitening.derotated(&seen, other.derotation());
        other = refine(&seen, other, StoppingCriteria::FULL).motion;
    }
    Some((other, Cow::Owned(seen)))
}

/// Whether a curved surface explains the depths better than a plane by more than chance and the error of the
/// motion would have it: the sum over all depths is less sensitive.
///
/// `rest`: what a plane leaves of each depth.
pub(crate) fn bent(observations: &Observations, s2: &[f64], rest: impl Fn(usize) -> f64) -> bool {
    const TERMS: usize = 9;
    let terms = if observations.spherical { TERMS } else { 6 };
    let mut sums = nalgebra::SMatrix::<f64, TERMS, { TERMS + 1 }>::zeros();
    for k in (0..observations.n).filter(|&k| s2[k] > 0.0) {
        let [x, y, z] = observations.position[k];
        let height = if observations.spherical { z } else { 1.0 };
        let row = [height, x, y, x * x, x * y, y * y, x * z, y * z, z * z, rest(k)];
        for i in 0..terms {
            for j in (i..terms).chain([TERMS]) {
                sums[(i, j)] += s2[k] * row[i] * row[j];
            }
        }
    }
    let normal = nalgebra::DMatrix::from_fn(terms, terms, |i, j| sums[(i.min(j), i.max(j))]);
    let right = nalgebra::DVector::from_fn(terms, |i, _| sums[(i, TERMS)]);
    // Without a solution (points on a line) nothing is known of the bending.
    let Some(factor) = normal.cholesky() else { return false };
    let explained = right.dot(&factor.solve(&right));
    !by_chance(explained, (terms - 3 + 5) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::model::input::{Flow, Noise, Placement};
    use crate::motion3d::model::motion::Motion;
    use crate::motion3d::model::rows::Derotation;
    use crate::motion3d::model::whitening::Whitening;
    use crate::motion3d::tests::scenes::{Scene, W};

    const SLANT: [f64; 3] = [0.9, 0.3, -0.2];

    fn along(x: f64, y: f64) -> f64 {
        SLANT[0] + SLANT[1] * x + SLANT[2] * y
    }

    #[test]
    fn eight_numbers_are_the_flow_of_a_plane_and_not_of_a_bend() {
        let motion = Motion::new([0.6, 0.2, 0.75], W);
        for bend in [0.0, 0.1] {
            let scene = Scene::new(motion, 400, 0.6, 1e-3, 3, |x, y, _| along(x, y) + bend * x * x);
            let fit = PlaneFlow::fit(&scene.observations()).unwrap();
            assert_eq!(fit.free, 792.0);
            assert_eq!((0.85..1.15).contains(&(fit.chi2 / fit.free)), bend == 0.0, "{bend}: {}", fit.chi2);
        }
    }

    /// Without noise, over a whole frame, whichever rotation was taken out.
    #[test]
    fn a_homography_is_the_displacement_of_a_plane() {
        let motion = Motion::new([0.6, 0.2, 0.75], [0.1, -0.05, 0.2]);
        let turn = Derotation::new(&motion.w());
        let points: Vec<[f64; 2]> =
            (0..100).map(|k| [f64::from(k % 10) * 0.1 - 0.45, f64::from(k / 10) * 0.1 - 0.45]).collect();
        let seen = |&[x, y]: &[f64; 2]| {
            let before = Vector3::new(x, y, 1.0) / (0.1 * along(x, y));
            let after = nalgebra::Rotation3::new(motion.w()) * before + Vector3::from(motion.displacement());
            [after.x / after.z - x, after.y / after.z - y]
        };
        let flow: Vec<[f64; 2]> = points.iter().map(seen).collect();
        let flow = Flow::Plane { points: &points, flow: &flow, camera: None };
        let whitening = Whitening::new(&flow, &Noise::StandardDeviation(1e-3), Placement::Midpoint);
        let start = whitening.whitened();
        for taken in [turn, motion.derotation(), Derotation::new(&Vector3::new(0.0, 0.1, -0.1))] {
            let fit = PlaneFlow::fit(&whitening.derotated(&start, taken)).unwrap();
            assert!(fit.chi2 < 1e-12 && fit.free == 192.0, "{}", fit.chi2);
        }
    }

    /// On a line fewer numbers than eight are determined, and what is left has so many more freedoms.
    #[test]
    fn points_on_a_line_determine_fewer_numbers() {
        let motion = Motion::new([0.6, 0.2, 0.75], W);
        let mut scene = Scene::new(motion, 50, 0.6, 1e-3, 3, |x, y, _| along(x, y));
        scene.points.iter_mut().for_each(|point| point[1] = 0.0);
        scene.flow = scene.points.iter().map(|&point| motion.plane_flow(point, along(point[0], 0.0))).collect();
        let fit = PlaneFlow::fit(&scene.observations()).unwrap();
        assert!(fit.free > 92.0 && fit.chi2 < 1e-6, "{} {}", fit.free, fit.chi2);
    }
}
