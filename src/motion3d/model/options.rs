//! What is given and how it is worked on.

use super::input::{Flow, Noise, Placement, refuse_if};
use super::motion::Motion;
use super::observations::KnownRotation;
use super::result::SystematicEffect;
use super::rows::Matrix5;
use crate::error::{Result, numbers};
use crate::parallel::Threads;
use crate::scattered::Smoother;
use nalgebra::{Matrix2, Matrix3, SMatrix, Vector3};

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
    /// Number of given points per statistically independent one, at least 1: the given variances are the
    /// points' own times this number. Outliers and chance are judged by the points' own. Default: 1.
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
    pub(crate) fn systematic_errors(&self) -> SystematicErrors {
        SystematicErrors { scale: self.flow_scale_std.unwrap_or(0.0), offset: self.flow_bias_std.unwrap_or(0.0) }
    }

    /// How far errors correlate, where they do.
    pub(crate) fn correlation(&self) -> Option<f64> {
        self.correlation_length.filter(|length| *length > 0.0)
    }

    /// The same options with these systematic errors where none are given.
    pub(crate) fn with_systematic_errors(&self, errors: SystematicErrors) -> Self {
        let (flow_scale_std, flow_bias_std) = (self.flow_scale_std.or(Some(errors.scale)), self.flow_bias_std);
        Self { flow_scale_std, flow_bias_std: flow_bias_std.or(Some(errors.offset)), ..self.clone() }
    }

    pub(crate) fn check(&self, flow: &Flow<'_>, noise: &Noise<'_>) -> Result<()> {
        if let Some(depths) = &self.weight_depths {
            let (n, name) = (flow.len(), "weight_inv_depth");
            refuse_if(depths.len() != n, name, format!("{n} values, one for each point"), depths.len())?;
            // Depths have any unit, but no sign that could be turned: what is behind the camera is not seen.
            let finite: Vec<f64> = depths.iter().copied().filter(|nu| nu.is_finite()).collect();
            let is_behind = !finite.is_empty() && finite.iter().all(|&nu| nu <= 0.0);
            refuse_if(is_behind, name, "at least one positive value", "none")?;
        }
        if let Some(RotationPrior { rotation, covariance }) = &self.rotation_prior {
            let got = format!("{} with {}", numbers(rotation), numbers(covariance.as_flattened()));
            let expected = "a finite rotation with a positive definite covariance";
            refuse_if(
                self.rotation_prior.and_then(|prior| prior.information()).is_none(),
                "rotation_prior",
                expected,
                got,
            )?;
        }
        if let Some(Motion { translation, rotation }) = &self.initial {
            let name = "initial";
            refuse_if(self.robust, name, "none, as a robust search looks everywhere", "a motion")?;
            refuse_if(*translation == [0.0; 3], name, "a translation with a direction", "zero")?;
            let is_finite = translation.iter().chain(rotation).all(|value| value.is_finite());
            let got = format!("{} and {}", numbers(translation), numbers(rotation));
            refuse_if(!is_finite, name, "a finite translation and rotation", got)?;
        }
        self.check_common(matches!(flow, Flow::Sphere { .. }))?;
        let length = self.correlation_length.unwrap_or(0.0);
        refuse_if(!(0.0..f64::INFINITY).contains(&length), "correlation_length", "a number of at least 0", length)?;
        let (points, name) = (self.points_per_independent_sample.unwrap_or(1.0), "points_per_independent_sample");
        refuse_if(!(1.0..f64::INFINITY).contains(&points), name, "a number of at least 1", points)?;
        refuse_if(points > 1.0 && matches!(noise, Noise::Unknown), name, "1 without noise_std and cov", points)
    }

    /// On the plane or the sphere.
    pub(crate) fn check_common(&self, is_spherical: bool) -> Result<()> {
        let SystematicErrors { scale, offset } = self.systematic_errors();
        refuse_if(!(0.0..=1.0).contains(&scale), "flow_scale_std", "a number from 0 to 1", scale)?;
        // Squares of larger ones are not finite.
        refuse_if(!(0.0..=1e100).contains(&offset), "flow_bias_std", "a number from 0 to 1e100", offset)?;
        let expected = "0 on the sphere, whose flow has no common displacement";
        refuse_if(is_spherical && offset > 0.0, "flow_bias_std", expected, offset)
    }
}

/// Standard deviations of errors that all flow of a picture has in common. Default: 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SystematicErrors {
    /// Of the factor, see [`MotionOptions::flow_scale_std`].
    pub scale: f64,
    /// Of the displacement, see [`MotionOptions::flow_bias_std`].
    pub offset: f64,
}

impl SystematicErrors {
    /// What both do to a motion: `inverse` of the equations' information, which holds what is known
    /// beforehand of the rotation, and their `response` (see
    /// [`Measurement::response`](super::measurement::Measurement::response)). `unit` maps flow to the plane
    /// at distance 1.
    pub(crate) fn on(
        &self,
        (inverse, response): (&Matrix5, &Matrix5),
        w: &Vector3<f64>,
        unit: &Matrix2<f64>,
    ) -> SystematicEffect {
        let mut changes = SMatrix::<f64, 5, 3>::zeros();
        changes.fixed_view_mut::<3, 1>(0, 0).copy_from(&(w * self.scale));
        changes.fixed_view_mut::<2, 2>(3, 1).copy_from(&(unit * self.offset));
        let motion = inverse * response * changes;
        SystematicEffect { scale: self.scale, displaced: (unit * self.offset).into(), motion: motion.into() }
    }
}
