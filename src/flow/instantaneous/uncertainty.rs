//! The affine estimate with its covariance and residual, in lanes: the formulae of
//! [`NoiseModel`](super::noise::NoiseModel), which stays their oracle.
//!
//! What noise leaves in the residual is `sum_f |G_f C^(1/2)|^2 - tr(A^T A Cov)` in the words of
//! [`propagation`](super::propagation); the first part is quadratic in m.

use super::condition::condition;
use super::lane_noise::LaneNoise;
use super::normal::{LaneRates, LaneSolution, Normal, eliminate, noise_square};
use super::propagation::{Factor, propagate};
use crate::math::Real;
use crate::simd::{Lanes, SimdReal};

/// What to say of a pixel beside its motion. The rest of an estimate is left at zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Detail {
    pub covariance: bool,
    /// Residual and condition.
    pub diagnostics: bool,
}

/// Everything about a pixel, in lanes.
#[derive(Clone, Copy)]
pub(super) struct LaneEstimate<V> {
    /// `u, v, u_x, v_x, u_y, v_y`.
    pub motion: [V; 6],
    /// Upper triangle of the covariance, row by row.
    pub covariance: [V; 21],
    /// Sum of the squared residuals.
    pub residual_square: V,
    /// Condition number of the column-scaled equations.
    pub condition: V,
    /// As [`LaneSolution::trust`], for all of it.
    pub trust: V,
}

impl LaneEstimate<f64> {
    /// The motion alone.
    pub fn plain(solution: &LaneSolution<f64>) -> Self {
        let LaneSolution { motion, trust } = *solution;
        Self { motion, covariance: [f64::NAN; 21], residual_square: f64::NAN, condition: f64::NAN, trust }
    }
}

/// Least share of the noise that must stay in the residual, for its expectation, a difference, to be worth
/// dividing by.
fn least_share<T: Real>() -> f64 {
    if size_of::<T>() == 4 { 1e-2 } else { 1e-6 }
}

/// How many times the squared rounding noise of twelve equations (with its margin) the squared residual must
/// have, where the pixel noise is judged by it: its relative error is then below one in a hundred.
const RESIDUAL_MARGIN: f64 = 1e3;

/// Solves the equations of each lane and propagates the pixel noise. `samples`: [`noise_square`] of the type
/// that the frames came in.
#[inline(always)]
pub(super) fn estimate_affine<T: SimdReal, V: Lanes<Scalar = T>>(
    rates: &LaneRates<V>,
    brightness: V,
    samples: f64,
    noise: &LaneNoise<T>,
    detail: Detail,
    memory: &mut Factor<V>,
) -> LaneEstimate<V> {
    let square = brightness * brightness;
    let normal = eliminate::<T, V>(rates, square * V::constant(samples));
    let LaneSolution { motion: m, mut trust } = normal.solution;
    let [_, first @ ..] = rates.minus_first;
    let residual_square = misfit(rates.jet, rates.minus_first, m) + misfit(first, rates.second, m);
    // Only the signs matter: whatever joins trust must be positive.
    if detail.diagnostics || noise.variance.is_none() {
        let rounding = V::constant(RESIDUAL_MARGIN * noise_square::<T>());
        trust = trust.min(square.neg_mul_add(rounding, residual_square));
    }
    let mut covariance = [V::zero(); 21];
    if detail.covariance {
        covariance = propagate(&normal, rates, noise, memory);
        let variance = if let Some(variance) = noise.variance {
            V::splat(variance)
        } else {
            let total = noise_total(m, noise);
            let expected = not_explained(&normal, &covariance, total);
            trust = trust.min(total.neg_mul_add(V::constant(least_share::<T>()), expected));
            residual_square / expected
        };
        for c in &mut covariance {
            *c = *c * variance;
        }
    }
    let mut condition = V::zero();
    if detail.diagnostics {
        let (value, trusted) = self::condition::<T, V>(&normal.triangle());
        condition = value;
        trust = trust.min(trusted);
    }
    // Zero times something that is not finite is NaN, which no comparison trusts.
    trust = trust + (covariance[0] + condition + residual_square) * V::zero();
    LaneEstimate { motion: m, covariance, residual_square, condition, trust }
}

/// `|c - J(part) m|^2` for J without the minus signs of (21).
#[inline(always)]
fn misfit<V: Lanes>([a, b, p, q, r]: [V; 5], [c1, c2, c3, c4, c5, c6]: [V; 6], m: [V; 6]) -> V {
    let [u, v, ux, vx, uy, vy] = m;
    let two = V::constant(2.0);
    let e1 = a.neg_mul_add(u, b.neg_mul_add(v, c1));
    let e2 = p.neg_mul_add(u, q.neg_mul_add(v, a.neg_mul_add(ux, b.neg_mul_add(vx, c2))));
    let e3 = q.neg_mul_add(u, r.neg_mul_add(v, a.neg_mul_add(uy, b.neg_mul_add(vy, c3))));
    let e4 = p.mul_add(ux, q * vx).neg_mul_add(two, c4);
    let e5 = q.neg_mul_add(ux, r.neg_mul_add(vx, p.neg_mul_add(uy, q.neg_mul_add(vy, c5))));
    let e6 = q.mul_add(uy, r * vy).neg_mul_add(two, c6);
    e1.mul_add(e1, e2.mul_add(e2, e3 * e3)) + e4.mul_add(e4, e5.mul_add(e5, e6 * e6))
}

