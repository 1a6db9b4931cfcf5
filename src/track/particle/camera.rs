//! Motion of the background: an affine map fitted to the corner tracks, robust against those on targets.

use crate::math::{median, random::CounterRng};

/// Triples of tracks that are tried (least median of squares; P. Rousseeuw, 1984).
const TRIPLES: u64 = 64;
/// Smallest determinant of a triple, in coordinates divided by the greatest distance from their mean.
const MIN_DETERMINANT: f64 = 1e-3;
/// Rounds of expectation and maximisation.
const ROUNDS: usize = 20;
/// Smallest standard deviation of the residual motion, px.
const MIN_RESIDUAL: f64 = 0.08;
/// Smallest range of the flow that outliers are spread over along each axis, px.
const MIN_RANGE: f64 = 4.0;
/// Bounds of the background's share of the tracks.
const SHARE: [f64; 2] = [0.05, 0.99];
/// Tracks that an affine map needs; fewer give a translation.
const AFFINE_TRACKS: usize = 12;
/// Tracks that a translation needs; fewer give no motion.
const TRANSLATION_TRACKS: usize = 3;
/// Median of the squared distance from the mean of a standard normal distribution of the plane, 2 log 2.
const MEDIAN_SQUARE: f64 = 2.0 * std::f64::consts::LN_2;

/// Motion of the background between two frames: `c(x) = shift + jacobian (x - origin)`, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CameraMotion {
    pub origin: [f64; 2],
    pub shift: [f64; 2],
    pub jacobian: [[f64; 2]; 2],
}

impl CameraMotion {
    /// A camera at rest.
    pub const NONE: Self = Self { origin: [0.0; 2], shift: [0.0; 2], jacobian: [[0.0; 2]; 2] };

    /// The motion with this affine map `(x', y') = A (x, y, 1)`.
    pub fn from_affine([[a, b, tx], [c, d, ty]]: [[f64; 3]; 2]) -> Self {
        Self { origin: [0.0; 2], shift: [tx, ty], jacobian: [[a - 1.0, b], [c, d - 1.0]] }
    }

    /// The affine map `(x', y') = A (x, y, 1)`.
    pub fn to_affine(self) -> [[f64; 3]; 2] {
        let [tx, ty] = self.at([0.0; 2]);
        let [[a, b], [c, d]] = self.jacobian;
        [[1.0 + a, b, tx], [c, 1.0 + d, ty]]
    }

    /// Displacement of the background at a place of the frame before.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (dx, dy) = (x - self.origin[0], y - self.origin[1]);
        [0, 1].map(|i| self.shift[i] + self.jacobian[i][0] * dx + self.jacobian[i][1] * dy)
    }

    /// This motion and then another one.
    pub fn then(&self, next: &Self) -> Self {
        let ([a, b], [c, d]) = (self.to_affine(), next.to_affine());
        let row = |next: [f64; 3]| {
            let at = |k: usize| next[0] * a[k] + next[1] * b[k];
            [at(0), at(1), at(2) + next[2]]
        };
        Self::from_affine([row(c), row(d)])
    }

    /// Where something at a place of the frame before is that moves relative to the background.
    pub fn carry(&self, place: [f64; 2], velocity: [f64; 2]) -> [f64; 2] {
        let c = self.at(place);
        [0, 1].map(|i| place[i] + c[i] + velocity[i])
    }

    /// By how much lengths grow: `exp(tr J / 2)`.
    pub fn growth(&self) -> f64 {
        (0.5 * (self.jacobian[0][0] + self.jacobian[1][1])).exp()
    }
}

/// The background's motion and, for each track, the probability that it follows it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Background {
    pub motion: CameraMotion,
    pub probability: Vec<f64>,
}

/// Fits the background's motion to the flow of tracks at `points`, px; a `known` motion is kept.
pub(super) fn fit_background(
    points: &[[f64; 2]],
    flow: &[[f64; 2]],
    known: Option<CameraMotion>,
    rng: CounterRng,
) -> Background {
    if points.len() < TRANSLATION_TRACKS {
        return Background { motion: known.unwrap_or(CameraMotion::NONE), probability: vec![1.0; points.len()] };
    }
    let origin = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / points.len() as f64);
    let middle = [0, 1].map(|i| median(&mut flow.iter().map(|f| f[i]).collect::<Vec<_>>()).unwrap_or(0.0));
    let translation = CameraMotion { origin, shift: middle, jacobian: [[0.0; 2]; 2] };
    let affine = points.len() >= AFFINE_TRACKS;
    let start = match known {
        Some(motion) => motion,
        None if affine => least_median(points, flow, translation, rng),
        None => translation,
    };
    let mut model = Model::begin(start, points, flow);
    for _ in 0..ROUNDS {
        model.expect(points, flow);
        model.maximise(points, flow, known.is_none().then_some(affine));
    }
    model.expect(points, flow);
    Background { motion: model.motion, probability: model.probability }
}

