//! The flow of one plane under any motion, and the second motion that explains it.
//!
//! Points of a plane `nu = n . eta` have the flow `f = G A eta`, `A = u n^t + [w]x` up to a multiple of the
//! unit matrix: eight numbers (H. Longuet-Higgins 1984). Over a whole frame it is `G A eta / (1 + a_3 .
//! eta)`, with the last row `a_3` of `V' A`: a homography. The test uses the flow itself, as depths depart
//! from a plane's by the error of the motion, too.

use crate::math::{RARE_STDS, by_chance, chi2_deviation, random::CounterRng};
use crate::motion3d::kernels::{Depths, depths};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::Observations;
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::MidpointDepth;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::covariance::DETERMINED;
use crate::motion3d::solver::finite_rotation::{ROUNDS, with_own_rotation};
use crate::motion3d::solver::starts::{SEARCHED, at_most};
use nalgebra::{Const, Matrix3, RowVector3, SMatrix, SVector, SymmetricEigen, Vector2, Vector3};

type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

/// The likeliest flow of a plane.
pub(crate) struct PlaneFlow {
    a: Matrix3<f64>,
    /// `a_3 = last A`; 0 for instantaneous flow.
    last: RowVector3<f64>,
    /// The rotation that was taken out.
    taken: Vector3<f64>,
    /// Squares of what it leaves of every point's flow, in units of noise.
    pub chi2: f64,
    /// Measurements less the numbers that they determine.
    pub free: f64,
}

impl PlaneFlow {
    /// `None` of fewer points than four, or where no plane has such a flow.
    pub fn fit(points: &Observations) -> Option<Self> {
        let (last, taken) =
            points.turn.map_or_else(Default::default, |turn| (turn.mean.row(2).into_owned(), turn.rotation));
        let (count, mut rank) = (points.n - points.unseen(), 0);
        let mut out = Self { a: Matrix3::zeros(), last, taken, chi2: 0.0, free: 0.0 };
        // Instantaneous flow is linear in the numbers.
        for _ in 0..if points.turn.is_some() { ROUNDS } else { 1 } {
            rank = out.step(points);
        }
        out.chi2 = (0..points.n).map(|k| out.rest(points, k).0.norm_squared()).sum();
        out.free = (2 * count) as f64 - rank as f64;
        (count >= 4 && out.chi2.is_finite() && out.free > 0.0).then_some(out)
    }

    /// What is left of the flow of a point, and the slopes of the plane's by the numbers of `A`.
    fn rest(&self, points: &Observations, k: usize) -> (Vector2<f64>, SMatrix<f64, 2, 9>) {
        let (row, eta) = (points.row(k), Vector3::from(points.eta[k]));
        let moved = self.a * eta;
        let nearer = 1.0 / (1.0 + (self.last * moved).x);
        let flow = row.g * moved * nearer;
        let g = (row.g - flow * self.last) * nearer;
        (row.f - row.r * self.taken - flow, SMatrix::from_fn(|i, j| g[(i, j / 3)] * eta[j % 3]))
    }

    /// One step of least squares; returns how many numbers the points determine.
    fn step(&mut self, points: &Observations) -> usize {
        let mut normal = Matrix9::zeros();
        let mut right = Vector9::zeros();
        for k in 0..points.n {
            let (rest, slopes) = self.rest(points, k);
            normal += slopes.transpose() * slopes;
            right += slopes.transpose() * rest;
        }
        let (change, rank) = solution(&normal, &right);
        self.a += Matrix3::from_row_slice(change.as_slice());
        rank
    }

    /// Whether a curved surface explains what is left along the epipolar lines by more than chance and the
    /// error of the motion would have it: the sum over all points is less sensitive.
    fn is_bent(&self, points: &Observations, motion: &Motion) -> bool {
        let (mut normal, mut right) = (Matrix9::zeros(), Vector9::zeros());
        for k in 0..points.n {
            let ([x, y, z], t) = (points.eta[k], points.row(k).g * motion.u());
            let s = t.norm().max(f64::MIN_POSITIVE);
            let terms = Vector9::from([x, y, z, x * x, x * y, y * y, x * z, y * z, z * z]) * s;
            normal += terms * terms.transpose();
            right += terms * (self.rest(points, k).0.dot(&t) / s);
        }
        // On the plane at distance 1 three of the terms are others.
        let (bend, rank) = solution(&normal, &right);
        rank > 3 && !by_chance(right.dot(&bend), (rank - 3 + 5) as f64)
    }
}

/// The shortest solution of least squares in units of each unknown's own information, and how many numbers
/// are determined: fewer than all by points on a line or at few places.
fn solution(normal: &Matrix9, right: &Vector9) -> (Vector9, usize) {
    let scale = normal.diagonal().map(|own| if own > 0.0 { 1.0 / own.sqrt() } else { 0.0 });
    let scaled = Matrix9::from_fn(|i, j| normal[(i, j)] * scale[i] * scale[j]);
    let eigen = SymmetricEigen::<f64, Const<9>>::new(scaled);
    let (mut out, mut rank) = (Vector9::zeros(), 0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > DETERMINED {
            out += vector * (vector.dot(&right.component_mul(&scale)) / value);
            rank += 1;
        }
    }
    (out.component_mul(&scale), rank)
}

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
    if observations.n > SEARCHED {
        PlaneFlow::fit(&at_most(observations, SEARCHED, CounterRng::new(0))).filter(fits)?;
    }
    PlaneFlow::fit(observations).filter(fits).filter(|plane| !plane.is_bent(observations, motion))?;
    let (u, Depths { nu, s2, .. }) = (motion.u(), depths(observations, motion));
    let at_first = observations.turn.map_or_else(MidpointDepth::default, |turn| turn.first_end(&u));
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for k in (0..observations.n).filter(|&k| s2[k] > 0.0) {
        let eta = Vector3::from(observations.eta[k]);
        normal += s2[k] * eta * eta.transpose();
        right += s2[k] * at_first.depth(nu[k]) * eta;
    }
    let n = Some(normal.cholesky()?.solve(&right)).filter(|n| n.norm() > 0.0)?;
    // What the estimate is off by is in the plane, too.
    let mut seen = observations.clone();
    let other = Motion::of(&n.normalize(), &(motion.w() + n.cross(&u)));
    let other = with_own_rotation(whitening, &mut seen, other).motion;
    let behind = |motion: Motion| {
        let at = depths(&seen, &motion);
        let behind: f64 = (0..seen.n).map(|k| at.nu[k].min(0.0).powi(2) * at.s2[k]).sum();
        Alternative { motion, excess: behind + seen.pulled(&motion.w()) }
    };
    let angle = other.u().cross(&u).norm().atan2(other.u().dot(&u).abs());
    let [own, opposite] = [other, other.reversed()].map(behind);
    (angle > distinct).then_some(if opposite.excess < own.excess { opposite } else { own })
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
