//! How much work each level gets: iterations, sweeps and tolerances of a preset.

use super::{options::Preset, regularize::Smoothness};

/// Iterations, sweeps and tolerances of all levels. One iteration is a linearisation and its regularisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Schedule {
    /// Finest level that is estimated; 0 is the frame itself.
    pub finest_level: usize,
    /// Maximum number of iterations on that level, the next coarser one and every other.
    pub iterations: [usize; 3],
    /// The same for the middle and next frame of a triple alone, which begin on the third of these levels.
    pub next_frame_iterations: [usize; 3],
    /// A level has converged when an iteration changes the flow by at most this, px of the level (root mean
    /// square): on the finest level, and on the others.
    pub tolerance: [f64; 2],
    /// Smoothness terms and sweeps after each linearisation.
    pub smoothness: Smoothness,
    /// Relaxation sweeps on the finest level: cheap, they remove most of what one linearisation leaves.
    pub finest_sweeps: usize,
    /// Last iterations on the finest level before which the flow is sharpened at motion boundaries.
    pub finest_sharpened: usize,
    /// Whether blocks are searched for on a coarse level (large motions).
    pub searches: bool,
    /// Levels above the finest from which the unregularised trial is run (small objects); `None`: never.
    pub trial_from: Option<usize>,
    /// Whether the motion one level above the finest is refined before it is carried down, for less noise.
    /// Not at half resolution, where that level has too few sites to choose windows.
    pub refines_intermediate: bool,
    /// Whether the flow is refined at every pixel.
    pub refines_pixels: bool,
}

/// Maximum size, pixels, of a level whose cost is negligible.
const SMALL_LEVEL_PIXELS: usize = 2500;
/// Maximum number of iterations on such a level: motion that it misses is not found later.
const COARSE_ITERATIONS: usize = 20;
/// Relaxation sweeps on such a level.
const COARSE_SWEEPS: usize = 10;
/// Maximum break strain on such a level: neighbours are far apart, and under fast rotation move differently.
const COARSE_BREAK_STRAIN: f64 = 0.07;

/// Maximum size, pixels, of the level on which blocks are searched for.
const MAX_SEARCHED_PIXELS: usize = 20_000;
/// Levels, from the finest up, on which the flow is sharpened at motion boundaries: coarser ones have few
/// sites.
const SHARPENED_LEVELS: usize = 3;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LevelSchedule {
    pub max_iterations: usize,
    /// Root-mean-square change of the flow, px of the level, at which iterations end.
    pub tolerance: f64,
    pub smoothness: Smoothness,
    pub runs_trial: bool,
    /// Iteration from which on the flow is sharpened at motion boundaries.
    pub sharpens_from: usize,
    /// Whether blocks are searched for.
    pub searches: bool,
    pub refines: bool,
}

impl Schedule {
    pub fn new(preset: Preset, frames: usize) -> Self {
        let smoothness = Smoothness::default();
        // Three frames have less noise than two: another linearisation pays.
        let (finest_tolerance, finest_sweeps) = if frames == 2 { (0.035, 6) } else { (0.023, 4) };
        match preset {
            Preset::Fast => Self {
                finest_level: 1,
                iterations: [3, 4, 4],
                next_frame_iterations: [2, 5, 5],
                tolerance: [0.02; 2],
                smoothness: Smoothness { sweeps: 4, ..smoothness },
                finest_sweeps: 4,
                finest_sharpened: 0,
                searches: false,
                trial_from: None,
                refines_intermediate: false,
                refines_pixels: false,
            },
            Preset::Balanced => Self {
                finest_level: 0,
                iterations: [3, 5, 5],
                next_frame_iterations: [2, 5, 5],
                tolerance: [finest_tolerance, 0.023],
                smoothness: Smoothness { sweeps: 4, break_strain: 0.14, ..smoothness },
                finest_sweeps,
                finest_sharpened: 2,
                searches: true,
                trial_from: Some(2),
                refines_intermediate: true,
                refines_pixels: true,
            },
            Preset::Accurate => Self {
                finest_level: 0,
                iterations: [4, 6, 6],
                next_frame_iterations: [4, 6, 6],
                tolerance: [0.003; 2],
                // More iterations undo less smoothing: noise is held back by the terms instead.
                smoothness: Smoothness { flow: 40.0, jacobian: 8000.0, break_strain: 0.2, ..smoothness },
                finest_sweeps: smoothness.sweeps,
                finest_sharpened: usize::MAX,
                searches: true,
                trial_from: Some(2),
                refines_intermediate: true,
                refines_pixels: true,
            },
        }
    }

    /// The schedule of level `k` (0: the frame) of `size` pixels; on the coarsest nothing is known.
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

    /// The level on which blocks are searched for: the finest that is small enough, but not the finest of
    /// all.
    pub fn searched_level(&self, sizes: impl Iterator<Item = (usize, usize)>) -> Option<usize> {
        let is_small = |(_, (width, height)): &(usize, (usize, usize))| width * height <= MAX_SEARCHED_PIXELS;
        let (found, _) = sizes.enumerate().skip(self.finest_level + 1).find(is_small)?;
        Some(found).filter(|_| self.searches)
    }

    /// Level `k` with at most `max_iterations` iterations, without trial and refinement.
    pub fn up_to(&self, k: usize, max_iterations: usize) -> LevelSchedule {
        let [finest, others] = self.tolerance;
        let (tolerance, sweeps) =
            if k <= self.finest_level { (finest, self.finest_sweeps) } else { (others, self.smoothness.sweeps) };
        LevelSchedule {
            max_iterations,
            tolerance,
            smoothness: Smoothness { sweeps, ..self.smoothness },
            runs_trial: false,
            sharpens_from: match k {
                _ if k <= self.finest_level => max_iterations.saturating_sub(self.finest_sharpened),
                _ if k < self.finest_level + SHARPENED_LEVELS => 1,
                _ => usize::MAX,
            },
            searches: false,
            refines: false,
        }
    }
}
