//! The result of an estimate.

use super::{motion::Motion, rows::Matrix5, rows::Vector5, rows::nested};
use crate::types::{Intrinsics, choices};
use nalgebra::{Matrix2, Matrix2x3, Matrix3x2, RowVector2, SVector, Vector2};

/// Whether an estimate is usable, or why not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Status {
    /// A motion with its covariance.
    Ok,
    /// Fewer than 12 points (or patches at fewer than 5 places): several motions may explain them exactly.
    /// Also too few to separate outliers from inliers: in large unknown noise, or where a tenth of the
    /// inliers are so by chance.
    FewPoints,
    /// Fewer than 5 points (or 2 patches): no motion.
    TooFewPoints,
    /// The flow is that of a rotation within its noise: `u` is NaN, inverse depths are 0.
    RotationOnly,
    /// Another motion explains the flow as well, and is among the alternatives: that of a plane, the opposite
    /// direction where depths do not exclude it, another minimum, that of other points in a robust search,
    /// that of the flow by itself where it contradicts what is known of the rotation.
    Ambiguous,
    /// The points do not determine all unknowns (then there is no covariance, or no motion), the direction's
    /// standard deviation exceeds 20 degrees or 1.5 times the field, its confidence interval has no end, or
    /// directions farther than the covariance has it explain the flow as well.
    IllConditioned,
    /// The depths are mostly noise: maximum likelihood's covariance is not known, and that of the smoothed
    /// weights is given.
    LowSnr,
}

choices!(Status:
    Ok "ok",
    FewPoints "few_points",
    TooFewPoints "too_few_points",
    RotationOnly "rotation_only",
    Ambiguous "ambiguous",
    IllConditioned "ill_conditioned",
    LowSnr "low_snr",
);

/// The maximum-likelihood solution beside the one that is returned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likelihood {
    /// The motion.
    pub motion: Motion,
    /// Covariance (17) of `(psi, w)`, row by row, in the axes `tangent`; NaN where it is not known.
    pub covariance: [[f64; 5]; 5],
    /// Axes of `psi`: two unit vectors perpendicular to `u`.
    pub tangent: [[f64; 3]; 2],
    /// `J`, the sum of squared residuals in units of noise.
    pub cost: f64,
}

/// Another motion that explains the flow about as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternative {
    /// The motion.
    pub motion: Motion,
    /// How much less likely it is, with its depths: in squared units of noise, like `J`; negative where
    /// maximum likelihood preferred it and the depths did not.
    pub excess: f64,
}

/// A motion with its uncertainty and the depths of N points.
#[derive(Debug, Clone)]
pub struct MotionEstimate {
    /// The motion of the scene relative to the camera; NaN where there is none.
    pub motion: Motion,
    /// How far it can be trusted.
    pub status: Status,
    /// Whether the smoothed weights were used: if not, the motion is that of maximum likelihood.
    pub efficient: bool,
    /// Whether the smoothed weights were requested but had no solution.
    pub fell_back: bool,
    /// Covariance of `(psi, w)`: `u + psi_1 tangent_1 + psi_2 tangent_2`, rad and rad/frame.
    pub covariance: [[f64; 5]; 5],
    /// Axes of `psi`: two unit vectors perpendicular to `u`.
    pub tangent: [[f64; 3]; 2],
    /// What is in the covariance of errors that all flow has in common.
    pub systematic_errors: SystematicEffect,
    /// The Cramér-Rao bound (8), with the information estimated; NaN where it is not known.
    pub bound: [[f64; 5]; 5],
    /// Standard deviation of the direction, `sqrt(tr psi)`, degrees; NaN where the covariance is not known,
    /// as that of 7 points and fewer in unknown noise.
    pub direction_std: f64,
    /// Standard deviations of the rotation, rad/frame.
    pub rotation_std: [f64; 3],
    /// `nu^` (N), in units of `|u|` per frame; NaN for points left out as unusable.
    pub inverse_depth: Vec<f64>,
    /// Standard deviations of `nu^` (N) for this motion; infinite at the epipole.
    pub inverse_depth_std: Vec<f64>,
    /// `nu~` (N), the depths in the weights; those of maximum likelihood are `nu^`. NaN for points left out.
    pub inverse_depth_smooth: Vec<f64>,
    /// `(nu, nu_x, nu_y)` in the weights (N), of six numbers a patch; else empty. Slopes are per unit of the
    /// plane at distance 1.
    pub surfaces: Vec<[f64; 3]>,
    /// Frames to contact (N), `-1 / (nu~ u_z)`: positive when approaching, infinite where there is no
    /// approach.
    pub time_to_contact: Vec<f64>,
    /// Standard deviations of those (N), of the depths and of the motion.
    pub time_to_contact_std: Vec<f64>,
    /// `nu u_z` of the points together and its standard deviation, 1/frame, weighted by what each point's own
    /// flow says: that of one object, or of the scene's mean. Its time to contact is `-1 / rate`.
    pub approach: (f64, f64),
    /// Inliers of the motion (N).
    pub inliers: Vec<bool>,
    /// Standard deviation of the flow, given or estimated, in its unit; 1 where covariances were given.
    pub noise_std: f64,
    /// Residuals across the epipolar lines (N), in units of noise; NaN for points left out as unusable.
    pub residuals: Vec<f64>,
    /// Other motions that explain the flow about as well, the best first.
    pub alternatives: Vec<Alternative>,
    /// The maximum-likelihood solution.
    pub likelihood: Likelihood,
}

