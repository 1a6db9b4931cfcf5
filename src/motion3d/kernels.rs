//! The loops over points, written once for every lane width.
//!
//! With `T = G u`, `s = |T|`, `d = f - R w`: `s e = T_y d_x - T_x d_y` is the residual across the epipolar line and `s m = T . d` the part along it (2).

use super::motion::Motion;
use super::observations::{Known, Observations};
use crate::simd::{Kernel, Lanes, dispatch};
use nalgebra::{Matrix2x3, Matrix3, SMatrix, Vector3};
use rayon::prelude::*;
use std::ops::{AddAssign, Range};

/// Planes of an [`Observations`].
pub(super) const PLANES: usize = 14;

/// A motion in every lane.
struct Everywhere<V> {
    u: [V; 3],
    w: [V; 3],
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

type Planes<'a> = [&'a [f64]; PLANES];

impl<V: Lanes<Scalar = f64>> Everywhere<V> {
    #[inline(always)]
    fn new(motion: &Motion) -> Self {
        Self { u: splat(motion.translation), w: splat(motion.rotation) }
    }
}

// Functions and loops instead of closures throughout: a closure would be compiled without the lanes' instructions.

#[inline(always)]
fn splat<V: Lanes<Scalar = f64>>([x, y, z]: [f64; 3]) -> [V; 3] {
    [V::splat(x), V::splat(y), V::splat(z)]
}

/// The two axes along which the direction varies.
#[inline(always)]
fn both_axes<V: Lanes<Scalar = f64>>(tangent: &Matrix2x3<f64>) -> [[V; 3]; 2] {
    [
        splat([tangent[(0, 0)], tangent[(0, 1)], tangent[(0, 2)]]),
        splat([tangent[(1, 0)], tangent[(1, 1)], tangent[(1, 2)]]),
    ]
}

#[inline(always)]
fn at<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, p: usize, i: usize) -> V {
    V::load(&planes[p][i..])
}

#[inline(always)]
fn dot<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, first: usize, i: usize, with: &[V; 3]) -> V {
    let tail = at::<V>(planes, first + 1, i).mul_add(with[1], at::<V>(planes, first, i) * with[0]);
    at::<V>(planes, first + 2, i).mul_add(with[2], tail)
}

/// `T_y a_x - T_x a_y`.
#[inline(always)]
fn turn<V: Lanes<Scalar = f64>>(t: &[V; 2], x: V, y: V) -> V {
    t[0].neg_mul_add(y, t[1] * x)
}

#[inline(always)]
fn see<V: Lanes<Scalar = f64>>(planes: &Planes<'_>, i: usize, motion: &Everywhere<V>, floor: V) -> Seen<V> {
    let t = [dot(planes, 0, i, &motion.u), dot(planes, 3, i, &motion.u)];
    let s2 = t[0].mul_add(t[0], t[1] * t[1]);
    let inverse = V::select(floor.lt(s2), V::constant(1.0) / s2, V::zero());
    let rx: [V; 3] = [at(planes, 6, i), at(planes, 7, i), at(planes, 8, i)];
    let ry: [V; 3] = [at(planes, 9, i), at(planes, 10, i), at(planes, 11, i)];
    let q = [turn(&t, rx[0], ry[0]), turn(&t, rx[1], ry[1]), turn(&t, rx[2], ry[2])];
    let w = &motion.w;
    let dx = rx[2].neg_mul_add(w[2], rx[1].neg_mul_add(w[1], rx[0].neg_mul_add(w[0], at(planes, 12, i))));
    let dy = ry[2].neg_mul_add(w[2], ry[1].neg_mul_add(w[1], ry[0].neg_mul_add(w[0], at(planes, 13, i))));
    Seen { s2, inverse, q, across: turn(&t, dx, dy), along: t[0].mul_add(dx, t[1] * dy), t }
}

/// The lanes' sum, in the order of the lanes.
#[inline(always)]
fn total<V: Lanes<Scalar = f64>>(lanes: V) -> f64 {
    let mut values = [0.0; 16];
    lanes.store(&mut values[..V::LANES]);
    values[..V::LANES].iter().sum()
}

