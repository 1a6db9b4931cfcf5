//! The paper's filter: position, velocity and acceleration of each axis, the acceleration a first-order
//! Gauss-Markov sequence.
//!
//! M. Chiba and S. Ozawa, equations (12) to (24). Unit of time is the frame. Per axis `F = [1 1 1/2; 0 1 1; 0
//! 0 alpha]`, `Q = diag(0, 0, q)`, `R = diag(r_pos, r_vel)`. What flow measures is the mean velocity since
//! the frame before, `x' - x'' / (2 alpha)`: that is the second row of H here. With [`Velocity::AsPrinted`]
//! it is `x'`.

use crate::filter::update_by_scalar;
use nalgebra::{Matrix3, RowVector3, Vector3};

/// What the measured velocity is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Velocity {
    /// The mean since the frame before: `H = [0 1 -1/(2 alpha)]`, correct for (23).
    #[default]
    Mean,
    /// The velocity at the frame: `H = [0 1 0]`, as (24) is printed.
    AsPrinted,
}

/// A measurement of both axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measurement {
    /// Position `(x, y)`, px, with its variance along x and y, px^2.
    pub position: Option<([f64; 2], [f64; 2])>,
    /// Step since the frame before, px/frame, with its variance.
    pub velocity: Option<([f64; 2], [f64; 2])>,
}

/// The filter of both axes, which are independent.
#[derive(Debug, Clone, PartialEq)]
pub struct GaussMarkovFilter {
    /// Correlation of the acceleration from frame to frame.
    pub alpha: f64,
    /// Variance of what drives the acceleration, (px/frame^2)^2.
    pub q: f64,
    /// What the measured velocity is.
    pub velocity: Velocity,
    /// (position, velocity, acceleration) along x and y, px and frames.
    pub x: [Vector3<f64>; 2],
    /// Their covariances.
    pub p: [Matrix3<f64>; 2],
}

/// Unscaled by the state: `alpha`, `q` and the variances of the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// See [`GaussMarkovFilter::alpha`].
    pub alpha: f64,
    /// See [`GaussMarkovFilter::q`].
    pub q: f64,
    /// Variances of position, velocity and acceleration at the start (21)(22).
    pub start: [f64; 3],
}

impl Default for Dynamics {
    fn default() -> Self {
        Self { alpha: 0.8, q: 0.5, start: [1.0, 4.0, 1.0] }
    }
}

impl GaussMarkovFilter {
    /// At rest at a position.
    pub fn new(position: [f64; 2], dynamics: Dynamics, velocity: Velocity) -> Self {
        let start = Matrix3::from_diagonal(&Vector3::from(dynamics.start));
        Self {
            alpha: dynamics.alpha,
            q: dynamics.q,
            velocity,
            x: position.map(|at| Vector3::new(at, 0.0, 0.0)),
            p: [start; 2],
        }
    }

    /// To the next frame (19)(20).
    pub fn predict(&mut self) {
        let f = Matrix3::new(1.0, 1.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, self.alpha);
        for (x, p) in self.x.iter_mut().zip(&mut self.p) {
            *x = f * *x;
            *p = f * *p * f.transpose();
            p[(2, 2)] += self.q;
        }
    }

    /// Rows of H with what they measure along an axis: value and variance.
    fn rows(&self, axis: usize, z: &Measurement) -> [Option<(RowVector3<f64>, f64, f64)>; 2] {
        let lag = match self.velocity {
            Velocity::Mean => -0.5 / self.alpha,
            Velocity::AsPrinted => 0.0,
        };
        let row = |h: RowVector3<f64>, measured: Option<([f64; 2], [f64; 2])>| {
            measured.map(|(value, variance)| (h, value[axis], variance[axis]))
        };
        [row(RowVector3::new(1.0, 0.0, 0.0), z.position), row(RowVector3::new(0.0, 1.0, lag), z.velocity)]
    }

    /// Normalised innovation squared of a measurement, both axes together: chi squared with as many degrees
    /// of freedom as numbers were measured.
    pub fn innovation(&self, z: &Measurement) -> f64 {
        let mut after = self.clone();
        // The innovations of rows taken one after the other are independent, and their squares add up to that
        // of all.
        (0..2).map(|axis| after.update_axis(axis, z)).sum()
    }

    /// Takes a measurement (16)(17), with the covariance in Joseph's form (18); returns its normalised
    /// innovation squared.
    pub fn update(&mut self, z: &Measurement) -> f64 {
        (0..2).map(|axis| self.update_axis(axis, z)).sum()
    }

    fn update_axis(&mut self, axis: usize, z: &Measurement) -> f64 {
        let rows = self.rows(axis, z);
        let (x, p) = (&mut self.x[axis], &mut self.p[axis]);
        let mut square = 0.0;
        for (h, value, r) in rows.into_iter().flatten() {
            square += update_by_scalar(x, p, &h, (value, r));
        }
        square
    }

