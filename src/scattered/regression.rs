//! Values predicted from neighbours: leave-one-out local-linear regression, a point in every lane.

use super::tree::Neighbours;
use crate::math::tangents;
use crate::parallel;
use crate::simd::{Kernel, Lanes, Level, dispatch};
use nalgebra::{Matrix2x3, Vector3};

/// Points of one task; a multiple of every lane count.
const BAND: usize = 256;

/// Weight that the farthest neighbour keeps.
const TAIL: f64 = 0.001;

/// Share of the points' weight that is added to their spread, so that points on one line determine a line.
const RIDGE: f64 = 1e-9;

/// Noise variance of a prediction that nothing is known for.
pub(crate) const NO_PREDICTION: f64 = 1e30;

/// Most lanes.
const ALIGN: usize = 16;

/// What a regression needs of a point, by its place in the tree: where it is, its value and the inverse
/// variance of that.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Site {
    pub at: [f64; 3],
    pub value: f64,
    pub precision: f64,
}

/// Predictions `q` and the variances `c` that noise of the neighbours gives them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Prediction {
    pub q: Vec<f64>,
    pub c: Vec<f64>,
}

struct Regress<'a> {
    sites: &'a [Site],
    queries: &'a [u32],
    neighbours: &'a Neighbours,
    /// Index of the first of `queries` in `neighbours`.
    first: usize,
    k: usize,
    spherical: bool,
    q: &'a mut [f64],
    c: &'a mut [f64],
}

/// A neighbour as a point sees it, in units of its reach: place, squared distance, value and its precision.
#[inline(always)]
fn seen_from(from: &Site, site: &Site, axes: Option<&Matrix2x3<f64>>, scale: f64) -> [f64; 5] {
    let d = [0, 1, 2].map(|i| (site.at[i] - from.at[i]) * scale);
    let [x, y] = match axes {
        None => [d[0], d[1]],
        Some(e) => [0, 1].map(|i| e[(i, 0)] * d[0] + e[(i, 1)] * d[1] + e[(i, 2)] * d[2]),
    };
    [x, y, d[0] * d[0] + d[1] * d[1] + d[2] * d[2], site.value, site.precision]
}

impl Kernel<f64> for Regress<'_> {
    type Output = ();
    #[inline(always)]
    fn run<V: Lanes<Scalar = f64>>(self) {
        // Neighbours of the same number of a point in every lane.
        let mut group = [[0.0; ALIGN]; 5];
        let (one, tail) = (V::constant(1.0), V::constant(TAIL));
        for start in (0..self.queries.len()).step_by(V::LANES) {
            let lanes = V::LANES.min(self.queries.len() - start);
            let mut from = [Site::default(); ALIGN];
            let mut axes = [None; ALIGN];
            let mut scale = [0.0; ALIGN];
            for lane in 0..lanes {
                from[lane] = self.sites[self.queries[start + lane] as usize];
                if self.spherical {
                    axes[lane] = Some(tangents(&Vector3::from(from[lane].at)));
                }
                let last = &self.sites[self.neighbours.of(self.first + start + lane)[self.k - 1] as usize].at;
                let d = [last[0] - from[lane].at[0], last[1] - from[lane].at[1], last[2] - from[lane].at[2]];
                let reach = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
                scale[lane] = if reach > 0.0 { 1.0 / reach } else { 0.0 };
            }
            // Sums over neighbours: X^t Omega X, X^t Omega value, X^t Omega V Omega X with rows (1, x, y).
            let mut n = [V::zero(); 6];
            let mut b = [V::zero(); 3];
            let mut v = [V::zero(); 6];
            for j in 0..self.k {
                for lane in 0..lanes {
                    let place = self.neighbours.of(self.first + start + lane)[j];
                    let site = &self.sites[place as usize];
                    let seen = seen_from(&from[lane], site, axes[lane].as_ref(), scale[lane]);
                    for (values, value) in group.iter_mut().zip(seen) {
                        values[lane] = value;
                    }
                }
                let (x, y) = (V::load(&group[0]), V::load(&group[1]));
                // The farthest is at 1 up to the rounding of distances.
                let d2 = V::load(&group[2]).min(one);
                let near = one - d2 * d2.sqrt();
                let kappa = near.mul_add(near, tail);
                let omega = kappa * V::load(&group[4]);
                let noise = kappa * omega;
                let products = [one, x, y, x * x, x * y, y * y];
                let value = V::load(&group[3]) * omega;
                for i in 0..6 {
                    n[i] = omega.mul_add(products[i], n[i]);
                    v[i] = noise.mul_add(products[i], v[i]);
                }
                for i in 0..3 {
                    b[i] = value.mul_add(products[i], b[i]);
                }
            }
            let ridge = n[0] * V::constant(RIDGE);
            let (xx, yy) = (n[3] + ridge, n[5] + ridge);
            // The first row of the inverse, times the determinant.
            let first = xx.mul_add(yy, -(n[4] * n[4]));
            let second = n[2].mul_add(n[4], -(n[1] * yy));
            let third = n[1].mul_add(n[4], -(n[2] * xx));
            let determinant = n[0].mul_add(first, n[1].mul_add(second, n[2] * third));
            let known = V::zero().lt(determinant);
            let inverse = one / determinant;
            let q = first.mul_add(b[0], second.mul_add(b[1], third * b[2])) * inverse;
            let mixed = first.mul_add(second * v[1], first.mul_add(third * v[2], second * third * v[4]));
            let pure = first.mul_add(first * v[0], second.mul_add(second * v[3], third * third * v[5]));
            let c = (mixed + mixed + pure) * inverse * inverse;
            let (mut at_q, mut at_c) = ([0.0; ALIGN], [0.0; ALIGN]);
            V::select(known, q, V::zero()).store(&mut at_q);
            V::select(known, c, V::constant(NO_PREDICTION)).store(&mut at_c);
            self.q[start..start + lanes].copy_from_slice(&at_q[..lanes]);
            self.c[start..start + lanes].copy_from_slice(&at_c[..lanes]);
        }
    }
}

