//! Passes over the points, written once for every lane width.
//!
//! Functions and loops instead of closures: a closure would be compiled without the lanes' instructions.

use super::{over_chunks, symmetric};
use crate::motion3d::model::motion::Motion;
use crate::motion3d::model::observations::{ALIGN, CHUNK, Observations, PLANES};
use crate::motion3d::model::rows::{Matrix5, Vector5};
use crate::parallel;
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::{Matrix2x3, Matrix3, SVector, Vector3};
use std::ops::Range;

/// Points of one chunk with the motion that they are seen with.
#[derive(Clone, Copy)]
struct View<'a> {
    planes: [&'a [f64]; PLANES],
    motion: &'a Motion,
    floor: f64,
}

impl<'a> View<'a> {
    fn new(observations: &'a Observations, range: &Range<usize>, motion: &'a Motion) -> Self {
        Self { planes: observations.slices(range), motion, floor: observations.floor }
    }

    fn len(&self) -> usize {
        self.planes[0].len()
    }

    #[inline(always)]
    fn at<V: Lanes<Scalar = f64>>(&self, p: usize, i: usize) -> V {
        V::load(&self.planes[p][i..])
    }

    #[inline(always)]
    fn dot<V: Lanes<Scalar = f64>>(&self, first: usize, i: usize, with: &[V; 3]) -> V {
        let tail = self.at::<V>(first + 1, i).mul_add(with[1], self.at::<V>(first, i) * with[0]);
        self.at::<V>(first + 2, i).mul_add(with[2], tail)
    }

    #[inline(always)]
    fn see<V: Lanes<Scalar = f64>>(&self, i: usize) -> Seen<V> {
        let (u, w) = (splat::<V>(self.motion.translation), splat::<V>(self.motion.rotation));
        let t: [V; 2] = [self.dot(0, i, &u), self.dot(3, i, &u)];
        let s2 = t[0].mul_add(t[0], t[1] * t[1]);
        let inverse = V::select(V::splat(self.floor).lt(s2), V::constant(1.0) / s2, V::zero());
        let rx: [V; 3] = [self.at(6, i), self.at(7, i), self.at(8, i)];
        let ry: [V; 3] = [self.at(9, i), self.at(10, i), self.at(11, i)];
        let q = [turn(&t, rx[0], ry[0]), turn(&t, rx[1], ry[1]), turn(&t, rx[2], ry[2])];
        let dx = rx[2].neg_mul_add(w[2], rx[1].neg_mul_add(w[1], rx[0].neg_mul_add(w[0], self.at(12, i))));
        let dy = ry[2].neg_mul_add(w[2], ry[1].neg_mul_add(w[1], ry[0].neg_mul_add(w[0], self.at(13, i))));
        Seen { s2, inverse, q, across: turn(&t, dx, dy), along: t[0].mul_add(dx, t[1] * dy), t }
    }
}

/// A point in every lane, seen with one motion.
struct Seen<V> {
    /// `T = G u`.
    t: [V; 2],
    /// `s^2` and its inverse, which is 0 at the epipole.
    s2: V,
    inverse: V,
    /// `s p^t R`.
    q: [V; 3],
    /// `s e`.
    across: V,
    /// `s m`.
    along: V,
}

#[inline(always)]
fn splat<V: Lanes<Scalar = f64>>([x, y, z]: [f64; 3]) -> [V; 3] {
    [V::splat(x), V::splat(y), V::splat(z)]
}

/// `T_y a_x - T_x a_y`.
#[inline(always)]
fn turn<V: Lanes<Scalar = f64>>(t: &[V; 2], x: V, y: V) -> V {
    t[0].neg_mul_add(y, t[1] * x)
}

/// Adds the upper triangle of `weight d^t d`, row by row.
#[inline(always)]
fn add_products<V: Lanes<Scalar = f64>, const N: usize>(sums: &mut [V], d: &[V; N], weight: V) {
    let mut k = 0;
    for row in 0..N {
        let weighted = d[row] * weight;
        for column in row..N {
            sums[k] = weighted.mul_add(d[column], sums[k]);
            k += 1;
        }
    }
}

/// Each sum over its lanes, in their order.
#[inline(always)]
fn totals<V: Lanes<Scalar = f64>, const N: usize>(sums: &[V; N]) -> SVector<f64, N> {
    let mut out = SVector::zeros();
    for k in 0..N {
        let mut values = [0.0; ALIGN];
        sums[k].store(&mut values[..V::LANES]);
        for value in &values[..V::LANES] {
            out[k] += value;
        }
    }
    out
}

/// The sums of one Gauss-Newton step at a motion.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Equations {
    /// `H = sum D(nu^)^t D(nu^)`.
    pub h: Matrix5,
    /// `sum D(nu^)^t e`.
    pub gradient: Vector5,
    /// `P = sum P_k`, the noise of the depths in `H`.
    pub p: Matrix5,
    /// `J = sum e^2`, or Tukey's loss where there is a cut.
    pub cost: f64,
    /// `sum (nu^ / sd)^2` over the points behind the camera.
    pub behind: f64,
    /// How many these are.
    pub reversed: f64,
}

impl Equations {
    /// What depths behind the camera speak against a motion: the noise of depths near 0 leaves `sum (nu^ /
    /// sd)^2` of no more than their number.
    pub fn cheirality_cost(&self) -> f64 {
        (self.behind - self.reversed).max(0.0)
    }
}

struct EquationSums<'a> {
    view: View<'a>,
    tangent: &'a Matrix2x3<f64>,
    inverse_cut: f64,
}

