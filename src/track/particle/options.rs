//! Options of the particle tracker, and the lengths that go with the size of the picture.

use crate::error::{Error, Result};
use crate::filter::particle::Resampling;
use crate::parallel::Threads;
use crate::segment::SegmentOptions;
use crate::types::choices;

/// Rows of the pictures that the lengths below are given for; others multiply them by rows / 480.
const REFERENCE_ROWS: f64 = 480.0;
/// Largest factor of all lengths: pictures of 48,000 rows.
const MAX_SCALE: f64 = 100.0;
/// Colour distance at which the segmentation lets regions grow, grey levels.
const SEGMENT_SCALE: f64 = 150.0;
/// Smoothing before the segmentation, px.
const SEGMENT_SIGMA: f64 = 0.8;
/// Smallest region in a picture of 480 rows, px^2.
const SEGMENT_AREA: f64 = 120.0;
/// Smallest number of particles: a regular covariance of six components needs at least seven.
const MIN_PARTICLES: usize = 8;

/// Which evidence weighs the particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum ParticleMode {
    /// Corner tracks on a target must move with it; hidden targets are recognised; particles move with the
    /// background's affine motion.
    #[default]
    Improved,
    /// The published method: a foreground map from mixtures over corners and a graph segmentation.
    Paper,
}

choices!(ParticleMode, "mode": Improved "improved", Paper "paper");

/// How a corner's flow becomes a probability of not being background.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub enum ForegroundModel {
    /// 1 - N(f) / max N of the background's Gaussian.
    #[default]
    Ratio,
    /// 1 - responsibility of the background's component.
    Posterior,
    /// 1 - N(f), clipped to 0..1: as printed, although a density is no probability.
    Literal,
    /// 1 - probability of following the background's affine motion.
    Affine,
}

choices!(ForegroundModel, "foreground":
    Ratio "ratio",
    Posterior "posterior",
    Literal "literal",
    Affine "affine",
);

/// The factors of a particle's likelihood, each of which can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[allow(clippy::struct_excessive_bools, reason = "a set of factors")]
pub struct Likelihoods {
    /// Histograms of hue and saturation in bands.
    pub colour: bool,
    /// Near the constant-velocity prediction.
    pub velocity: bool,
    /// Away from the predictions of near targets.
    pub distance: bool,
    /// Corner tracks in the box move with the particle.
    pub tracks: bool,
    /// The foreground map at the centre.
    pub foreground: bool,
}

impl Likelihoods {
    /// Names of the factors, in the order of the fields.
    pub const NAMES: [&'static str; 5] = ["colour", "velocity", "distance", "tracks", "foreground"];

    /// The default factors of a mode.
    pub fn of(mode: ParticleMode) -> Self {
        let improved = mode == ParticleMode::Improved;
        Self { colour: true, velocity: true, distance: !improved, tracks: improved, foreground: !improved }
    }

    /// The factors with these names.
    ///
    /// # Errors
    /// [`Error::Argument`] named `likelihoods` for a name that is not known.
    pub fn from_names<S: AsRef<str>>(names: &[S]) -> Result<Self> {
        let mut on = [false; Self::NAMES.len()];
        for at in positions("likelihoods", &Self::NAMES, names)? {
            on[at] = true;
        }
        let [colour, velocity, distance, tracks, foreground] = on;
        Ok(Self { colour, velocity, distance, tracks, foreground })
    }
}

/// Places of some names among those that are known.
fn positions<S: AsRef<str>>(argument: &'static str, known: &[&str], names: &[S]) -> Result<Vec<usize>> {
    let place = |name: &S| {
        let found = known.iter().position(|known| *known == name.as_ref());
        found.ok_or_else(|| Error::argument(argument, format!("names among {}", known.join(", ")), name.as_ref()))
    };
    names.iter().map(place).collect()
}

/// Options of [`ParticleTracker`](super::ParticleTracker).
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ParticleOptions {
    /// Which evidence weighs the particles; default: improved.
    pub mode: ParticleMode,
    /// Particles of a target; default 1000.
    pub n_particles: usize,
    /// Particles of a target while another one is near; default 2000.
    pub n_near: usize,
    /// Factor of all lengths; default `None`: rows / 480.
    pub scale: Option<f64>,
    /// Factors of the likelihood; default `None`: those of the mode.
    pub likelihoods: Option<Likelihoods>,
    /// Resampling scheme; default multinomial.
    pub resampling: Resampling,
    /// Particles are resampled if the effective sample size is below this share of their number; default 1:
    /// in every frame.
    pub ess_threshold: f64,
    /// What makes a corner foreground (paper mode); default: the ratio.
    pub foreground: ForegroundModel,
    /// Scale of the segmentation, grey levels; default 150.
    pub segment_scale: f64,
    /// Smoothing before the segmentation, px; default 0.8.
    pub segment_sigma: f64,
    /// Smallest region, px^2; default `None`: 120 times the square of the scale.
    pub segment_min_size: Option<usize>,
    /// Seed of all random numbers; default 0.
    pub random_state: u64,
    /// Number of threads.
    pub threads: Threads,
}

impl Default for ParticleOptions {
    fn default() -> Self {
        Self {
            mode: ParticleMode::Improved,
            n_particles: 1000,
            n_near: 2000,
            scale: None,
            likelihoods: None,
            resampling: Resampling::Multinomial,
            ess_threshold: 1.0,
            foreground: ForegroundModel::Ratio,
            segment_scale: SEGMENT_SCALE,
            segment_sigma: SEGMENT_SIGMA,
            segment_min_size: None,
            random_state: 0,
            threads: Threads::default(),
        }
    }
}

impl ParticleOptions {
    /// Checks every option.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        for (name, count) in [("n_particles", self.n_particles), ("n_near", self.n_near)] {
            if count < MIN_PARTICLES {
                return Err(Error::argument(name, format!("at least {MIN_PARTICLES} particles"), count));
            }
        }
        if let Some(scale) = self.scale.filter(|scale| !(*scale > 0.0 && *scale <= MAX_SCALE)) {
            return Err(Error::argument("scale", format!("a positive number up to {MAX_SCALE}"), scale));
        }
        if !(0.0..=1.0).contains(&self.ess_threshold) {
            return Err(Error::argument("ess_threshold", "a share from 0 to 1", self.ess_threshold));
        }
        self.segmentation(1.0).check()?;
        self.threads.check().map(|_| ())
    }

    /// Factors of the likelihood in use.
    pub fn factors(&self) -> Likelihoods {
        self.likelihoods.unwrap_or_else(|| Likelihoods::of(self.mode))
    }

    /// Whether a rule of improved mode acts; `rule` is its name in [`crate::ablation::HEURISTICS`].
    pub(super) fn uses(&self, rule: &'static str) -> bool {
        self.mode == ParticleMode::Improved && crate::ablation::keeps(rule)
    }

    /// Factor of all lengths for a picture of this many rows.
    pub fn length_scale(&self, rows: usize) -> f64 {
        self.scale.unwrap_or(rows as f64 / REFERENCE_ROWS)
    }

    pub(super) fn segmentation(&self, scale: f64) -> SegmentOptions {
        let min_size = self.segment_min_size.unwrap_or((SEGMENT_AREA * scale * scale).round() as usize);
        SegmentOptions { scale: self.segment_scale, sigma: self.segment_sigma, min_size }
    }
}
