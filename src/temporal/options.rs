//! Options of the flow filter, and the profiles that have been measured.

use crate::error::{Error, Result};
use crate::filter::SigmaPoints;
use crate::image::{GaussianSmoother, Preprocess, Quantiser};
use crate::jet::Neighbourhood;
use crate::parallel::Threads;
use crate::simd::Level;
use crate::types::{Mask, Precision, SamplingGrid, Units, choices};
use serde::{Deserialize, Serialize};

/// Least measurement noise for which single precision is the default, grey levels squared. With the patent's
/// 1e-3 the two precisions differed by 33 standard deviations after 1500 still frames of white noise.
const MIN_SINGLE_NOISE: f64 = 0.25;

/// How the non-linear prediction is carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FilterForm {
    /// Sigma points of the state together with its process noise: 24 dimensions, 49 points, the noise held
    /// constant inside the step. The patent's form.
    #[default]
    Augmented,
    /// Sigma points of the state alone (25), the process noise added to their covariance.
    NonAugmented,
    /// Sigma points of the motion alone (13); given the motion the brightness part is linear, so its
    /// conditional covariance is carried exactly. The same numbers as [`Self::NonAugmented`] with
    /// [`SquareRoot::MotionFirst`], but for rounding; see there how far that is from its default.
    Fast,
    /// Extended Kalman filter: linearised at the mean.
    Extended,
}

choices!(FilterForm, "form":
    Augmented "augmented",
    NonAugmented "non_augmented",
    Fast "fast",
    Extended "extended",
);

/// How a state moves over one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transition {
    /// One step of the classical Runge-Kutta method; the patent's.
    #[default]
    Rk4,
    /// The closed form: affine velocity maps quadratics to quadratics. Noise is added at the frame's end.
    Exact,
}

choices!(Transition, "transition": Rk4 "rk4", Exact "exact");

/// In which order the Cholesky factor that spreads the sigma points takes the state.
///
/// To second order the points have the same moments with any root, beyond that not. On the patent's ramp
/// (frames 200 to 399, by `tests/temporal/filter_forms.rs`) the rms errors of `u` differ by less than 0.3 %
/// with the profile `measured`. With the patent's large process noise they are 0.063 px with the brightness
/// first and 0.30 px with the motion first.
///
/// Brightness first cannot be had from fewer points: each of its twelve columns moves the motion, in which
/// the step is a polynomial of fourth degree, so that the step must be evaluated at 25 motions. Motion first,
/// six of the columns leave the motion alone, and there the step is linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SquareRoot {
    /// The state as it stands, `I` first: what `filterpy` does.
    BrightnessFirst,
    /// `u, v, u_x, ...` first: brightness columns then leave the motion alone.
    MotionFirst,
}

choices!(SquareRoot, "square_root": BrightnessFirst "brightness_first", MotionFirst "motion_first");

/// Options of [`FlowFilter`](super::FlowFilter). The default is [`FlowFilterOptions::patent`].
///
/// States are `q = (I, Ix, Iy, Ixx, Ixy, Iyy, u, v, u_x, v_x, u_y, v_y)`, 8-bit grey levels, px, frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlowFilterOptions {
    /// Pixels that a measurement takes in, by default 3x3; weights are those of the fit.
    pub neighbourhood: Neighbourhood,
    /// How the prediction is carried out.
    pub form: FilterForm,
    /// How a state moves over one frame.
    pub transition: Transition,
    /// Order of the square root; `None`: motion first for [`FilterForm::Fast`], which knows no other, else
    /// brightness first. Without meaning for [`FilterForm::Extended`].
    pub square_root: Option<SquareRoot>,
    /// Diagonal of the process noise Q, variances a frame; each >= 0.
    pub process_noise: [f64; 12],
    /// Variance of the noise of one pixel, grey levels squared; > 0.
    pub measurement_noise: f64,
    /// Takes what the frames say about the noise: the residual of each fit is noise where it exceeds that of
    /// `measurement_noise`, and a measurement that the prediction excludes starts the brightness anew.
    /// `false`: the patent's filter for all frames.
    pub adaptive: bool,
    /// Mean before the first frame.
    pub initial_mean: [f64; 12],
    /// Diagonal of the covariance before the first frame; each > 0.
    pub initial_covariance: [f64; 12],
    /// Constants of the sigma points.
    pub sigma_points: SigmaPoints,
    /// The sample value that stands for 255 grey levels: 65535 for `u16`, 1 for floats in [0, 1].
    pub full_scale: f64,
    /// What [`FlowFilter::prepare`](super::FlowFilter::prepare) does to each frame first, with the `mask`.
    pub preprocess: Preprocess,
    /// Where the filters are; every pixel by default.
    pub sites: SamplingGrid,
    /// Which pixels may be used; `None`: all.
    #[serde(with = "saved_mask")]
    pub mask: Option<Mask>,
    /// Deliver the 6x6 covariance of the motion with each field (21 planes).
    pub covariance: bool,
    /// What the fields' lengths and times are measured in. States stay in px and frames.
    pub units: Units,
    /// Threads; results do not depend on their number. They belong to the run, not to a saved state.
    #[serde(skip)]
    pub threads: Threads,
    /// Instruction set; `None`: the best one.
    #[serde(with = "saved_level")]
    pub simd: Option<Level>,
}

impl Default for FlowFilterOptions {
    fn default() -> Self {
        Self::patent()
    }
}

impl FlowFilterOptions {
    /// The set of constants called `name`: `patent` or `measured`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `profile` for another word.
    pub fn profile(name: &str) -> Result<Self> {
        match name {
            "patent" => Ok(Self::patent()),
            "measured" => Ok(Self::measured()),
            other => Err(Error::argument("profile", "patent or measured", other)),
        }
    }