fn residual(motion: &CameraMotion, point: [f64; 2], flow: [f64; 2]) -> [f64; 2] {
    let c = motion.at(point);
    [flow[0] - c[0], flow[1] - c[1]]
}

fn median_square(motion: &CameraMotion, points: &[[f64; 2]], flow: &[[f64; 2]], squares: &mut Vec<f64>) -> f64 {
    squares.clear();
    squares.extend(points.iter().zip(flow).map(|(&point, &flow)| {
        let [u, v] = residual(motion, point, flow);
        u * u + v * v
    }));
    median(squares).unwrap_or(0.0)
}

/// The map through three tracks that leaves the least median of squared residuals, or the translation.
fn least_median(points: &[[f64; 2]], flow: &[[f64; 2]], translation: CameraMotion, rng: CounterRng) -> CameraMotion {
    let origin = translation.origin;
    let reach = points.iter().map(|p| (p[0] - origin[0]).hypot(p[1] - origin[1])).fold(0.0, f64::max);
    let mut squares = Vec::with_capacity(points.len());
    let mut best = (median_square(&translation, points, flow, &mut squares), translation);
    for k in 0..TRIPLES {
        let chosen = [0, 1, 2].map(|j| (rng.uniform(3 * k + j) * points.len() as f64) as usize);
        let rows = chosen.map(|j| [0, 1].map(|i| (points[j][i] - origin[i]) / reach));
        let targets = chosen.map(|j| flow[j]);
        let Some(motion) = through(rows, targets, origin, reach) else { continue };
        let left = median_square(&motion, points, flow, &mut squares);
        if left < best.0 {
            best = (left, motion);
        }
    }
    best.1
}

/// The affine map with these displacements at three places in scaled coordinates.
fn through(places: [[f64; 2]; 3], flow: [[f64; 2]; 3], origin: [f64; 2], reach: f64) -> Option<CameraMotion> {
    let [p, q, r] = places;
    let (a, b) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
    let determinant = a[0] * b[1] - a[1] * b[0];
    if determinant.is_nan() || determinant.abs() < MIN_DETERMINANT {
        return None;
    }
    let row = |i: usize| {
        let (fa, fb) = (flow[1][i] - flow[0][i], flow[2][i] - flow[0][i]);
        [(fa * b[1] - fb * a[1]) / determinant, (fb * a[0] - fa * b[0]) / determinant]
    };
    let jacobian = [row(0), row(1)];
    let shift = [0, 1].map(|i| flow[0][i] - jacobian[i][0] * p[0] - jacobian[i][1] * p[1]);
    Some(CameraMotion { origin, shift, jacobian: jacobian.map(|row| row.map(|d| d / reach)) })
}

/// A Gaussian about the affine motion, and outliers that are uniform over the range of the flow.
struct Model {
    motion: CameraMotion,
    /// Covariance of the residual motion: xx, xy, yy.
    covariance: [f64; 3],
    share: f64,
    /// Density of outliers, 1/px^2.
    outlier_density: f64,
    probability: Vec<f64>,
}