impl MotionEstimate {
    /// The motion as [`contact_map`](crate::motion3d::contact_map) takes it.
    pub fn uncertain(&self) -> UncertainMotion {
        let Self { motion, tangent, covariance, systematic_errors, .. } = *self;
        UncertainMotion { motion, tangent, covariance, systematic_errors }
    }

    /// No motion, for N points.
    pub(crate) fn nothing(n: usize, status: Status, noise_std: f64) -> Self {
        let none = Motion { translation: [f64::NAN; 3], rotation: [f64::NAN; 3] };
        let (nowhere, unknown) = ([[f64::NAN; 3]; 2], [[f64::NAN; 5]; 5]);
        Self {
            motion: none,
            status,
            efficient: false,
            fell_back: false,
            covariance: unknown,
            tangent: nowhere,
            systematic_errors: SystematicEffect::default(),
            bound: unknown,
            direction_std: f64::NAN,
            rotation_std: [f64::NAN; 3],
            inverse_depth: vec![f64::NAN; n],
            inverse_depth_std: vec![f64::NAN; n],
            inverse_depth_smooth: vec![f64::NAN; n],
            surfaces: Vec::new(),
            time_to_contact: vec![f64::NAN; n],
            time_to_contact_std: vec![f64::NAN; n],
            approach: (f64::NAN, f64::NAN),
            inliers: vec![false; n],
            noise_std,
            residuals: vec![f64::NAN; n],
            alternatives: Vec::new(),
            likelihood: Likelihood { motion: none, covariance: unknown, tangent: nowhere, cost: f64::NAN },
        }
    }
}

/// The focus of expansion `K (u / u_z)` with its covariance from that of `(psi, w)` in the axes `tangent`
/// (px, px^2; without a camera on the plane at distance 1); `None` when `|u_z| < 1e-9`.
pub fn focus_of_expansion(
    motion: &Motion,
    tangent: &[[f64; 3]; 2],
    covariance: &[[f64; 5]; 5],
    camera: Option<&Intrinsics>,
) -> Option<([f64; 2], [[f64; 2]; 2])> {
    let [x, y, z] = motion.translation;
    if z.is_nan() || z.abs() < 1e-9 {
        return None;
    }
    let at = [x / z, y / z];
    // d(x / z) = (dx - (x / z) dz) / z.
    let slope = Matrix2x3::new(1.0, 0.0, -at[0], 0.0, 1.0, -at[1]) / z;
    let slope = camera.map_or(slope, |camera| camera.unscale() * slope);
    let slope = slope * Matrix3x2::from_fn(|i, j| tangent[j][i]);
    let block = Matrix2::from_fn(|i, j| covariance[i][j]);
    let of_focus = slope * block * slope.transpose();
    let at = camera.map_or(at, |camera| camera.to_pixel(at));
    Some((at, nested(&of_focus)))
}

/// What they do to a motion: its covariance has the squares of `motion` in it. Default: nothing.
///
/// What is computed from the same flow and the motion, as depths are, errs with both.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SystematicEffect {
    /// Standard deviation of the factor.
    pub scale: f64,
    /// Displacements of one standard deviation along both axes of the picture, on the plane at distance 1.
    pub displaced: [[f64; 2]; 2],
    /// What one standard deviation of the factor and each of these displacements do to `(psi, w)`, rad and
    /// rad/frame.
    pub motion: [[f64; 5]; 3],
}

impl SystematicEffect {
    /// What displacements of one standard deviation do to the motion.
    fn moves(&self) -> [Vector5; 3] {
        self.motion.map(SVector::from)
    }

    /// What is in the motion's covariance.
    pub(crate) fn added(&self) -> Matrix5 {
        self.moves().iter().map(|moved| moved * moved.transpose()).sum()
    }

    /// The variance of a value that is `value` times as large with all flow, by its slopes along `(psi, w)`
    /// and along a point's own flow on the plane at distance 1.
    pub(crate) fn variance(&self, value: f64, of_motion: &Vector5, of_flow: &RowVector2<f64>) -> f64 {
        let [_, along @ ..] = self.moves();
        let displaced = along.iter().zip(self.displaced.map(Vector2::from));
        let moved = displaced.map(|(moved, by)| (of_motion.dot(moved) + (of_flow * by)[0]).powi(2));
        (value * self.scale).powi(2) + moved.sum::<f64>()
    }
}

/// What times to contact need of a motion: that of a [`MotionEstimate`](crate::motion3d::MotionEstimate) by
/// [`uncertain`](crate::motion3d::MotionEstimate::uncertain).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainMotion {
    /// The motion of the scene relative to the camera.
    pub motion: Motion,
    /// Axes of `psi`: two unit vectors perpendicular to `u`.
    pub tangent: [[f64; 3]; 2],
    /// Covariance of `(psi, w)`, rad and rad/frame.
    pub covariance: [[f64; 5]; 5],
    /// What is in it of errors that all flow has in common, those of the points whose times are wanted too.
    pub systematic_errors: SystematicEffect,
}
