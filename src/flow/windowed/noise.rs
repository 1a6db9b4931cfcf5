//! How white pixel noise enters the equations.
//!
//! With `P(i) = -J(i)` a pixel's residual is `i' + P(i) m`, and below it `i'' + P(i') m`. Noise of the pixels
//! enters through the right-hand side and, times m, through the coefficients. `P(i) m` is linear in the jet i
//! and linear in m; both views are needed.

use super::combine::Combination;
use super::jet_matrix::basis;
use super::truncation::{DERIVATIVES, Truncation};
use crate::flow::moment_filter::weights;
use crate::flow::symmetric::{ENTRIES, upper};
use crate::jet::JetStencil;
use crate::simd::Lanes;

/// Weights of the jet's components in `c . (P(jet) m)`, for weights `c` of the rows.
#[inline(always)]
pub(super) fn pulled_back<V: Lanes>(c: &[V; 6], m: &[V; 6]) -> [V; 6] {
    let [u, v, u_x, v_x, u_y, v_y] = *m;
    let twice = |a: V| a + a;
    [
        V::zero(),
        c[0].mul_add(u, c[1].mul_add(u_x, c[2] * u_y)),
        c[0].mul_add(v, c[1].mul_add(v_x, c[2] * v_y)),
        c[1].mul_add(u, twice(c[3]).mul_add(u_x, c[4] * u_y)),
        c[1].mul_add(v, c[2].mul_add(u, twice(c[3]).mul_add(v_x, c[4].mul_add(u_x + v_y, twice(c[5]) * u_y)))),
        c[2].mul_add(v, c[4].mul_add(v_x, twice(c[5]) * v_y)),
    ]
}

/// Second moments of the noise in one pixel's equations, per unit variance of the pixels, in the scaled
/// unknowns.
#[derive(Debug, Clone)]
pub(super) struct PixelNoise {
    /// Variance of the right-hand sides, summed over the rows.
    pub constant: f64,
    /// `E[sum over rows of coefficient noise times right-hand side noise]`, a vector over the unknowns.
    pub linear: [f64; 6],
    /// `E[dP^T dP]`, upper triangle.
    pub quadratic: [f64; ENTRIES],
    /// `E[dP^T dP - dP^T dr]`, r being the residual that [`Truncation`] reads from the image, per unit of the
    /// motion: noise passes for texture there.
    pub pull: [[f64; 6]; 6],
    /// `mixing[q]`: amounts of the three ways in which noise enters (through i, i', i'') in the q-th of as
    /// many independent noises.
    pub mixing: Vec<[f64; 3]>,
}

impl PixelNoise {
    /// For `rows` equations, frames combined so, smoothed by `smooth` px first, and a window of `sigma` px.
    pub fn new(
        stencil: &JetStencil,
        combination: Combination,
        rows: usize,
        smooth: Option<f64>,
        sigma: f64,
        truncation: &Truncation,
    ) -> Self {
        let gram = smoothed_covariance(stencil, smooth);
        let w = combination.weights();
        let dot = |a: usize, b: usize| w[a].iter().zip(&w[b]).map(|(x, y)| x * y).sum::<f64>();
        let block = rows.min(6);
        let two = rows == 12;
        let both = |first: f64, second: f64| first + if two { second } else { 0.0 };
        let trace: f64 = (0..block).map(|k| gram[k][k]).sum();
        let basis = basis(block);
        let scale = |a: usize| if a < 2 { 1.0 } else { 1.0 / sigma };
        let mut linear = [0.0; 6];
        let mut quadratic = [0.0; ENTRIES];
        for a in 0..6 {
            for k in 0..block {
                let along: f64 = (0..6).map(|j| basis[j][a][k] * gram[j][k]).sum();
                linear[a] += along * scale(a) * both(dot(0, 1), dot(1, 2));
                for b in a..6 {
                    let mut sum = 0.0;
                    for j in 0..6 {
                        for l in 0..6 {
                            sum += basis[j][a][k] * gram[j][l] * basis[l][b][k];
                        }
                    }
                    quadratic[upper(a, b)] += sum * scale(a) * scale(b) * both(dot(0, 0), dot(1, 1));
                }
            }
        }
        let mut pull = [[0.0; 6]; 6];
        let cross = cross_covariance(stencil, smooth);
        for a in 0..6 {
            for b in 0..6 {
                let mut sum = 0.0;
                for k in 0..block {
                    for j in 0..6 {
                        let along: f64 = (0..DERIVATIVES).map(|d| cross[j][d] * truncation.rows[k][b][d]).sum();
                        sum += basis[j][a][k] * along;
                    }
                }
                let square = quadratic[if a <= b { upper(a, b) } else { upper(b, a) }];
                let sum = square - sum * scale(a) * scale(b) * both(dot(0, 0), dot(1, 1));
                pull[a][b] = sum;
            }
        }
        let ways = if two { 3 } else { 2 };
        Self {
            constant: trace * both(dot(1, 1), dot(2, 2)),
            linear,
            quadratic,
            pull,
            mixing: independent(ways, &|a, b| dot(a, b)),
        }
    }
}