/// Predicts the value of each of `queries` (places in the tree) from the `k` nearest of its neighbours,
/// itself left out.
///
/// Weights `(1 - (d / h)^3)^2 + 0.001` times the precision, with the distance `h` of the `k`-th; `c = sum
/// l_j^2 v_j` of the smoother's weights `l`.
pub(crate) fn regress(
    sites: &[Site],
    queries: &[u32],
    neighbours: &Neighbours,
    k: usize,
    spherical: bool,
    level: Level,
) -> Prediction {
    let mut out = Prediction { q: vec![0.0; queries.len()], c: vec![0.0; queries.len()] };
    let bands = out.q.chunks_mut(BAND).zip(out.c.chunks_mut(BAND)).zip(queries.chunks(BAND)).enumerate();
    parallel::for_each(bands, |(band, ((q, c), queries))| {
        let first = band * BAND;
        dispatch(level, Regress { sites, queries, neighbours, first, k, spherical, q, c });
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::CounterRng;
    use crate::scattered::Tree;
    use nalgebra::{DMatrix, DVector};

    /// The same by matrices.
    fn plain(sites: &[Site], from: &Site, nearest: &[u32], axes: &Matrix2x3<f64>) -> (f64, f64) {
        let to = |j: &u32| Vector3::from(sites[*j as usize].at) - Vector3::from(from.at);
        let reach = nearest.iter().map(|j| to(j).norm()).fold(0.0, f64::max);
        let rows: Vec<_> = nearest.iter().map(|j| axes * to(j)).collect();
        let x = DMatrix::from_fn(rows.len(), 3, |i, j| if j == 0 { 1.0 } else { rows[i][j - 1] });
        let kappa = |j: &u32| (1.0 - (to(j).norm() / reach).powi(3)).powi(2) + 0.001;
        let omega = DMatrix::from_diagonal(&DVector::from_iterator(
            nearest.len(),
            nearest.iter().map(|j| kappa(j) * sites[*j as usize].precision),
        ));
        let value = DVector::from_iterator(nearest.len(), nearest.iter().map(|&j| sites[j as usize].value));
        let solve = (x.transpose() * &omega * &x).try_inverse().unwrap() * x.transpose() * omega;
        let c = nearest.iter().enumerate().map(|(i, &j)| solve[(0, i)].powi(2) / sites[j as usize].precision).sum();
        ((solve * value)[0], c)
    }

    #[test]
    fn lanes_agree_with_matrices_on_the_plane_and_on_the_sphere() {
        let rng = CounterRng::new(8);
        for spherical in [false, true] {
            let at = |k: u64| {
                let p = [0, 1, 2].map(|i| rng.normal(3 * k + i));
                if spherical { Vector3::from(p).normalize().into() } else { [p[0], p[1], 0.0] }
            };
            let tree = Tree::new(&(0..150).map(at).collect::<Vec<_>>());
            let site = |(i, &at): (usize, &[f64; 3])| Site {
                at,
                value: rng.stream(1).normal(i as u64),
                precision: 0.5 + rng.stream(2).uniform(i as u64),
            };
            let sites: Vec<Site> = tree.points().iter().enumerate().map(site).collect();
            let queries: Vec<u32> = (0..150).step_by(7).collect();
            let lists = tree.nearest(&queries, 32);
            for k in [8, 32] {
                let got = regress(&sites, &queries, &lists, k, spherical, Level::detect());
                for (i, &place) in queries.iter().enumerate() {
                    let from = &sites[place as usize];
                    let flat = Matrix2x3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0);
                    let axes = if spherical { tangents(&Vector3::from(from.at)) } else { flat };
                    let (q, c) = plain(&sites, from, &lists.of(i)[..k], &axes);
                    assert!((got.q[i] - q).abs() < 1e-5 * q.abs().max(1.0), "{} {q}", got.q[i]);
                    assert!((got.c[i] - c).abs() < 1e-5 * c, "{} {c}", got.c[i]);
                }
            }
        }
    }
}