    /// The patent's constants (embodiment 2): `Q = diag(1e-1, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-1, 1e-1, 1e-3,
    /// 1e-3, 1e-3, 1e-3)`, `R = 1e-3`, start at 0, with what the patent leaves open: `P0 = I`, `alpha = 1,
    /// beta = 2, kappa = 0`. Augmented, Runge-Kutta, 3x3.
    ///
    /// Its process noise biases the divergence: on the patent's scene `u_x` and `v_y` are near +0.09, not 0.
    pub fn patent() -> Self {
        Self {
            neighbourhood: Neighbourhood::default(),
            form: FilterForm::Augmented,
            transition: Transition::Rk4,
            square_root: None,
            process_noise: [1e-1, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-1, 1e-1, 1e-3, 1e-3, 1e-3, 1e-3],
            measurement_noise: 1e-3,
            adaptive: true,
            initial_mean: [0.0; 12],
            initial_covariance: [1.0; 12],
            sigma_points: SigmaPoints::default(),
            full_scale: 255.0,
            preprocess: Preprocess::default(),
            sites: SamplingGrid::default(),
            mask: None,
            covariance: false,
            units: Units::default(),
            threads: Threads::default(),
            simd: None,
        }
    }

    /// Constants for raw 8-bit frames, not smoothed: 9x9 pixels, `R = 1/12` (the variance of rounding), and
    /// process noise small enough not to bias the divergence. On the patent's scene its error is about a
    /// third of the patent's in `u` and a fiftieth in the Jacobian.
    pub fn measured() -> Self {
        Self {
            neighbourhood: Neighbourhood::square(9),
            process_noise: [1e-4, 1e-6, 1e-6, 1e-8, 1e-8, 1e-8, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6, 1e-6],
            measurement_noise: 1.0 / 12.0,
            initial_covariance: [1e4, 10.0, 10.0, 1.0, 1.0, 1.0, 10.0, 10.0, 0.01, 0.01, 0.01, 0.01],
            ..Self::patent()
        }
    }

    /// Whether frames of samples of type `dtype` are filtered in double precision. By default float64 frames
    /// are, and all frames where the measurement noise is below 0.25 grey levels squared.
    pub fn is_double(&self, precision: Precision, dtype: &str) -> bool {
        let is_demanding = precision == Precision::Auto && self.measurement_noise < MIN_SINGLE_NOISE;
        is_demanding || precision.is_double(dtype)
    }

    pub(super) fn motion_first(&self) -> bool {
        match self.form {
            FilterForm::Fast => true,
            FilterForm::Extended => false,
            _ => self.square_root == Some(SquareRoot::MotionFirst),
        }
    }

    /// Refuses values that no filter can run with.
    pub(super) fn check(&self, frame_size: (usize, usize)) -> Result<()> {
        let all = |name, values: &[f64], what: &str, good: &dyn Fn(f64) -> bool| match values
            .iter()
            .find(|&&v| !(v.is_finite() && good(v)))
        {
            Some(value) => Err(Error::argument(name, what, value)),
            None => Ok(()),
        };
        all("process_noise", &self.process_noise, "twelve finite variances, each >= 0", &|v| v >= 0.0)?;
        all("measurement_noise", &[self.measurement_noise], "a finite variance > 0", &|v| v > 0.0)?;
        all("initial_mean", &self.initial_mean, "twelve finite numbers", &|_| true)?;
        all("initial_covariance", &self.initial_covariance, "twelve finite variances, each > 0", &|v| v > 0.0)?;
        all("full_scale", &[self.full_scale], "a finite number > 0", &|v| v > 0.0)?;
        if let Some(quantiser) = &self.preprocess.quantise {
            Quantiser::new(quantiser.step)?;
        }
        if let Some(smoother) = &self.preprocess.smooth {
            GaussianSmoother::with(smoother.sigma, smoother.truncate, smoother.border)?;
        }
        self.units.check()?;
        self.sigma_points.check(12)?;
        self.threads.check()?;
        Level::check(self.simd)?;
        if (self.form, self.square_root) == (FilterForm::Fast, Some(SquareRoot::BrightnessFirst)) {
            let expected = "motion_first (or form non_augmented: the form fast takes the motion first)";
            return Err(Error::argument("square_root", expected, SquareRoot::BrightnessFirst.name()));
        }
        if let Some(mask) = &self.mask
            && mask.size() != frame_size
        {
            let text = |(w, h)| format!("{w} x {h}");
            return Err(Error::argument("mask", format!("the frames' size {}", text(frame_size)), text(mask.size())));
        }
        Ok(())
    }
}

/// A mask as a saved state names it: whether there is one. Its pixels are an array of their own.
mod saved_mask {
    use super::{Deserialize, Mask};
    use serde::{Deserializer, Serializer};

    // Serde passes references.
    #[allow(clippy::ref_option)]
    pub(super) fn serialize<S: Serializer>(mask: &Option<Mask>, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bool(mask.is_some())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Mask>, D::Error> {
        Ok(bool::deserialize(from)?.then(Mask::default))
    }
}

/// An instruction set by its name. One that this processor lacks gives way to its best one.
mod saved_level {
    use super::{Deserialize, Level, Serialize};
    use serde::{Deserializer, Serializer};

    #[allow(clippy::ref_option, clippy::trivially_copy_pass_by_ref)]
    pub(super) fn serialize<S: Serializer>(level: &Option<Level>, to: S) -> Result<S::Ok, S::Error> {
        level.map(Level::name).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Level>, D::Error> {
        Ok(Option::<String>::deserialize(from)?.and_then(|name| Level::parse(&name).ok()))
    }
}