/// `sum_f |G_f C^(1/2)|^2`: the noise of all twelve equations.
#[inline(always)]
fn noise_total<T: SimdReal, V: Lanes<Scalar = T>>(m: [V; 6], noise: &LaneNoise<T>) -> V {
    let mut total = V::splat(noise.constant);
    let mut at = 0;
    for p in 0..6 {
        let mut slope = V::splat(noise.linear[p]);
        for q in p..6 {
            slope = m[q].mul_add(V::splat(noise.quadratic[at]), slope);
            at += 1;
        }
        total = m[p].mul_add(slope, total);
    }
    total
}

/// What of it the solution cannot follow: `total - tr(N Cov)`.
#[inline(always)]
fn not_explained<V: Lanes>(normal: &Normal<V>, unit: &[V; 21], total: V) -> V {
    let n = normal.triangle();
    let (mut diagonal, mut beside) = (V::zero(), V::zero());
    let mut at = 0;
    for i in 0..6 {
        for j in i..6 {
            if i == j {
                diagonal = n[at].mul_add(unit[at], diagonal);
            } else {
                beside = n[at].mul_add(unit[at], beside);
            }
            at += 1;
        }
    }
    beside.neg_mul_add(V::constant(2.0), total - diagonal)
}

#[cfg(test)]
mod tests {
    use super::super::lane_noise::triangle;
    use super::super::noise::NoiseModel;
    use super::super::propagation::factor_memory;
    use super::*;
    use crate::flow::least_squares::solve;
    use crate::flow::model::{Affine, MotionModel};
    use crate::jet::{JetRates, JetStencil, Neighbourhood, TimeScheme};
    use crate::math::random::CounterRng;

    const BOTH: Detail = Detail { covariance: true, diagnostics: true };

    /// A jet and rates that the motion explains up to a misfit, as an image would give them.
    fn rates(seed: u64) -> JetRates<f64> {
        let rng = CounterRng::new(seed);
        let draw = |s: u64, scale: f64| -> [f64; 6] { std::array::from_fn(|k| scale * rng.stream(s).normal(k as u64)) };
        let (jet, m) = (draw(0, 5.0), draw(1, 0.5));
        let along = |i: &[f64; 6]| Affine::brightness_jacobian(i).map(|row| (0..6).map(|k| row[k] * m[k]).sum::<f64>());
        let mut first = along(&jet);
        let mut second = along(&first);
        for (k, (a, b)) in draw(2, 0.3).into_iter().zip(draw(3, 0.3)).enumerate() {
            first[k] += a;
            second[k] += b;
        }
        JetRates { jet, first, second }
    }

    fn models() -> Vec<(JetStencil, TimeScheme, Option<f64>)> {
        let rectangle = |width, height, sigma| Neighbourhood::Rectangle { width, height, sigma };
        let offsets = vec![(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 2), (2, -1)];
        let shapes =
            [rectangle(3, 3, None), rectangle(4, 5, Some(1.2)), Neighbourhood::Points { offsets, sigma: None }];
        let mut all = Vec::new();
        for shape in &shapes {
            for scheme in [TimeScheme::Central, TimeScheme::Backward] {
                for pixel in [None, Some(0.7)] {
                    all.push((JetStencil::new(shape, (1.0, 1.0)).unwrap(), scheme, pixel));
                }
            }
        }
        all
    }

    /// Differences from the careful path relative to standard deviations, over the condition squared (which
    /// normal equations cost).
    fn check<T: SimdReal>(tolerance: f64) {
        let mut trusted = 0;
        for (stencil, scheme, pixel) in models() {
            let oracle = NoiseModel::new(&stencil, scheme, pixel);
            let noise = oracle.lanes().cast::<T>();
            for seed in 0..200 {
                let r = rates(seed);
                let cast = |v: f64| T::from_f64(v);
                let lanes = LaneRates {
                    jet: std::array::from_fn(|k| cast(r.jet[k + 1])),
                    minus_first: r.first.map(|v| cast(-v)),
                    second: r.second.map(cast),
                };
                let got = estimate_affine::<T, T>(
                    &lanes,
                    cast(r.jet[0]),
                    noise_square::<T>(),
                    &noise,
                    BOTH,
                    &mut factor_memory(),
                );
                if got.trust.to_f64().is_nan() || got.trust.to_f64() <= 0.0 {
                    continue;
                }
                trusted += 1;
                let (a, b) = Affine::equations(&r);
                let solution = solve(&a, &b, 0.0);
                let want = oracle.covariance::<Affine, 12, 6>(&a, &solution, &|| f64::NAN);
                let bound = tolerance * solution.condition.powi(2);
                let residual = got.residual_square.to_f64() / solution.residual_square;
                assert!((residual - 1.0).abs() < bound, "{seed} {residual}");
                let condition = got.condition.to_f64() / solution.condition;
                assert!((condition - 1.0).abs() < bound, "{seed} {condition}");
                for (c, (p, q)) in got.covariance.iter().zip(triangle()) {
                    let scale = (want[p][p] * want[q][q]).sqrt();
                    let difference = (c.to_f64() - want[p][q]).abs() / scale;
                    assert!(difference < bound, "{seed} {p} {q}: {difference} of {bound}");
                }
            }
        }
        assert!(trusted > 1500, "{trusted}");
    }

    #[test]
    fn agrees_with_the_careful_path_in_both_precisions() {
        check::<f64>(1e-13);
        check::<f32>(1e-5);
    }
}
