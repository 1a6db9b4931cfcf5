//! What is given and how it is worked on.

use super::camera::Intrinsics;
use super::motion::{Motion, Projection, tangents};
use super::result::MotionEstimate;
use crate::error::{Error, Result, numbers};
use crate::motion3d::diagnostics::rotation_prior::Known;
use crate::motion3d::diagnostics::systematic_errors::CommonErrors;
use crate::motion3d::solver::smoothing::Smoother;
use crate::parallel::Threads;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Points with their flow, N of each.
#[derive(Debug, Clone, Copy)]
pub enum Flow<'a> {
    /// On the picture.
    Plane {
        /// Where, px with a camera, else on the plane at distance 1.
        points: &'a [[f64; 2]],
        /// Displacement over one frame, in the same unit.
        flow: &'a [[f64; 2]],
        /// The camera; `None`: everything is on the plane at distance 1.
        camera: Option<&'a Intrinsics>,
    },
    /// On the unit sphere.
    Sphere {
        /// Bearings of length 1.
        bearings: &'a [[f64; 3]],
        /// Their rates of change, rad/frame; parts along the bearings do not count.
        flow: &'a [[f64; 3]],
    },
}

/// Noise of the flow.
#[derive(Debug, Clone, Copy, Default)]
pub enum Noise<'a> {
    /// The same everywhere; its size is estimated from the residuals.
    #[default]
    Unknown,
    /// Standard deviation of each component, in the unit of the flow.
    Sigma(f64),
    /// A covariance for every point, row by row: 4 values on the plane, 9 on the sphere, in squared units of
    /// the flow. Points whose covariance is not finite are left out; others must be symmetric and positive
    /// definite, on the sphere across the bearing. A point whose smaller variance is below a millionth of the
    /// lower quartile of all has that quartile added: no measurement is so much better than others, and one
    /// that says so would decide alone.
    Covariances(&'a [f64]),
}

/// Which estimator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// [`Method::Efficient`] from 30 points on, [`Method::MaximumLikelihood`] below.
    #[default]
    Auto,
    /// The least residuals across the epipolar lines: (3), (4).
    MaximumLikelihood,
    /// The estimating equation whose weights have smoothed depths: (19), (25).
    Efficient,
}

/// Where on its path a displacement is taken to be the instantaneous flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Placement {
    /// Half way: exact to second order.
    #[default]
    Midpoint,
    /// Where the point was: for flow that is instantaneous already.
    Start,
}

/// A rotation rate known from elsewhere: a gyroscope, or the rest of the scene where the points lie on a
/// thing that moves by itself.
///
/// In a narrow field a rotation looks like a sideways translation; what is known of it decides between both.
/// Where flow contradicts it beyond chance the status is [`Ambiguous`](crate::motion3d::Status::Ambiguous); of a
/// rotation alone the covariance and the alternative tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationPrior {
    /// Rotation rate `w`, rad/frame.
    pub rotation: [f64; 3],
    /// Its covariance, row by row.
    pub covariance: [[f64; 3]; 3],
}

impl RotationPrior {
    /// What a scene's rotation says of that of a thing in it, which may turn by itself by `turning` (standard
    /// deviation about each axis, rad/frame). `None` where the scene's is not known.
    pub fn of_scene(scene: &MotionEstimate, turning: f64) -> Option<Self> {
        Self::beside(scene.motion.rotation, &scene.covariance, turning)
    }

    /// The same from the scene's rotation and the covariance of its `(psi, w)`.
    pub fn beside(rotation: [f64; 3], covariance: &[[f64; 5]; 5], turning: f64) -> Option<Self> {
        let own = |i, j| if i == j { turning * turning } else { 0.0 };
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| covariance[2 + i][2 + j] + own(i, j)));
        let known = Self { rotation, covariance };
        known.rotation.iter().chain(covariance.as_flattened()).all(|value| value.is_finite()).then_some(known)
    }
}

