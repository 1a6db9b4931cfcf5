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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
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
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(from = "Saved", into = "Saved")]
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

/// The filter in plain numbers.
#[derive(serde::Serialize, serde::Deserialize)]
struct Saved {
    alpha: f64,
    q: f64,
    velocity: Velocity,
    x: [[f64; 3]; 2],
    p: [[[f64; 3]; 3]; 2],
}

impl From<Saved> for GaussMarkovFilter {
    fn from(Saved { alpha, q, velocity, x, p }: Saved) -> Self {
        Self { alpha, q, velocity, x: x.map(Into::into), p: p.map(Into::into) }
    }
}

impl From<GaussMarkovFilter> for Saved {
    fn from(GaussMarkovFilter { alpha, q, velocity, x, p }: GaussMarkovFilter) -> Self {
        Self { alpha, q, velocity, x: x.map(Into::into), p: p.map(Into::into) }
    }
}

/// Unscaled by the state: `alpha`, `q` and the variances of the start.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
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
        // Innovations of sequential scalar updates are independent: their squares sum to the total.
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
