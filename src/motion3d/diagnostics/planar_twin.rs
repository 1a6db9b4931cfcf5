//! The second motion of a scene that is one plane.
//!
//! The flow of a plane `n . X = 1` under the motion `(u, w)` is that of `(n / |n|, w + n x u)` with the plane
//! `|n| u`, too (H. Longuet-Higgins 1984).
//!
//! Whether the points are a plane is tested on their flow, with the motion and the plane that suit each other
//! best: depths at an estimated motion depart from a plane's by what the motion is off. A curved surface must
//! not explain more than chance does either: the sum over all points is less sensitive.

use crate::math::random::CounterRng;
use crate::math::{RARE_STDS, by_chance, chi2_deviation};
use crate::motion3d::kernels::depths;
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{Observations, Row};
use crate::motion3d::model::result::Alternative;
use crate::motion3d::model::rows::tangents;
use crate::motion3d::model::whitening::Whitening;
use crate::motion3d::solver::finite_rotation::with_own_rotation;
use crate::motion3d::solver::starts::{SEARCHED, at_most};
use nalgebra::{Matrix3, RowVector3, SMatrix, SVector, Vector2, Vector3};

/// Unknowns of a plane's flow: motion and plane; and three more that bend the surface.
const PLANE: usize = 8;
const CURVED: usize = PLANE + 3;

/// Steps towards the plane and its motion.
const STEPS: usize = 4;

/// A plane `nu = n . eta` with its motion, of displacements in the axes half way.
struct Plane {
    n: Vector3<f64>,
    motion: Motion,
    /// Squares of what it leaves of the flow, and how much of that a curved surface explains; in squared
    /// units of noise.
    chi2: f64,
    bend: f64,
    /// Measurements less unknowns.
    free: f64,
}

/// Where a point is seen, in the axes half way, by the first view.
fn direction(points: &Observations, k: usize) -> Option<Vector3<f64>> {
    match &points.turn {
        Some(turn) => turn.first_end(points.site[k]),
        None if points.spherical => Some(points.position[k].into()),
        None => Some(Vector3::new(points.position[k][0], points.position[k][1], 1.0)),
    }
}

impl Plane {
    /// Least squares from a motion; `None` where the points do not determine a plane.
    ///
    /// Inverse depths in the rows are those at the second end, `n . eta / (1 + n . eta t_z)`.
    fn fit(points: &Observations, start: &Motion) -> Option<Self> {
        let counts = |k: &usize| points.row(*k).g.norm_squared() > 0.0;
        let seen = |k: usize| Some((points.row(k), direction(points, k)?));
        let used: Vec<(Row, Vector3<f64>)> = (0..points.n).filter(counts).map(seen).collect::<Option<_>>()?;
        let ahead = points.turn.map_or(RowVector3::zeros(), |turn| turn.mean.row(2).into_owned());
        let middle: Vector3<f64> = used.iter().map(|(_, eta)| eta).sum();
        let across = tangents(&middle.normalize());
        let (mut motion, mut n) = (*start, Vector3::zeros());
        let mut found = None;
        for round in 0..=STEPS {
            let (u, w) = (motion.u(), motion.w());
            let tangent = tangents(&u);
            let (depth_ahead, by_direction) = ((ahead * u)[0], ahead * tangent.transpose());
            let mut normal = SMatrix::<f64, CURVED, CURVED>::zeros();
            let (mut right, mut square) = (SVector::<f64, CURVED>::zeros(), 0.0);
            for (Row { g, r, f }, eta) in &used {
                let nearer = 1.0 / (1.0 + n.dot(eta) * depth_ahead);
                let (nu, t) = (n.dot(eta) * nearer, g * u);
                let p = across * eta;
                let mut slopes = SMatrix::<f64, 2, CURVED>::zeros();
                slopes
                    .fixed_columns_mut::<2>(0)
                    .copy_from(&(g * tangent.transpose() * nu - t * by_direction * (nu * nu)));
                slopes.fixed_columns_mut::<3>(2).copy_from(r);
                let along = t * (nearer * nearer);
                slopes.fixed_columns_mut::<3>(5).copy_from(&(along * eta.transpose()));
                slopes
                    .fixed_columns_mut::<3>(PLANE)
                    .copy_from(&(along * RowVector3::new(p.x * p.x, p.x * p.y, p.y * p.y)));
                let rest: Vector2<f64> = f - t * nu - r * w;
                normal += slopes.tr_mul(&slopes);
                right += slopes.tr_mul(&rest);
                square += rest.norm_squared();
            }
            if round == 0 {
                // Of no depths the direction says nothing.
                n = normal.fixed_view::<3, 3>(5, 5).into_owned().cholesky()?.solve(&right.fixed_rows::<3>(5));
                continue;
            }
            let own: SVector<f64, PLANE> = right.fixed_rows::<PLANE>(0).into_owned();
            let step = normal.fixed_view::<PLANE, PLANE>(0, 0).into_owned().cholesky()?.solve(&own);
            // Without a solution nothing is known of the bending.
            let explained = normal.cholesky().map_or(0.0, |factor| right.dot(&factor.solve(&right)));
            let gained = own.dot(&step);
            motion = motion.stepped(&tangent, &step.fixed_rows::<5>(0).into_owned());
            n += step.fixed_rows::<3>(5);
            let free = 2.0 * used.len() as f64 - PLANE as f64;
            found = Some(Self { n, motion, chi2: square - gained, bend: explained - gained, free });
        }
        found.filter(|found| found.chi2.is_finite() && found.free > 0.0)
    }

