//! Small dense least squares without allocation: Householder QR, then one-sided Jacobi SVD of R.
//!
//! For ill-conditioned pixels of the per-pixel estimators: normal equations square the condition number, this
//! does not. (G. Golub, C. Van Loan, "Matrix Computations", 4th ed., 5.2 and 8.6; J. Demmel, K. Veselic 1992
//! for the relative accuracy of Jacobi.)

/// Smallest singular value of the column-scaled system, relative to the largest, that counts as rank.
pub(super) const RANK_TOLERANCE: f64 = 1e-9;

/// Least-squares solution of `A x = b`, A of N rows and P columns.
#[derive(Debug, Clone, Copy)]
pub struct Solution<const N: usize, const P: usize> {
    /// The solution: unique where `rank == P`, else the one of least norm.
    pub x: [f64; P],
    /// Rank of A, columns scaled to length 1.
    pub rank: usize,
    /// Largest over smallest singular value of the column-scaled A (infinite when one is zero).
    pub condition: f64,
    /// `|b - A x|^2`.
    pub residual_square: f64,
    /// The pseudo-inverse, so that `x = inverse b`.
    pub inverse: [[f64; N]; P],
}

/// Solves `A x = b` in the least-squares sense and decides the rank of A.
///
/// `floor`: standard deviation of the rounding noise in each entry of A, in the units of A. Columns and
/// singular values that such noise explains count as zero; scaling A, b and `floor` together changes nothing,
/// nor does scaling a column.
pub fn solve<const N: usize, const P: usize>(a: &[[f64; P]; N], b: &[f64; N], floor: f64) -> Solution<N, P> {
    let noise = floor * (N as f64).sqrt();
    let mut scale = [0.0; P];
    let mut threshold = RANK_TOLERANCE;
    for k in 0..P {
        let norm = a.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        if norm > noise {
            scale[k] = norm;
            threshold = threshold.max(noise / norm);
        }
    }
    let scaled: [[f64; P]; N] = std::array::from_fn(|i| std::array::from_fn(|k| a[i][k] * reciprocal(scale[k])));
    let factors = decompose(&scaled);
    let largest = factors.sigma.iter().copied().fold(0.0, f64::max);
    let rank = factors.sigma.iter().filter(|&&s| s > threshold * largest && s > 0.0).count();
    let smallest = factors.sigma.iter().copied().fold(f64::INFINITY, f64::min);
    let condition = if smallest > 0.0 { largest / smallest } else { f64::INFINITY };
    let inverse = if rank == P {
        let mut inverse = factors.pseudo_inverse(rank);
        for k in 0..P {
            for v in &mut inverse[k] {
                *v /= scale[k];
            }
        }
        inverse
    } else {
        // Least norm is meant in the unknowns' own units, so the columns go unscaled here.
        decompose(a).pseudo_inverse(rank)
    };
    let x: [f64; P] = std::array::from_fn(|k| inverse[k].iter().zip(b).map(|(w, b)| w * b).sum());
    let residual = |i: usize| b[i] - a[i].iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
    let residual_square = (0..N).map(|i| residual(i).powi(2)).sum();
    Solution { x, rank, condition, residual_square, inverse }
}

fn reciprocal(v: f64) -> f64 {
    if v > 0.0 { 1.0 / v } else { 0.0 }
}

/// `A = Q W V^T` with orthonormal Q (N x P), orthogonal columns of W of length sigma, and orthogonal V.
struct Factors<const N: usize, const P: usize> {
    /// The Householder vectors, below and on the diagonal, and their factors.
    reflectors: [[f64; P]; N],
    tau: [f64; P],
    /// Columns of W, each as an array.
    w: [[f64; P]; P],
    v: [[f64; P]; P],
    sigma: [f64; P],
}

fn decompose<const N: usize, const P: usize>(a: &[[f64; P]; N]) -> Factors<N, P> {
    let mut h = *a;
    let mut tau = [0.0; P];
    let mut r = [[0.0; P]; P]; // columns
    for k in 0..P.min(N) {
        let norm = h[k..].iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt();
        if norm > 0.0 {
            let alpha = if h[k][k] > 0.0 { -norm } else { norm };
            let head = h[k][k] - alpha;
            // v = (1, h[k+1..] / head): tau = 2 / |v|^2.
            for row in &mut h[k + 1..] {
                row[k] /= head;
            }
            h[k][k] = 1.0;
            tau[k] = -head / alpha;
            for j in k + 1..P {
                let dot: f64 = h[k..].iter().map(|row| row[k] * row[j]).sum();
                for row in &mut h[k..] {
                    row[j] -= tau[k] * dot * row[k];
                }
            }
            r[k][k] = alpha;
        }
        for j in k + 1..P {
            r[j][k] = h[k][j];
        }
    }
    let (w, v) = jacobi(r);
    let sigma = w.map(|column| length(&column));
    Factors { reflectors: h, tau, w, v, sigma }
}

/// Rotates the columns of R until they are orthogonal: `W = R V`.
fn jacobi<const P: usize>(mut w: [[f64; P]; P]) -> ([[f64; P]; P], [[f64; P]; P]) {
    let mut v: [[f64; P]; P] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _sweep in 0..40 {
        let mut turned = false;
        for i in 0..P {
            for j in i + 1..P {
                let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
                for r in 0..P {
                    aa += w[i][r] * w[i][r];
                    bb += w[j][r] * w[j][r];
                    ab += w[i][r] * w[j][r];
                }
                if ab.abs() <= 1e-15 * (aa * bb).sqrt() || ab == 0.0 {
                    continue;
                }
                turned = true;
                let zeta = (bb - aa) / (2.0 * ab);
                let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let c = 1.0 / t.hypot(1.0);
                let s = c * t;
                for m in [&mut w, &mut v] {
                    for r in 0..P {
                        let (x, y) = (m[i][r], m[j][r]);
                        m[i][r] = c * x - s * y;
                        m[j][r] = s * x + c * y;
                    }
                }
            }
        }
        if !turned {
            break;
        }
    }
    (w, v)
}

fn length(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl<const N: usize, const P: usize> Factors<N, P> {
    /// `V S^+ U^T Q^T`, keeping the `rank` largest singular values.
    fn pseudo_inverse(&self, rank: usize) -> [[f64; N]; P] {
        let mut order: [usize; P] = std::array::from_fn(|k| k);
        order.sort_by(|&i, &j| self.sigma[j].total_cmp(&self.sigma[i]));
        let mut inner = [[0.0; P]; P]; // V S^-2 W^T
        for &k in &order[..rank] {
            let s2 = self.sigma[k] * self.sigma[k];
            for i in 0..P {
                for j in 0..P {
                    inner[i][j] += self.v[k][i] * self.w[k][j] / s2;
                }
            }
        }
        let mut out = [[0.0; N]; P];
        for (row, coefficients) in out.iter_mut().zip(&inner) {
            // Row of inner times Q^T = Q applied to the row, padded with zeros.
            row[..P.min(N)].copy_from_slice(&coefficients[..P.min(N)]);
            for k in (0..P.min(N)).rev() {
                let dot: f64 = (k..N).map(|r| self.reflectors[r][k] * row[r]).sum();
                for r in k..N {
                    row[r] -= self.tau[k] * dot * self.reflectors[r][k];
                }
            }
        }
        out
    }
}
