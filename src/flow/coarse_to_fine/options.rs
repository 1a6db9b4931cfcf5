//! What the coarse-to-fine estimator may be told.

use super::couple::Coupling;
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

    /// What it means for so many frames.
    pub(super) fn effort(self, frames: usize) -> Effort {
        let coupling = Coupling::default();
        // Three frames are more exact than two: they are worth another linearisation.
        let (finest_settled, finest_sweeps) = if frames == 2 { (0.035, 6) } else { (0.023, 4) };
        match self {
            Self::Fast => Effort {
                last: 1,
                iterations: [3, 4, 4],
                ahead: [2, 5, 5],
                settled: [0.02; 2],
                coupling: Coupling { sweeps: 4, ..coupling },
                finest_sweeps: 4,
                loosened: None,
                refined_above: false,
            },
            Self::Balanced => Effort {
                last: 0,
                iterations: [3, 5, 5],
                ahead: [2, 5, 5],
                settled: [finest_settled, 0.023],
                coupling: Coupling { sweeps: 4, break_at: 0.14, ..coupling },
                finest_sweeps,
                loosened: Some(2),
                refined_above: true,
            },
            Self::Accurate => Effort {
                last: 0,
                iterations: [4, 6, 6],
                ahead: [4, 6, 6],
                settled: [0.003; 2],
                coupling: Coupling { break_at: 0.2, ..coupling },
                finest_sweeps: coupling.sweeps,
                loosened: Some(2),
                refined_above: true,
            },
        }
    }
}

/// How much is done: linearisations, each followed by coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// The finest level that is worked on, 0 being the frame itself.
    pub last: usize,
    /// Most iterations on that level, the next and every coarser one.
    pub iterations: [usize; 3],
    /// The same for what a triple's next frame alone says, which begins on the third of these levels.
    pub ahead: [usize; 3],
    /// A level is done when an iteration has changed the flow by no more than this, px of the level (root
    /// mean square): that level, and every coarser one.
    pub settled: [f64; 2],
    /// After each iteration.
    pub coupling: Coupling,
    /// Sweeps of the coupling on the finest level: they cost a fraction of what a linearisation does, and
    /// most of what is left after one is theirs to do.
    pub finest_sweeps: usize,
    /// From so many levels above that one on, bonds are loosened at the end, for small objects to come free;
    /// `None`: nowhere.
    pub loosened: Option<usize>,
    /// Whether the motion of the level above the finest is refined before it is taken further: what it begins
    /// with has less noise then, and slopes that wider windows tell. Half the resolution does without: the
    /// level above it sees too little for windows to be chosen well.
    pub refined_above: bool,
}

/// Pixels of a level on which work costs next to nothing.
const SMALL: usize = 2500;
/// Most iterations there: what coarse levels miss is lost.
const COARSE_ITERATIONS: usize = 20;
/// Sweeps there.
const COARSE_SWEEPS: usize = 10;
/// Bonds there break at this strain, if not at less: neighbours are far from each other, and under a fast
/// rotation move differently.
const COARSE_BREAK: f64 = 0.07;

/// When a level is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    /// Most iterations.
    pub most: usize,
    /// An iteration that changes the flow by no more than this was the last, px of the level (root mean
    /// square).
    pub settled: f64,
    /// After each iteration.
    pub coupling: Coupling,
    /// Whether sites are tried without their neighbours then.
    pub loosened: bool,
    /// Whether what has been found is refined at last.
    pub refined: bool,
}

impl Effort {
    /// What is done on level `k` (0 being the frame itself) of `size` pixels; on the coarsest nothing is
    /// known yet.
    pub fn on_level(&self, k: usize, size: (usize, usize), is_coarsest: bool) -> Limits {
        let loosened = self.loosened.is_some_and(|above| k >= self.last + above);
        let refined = self.refined_above && k == self.last + 1;
        if is_coarsest || size.0 * size.1 <= SMALL {
            let break_at = self.coupling.break_at.min(COARSE_BREAK);
            let coupling = Coupling { sweeps: COARSE_SWEEPS, break_at, ..self.coupling };
            return Limits {
                coupling,
                loosened: loosened && !is_coarsest,
                refined,
                ..self.up_to(k, COARSE_ITERATIONS)
            };
        }
        let [finest, second, others] = self.iterations;
        let most = match k.saturating_sub(self.last) {
            0 => finest,
            1 => second,
            _ => others,
        };
        Limits { loosened, refined, ..self.up_to(k, most) }
    }

    /// So many iterations at most on level `k`.
    pub fn up_to(&self, k: usize, most: usize) -> Limits {
        let [finest, others] = self.settled;
        let (settled, sweeps) =
            if k <= self.last { (finest, self.finest_sweeps) } else { (others, self.coupling.sweeps) };
        Limits { most, settled, coupling: Coupling { sweeps, ..self.coupling }, loosened: false, refined: false }
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
pub const LEAST_SIDE: usize = 8;
/// Most pyramid levels.
const MOST_LEVELS: usize = 12;

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
        if let Some(levels) = self.levels.filter(|levels| !(1..=MOST_LEVELS).contains(levels)) {
            return Err(Error::argument("levels", format!("1 to {MOST_LEVELS} pyramid levels"), levels));
        }
        Ok(())
    }
}