    /// Whether it leaves no more than noise.
    fn fits(&self, points: &Observations, unknown: bool) -> bool {
        // The ratio of two independent variances, one of twice as many numbers as the other, deviates by so
        // much more than one alone.
        let usual = if unknown { 3.0f64.sqrt() } else { 1.0 };
        let deviation = chi2_deviation(self.chi2, self.free / points.points_per_independent_sample);
        deviation < usual * RARE_STDS && by_chance(self.bend, (CURVED - PLANE) as f64)
    }

    /// The other motion, and the points with its own rotation taken out of displacements.
    fn other(&self, whitening: &Whitening<'_>, points: &Observations) -> Option<(Motion, Observations)> {
        // In the axes half way the translation is V' u and rotations are V' w; the plane is that of the
        // points half way.
        let mean = points.turn.map_or(Matrix3::identity(), |turn| turn.mean);
        let (back, t) = (mean.try_inverse()?, mean * self.motion.u());
        let n = if points.turn.is_some() { self.n / (1.0 + 0.5 * self.n.dot(&t)) } else { self.n };
        let other = Motion::of(&(back * n).normalize(), &(self.motion.w() + back * n.cross(&t)));
        let mut seen = points.clone();
        let found = with_own_rotation(whitening, &mut seen, other).motion;
        Some((found, seen))
    }
}

/// The other motion of a plane where the flow is that of one within its noise, with the squared depths behind
/// the camera, in units of their standard deviation, that it has, and how far it is from a known rotation;
/// `None` of another scene, or where both motions are the same.
///
/// `distinct`: least angle between both directions, rad, that is no mere error of the estimate; `unknown`:
/// the noise is what the motion leaves.
pub(crate) fn planar_twin(
    whitening: &Whitening<'_>,
    points: &Observations,
    motion: &Motion,
    distinct: f64,
    unknown: bool,
) -> Option<Alternative> {
    // What is far from a plane is so for few points already.
    if points.n > SEARCHED {
        let few = at_most(points, SEARCHED, CounterRng::new(0));
        Plane::fit(&few, motion).filter(|plane| plane.fits(&few, unknown))?;
    }
    let plane = Plane::fit(points, motion).filter(|plane| plane.fits(points, unknown) && plane.n.norm() > 0.0)?;
    let (other, seen) = plane.other(whitening, points)?;
    let behind = |motion: Motion| {
        let at = depths(&seen, &motion);
        let behind: f64 = (0..seen.n).map(|k| at.nu[k].min(0.0).powi(2) * at.s2[k]).sum();
        Alternative { motion, excess: behind + seen.pulled(&motion.w()) }
    };
    let angle = other.u().cross(&motion.u()).norm().atan2(other.u().dot(&motion.u()).abs());
    let [own, opposite] = [other, other.reversed()].map(behind);
    (angle > distinct).then_some(if opposite.excess < own.excess { opposite } else { own })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion3d::model::input::{Flow, Noise, Placement};
    use crate::motion3d::tests::scenes::{Scene, W};

    fn along(x: f64, y: f64) -> f64 {
        0.9 + 0.3 * x - 0.2 * y
    }

    #[test]
    fn eight_numbers_are_the_flow_of_a_plane_and_not_of_a_bend() {
        let motion = Motion::new([0.6, 0.2, 0.75], W);
        for bend in [0.0, 0.1] {
            let scene = Scene::new(motion, 400, 0.6, 1e-3, 3, |x, y, _| along(x, y) + bend * x * x);
            let fit = Plane::fit(&scene.observations(), &motion).unwrap();
            assert_eq!(fit.free, 792.0);
            assert_eq!(by_chance(fit.bend, 3.0), bend == 0.0, "{bend}: {}", fit.bend);
        }
    }

    /// Without noise, over a whole frame, whichever rotation was taken out.
    #[test]
    fn the_flow_of_a_plane_is_its_displacement() {
        let motion = Motion::new([0.6, 0.2, 0.75], [0.1, -0.05, 0.2]);
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
        let derotated = whitening.derotated(&whitening.whitened(), motion.derotation());
        let near = Motion::new([0.65, 0.2, 0.7], [0.1, -0.05, 0.2]);
        for start in [motion, near] {
            let fit = Plane::fit(&derotated, &start).unwrap();
            assert!(fit.chi2 < 1e-6 && fit.free == 192.0, "{}", fit.chi2);
        }
        // Both motions explain it exactly.
        let (other, seen) = Plane::fit(&derotated, &motion).unwrap().other(&whitening, &derotated).unwrap();
        let left: f64 = depths(&seen, &other).e.iter().map(|e| e * e).sum();
        assert!(left < 1e-12 && other.angle_to(&motion) > 0.1, "{left}");
    }
}
