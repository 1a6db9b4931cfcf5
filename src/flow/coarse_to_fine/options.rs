//! What the coarse-to-fine estimator may be told.

use super::couple::Coupling;
use crate::error::{Error, Result};

/// How much work an estimate may cost. Errors and times of each are measured by `benchmarks/compare.py`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Hash)]
pub enum Preset {
    /// The motion at half the resolution, where few iterations cost little; detail of a few px is lost.
    Fast,
    /// Two linearisations on the finest level.
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

    /// What it means.
    pub(super) fn effort(self) -> Effort {
        let coupling = Coupling::default();
        match self {
            Self::Fast => {
                Effort { last: 1, finest: 3, second: 4, third: 4, coupling: Coupling { sweeps: 4, ..coupling } }
            }
            Self::Balanced => Effort {
                last: 0,
                finest: 2,
                second: 5,
                third: 5,
                coupling: Coupling { sweeps: 4, break_at: 0.13, ..coupling },
            },
            Self::Accurate => {
                Effort { last: 0, finest: 4, second: 6, third: 6, coupling: Coupling { break_at: 0.2, ..coupling } }
            }
        }
    }
}

/// Numbers of iterations: linearisations, each followed by coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// The finest level that is worked on, 0 being the frame itself.
    pub last: usize,
    /// On that level.
    pub finest: usize,
    /// On the next.
    pub second: usize,
    /// On the third.
    pub third: usize,
    /// After each.
    pub coupling: Coupling,
}

/// Pixels of a level on which work costs next to nothing.
const SMALL: usize = 2500;
/// Iterations and sweeps there: what coarse levels miss is lost.
const COARSE: (usize, usize) = (10, 10);

impl Effort {
    /// Iterations on level `k` (0 being the frame itself) of `size` pixels, and how strongly and often sites are coupled there; on the coarsest nothing is known
    /// yet.
    pub fn on_level(&self, k: usize, size: (usize, usize), is_coarsest: bool) -> (usize, Coupling) {
        match k - self.last.min(k) {
            _ if is_coarsest || size.0 * size.1 <= SMALL => (COARSE.0, Coupling { sweeps: COARSE.1, ..self.coupling }),
            0 => (self.finest, self.coupling),
            1 => (self.second, self.coupling),
            _ => (self.third, self.coupling),
        }
    }
}

/// Options of the coarse-to-fine estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct CoarseToFineOptions {
    /// Cost against error. Default [`Preset::Balanced`].
    pub preset: Preset,
    /// Frames of one estimate: 3 (default), the field then belongs to the middle frame, or 2: it belongs to the first, and tells where its pixels are in
    /// the second.
    pub frames: usize,
    /// Pyramid levels, each half the size of the one before; the motion may be as large as about `2^levels` px. `None` (default): as many as the frame
    /// allows, down to [`LEAST_SIDE`] px.
    pub levels: Option<usize>,
}

impl Default for CoarseToFineOptions {
    fn default() -> Self {
        Self { preset: Preset::default(), frames: 3, levels: None }
    }
}

/// Smallest width and height of a pyramid level, px.
pub const LEAST_SIDE: usize = 12;
/// Most pyramid levels.
const MOST_LEVELS: usize = 12;

impl CoarseToFineOptions {
    /// The default for two frames.
    pub fn pair() -> Self {
        Self { frames: 2, ..Self::default() }
    }

    /// Refuses values that mean nothing.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the option.
    pub fn check(&self) -> Result<()> {
        if !(2..=3).contains(&self.frames) {
            return Err(Error::argument("frames", "2 or 3 for a coarse-to-fine estimate", self.frames));
        }
        if let Some(levels) = self.levels.filter(|levels| !(1..=MOST_LEVELS).contains(levels)) {
            return Err(Error::argument("levels", format!("1 to {MOST_LEVELS} pyramid levels"), levels));
        }
        Ok(())
    }
}