impl Kernel<f64> for EquationSums<'_> {
    type Output = SVector<f64, 27>;
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Self::Output {
        let t = self.tangent;
        let e1 = splat::<V>([t[(0, 0)], t[(0, 1)], t[(0, 2)]]);
        let e2 = splat::<V>([t[(1, 0)], t[(1, 1)], t[(1, 2)]]);
        let (cut, one) = (V::splat(self.inverse_cut), V::constant(1.0));
        let mut sums = [V::zero(); 27];
        for i in (0..self.view.len()).step_by(V::LANES) {
            let seen = self.view.see::<V>(i);
            let square = seen.across * seen.across * seen.inverse;
            // Tukey's weight (1 - (e / cut)^2)^2, 1 without a cut.
            let rest = one - (square * cut).min(one);
            let weight = rest * rest * seen.inverse;
            let nu = seen.along * seen.inverse;
            let a = turn(&seen.t, self.view.dot(0, i, &e1), self.view.dot(3, i, &e1));
            let b = turn(&seen.t, self.view.dot(0, i, &e2), self.view.dot(3, i, &e2));
            let d = [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]];
            add_products(&mut sums, &d, weight);
            for row in 0..5 {
                sums[15 + row] = (d[row] * weight).mul_add(seen.across, sums[15 + row]);
            }
            add_products(&mut sums[20..], &[a, b], weight * seen.inverse);
            sums[23] = sums[23] + square;
            sums[24] = sums[24] + (one - rest * rest * rest);
            let behind = seen.along.min(V::zero());
            sums[25] = (behind * behind).mul_add(seen.inverse, sums[25]);
            sums[26] = sums[26] + V::select(seen.along.lt(V::zero()), one, V::zero());
        }
        totals(&sums)
    }
}

/// The equations at a motion, `theta = (psi, w)` with `psi` along the rows of `tangent`; with `cut`, Tukey's
/// weights that end there, in units of noise.
pub(crate) fn equations(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    cut: Option<f64>,
) -> Equations {
    let inverse_cut = cut.map_or(0.0, |cut| 1.0 / (cut * cut));
    let sums = over_chunks(observations, |range| {
        let view = View::new(observations, &range, motion);
        dispatch(observations.level, EquationSums { view, tangent, inverse_cut })
    });
    let sums = sums.as_slice();
    let (mut h, mut gradient) = (symmetric(&sums[..15]), Vector5::from_column_slice(&sums[15..20]));
    let mut cost = cut.map_or(sums[23], |cut| cut * cut / 3.0 * sums[24]);
    if let Some(known) = &observations.prior {
        known.add(&motion.w(), &mut h, &mut gradient, &mut cost);
    }
    let mut p = Matrix5::zeros();
    (p[(0, 0)], p[(0, 1)], p[(1, 0)], p[(1, 1)]) = (sums[20], sums[21], sums[21], sums[22]);
    Equations { h, gradient, p, cost, behind: sums[25], reversed: sums[26] }
}

/// The 3 x 3 normal equations of `w` for a fixed direction.
struct RotationSums<'a>(View<'a>);

impl Kernel<f64> for RotationSums<'_> {
    type Output = SVector<f64, 10>;
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> Self::Output {
        let mut sums = [V::zero(); 10];
        for i in (0..self.0.len()).step_by(V::LANES) {
            let Seen { q, across, inverse, .. } = self.0.see::<V>(i);
            add_products(&mut sums, &[q[0], q[1], q[2], across], inverse);
        }
        totals(&sums)
    }
}

/// The best rotation for the translation `direction` and its `J`; `None` where the points do not determine
/// it.
pub(crate) fn best_rotation(observations: &Observations, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
    let still = Motion::of(direction, &Vector3::zeros());
    let sums = over_chunks(observations, |range| {
        dispatch(observations.level, RotationSums(View::new(observations, &range, &still)))
    });
    let [xx, xy, xz, xc, yy, yz, yc, zz, zc, mut cc] = sums.into();
    let mut normal = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let mut right = Vector3::new(xc, yc, zc);
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&Vector3::zeros());
        normal += known.information;
        right += pull;
        cc += square;
    }
    least_squares(&normal, &right, cc)
}

/// The solution of normal equations with what it leaves of the sum of squares `square`.
pub(crate) fn least_squares(normal: &Matrix3<f64>, right: &Vector3<f64>, square: f64) -> Option<(Vector3<f64>, f64)> {
    let w = normal.cholesky()?.solve(right);
    let cost = (square - right.dot(&w)).max(0.0);
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

impl Depths {
    /// Depths with their precisions.
    pub fn measured(&self) -> (&[f64], &[f64]) {
        (&self.nu, &self.s2)
    }
}

struct DepthPlanes<'a> {
    view: View<'a>,
    out: [&'a mut [f64]; 3],
}

impl Kernel<f64> for DepthPlanes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        let [nu, s2, e] = self.out;
        for i in (0..self.view.len()).step_by(V::LANES) {
            let seen = self.view.see::<V>(i);
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
    let planes = out.nu.chunks_mut(CHUNK).zip(out.s2.chunks_mut(CHUNK)).zip(out.e.chunks_mut(CHUNK));
    parallel::for_each(planes.zip(observations.chunks()), |(((nu, s2), e), range)| {
        let view = View::new(observations, &range, motion);
        dispatch(observations.level, DepthPlanes { view, out: [nu, s2, e] });
    });
    out
}
