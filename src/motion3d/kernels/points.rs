//! Single passes over the points: the best rotation for a direction, depths, the truncated cost.

use super::{Everywhere, Planes, over_chunks, see, total};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{CHUNK, Observations};
use crate::motion3d::model::rows::Vector5;
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::{Matrix2x3, Matrix3, Vector3};
use rayon::prelude::*;

/// The 3 x 3 normal equations of `w` for a fixed direction.
struct RotationSums<'a> {
    planes: Planes<'a>,
    direction: &'a Vector3<f64>,
    floor: f64,
}

impl Kernel<f64> for RotationSums<'_> {
    type Output = [f64; 10];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; 10] {
        let motion = Everywhere::<V>::new(&Motion::of(self.direction, &Vector3::zeros()));
        let floor = V::splat(self.floor);
        let mut sums = [V::zero(); 10];
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let c = seen.across;
            let row = [seen.q[0], seen.q[1], seen.q[2], c];
            let mut k = 0;
            for a in 0..4 {
                let weighted = row[a] * seen.inverse;
                for b in a..4 {
                    sums[k] = weighted.mul_add(row[b], sums[k]);
                    k += 1;
                }
            }
        }
        sums.map(total)
    }
}

/// The best rotation for the translation `direction` and its `J`; `None` where the points do not determine
/// it.
pub(crate) fn best_rotation(observations: &Observations, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
    let sums = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, RotationSums { planes, direction, floor: observations.floor })
    });
    let [xx, xy, xz, xc, yy, yz, yc, zz, zc, mut cc] = sums;
    let mut normal = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let mut right = Vector3::new(xc, yc, zc);
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&Vector3::zeros());
        normal += known.information;
        right += pull;
        cc += square;
    }
    let w = normal.cholesky()?.solve(&right);
    let cost = (cc - right.dot(&w)).max(0.0);
    (w.iter().all(|value| value.is_finite()) && cost.is_finite()).then_some((w, cost))
}

/// Depths of the points at a motion; as long as the planes, zeros at the end included.
#[derive(Debug, Clone, Default)]
pub(crate) struct Depths {
    /// `nu^ = m / s`, 0 at the epipole.
    pub nu: Vec<f64>,
    /// `s^2`, the inverse variance of `nu^`; 0 at the epipole.
    pub s2: Vec<f64>,
    /// `e`, in units of noise.
    pub e: Vec<f64>,
}

struct DepthPlanes<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    floor: f64,
    out: [&'a mut [f64]; 3],
}

impl Kernel<f64> for DepthPlanes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let motion = Everywhere::<V>::new(self.motion);
        let floor = V::splat(self.floor);
        let [nu, s2, e] = self.out;
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            (seen.along * seen.inverse).store(&mut nu[i..]);
            (seen.s2 * seen.s2 * seen.inverse).store(&mut s2[i..]);
            (seen.across * seen.inverse.sqrt()).store(&mut e[i..]);
        }
    }
}

/// Depths and residuals of all points at a motion.
pub(crate) fn depths(observations: &Observations, motion: &Motion) -> Depths {
    let stride = observations.stride;
    let mut out = Depths { nu: vec![0.0; stride], s2: vec![0.0; stride], e: vec![0.0; stride] };
    let work = |chunk: usize, out: [&mut [f64]; 3]| {
        let planes = observations.slices(&(chunk * CHUNK..chunk * CHUNK + out[0].len()));
        dispatch(observations.level, DepthPlanes { planes, motion, floor: observations.floor, out });
    };
    if stride <= CHUNK {
        work(0, [&mut out.nu, &mut out.s2, &mut out.e]);
    } else {
        let planes = out.nu.par_chunks_mut(CHUNK).zip(out.s2.par_chunks_mut(CHUNK));
        let planes = planes.zip(out.e.par_chunks_mut(CHUNK)).enumerate();
        planes.for_each(|(chunk, ((nu, s2), e))| work(chunk, [nu, s2, e]));
    }
    out
}

/// The truncated cost of a motion.
struct ConsensusSum<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    floor: f64,
    cut2: f64,
}

impl Kernel<f64> for ConsensusSum<'_> {
    type Output = [f64; 1];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; 1] {
        let motion = Everywhere::<V>::new(self.motion);
        let (floor, cut2) = (V::splat(self.floor), V::splat(self.cut2));
        let half = V::splat(0.5 * self.cut2);
        let mut sum = V::zero();
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let behind = seen.along.min(V::zero());
            let sign = (behind * behind * seen.inverse).min(half);
            let both = (seen.across * seen.across).mul_add(seen.inverse, sign);
            sum = sum + both.min(cut2);
        }
        [total(sum)]
    }
}

/// `sum min(e^2 + [nu^ < 0] min((nu^ / sd)^2, cut^2 / 2), cut^2)`: an outlier counts once.
///
/// One on its epipolar line with a depth behind the camera counts half: what moves along with the camera, or
/// overtakes it, lies on the same lines, unlike an outlier.
pub(crate) fn consensus(observations: &Observations, motion: &Motion, cut: f64) -> f64 {
    let [cost] = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, ConsensusSum { planes, motion, floor: observations.floor, cut2: cut * cut })
    });
    cost
}

/// The row `D(nu)` of point `k`, 0 at the epipole.
pub(crate) fn slopes(points: &Observations, motion: &Motion, tangent: &Matrix2x3<f64>, nu: f64, k: usize) -> Vector5 {
    let point = points.row(k);
    let t = point.g * motion.u();
    let s = t.norm();
    if s * s <= points.floor {
        return Vector5::zeros();
    }
    let across = nalgebra::RowVector2::new(t.y, -t.x) / s;
    let psi = across * point.g * tangent.transpose() * nu;
    let turn = across * point.r;
    Vector5::new(psi.x, psi.y, turn.x, turn.y, turn.z)
}
