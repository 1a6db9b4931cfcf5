//! What the coarse-to-fine estimator may be told.

use crate::error::{Error, Result};

/// How much work an estimate may cost. Errors and times of each are measured by `benchmarks/compare.py`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Preset {
    /// The motion at half the resolution, where few iterations cost little; detail of a few px is lost.
    Fast,
    /// Every level until it settles, three linearisations at most on the finest.
    #[default]
    Balanced,
    /// More of everything, for offline work.
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
    /// Frames of one estimate: 3 (default) or 2. The field tells where the pixels of the middle frame (of the
    /// first of two) are in the next; a frame before helps as far as motion goes on as it was.
    pub frames: usize,
    /// Whether three frames tell the mean of both steps instead, `(-1, 1) / 2`: the velocity at the middle
    /// frame, to second order in time where it accelerates. Default: no.
    pub central: bool,
    /// Pyramid levels, each half the size of the one before; the motion may be as large as about `2^levels`
    /// px. `None` (default): as many as the frame allows, down to [`LEAST_SIDE`] px.
    pub levels: Option<usize>,
}

impl Default for CoarseToFineOptions {
    fn default() -> Self {
        Self { preset: Preset::default(), frames: 3, central: false, levels: None }
    }
}

/// Smallest width and height of a pyramid level, px.
pub const MIN_LEVEL_SIDE: usize = 8;
/// Most pyramid levels.
const MAX_LEVELS: usize = 12;

impl CoarseToFineOptions {
    /// The default for two frames.
    pub fn pair() -> Self {
        Self { frames: 2, ..Self::default() }
    }

    /// Tells three frames' motion as the time scheme called `name` has it: `forward` to the next frame or
    /// `central`.
    ///
    /// # Errors
    /// [`Error::Argument`] naming `scheme` for another word.
    pub fn set_scheme(&mut self, name: &str) -> Result<()> {
        self.central = match name {
            "forward" => false,
            "central" => true,
            other => return Err(Error::argument("scheme", "forward or central for a coarse-to-fine estimate", other)),
        };
        Ok(())
    }

    /// Refuses values that mean nothing.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
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