/// Adds up what `part` gives for each chunk, in the order of the chunks, whoever computes them.
fn over_chunks<const N: usize>(
    observations: &Observations,
    part: impl Fn(Range<usize>) -> [f64; N] + Sync,
) -> [f64; N] {
    let chunks: Vec<_> = observations.chunks().collect();
    let parts: Vec<[f64; N]> = if chunks.len() < 2 {
        chunks.into_iter().map(&part).collect()
    } else {
        chunks.into_par_iter().map(&part).collect()
    };
    let mut sums = [0.0; N];
    for part in &parts {
        sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
    }
    sums
}

/// Indices of the upper triangle of a 5 x 5 matrix, row by row.
const UPPER: [(usize, usize); 15] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (0, 3),
    (0, 4),
    (1, 1),
    (1, 2),
    (1, 3),
    (1, 4),
    (2, 2),
    (2, 3),
    (2, 4),
    (3, 3),
    (3, 4),
    (4, 4),
];

/// The sums of one Gauss-Newton step at a motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct Equations {
    /// `H = sum D(nu^)^t D(nu^)`.
    pub h: SMatrix<f64, 5, 5>,
    /// `sum D(nu^)^t e`.
    pub gradient: SMatrix<f64, 5, 1>,
    /// `P = sum P_k`, the noise of the depths in `H`.
    pub p: SMatrix<f64, 5, 5>,
    /// `J = sum e^2`, or Tukey's loss where there is a cut.
    pub cost: f64,
    /// `sum (nu^ / sd)^2` over the points behind the camera.
    pub behind: f64,
}

struct EquationSums<'a> {
    planes: Planes<'a>,
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
    inverse_cut: f64,
}

const EQUATION_SUMS: usize = 26;

impl Kernel<f64> for EquationSums<'_> {
    type Output = [f64; EQUATION_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; EQUATION_SUMS] {
        let motion = Everywhere::<V>::new(self.motion);
        let [first, second] = both_axes::<V>(self.tangent);
        let (floor, cut, one) = (V::splat(self.floor), V::splat(self.inverse_cut), V::constant(1.0));
        let mut sums = [V::zero(); EQUATION_SUMS];
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let e2 = seen.across * seen.across * seen.inverse;
            // Tukey's weight (1 - (e / cut)^2)^2, 1 without a cut.
            let rest = one - (e2 * cut).min(one);
            let weight = rest * rest * seen.inverse;
            let nu = seen.along * seen.inverse;
            let a = turn(&seen.t, dot(&self.planes, 0, i, &first), dot(&self.planes, 3, i, &first));
            let b = turn(&seen.t, dot(&self.planes, 0, i, &second), dot(&self.planes, 3, i, &second));
            let d = [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]];
            let mut k = 0;
            for row in 0..5 {
                let weighted = d[row] * weight;
                for column in row..5 {
                    sums[k] = weighted.mul_add(d[column], sums[k]);
                    k += 1;
                }
                sums[15 + row] = weighted.mul_add(seen.across, sums[15 + row]);
            }
            let twice = weight * seen.inverse;
            sums[20] = (a * twice).mul_add(a, sums[20]);
            sums[21] = (a * twice).mul_add(b, sums[21]);
            sums[22] = (b * twice).mul_add(b, sums[22]);
            sums[23] = sums[23] + e2;
            sums[24] = sums[24] + (one - rest * rest * rest);
            let behind = seen.along.min(V::zero());
            sums[25] = (behind * behind).mul_add(seen.inverse, sums[25]);
        }
        sums.map(total)
    }
}

/// Adds a 3 x 3 matrix, times a factor, to the block of the rotation.
fn add_to_rotation(h: &mut SMatrix<f64, 5, 5>, information: &Matrix3<f64>, factor: f64) {
    h.fixed_view_mut::<3, 3>(2, 2).add_assign(information * factor);
}

/// The equations at a motion, `theta = (psi, w)` with `psi` along the rows of `tangent`; with `cut`, Tukey's weights that end there, in units of noise.
pub(super) fn equations(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    cut: Option<f64>,
) -> Equations {
    let inverse_cut = cut.map_or(0.0, |cut| 1.0 / (cut * cut));
    let sums = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, EquationSums { planes, motion, tangent, floor: observations.floor, inverse_cut })
    });
    let (mut h, mut p) = (SMatrix::<f64, 5, 5>::zeros(), SMatrix::<f64, 5, 5>::zeros());
    for (value, &(i, j)) in sums.iter().zip(&UPPER) {
        h[(i, j)] = *value;
        h[(j, i)] = *value;
    }
    let mut gradient = SMatrix::<f64, 5, 1>::from_column_slice(&sums[15..20]);
    let mut cost = cut.map_or(sums[23], |cut| cut * cut / 3.0 * sums[24]);
    if let Some(known) = &observations.prior {
        let (pull, square) = known.pull(&motion.w());
        add_to_rotation(&mut h, &known.information, 1.0);
        gradient.fixed_rows_mut::<3>(2).add_assign(&pull);
        cost += square;
    }
    p[(0, 0)] = sums[20];
    p[(0, 1)] = sums[21];
    p[(1, 0)] = sums[21];
    p[(1, 1)] = sums[22];
    Equations { h, gradient, p, cost, behind: sums[25] }
}

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

