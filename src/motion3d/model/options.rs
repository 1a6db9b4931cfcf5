//! What is given and how it is worked on.

use super::input::{Flow, Noise, Placement};
use super::motion::Motion;
use super::observations::KnownRotation;
use super::result::{CommonEffect, Moved};
use super::rows::{Matrix5, Vector5};
use crate::error::{Error, Result, numbers};
use crate::parallel::Threads;
use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector3};

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

/// A rotation rate known from elsewhere: a gyroscope, or the rest of the scene where the points lie on a
/// object that moves by itself.
///
/// In a narrow field a rotation looks like a lateral translation; what is known of it decides between both.
/// Where flow contradicts it beyond chance the status is [`Ambiguous`](crate::motion3d::Status::Ambiguous);
/// of a rotation alone the covariance and the alternative show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationPrior {
    /// Rotation rate `w`, rad/frame.
    pub rotation: [f64; 3],
    /// Its covariance, row by row.
    pub covariance: [[f64; 3]; 3],
}

impl RotationPrior {
    /// `None` unless everything is finite and the covariance positive definite.
    pub(crate) fn information(&self) -> Option<KnownRotation> {
        let covariance = Matrix3::from_fn(|i, j| 0.5 * (self.covariance[i][j] + self.covariance[j][i]));
        let known = KnownRotation { rotation: self.rotation.into(), information: covariance.cholesky()?.inverse() };
        known.rotation.iter().chain(known.information.iter()).all(|value| value.is_finite()).then_some(known)
    }

    /// The prior for an object in a scene, from the scene's rotation and the covariance of its `(psi, w)`:
    /// the object may rotate by itself by `object_rotation_std` (standard deviation about each axis,
    /// rad/frame). `None` where the scene's rotation is not known.
    pub fn of_scene(rotation: [f64; 3], covariance: &[[f64; 5]; 5], object_rotation_std: f64) -> Option<Self> {
        let own = |i, j| if i == j { object_rotation_std * object_rotation_std } else { 0.0 };
        let covariance = std::array::from_fn(|i| std::array::from_fn(|j| covariance[2 + i][2 + j] + own(i, j)));
        let prior = Self { rotation, covariance };
        rotation.iter().chain(covariance.as_flattened()).all(|value| value.is_finite()).then_some(prior)
    }
}

/// Options of [`estimate_motion`](crate::motion3d::estimate_motion).
#[derive(Debug, Clone, Default)]
pub struct MotionOptions {
    /// Which estimator; default: by the number of points.
    pub method: Method,
    /// Whether outliers of the motion are found and left out; default: no.
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
    /// so that together they count once. What is an outlier, and what chance explains, is judged by their
    /// own. Default: 1.
    pub points_per_independent_sample: Option<f64>,
    /// Correlation length of the errors of neighbours, in the unit of the points (px with a camera, rad on
    /// the sphere), as windowed flow has: the covariance is in no direction smaller than that of independent
    /// points. Default: 0.
    pub correlation_length: Option<f64>,
    /// Standard deviation of a factor, about 1, that all flow is too long by, as flow from gradients is: no
    /// residual shows it, and it is one of the rotation's length. From 0 to 1; default: 0.
    pub flow_scale_std: Option<f64>,
    /// Standard deviation of each component of a displacement that all flow has in common, in the unit of the
    /// flow: most of it looks like a rotation. Not on the sphere. Default: 0.
    pub flow_bias_std: Option<f64>,
    /// Seed of the random choices; default: 0.
    pub random_state: u64,
    /// Number of threads; the result does not depend on it.
    pub threads: Threads,
}

impl MotionOptions {
    /// Errors that all flow has in common.
    pub(crate) fn systematic_errors(&self) -> CommonErrors {
        CommonErrors { scale: self.flow_scale_std.unwrap_or(0.0), offset: self.flow_bias_std.unwrap_or(0.0) }
    }

    /// How far errors correlate, where they do.
    pub(crate) fn correlation(&self) -> Option<f64> {
        self.correlation_length.filter(|length| *length > 0.0)
    }

    /// The same options with these common errors where none are given.
    pub(crate) fn with_common(&self, common: CommonErrors) -> Self {
        let (flow_scale_std, flow_bias_std) = (self.flow_scale_std.or(Some(common.scale)), self.flow_bias_std);
        Self { flow_scale_std, flow_bias_std: flow_bias_std.or(Some(common.offset)), ..self.clone() }
    }