impl Model {
    fn begin(motion: CameraMotion, points: &[[f64; 2]], flow: &[[f64; 2]]) -> Self {
        let range = |i: usize| {
            let (low, high) =
                flow.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(f[i]), h.max(f[i])));
            (high - low).max(MIN_RANGE)
        };
        let variance = median_square(&motion, points, flow, &mut Vec::new()) / MEDIAN_SQUARE + MIN_RESIDUAL.powi(2);
        Self {
            motion,
            covariance: [variance, 0.0, variance],
            share: 0.5,
            outlier_density: 1.0 / (range(0) * range(1)),
            probability: vec![0.0; points.len()],
        }
    }

    fn expect(&mut self, points: &[[f64; 2]], flow: &[[f64; 2]]) {
        let [xx, xy, yy] = self.covariance;
        let determinant = xx * yy - xy * xy;
        let peak = self.share / (std::f64::consts::TAU * determinant.sqrt());
        let outliers = (1.0 - self.share) * self.outlier_density;
        for ((q, &point), &flow) in self.probability.iter_mut().zip(points).zip(flow) {
            let [u, v] = residual(&self.motion, point, flow);
            let square = (yy * u * u - 2.0 * xy * u * v + xx * v * v) / determinant;
            let inlier = peak * (-0.5 * square).exp();
            *q = inlier / (inlier + outliers);
        }
    }

    /// `affine`: whether the motion is affine or a translation; `None`: it stays.
    fn maximise(&mut self, points: &[[f64; 2]], flow: &[[f64; 2]], affine: Option<bool>) {
        let total: f64 = self.probability.iter().sum();
        if total.is_nan() || total <= 0.0 {
            return;
        }
        self.share = (total / points.len() as f64).clamp(SHARE[0], SHARE[1]);
        match affine {
            Some(true) => {
                let fitted = weighted_affine(points, flow, &self.probability, self.motion.origin);
                self.motion = fitted.unwrap_or(self.motion);
            }
            Some(false) => {
                let mean = |i: usize| self.probability.iter().zip(flow).map(|(q, f)| q * f[i]).sum::<f64>() / total;
                self.motion.shift = [mean(0), mean(1)];
            }
            None => {}
        }
        let mut sums = [0.0; 3];
        for ((&q, &point), &flow) in self.probability.iter().zip(points).zip(flow) {
            let [u, v] = residual(&self.motion, point, flow);
            for (sum, product) in sums.iter_mut().zip([u * u, u * v, v * v]) {
                *sum += q * product;
            }
        }
        let floor = MIN_RESIDUAL.powi(2);
        self.covariance = [sums[0] / total + floor, sums[1] / total, sums[2] / total + floor];
    }
}

/// Weighted least squares for the affine motion; `None` where the places do not determine it.
fn weighted_affine(points: &[[f64; 2]], flow: &[[f64; 2]], weights: &[f64], origin: [f64; 2]) -> Option<CameraMotion> {
    let mut normal = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Matrix3x2::<f64>::zeros();
    for ((&point, &flow), &weight) in points.iter().zip(flow).zip(weights) {
        let row = nalgebra::Vector3::new(1.0, point[0] - origin[0], point[1] - origin[1]);
        normal += row * row.transpose() * weight;
        right += row * nalgebra::RowVector2::new(flow[0], flow[1]) * weight;
    }
    let solution = normal.cholesky()?.solve(&right);
    let jacobian = [0, 1].map(|i| [solution[(1, i)], solution[(2, i)]]);
    solution.iter().all(|value| value.is_finite()).then_some(CameraMotion {
        origin,
        shift: [solution[(0, 0)], solution[(0, 1)]],
        jacobian,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tracks on a background that zooms, rolls and shifts; every fourth moves by itself.
    fn tracks(count: usize, noise: f64) -> (Vec<[f64; 2]>, Vec<[f64; 2]>, CameraMotion) {
        let rng = CounterRng::new(3);
        let truth = CameraMotion { origin: [0.0; 2], shift: [2.0, -1.0], jacobian: [[0.004, -0.003], [0.003, 0.004]] };
        let points: Vec<[f64; 2]> =
            (0..count as u64).map(|k| [360.0 * rng.uniform(4 * k), 240.0 * rng.uniform(4 * k + 1)]).collect();
        let flow = points.iter().zip(0u64..).map(|(&point, k)| {
            let c = truth.at(point);
            let own = if k % 4 == 3 { [4.0 * rng.uniform(4 * k + 2) + 1.0, 2.0] } else { [0.0; 2] };
            [0, 1].map(|i| c[i] + own[i] + noise * rng.normal(9_000 + 2 * k + i as u64))
        });
        let flow = flow.collect();
        (points, flow, truth)
    }

    #[test]
    fn zoom_and_roll_are_found_among_outliers() {
        let (points, flow, truth) = tracks(300, 0.05);
        let found = fit_background(&points, &flow, None, CounterRng::new(1));
        for place in [[0.0, 0.0], [360.0, 0.0], [180.0, 240.0]] {
            let (got, want) = (found.motion.at(place), truth.at(place));
            assert!((got[0] - want[0]).hypot(got[1] - want[1]) < 0.05, "{got:?} {want:?}");
        }
        for (k, q) in found.probability.iter().enumerate() {
            assert!(if k % 4 == 3 { *q < 0.05 } else { *q > 0.2 }, "{k} {q}");
        }
        assert!((found.motion.growth() - truth.growth()).abs() < 1e-3);
    }
}