/// Cholesky factor of the Gram matrix of the ways, column by column; columns of zero are left out.
fn independent(ways: usize, gram: &dyn Fn(usize, usize) -> f64) -> Vec<[f64; 3]> {
    let mut lower = [[0.0; 3]; 3];
    for j in 0..ways {
        let pivot: f64 = gram(j, j) - (0..j).map(|k| lower[j][k] * lower[j][k]).sum::<f64>();
        if pivot < 1e-12 {
            continue;
        }
        lower[j][j] = pivot.sqrt();
        for i in j + 1..ways {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            lower[i][j] = (gram(i, j) - sum) / lower[j][j];
        }
    }
    (0..ways).map(|q| [lower[0][q], lower[1][q], lower[2][q]]).filter(|c| c.iter().any(|v| *v != 0.0)).collect()
}

/// Weights at distance 0, 1, ... of the Gaussian that smooths frames: cut at 4 sigma like
/// [`crate::image::GaussianSmoother`].
pub(super) fn smoothing_weights(sigma: f64) -> Vec<f64> {
    weights(sigma, (4.0 * sigma + 0.5) as usize)
}

/// Correlation, along one axis, of white noise of variance 1 smoothed by `smooth` px: at lag 0 its variance's
/// root.
pub(super) fn shared(smooth: Option<f64>) -> impl Fn(i32) -> f64 {
    let half = smooth.map_or_else(|| vec![1.0], smoothing_weights);
    let r = half.len() as i32 - 1;
    let weight = |k: i32| half.get(k.unsigned_abs() as usize).copied().unwrap_or(0.0);
    let lags: Vec<f64> = (0..=2 * r).map(|d| (-r..=r).map(|k| weight(k) * weight(k + d)).sum()).collect();
    move |d| lags.get(d.unsigned_abs() as usize).copied().unwrap_or(0.0)
}

/// Covariance of the jet for white pixel noise of variance 1 that was smoothed before.
fn smoothed_covariance(stencil: &JetStencil, smooth: Option<f64>) -> [[f64; 6]; 6] {
    if smooth.is_none() {
        return stencil.covariance();
    }
    let correlation = shared(smooth);
    let mut covariance = [[0.0; 6]; 6];
    for (o, w) in stencil.offsets().iter().zip(stencil.weights()) {
        for (p, z) in stencil.offsets().iter().zip(stencil.weights()) {
            let c = correlation(o.0 - p.0) * correlation(o.1 - p.1);
            for i in 0..6 {
                for j in 0..6 {
                    covariance[i][j] += c * w[i] * z[j];
                }
            }
        }
    }
    covariance
}