    pub(crate) fn check(&self, flow: &Flow<'_>, noise: &Noise<'_>) -> Result<()> {
        if let Some(depths) = self.weight_depths.as_ref().filter(|depths| depths.len() != flow.len()) {
            let expected = format!("{} values, one for each point", flow.len());
            return Err(Error::argument("weight_inv_depth", expected, depths.len()));
        }
        // Depths have any unit, but no sign that could be turned: what is behind the camera is not seen.
        let finite = || self.weight_depths.iter().flatten().filter(|nu| nu.is_finite());
        if finite().count() > 0 && !finite().any(|&nu| nu > 0.0) {
            let expected = "inverse depths of points before the camera, which are positive";
            return Err(Error::argument("weight_inv_depth", expected, "none above 0"));
        }
        if let Some(prior) = self.rotation_prior.as_ref().filter(|prior| prior.information().is_none()) {
            let expected = "a finite rotation with a positive definite covariance";
            let (rotation, covariance) = (numbers(&prior.rotation), numbers(prior.covariance.as_flattened()));
            return Err(Error::argument("rotation_prior", expected, format!("{rotation} with {covariance}")));
        }
        self.check_initial()?;
        self.check_common(matches!(flow, Flow::Sphere { .. }))?;
        self.check_correlation(noise)
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

    /// On the plane or the sphere.
    pub(crate) fn check_common(&self, is_spherical: bool) -> Result<()> {
        let CommonErrors { scale, offset } = self.systematic_errors();
        if !(0.0..=1.0).contains(&scale) {
            return Err(Error::argument("flow_scale_std", "a number from 0 to 1", scale));
        }
        // Squares of larger ones are not finite.
        if !(0.0..=1e100).contains(&offset) {
            return Err(Error::argument("flow_bias_std", "a number from 0 to 1e100", offset));
        }
        if is_spherical && offset > 0.0 {
            let expected = "0 on the sphere, whose flow has no common displacement";
            return Err(Error::argument("flow_bias_std", expected, offset));
        }
        Ok(())
    }

    fn check_correlation(&self, noise: &Noise<'_>) -> Result<()> {
        if let Some(length) = self.correlation_length.filter(|length| !(length.is_finite() && *length >= 0.0)) {
            return Err(Error::argument("correlation_length", "a number of at least 0", length));
        }
        match self.points_per_independent_sample {
            Some(points) if !(points.is_finite() && points >= 1.0) => {
                Err(Error::argument("points_per_independent_sample", "a number of at least 1", points))
            }
            Some(points) if points > 1.0 && matches!(noise, Noise::Unknown) => {
                Err(Error::argument("points_per_independent_sample", "1 without noise_std and cov", points))
            }
            _ => Ok(()),
        }
    }
}

/// Which predictors may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Smoother {
    /// The better of both on these points.
    #[default]
    Auto,
    /// One normal distribution of all inverse depths.
    Prior,
    /// Local-linear regression on the 8, 16, 32 or 64 nearest points.
    Neighbours,
}

/// Standard deviations of errors that all flow of a picture has in common. Default: 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CommonErrors {
    /// Of the factor, see [`MotionOptions::flow_scale_std`].
    pub scale: f64,
    /// Of the displacement, see [`MotionOptions::flow_bias_std`].
    pub offset: f64,
}

impl CommonErrors {
    /// What both do to a motion of this covariance; `moved`: what displacements on the plane at distance 1 do
    /// to it, to which `unit` maps flow. Less what is known beforehand of the rotation.
    pub(crate) fn on(
        &self,
        covariance: &Matrix5,
        motion: &Motion,
        known: Option<&KnownRotation>,
        (moved, unit): (&Moved, &Matrix2<f64>),
    ) -> CommonEffect {
        let w = motion.w();
        let mut scaled = Vector5::new(0.0, 0.0, w.x, w.y, w.z);
        if let Some(known) = known {
            scaled -= covariance.fixed_columns::<3>(2) * (known.information * w);
        }
        let displaced = unit * self.offset;
        let along = moved * displaced;
        CommonEffect {
            scale: self.scale,
            displaced: [0, 1].map(|k| displaced.column(k).into_owned().into()),
            motion: [
                (scaled * self.scale).into(),
                along.column(0).into_owned().into(),
                along.column(1).into_owned().into(),
            ],
        }
    }

    /// What both add to the covariance of a rotation alone; `moved`: what displacements in the unit of the
    /// flow do to it.
    pub(crate) fn added_to_rotation(&self, w: &Vector3<f64>, moved: &Matrix3x2<f64>) -> Matrix3<f64> {
        w * w.transpose() * self.scale.powi(2) + moved * moved.transpose() * self.offset.powi(2)
    }
}
