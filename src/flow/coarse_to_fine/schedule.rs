//! How much work each level gets: iterations, sweeps and tolerances of a preset.

use super::options::Preset;
use super::regularize::Smoothness;

/// How much is done: linearisations, each followed by coupling.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Schedule {
    /// The finest level that is worked on, 0 being the frame itself.
    pub finest_level: usize,
    /// Most iterations on that level, the next and every coarser one.
    pub iterations: [usize; 3],
    /// The same for what a triple's next frame alone says, which begins on the third of these levels.
    pub next_frame_iterations: [usize; 3],
    /// A level is done when an iteration has changed the flow by no more than this, px of the level (root
    /// mean square): that level, and every coarser one.
    pub tolerance: [f64; 2],
    /// After each iteration.
    pub smoothness: Smoothness,
    /// Sweeps of the coupling on the finest level: they cost a fraction of what a linearisation does, and
    /// most of what is left after one is theirs to do.
    pub finest_sweeps: usize,
    /// From so many levels above that one on, bonds are loosened at the end, for small objects to come free;
    /// `None`: nowhere.
    pub trial_from: Option<usize>,
    /// Whether the motion of the level above the finest is refined before it is taken further: what it begins
    /// with has less noise then, and slopes that wider windows tell. Half the resolution does without: the
    /// level above it sees too little for windows to be chosen well.
    pub refines_intermediate: bool,
}

/// Pixels of a level on which work costs next to nothing.
const SMALL_LEVEL_PIXELS: usize = 2500;
/// Most iterations there: what coarse levels miss is lost.
const COARSE_ITERATIONS: usize = 20;
/// Sweeps there.
const COARSE_SWEEPS: usize = 10;
/// Bonds there break at this strain, if not at less: neighbours are far from each other, and under a fast
/// rotation move differently.
const COARSE_BREAK_STRAIN: f64 = 0.07;

/// When a level is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LevelSchedule {
    /// Most iterations.
    pub max_iterations: usize,
    /// An iteration that changes the flow by no more than this was the last, px of the level (root mean
    /// square).
    pub tolerance: f64,
    /// After each iteration.
    pub smoothness: Smoothness,
    /// Whether sites are tried without their neighbours then.
    pub runs_trial: bool,
    /// Whether what has been found is refined at last.
    pub refines: bool,
}

impl Schedule {
    /// What it means for so many frames.
    pub fn new(preset: Preset, frames: usize) -> Self {
        let smoothness = Smoothness::default();
        // Three frames are more exact than two: they are worth another linearisation.
        let (finest_tolerance, finest_sweeps) = if frames == 2 { (0.035, 6) } else { (0.023, 4) };
        match preset {
            Preset::Fast => Self {
                finest_level: 1,
                iterations: [3, 4, 4],
                next_frame_iterations: [2, 5, 5],
                tolerance: [0.02; 2],
                smoothness: Smoothness { sweeps: 4, ..smoothness },
                finest_sweeps: 4,
                trial_from: None,
                refines_intermediate: false,
            },
            Preset::Balanced => Self {
                finest_level: 0,
                iterations: [3, 5, 5],
                next_frame_iterations: [2, 5, 5],
                tolerance: [finest_tolerance, 0.023],
                smoothness: Smoothness { sweeps: 4, break_strain: 0.14, ..smoothness },
                finest_sweeps,
                trial_from: Some(2),
                refines_intermediate: true,
            },
            Preset::Accurate => Self {
                finest_level: 0,
                iterations: [4, 6, 6],
                next_frame_iterations: [4, 6, 6],
                tolerance: [0.003; 2],
                smoothness: Smoothness { break_strain: 0.2, ..smoothness },
                finest_sweeps: smoothness.sweeps,
                trial_from: Some(2),
                refines_intermediate: true,
            },
        }
    }

    /// What is done on level `k` (0 being the frame itself) of `size` pixels; on the coarsest nothing is
    /// known yet.
    pub fn on_level(&self, k: usize, size: (usize, usize), is_coarsest: bool) -> LevelSchedule {
        let runs_trial = self.trial_from.is_some_and(|above| k >= self.finest_level + above);
        let refines = self.refines_intermediate && k == self.finest_level + 1;
        if is_coarsest || size.0 * size.1 <= SMALL_LEVEL_PIXELS {
            let break_strain = self.smoothness.break_strain.min(COARSE_BREAK_STRAIN);
            let smoothness = Smoothness { sweeps: COARSE_SWEEPS, break_strain, ..self.smoothness };
            return LevelSchedule {
                smoothness,
                runs_trial: runs_trial && !is_coarsest,
                refines,
                ..self.up_to(k, COARSE_ITERATIONS)
            };
        }
        let [finest, second, others] = self.iterations;
        let max_iterations = match k.saturating_sub(self.finest_level) {
            0 => finest,
            1 => second,
            _ => others,
        };
        LevelSchedule { runs_trial, refines, ..self.up_to(k, max_iterations) }
    }

    /// So many iterations at most on level `k`.
    pub fn up_to(&self, k: usize, max_iterations: usize) -> LevelSchedule {
        let [finest, others] = self.tolerance;
        let (tolerance, sweeps) =
            if k <= self.finest_level { (finest, self.finest_sweeps) } else { (others, self.smoothness.sweeps) };
        LevelSchedule {
            max_iterations,
            tolerance,
            smoothness: Smoothness { sweeps, ..self.smoothness },
            runs_trial: false,
            refines: false,
        }
    }
}