/// Covariance of the jet with the derivatives of [`Truncation`], for the same noise.
fn cross_covariance(stencil: &JetStencil, smooth: Option<f64>) -> [[f64; DERIVATIVES]; 6] {
    let correlation = shared(smooth);
    let mut covariance = [[0.0; DERIVATIVES]; 6];
    for d in 0..DERIVATIVES {
        for (p, z) in Truncation::derivative(stencil, d) {
            for (o, w) in stencil.offsets().iter().zip(stencil.weights()) {
                let c = correlation(o.0 - p.0) * correlation(o.1 - p.1);
                for j in 0..6 {
                    covariance[j][d] += c * z * w[j];
                }
            }
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::super::jet_matrix::columns;
    use super::*;
    use crate::jet::{Neighbourhood, TimeScheme};
    use crate::math::random::CounterRng;
    use crate::types::Frame;

    #[test]
    fn pulling_back_is_the_same_bilinear_form() {
        let jet = [0.1, 0.7, -0.4, 0.9, 0.3, -0.6];
        let m = [0.3, -0.2, 0.05, 0.07, -0.04, 0.02];
        let c = [0.5, -0.8, 0.25, 0.65, -0.15, 0.95];
        let p = columns::<f64, 6>(&jet);
        let direct: f64 = (0..6).map(|k| c[k] * (0..6).map(|a| p[a][k] * m[a]).sum::<f64>()).sum();
        let pulled: f64 = pulled_back(&c, &m).iter().zip(jet).map(|(d, j)| d * j).sum();
        assert!((direct - pulled).abs() < 1e-14);
    }

    #[test]
    fn second_moments_are_those_of_simulated_noise() {
        let stencil = JetStencil::new(&Neighbourhood::default(), (1.0, 1.0)).unwrap();
        let sigma = 4.0;
        for (frames, scheme, smooth) in
            [(3, TimeScheme::Central, None), (3, TimeScheme::Backward, None), (2, TimeScheme::Central, Some(1.0))]
        {
            let combination = Combination::of(frames, scheme);
            let rows = if frames == 3 { 12 } else { 6 };
            let noise = PixelNoise::new(
                &stencil,
                combination,
                rows,
                smooth,
                sigma,
                &Truncation::new(&stencil, combination, None),
            );
            let side = 300usize;
            let images: Vec<Frame<f64>> = (0..frames)
                .map(|k| {
                    let rng = CounterRng::new(3).stream(k as u64);
                    let white = Frame::from_fn(side, side, |x, y| rng.normal((y * side + x) as u64));
                    smooth.map_or(white.clone(), |s| crate::image::GaussianSmoother::new(s).unwrap().apply(&white))
                })
                .collect();
            let w = combination.weights();
            let (mut constant, mut linear, mut quadratic, mut n) = (0.0, [0.0; 6], [0.0; ENTRIES], 0.0);
            for y in 10..side - 10 {
                for x in 10..side - 10 {
                    let jets: Vec<[f64; 6]> = images.iter().map(|f| stencil.at(f, x, y)).collect();
                    let mix = |k: usize| -> [f64; 6] {
                        std::array::from_fn(|j| jets.iter().zip(w[k]).map(|(i, w)| w * i[j]).sum())
                    };
                    let blocks = [(mix(0), mix(1)), (mix(1), mix(2))];
                    for (jet, rate) in &blocks[..if rows == 12 { 2 } else { 1 }] {
                        let p = columns::<f64, 6>(jet);
                        constant += rate.iter().map(|r| r * r).sum::<f64>();
                        for a in 0..6 {
                            let s = if a < 2 { 1.0 } else { 1.0 / sigma };
                            linear[a] += s * (0..6).map(|k| p[a][k] * rate[k]).sum::<f64>();
                            for b in a..6 {
                                let t = if b < 2 { 1.0 } else { 1.0 / sigma };
                                quadratic[upper(a, b)] += s * t * (0..6).map(|k| p[a][k] * p[b][k]).sum::<f64>();
                            }
                        }
                    }
                    n += 1.0;
                }
            }
            let near = |got: f64, want: f64, scale: f64| {
                assert!((got / n - want).abs() < 0.03 * scale, "{frames} {scheme:?}: {} {want}", got / n);
            };
            near(constant, noise.constant, noise.constant);
            let sizes: Vec<f64> = (0..6).map(|a| noise.quadratic[upper(a, a)].sqrt()).collect();
            for a in 0..6 {
                near(linear[a], noise.linear[a], sizes[a] * noise.constant.sqrt());
                for b in a..6 {
                    near(quadratic[upper(a, b)], noise.quadratic[upper(a, b)], sizes[a] * sizes[b]);
                }
            }
        }
    }

    #[test]
    fn independent_noises_reproduce_the_correlations() {
        let stencil = JetStencil::new(&Neighbourhood::default(), (1.0, 1.0)).unwrap();
        for scheme in [TimeScheme::Central, TimeScheme::Backward] {
            let combination = Combination::of(3, scheme);
            let noise =
                PixelNoise::new(&stencil, combination, 12, None, 3.0, &Truncation::new(&stencil, combination, None));
            let w = combination.weights();
            for a in 0..3 {
                for b in 0..3 {
                    let want: f64 = w[a].iter().zip(&w[b]).map(|(x, y)| x * y).sum();
                    let got: f64 = noise.mixing.iter().map(|c| c[a] * c[b]).sum();
                    assert!((got - want).abs() < 1e-12);
                }
            }
        }
    }
}