/// The best rotation for the translation `direction` and its `J`; `None` where the points do not determine it.
pub(super) fn best_rotation(observations: &Observations, direction: &Vector3<f64>) -> Option<(Vector3<f64>, f64)> {
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
pub(super) struct Depths {
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
pub(super) fn depths(observations: &Observations, motion: &Motion) -> Depths {
    use super::observations::CHUNK;
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

/// `sum W^t W` for given depths in the weights, as the upper triangle.
struct WeightSums<'a> {
    planes: Planes<'a>,
    nu: &'a [f64],
    motion: &'a Motion,
    tangent: &'a Matrix2x3<f64>,
    floor: f64,
}

impl WeightSums<'_> {
    /// `s D(nu)` and what else the points' equations need.
    #[inline(always)]
    fn row<V: Lanes<Scalar = f64>>(
        planes: &Planes<'_>,
        nu: &[f64],
        i: usize,
        motion: &Everywhere<V>,
        axes: &[[V; 3]; 2],
        floor: V,
    ) -> (Seen<V>, [V; 5]) {
        let seen = see(planes, i, motion, floor);
        let nu = V::load(&nu[i..]);
        let a = turn(&seen.t, dot(planes, 0, i, &axes[0]), dot(planes, 3, i, &axes[0]));
        let b = turn(&seen.t, dot(planes, 0, i, &axes[1]), dot(planes, 3, i, &axes[1]));
        let d = [nu * a, nu * b, seen.q[0], seen.q[1], seen.q[2]];
        (seen, d)
    }
}

impl Kernel<f64> for WeightSums<'_> {
    type Output = [f64; 15];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; 15] {
        let motion = Everywhere::<V>::new(self.motion);
        let axes = both_axes(self.tangent);
        let floor = V::splat(self.floor);
        let mut sums = [V::zero(); 15];
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let (seen, d) = Self::row(&self.planes, self.nu, i, &motion, &axes, floor);
            let mut k = 0;
            for row in 0..5 {
                let weighted = d[row] * seen.inverse;
                for column in row..5 {
                    sums[k] = weighted.mul_add(d[column], sums[k]);
                    k += 1;
                }
            }
        }
        sums.map(total)
    }
}

/// `sum D(nu)^t D(nu)` with the depths `nu` (as many as the planes have values) in the weights.
pub(super) fn information(
    observations: &Observations,
    motion: &Motion,
    tangent: &Matrix2x3<f64>,
    nu: &[f64],
) -> SMatrix<f64, 5, 5> {
    let sums = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        let nu = &nu[range];
        dispatch(observations.level, WeightSums { planes, nu, motion, tangent, floor: observations.floor })
    });
    let mut h = SMatrix::<f64, 5, 5>::zeros();
    for (value, &(i, j)) in sums.iter().zip(&UPPER) {
        h[(i, j)] = *value;
        h[(j, i)] = *value;
    }
    if let Some(known) = &observations.prior {
        add_to_rotation(&mut h, &known.information, 1.0);
    }
    h
}

/// `sum V^t h` of the bilinear residual `s e = sum_i u_i (h_i0 + sum_j h_ij w_j)`.
struct BilinearSums<'a> {
    weights: WeightSums<'a>,
    /// `kappa^2`, the largest variance of the direction.
    spread: f64,
}

const BILINEAR_SUMS: usize = 60;

