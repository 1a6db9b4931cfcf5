//! Options of the coarse-to-fine estimator.

use crate::error::{Error, Result};

/// Cost against error. `benchmarks` measures errors and times of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Preset {
    /// Motion at half the resolution, where few iterations cost little; details of a few px are lost.
    Fast,
    /// Every level until it converges, at most three linearisations on the finest.
    #[default]
    Balanced,
    /// More iterations and smaller tolerances, for offline work.
    Accurate,
}

impl Preset {
    /// Every preset, the cheapest first.
    pub const EVERY: [Self; 3] = [Self::Fast, Self::Balanced, Self::Accurate];

    /// The name used in options: `fast`, `balanced`, `accurate`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Balanced => "balanced",
            Self::Accurate => "accurate",
        }
    }

    /// The preset called `name`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `preset` for another word.
    pub fn parse(name: &str) -> Result<Self> {
        Self::EVERY
            .into_iter()
            .find(|preset| preset.name() == name)
            .ok_or_else(|| Error::argument("preset", "fast, balanced or accurate", name))
    }
}

/// Options of the coarse-to-fine estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarseToFineOptions {
    /// Cost against error. Default [`Preset::Balanced`].
    pub preset: Preset,
    /// Frames of one estimate: 3 (default) or 2. The field says where the pixels of the middle frame (of the
    /// first of two) are in the next frame. A frame before helps if the motion is nearly the same in both
    /// steps.
    pub frames: usize,
    /// Whether three frames give the mean of both steps instead, `(-1, 1) / 2`: the velocity at the middle
    /// frame, to second order in time under acceleration. Default: no.
    pub central: bool,
    /// Pyramid levels, each half the size of the one before. Motion may be up to about `2^levels` px. `None`
    /// (default): all levels of at least [`MIN_LEVEL_SIDE`] px.
    pub levels: Option<usize>,
}

impl Default for CoarseToFineOptions {
    fn default() -> Self {
        Self { preset: Preset::default(), frames: 3, central: false, levels: None }
    }
}

/// Minimum width and height of a pyramid level, px: a smaller one has too few sites to regularise.
pub const MIN_LEVEL_SIDE: usize = 8;
/// Maximum number of pyramid levels: enough for frames of 30,000 px.
const MAX_LEVELS: usize = 12;

impl CoarseToFineOptions {
    /// The default for two frames.
    pub fn pair() -> Self {
        Self { frames: 2, ..Self::default() }
    }

    /// Sets what three frames estimate: `forward` (the step to the next frame) or `central` (the mean step).
    ///
    /// # Errors [`Error::Argument`] naming `scheme` for another word.
    pub fn set_scheme(&mut self, name: &str) -> Result<()> {
        self.central = match name {
            "forward" => false,
            "central" => true,
            other => return Err(Error::argument("scheme", "forward or central for a coarse-to-fine estimate", other)),
        };
        Ok(())
    }

    /// Checks ranges.
    ///
    /// # Errors [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(2..=3).contains(&self.frames) {
            return Err(Error::argument("frames", "2 or 3 for a coarse-to-fine estimate", self.frames));
        }
        if let Some(levels) = self.levels.filter(|levels| !(1..=MAX_LEVELS).contains(levels)) {
            return Err(Error::argument("levels", format!("1 to {MAX_LEVELS} pyramid levels"), levels));
        }
        Ok(())
    }
}