    /// Position `(x, y)`, px.
    pub fn position(&self) -> [f64; 2] {
        [self.x[0][0], self.x[1][0]]
    }

    /// Velocity, px/frame.
    pub fn speed(&self) -> [f64; 2] {
        [self.x[0][1], self.x[1][1]]
    }

    /// Acceleration, px/frame^2.
    pub fn acceleration(&self) -> [f64; 2] {
        [self.x[0][2], self.x[1][2]]
    }

    /// Covariances along x and y.
    pub fn covariance(&self) -> [[[f64; 3]; 3]; 2] {
        self.p.map(|p| std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (p[(i, j)] + p[(j, i)]))))
    }

    /// Moves the position without moving anything else: the camera turned.
    pub fn shift(&mut self, by: [f64; 2]) {
        self.x.iter_mut().zip(by).for_each(|(x, by)| x[0] += by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(position: [f64; 2], velocity: [f64; 2], r: [f64; 2]) -> Measurement {
        Measurement { position: Some((position, [r[0]; 2])), velocity: Some((velocity, [r[1]; 2])) }
    }

    #[test]
    fn the_steady_gain_as_printed_is_that_of_the_riccati_equation() {
        let mut f = GaussMarkovFilter::new([0.0; 2], Dynamics::default(), Velocity::AsPrinted);
        let z = measured([0.0; 2], [0.0; 2], [1.0, 0.25]);
        for _ in 0..400 {
            f.predict();
            f.update(&z);
        }
        let p = f.p[0];
        for (k, want) in [0.3543, 0.1879, 0.629].into_iter().enumerate() {
            assert!((p[(k, k)] - want).abs() < 1e-3, "{k}: {}", p[(k, k)]);
        }
        // K = P H' R^-1 with the covariance after the update.
        let want = [[0.3543, 0.3795], [0.0949, 0.7517], [-0.0079, 0.4635]];
        for (i, row) in want.into_iter().enumerate() {
            for (j, want) in row.into_iter().enumerate() {
                let gain = p[(i, j)] / [1.0, 0.25][j];
                assert!((gain - want).abs() < 1e-3, "{i} {j}: {gain}");
            }
        }
    }

    #[test]
    fn the_mean_velocity_of_a_circle_is_taken_for_what_it_is() {
        // On a circle the mean velocity lags by half a frame; as printed that is an error.
        let rmse = |velocity: Velocity, period: f64| {
            let dynamics = Dynamics { q: 0.05, ..Dynamics::default() };
            let w = std::f64::consts::TAU / period;
            let at = |k: i32| [24.0 * (w * f64::from(k)).cos(), 24.0 * (w * f64::from(k)).sin()];
            let mut f = GaussMarkovFilter::new(at(0), dynamics, velocity);
            let (mut sum, mut count) = (0.0, 0);
            for k in 1..400 {
                f.predict();
                let (now, before) = (at(k), at(k - 1));
                f.update(&measured(now, [now[0] - before[0], now[1] - before[1]], [0.05, 0.05]));
                if k > 60 {
                    sum += (f.x[0][1] + 24.0 * w * (w * f64::from(k)).sin()).powi(2);
                    count += 1;
                }
            }
            (sum / f64::from(count)).sqrt()
        };
        for period in [50.0, 25.0] {
            assert!(rmse(Velocity::Mean, period) < 0.95 * rmse(Velocity::AsPrinted, period));
        }
    }

    #[test]
    fn innovations_are_those_of_the_joint_measurement_and_nothing_measured_changes_nothing() {
        let mut f = GaussMarkovFilter::new([3.0, 4.0], Dynamics::default(), Velocity::Mean);
        f.predict();
        let before = f.clone();
        assert_eq!(f.update(&Measurement::default()), 0.0);
        assert_eq!(f, before);
        let z = measured([4.0, 4.0], [0.5, 0.0], [1.0, 0.25]);
        let want: f64 = (0..2)
            .map(|axis| {
                let h = nalgebra::Matrix2x3::new(1.0, 0.0, 0.0, 0.0, 1.0, -0.5 / 0.8);
                let s = h * f.p[axis] * h.transpose() + nalgebra::Matrix2::new(1.0, 0.0, 0.0, 0.25);
                let y = nalgebra::Vector2::new([4.0, 4.0][axis], [0.5, 0.0][axis]) - h * f.x[axis];
                (y.transpose() * s.try_inverse().unwrap() * y)[0]
            })
            .sum();
        assert!((f.innovation(&z) - want).abs() < 1e-12);
        assert_eq!(f, before);
        f.shift([2.0, -1.0]);
        assert_eq!(f.position(), [5.0, 3.0]);
    }
}