impl Kernel<f64> for BilinearSums<'_> {
    type Output = [f64; BILINEAR_SUMS];
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) -> [f64; BILINEAR_SUMS] {
        let WeightSums { planes, nu, motion, tangent, floor } = self.weights;
        let motion = Everywhere::<V>::new(motion);
        let axes = both_axes(tangent);
        let (floor, half_spread) = (V::splat(floor), V::splat(0.5 * self.spread));
        let mut sums = [[V::zero(); 12]; 5];
        for i in (0..planes[0].len()).step_by(V::LANES) {
            let (seen, d) = WeightSums::row(&planes, nu, i, &motion, &axes, floor);
            let mut g = [V::zero(); 6];
            let mut size = V::zero();
            for p in 0..6 {
                g[p] = at(&planes, p, i);
                size = g[p].mul_add(g[p], size);
            }
            // V = W s / (s^2 + g kappa^2), and nothing at the epipole.
            let damped = size.mul_add(half_spread, seen.s2);
            let scale = V::select(floor.lt(seen.s2), V::constant(1.0) / damped, V::zero());
            for c in 0..3 {
                let column = [g[c], g[3 + c]];
                let mut h = [turn(&column, at(&planes, 12, i), at(&planes, 13, i)) * scale; 4];
                for j in 0..3 {
                    h[1 + j] = -turn(&column, at(&planes, 6 + j, i), at(&planes, 9 + j, i)) * scale;
                }
                for row in 0..5 {
                    for j in 0..4 {
                        sums[row][4 * c + j] = h[j].mul_add(d[row], sums[row][4 * c + j]);
                    }
                }
            }
        }
        let mut out = [0.0; BILINEAR_SUMS];
        for (to, lanes) in out.iter_mut().zip(sums.into_iter().flatten()) {
            *to = total(lanes);
        }
        out
    }
}

/// The frozen estimating equation `sum V^t (s e)(u, w)`: five values, each bilinear in `u` and `(1, w)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bilinear {
    sums: [f64; BILINEAR_SUMS],
    prior: Option<Known>,
}

impl Bilinear {
    /// With `D(nu)` at a motion as weights, damped within `kappa^2 = spread` of the epipole.
    pub fn new(
        observations: &Observations,
        motion: &Motion,
        tangent: &Matrix2x3<f64>,
        nu: &[f64],
        spread: f64,
    ) -> Self {
        let sums = over_chunks(observations, |range| {
            let planes = observations.slices(&range);
            let weights = WeightSums { planes, nu: &nu[range], motion, tangent, floor: observations.floor };
            dispatch(observations.level, BilinearSums { weights, spread })
        });
        Self { sums, prior: observations.prior }
    }

    /// Its value at a motion, and its slopes along `tangent` and `w`.
    pub fn at(&self, motion: &Motion, tangent: &Matrix2x3<f64>) -> (SMatrix<f64, 5, 1>, SMatrix<f64, 5, 5>) {
        let (u, w) = (motion.translation, motion.rotation);
        let (mut value, mut slope) = (SMatrix::<f64, 5, 1>::zeros(), SMatrix::<f64, 5, 5>::zeros());
        for row in 0..5 {
            let h = |i: usize, j: usize| self.sums[12 * row + 4 * i + j];
            for i in 0..3 {
                let along = h(i, 0) + (0..3).map(|j| h(i, 1 + j) * w[j]).sum::<f64>();
                value[row] += u[i] * along;
                slope[(row, 0)] += tangent[(0, i)] * along;
                slope[(row, 1)] += tangent[(1, i)] * along;
                for j in 0..3 {
                    slope[(row, 2 + j)] += u[i] * h(i, 1 + j);
                }
            }
        }
        if let Some(known) = &self.prior {
            value.fixed_rows_mut::<3>(2).add_assign(&known.pull(&motion.w()).0);
            add_to_rotation(&mut slope, &known.information, -1.0);
        }
        (value, slope)
    }
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
        let mut sum = V::zero();
        for i in (0..self.planes[0].len()).step_by(V::LANES) {
            let seen = see(&self.planes, i, &motion, floor);
            let behind = seen.along.min(V::zero());
            let both = seen.across.mul_add(seen.across, behind * behind) * seen.inverse;
            sum = sum + both.min(cut2);
        }
        [total(sum)]
    }
}

/// `sum min(e^2 + [nu^ < 0] (nu^ / sd)^2, cut^2)`: a point that does not obey counts once, for whatever reason.
pub(super) fn consensus(observations: &Observations, motion: &Motion, cut: f64) -> f64 {
    let [cost] = over_chunks(observations, |range| {
        let planes = observations.slices(&range);
        dispatch(observations.level, ConsensusSum { planes, motion, floor: observations.floor, cut2: cut * cut })
    });
    cost
}