/// Options of [`estimate_motion`](crate::motion3d::estimate_motion).
#[derive(Debug, Clone, Default)]
pub struct MotionOptions {
    /// Which estimator; default: by the number of points.
    pub method: Method,
    /// Whether points that do not obey the motion are found and left out; default: no.
    pub robust: bool,
    /// Where displacements belong on the plane; default: half way. Bearings and their flow are taken as
    /// given.
    pub placement: Placement,
    /// Which predictors smooth depths for the weights; default: the better one.
    pub smoother: Smoother,
    /// Inverse depths for the weights, one for each point, known from elsewhere up to a common factor; points
    /// whose value is not finite are left out; default: smoothed from the flow.
    pub weight_depths: Option<Vec<f64>>,
    /// A motion near which the minimum is looked for, instead of everywhere; not with `robust`.
    pub initial: Option<Motion>,
    /// What is known of the rotation beforehand; default: nothing.
    pub rotation_prior: Option<RotationPrior>,
    /// How many points share one error, at least 1: the noise given is so many times their own in variance,
    /// so that together they tell no more than they know. What is an outlier, and what chance explains, is
    /// judged by their own. Default: 1.
    pub shared: Option<f64>,
    /// How far errors of neighbours go together, in the unit of the points (px with a camera, rad on the
    /// sphere), as those of windowed flow do: the covariance is then that of the sums over points whose
    /// errors correlate (`together`), in no direction smaller than that of independent points. Default: not
    /// at all.
    pub correlation_length: Option<f64>,
    /// Errors that all flow has in common, as flow from gradients has them. Default: none.
    pub common: CommonErrors,
    /// Seed of the random choices; default: 0.
    pub random_state: u64,
    /// Number of threads; the result does not depend on it.
    pub threads: Threads,
}

impl MotionOptions {
    pub(crate) fn check(&self, flow: &Flow<'_>, noise: &Noise<'_>) -> Result<()> {
        if let Some(depths) = self.weight_depths.as_ref().filter(|depths| depths.len() != flow.len()) {
            let expected = format!("{} values, one for each point", flow.len());
            return Err(Error::argument("weight_inv_depth", expected, depths.len()));
        }
        self.check_in_front()?;
        if let Some(prior) = self.rotation_prior.as_ref().filter(|prior| Known::new(prior).is_none()) {
            let expected = "a finite rotation with a positive definite covariance";
            let (rotation, covariance) = (numbers(&prior.rotation), numbers(prior.covariance.as_flattened()));
            return Err(Error::argument("rotation_prior", expected, format!("{rotation} with {covariance}")));
        }
        self.check_initial()?;
        self.common.check(flow.projection())?;
        self.check_correlation(noise)
    }

    /// Depths have any unit, but no sign that could be turned: what is behind the camera is not seen.
    fn check_in_front(&self) -> Result<()> {
        let Some(depths) = &self.weight_depths else { return Ok(()) };
        let mut finite = depths.iter().filter(|nu| nu.is_finite()).peekable();
        if finite.peek().is_none() || finite.any(|&nu| nu > 0.0) {
            return Ok(());
        }
        let got = "none above 0";
        Err(Error::argument("weight_inv_depth", "inverse depths of points before the camera, which are positive", got))
    }

    fn check_initial(&self) -> Result<()> {
        match &self.initial {
            Some(_) if self.robust => {
                Err(Error::argument("initial", "none, as a robust search looks everywhere", "a motion"))
            }
            Some(m) if m.translation == [0.0; 3] => {
                Err(Error::argument("initial", "a translation with a direction", "zero"))
            }
            Some(m) if !m.translation.iter().chain(&m.rotation).all(|value| value.is_finite()) => {
                let got = format!("{} and {}", numbers(&m.translation), numbers(&m.rotation));
                Err(Error::argument("initial", "a finite translation and rotation", got))
            }
            _ => Ok(()),
        }
    }

    fn check_correlation(&self, noise: &Noise<'_>) -> Result<()> {
        if let Some(length) = self.correlation_length.filter(|length| !(length.is_finite() && *length >= 0.0)) {
            return Err(Error::argument("correlation_length", "a number of at least 0", length));
        }
        match self.shared {
            Some(shared) if !(shared.is_finite() && shared >= 1.0) => {
                Err(Error::argument("shared", "a number of at least 1", shared))
            }
            Some(_) if matches!(noise, Noise::Unknown) => {
                Err(Error::argument("shared", "a noise that is known", "sigma and cov left out"))
            }
            _ => Ok(()),
        }
    }
}

