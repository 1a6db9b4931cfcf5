//! The noise of the jets, prepared for the lanes: factored, so that the covariance of the motion becomes a
//! sum of squares.

use crate::flow::model::Affine;
use crate::math::Real;

/// The noise of the jets as the lanes use it.
#[derive(Debug, Clone)]
pub(super) struct LaneNoise<T> {
    /// Entries of R above its diagonal that are not zero: row, column, value for columns already times the
    /// root of S. Last columns first.
    pub mixing: Vec<(usize, usize, T)>,
    /// K, lower triangle row by row, times the root of S.
    pub gains: [[T; 6]; 6],
    /// `sum_f |G_f C^(1/2)|^2` as a polynomial in m: constant, linear, upper triangle of the quadratic part
    /// with its mirror image added.
    pub constant: T,
    pub linear: [T; 6],
    pub quadratic: [T; 21],
    /// Variance of the pixel noise, where it is known.
    pub variance: Option<T>,
}

impl LaneNoise<f64> {
    /// From the covariance of a jet for unit noise, the weights of three frames in i, i', i'', and the pixel
    /// noise.
    pub fn new(jet: &[[f64; 6]; 6], weights: &[[f64; 3]; 3], pixel: Option<f64>) -> Self {
        let product = |a: usize, b: usize| -> f64 { (0..3).map(|f| weights[a][f] * weights[b][f]).sum() };
        let (mut mixing, spread) = factor(jet);
        for (i, j, value) in &mut mixing {
            *value *= (spread[*j] / spread[*i]).sqrt();
        }
        // Cholesky of W; what rounding makes of a zero pivot is taken for zero.
        let mut k = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..=i {
                let left = product(i, j) - (0..j).map(|l| k[i][l] * k[j][l]).sum::<f64>();
                k[i][j] = match (i == j, k[j][j] > 0.0) {
                    (true, _) => left.max(0.0).sqrt(),
                    (false, true) => left / k[j][j],
                    (false, false) => 0.0,
                };
            }
        }
        let lower = [k[0][0], k[1][0], k[1][1], k[2][0], k[2][1], k[2][2]];
        let gains = lower.map(|k| spread.map(|s| k * s.sqrt()));
        // Column j of L(m) is J(e_j) m.
        let columns: [[[f64; 6]; 6]; 6] = std::array::from_fn(|j| {
            let mut one = [0.0; 6];
            one[j] = 1.0;
            Affine::brightness_jacobian(&one)
        });
        let pairs = || (0..6).flat_map(|j| (0..6).map(move |l| (j, l)));
        let trace: f64 = (0..6).map(|j| jet[j][j]).sum();
        let linear = std::array::from_fn(|p| {
            let along: f64 = pairs().map(|(r, j)| columns[j][r][p] * jet[j][r]).sum();
            -2.0 * (product(0, 1) + product(1, 2)) * along
        });
        let mut quadratic = [0.0; 21];
        for (value, (p, q)) in quadratic.iter_mut().zip(triangle()) {
            let across: f64 = pairs()
                .map(|(j, l)| jet[j][l] * (0..6).map(|r| columns[j][r][p] * columns[l][r][q]).sum::<f64>())
                .sum();
            *value = (product(0, 0) + product(1, 1)) * across * if p == q { 1.0 } else { 2.0 };
        }
        let constant = (product(1, 1) + product(2, 2)) * trace;
        Self { mixing, gains, constant, linear, quadratic, variance: pixel.map(|sd| sd * sd) }
    }

    /// In working precision.
    pub fn cast<T: Real>(&self) -> LaneNoise<T> {
        LaneNoise {
            mixing: self.mixing.iter().map(|&(i, j, v)| (i, j, T::from_f64(v))).collect(),
            gains: self.gains.map(|row| row.map(T::from_f64)),
            constant: T::from_f64(self.constant),
            linear: self.linear.map(T::from_f64),
            quadratic: self.quadratic.map(T::from_f64),
            variance: self.variance.map(T::from_f64),
        }
    }
}

/// Places of the upper triangle, row by row.
pub(super) fn triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|i| (i..6).map(move |j| (i, j)))
}

/// `C = R S R^T`: R's entries above its unit diagonal, and the diagonal of S.
fn factor(c: &[[f64; 6]; 6]) -> (Vec<(usize, usize, f64)>, [f64; 6]) {
    let mut left = *c;
    let mut mixing = Vec::new();
    let mut spread = [0.0; 6];
    for k in (0..6).rev() {
        spread[k] = left[k][k].max(0.0);
        let column: [f64; 6] = std::array::from_fn(|i| if left[k][k] > 0.0 { left[i][k] / left[k][k] } else { 0.0 });
        for i in 0..k {
            for j in 0..k {
                left[i][j] -= column[i] * column[j] * spread[k];
            }
            // What is left of exact zeros after rounding is not worth a pass over the columns.
            if column[i] * column[i] * spread[k] > 1e-24 * c[i][i] {
                mixing.push((i, k, column[i]));
            }
        }
    }
    (mixing, spread)
}