impl Flow<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Plane { points, .. } => points.len(),
            Self::Sphere { bearings, .. } => bearings.len(),
        }
    }
    /// No point at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Where point `k` lies, in the unit of the points.
    pub(crate) fn place(&self, k: usize) -> Vector3<f64> {
        match self {
            Self::Plane { points, .. } => Vector3::new(points[k][0], points[k][1], 0.0),
            Self::Sphere { bearings, .. } => bearings[k].into(),
        }
    }
    /// The camera that saw it.
    pub(crate) fn camera(&self) -> Option<&Intrinsics> {
        if let Self::Plane { camera, .. } = self { *camera } else { None }
    }
    /// The screen.
    pub fn projection(&self) -> Projection {
        match self {
            Self::Plane { .. } => Projection::Plane,
            Self::Sphere { .. } => Projection::Sphere,
        }
    }

    /// Whether all covariances that are finite are some; on the sphere only across the bearing, where the
    /// flow is.
    fn check_covariances(&self, covariances: &[f64], values: usize) -> Result<()> {
        for (k, given) in covariances.chunks_exact(values).enumerate() {
            let good = match self {
                Self::Plane { .. } => is_covariance(&DMatrix::from_row_slice(2, 2, given)),
                Self::Sphere { bearings, .. } => {
                    let axes = tangents(&Vector3::from(bearings[k]).normalize());
                    let given = Matrix3::from_row_slice(given);
                    let across = axes * given * axes.transpose();
                    symmetric(given.as_slice(), 3)
                        && is_covariance(&DMatrix::from_column_slice(2, 2, across.as_slice()))
                }
            };
            if !good {
                return Err(not_covariance(k, given));
            }
        }
        Ok(())
    }

    pub(crate) fn check(&self, noise: &Noise<'_>) -> Result<()> {
        let (points, flow, values) = match self {
            Self::Plane { points, flow, .. } => (points.len(), flow.len(), 4),
            Self::Sphere { bearings, flow } => (bearings.len(), flow.len(), 9),
        };
        if points != flow {
            return Err(Error::argument("flow", format!("{points} values, one for each point"), flow));
        }
        if let Self::Sphere { bearings, .. } = self {
            let off = |b: &&[f64; 3]| (b[0].hypot(b[1]).hypot(b[2]) - 1.0).abs() > 1e-3;
            if let Some(wrong) = bearings.iter().find(off) {
                return Err(Error::argument("points", "bearings of length 1", numbers(wrong)));
            }
        }
        match noise {
            // The sums of squares that an estimate is made of are of its fourth power.
            Noise::Sigma(sigma) if !(*sigma > 0.0 && sigma.powi(4).is_normal()) => {
                Err(Error::argument("sigma", "a positive number between 1e-75 and 1e75", sigma))
            }
            Noise::Covariances(c) if c.len() != values * points => {
                let expected = format!("{points} matrices of {values} values");
                Err(Error::argument("cov", expected, format!("{} values", c.len())))
            }
            Noise::Covariances(c) => self.check_covariances(c, values),
            _ => Ok(()),
        }
    }
}

/// Asymmetry of a covariance, in shares of its largest entry, that is rounding.
const ROUNDED: f64 = 1e-5;

fn symmetric(values: &[f64], size: usize) -> bool {
    let largest = values.iter().fold(0.0f64, |most, value| most.max(value.abs()));
    let off = |i: usize, j: usize| (values[size * i + j] - values[size * j + i]).abs();
    (0..size).all(|i| (0..i).all(|j| off(i, j) <= ROUNDED * largest))
}

/// Whether a matrix is symmetric and positive definite, or not finite: then its point is left out.
pub(crate) fn is_covariance(matrix: &DMatrix<f64>) -> bool {
    if !matrix.iter().all(|value| value.is_finite()) {
        return true;
    }
    let even = 0.5 * (matrix + matrix.transpose());
    symmetric(matrix.as_slice(), matrix.nrows()) && even.cholesky().is_some()
}

pub(crate) fn not_covariance(k: usize, got: &[f64]) -> Error {
    Error::argument("cov", "symmetric positive definite matrices", format!("at point {k} {}", numbers(got)))
}
