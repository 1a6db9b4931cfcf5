//! Pairs of views, read ahead and in grey levels.

use crate::error::Result;
use crate::image::Preprocess;
use crate::io::ViewPairs;
use crate::parallel::{Progress, Threads};
use crate::pipeline::prefetch::Prefetch;
use crate::track::GreyLevels;
use crate::types::{AnyFrame, Frame};

/// Both views of a moment, left and right.
#[derive(Debug)]
pub struct GreyPair {
    /// As they came.
    pub views: [AnyFrame; 2],
    /// Prepared, in 8-bit grey levels, as matching takes them.
    pub grey: [Frame<f32>; 2],
}

/// Reads pairs ahead, on a thread of their own, and prepares them.
pub struct GreyPairs {
    pairs: Prefetch<[AnyFrame; 2]>,
    total: usize,
    preprocess: Preprocess,
    threads: Threads,
    levels: Option<GreyLevels>,
}

impl GreyPairs {
    /// Starts to read.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) where there can be no thread.
    pub fn start(views: ViewPairs, preprocess: Preprocess, threads: Threads) -> Result<Self> {
        let total = views.len_hint().unwrap_or(0);
        Ok(Self { pairs: Prefetch::pairs(views)?, total, preprocess, threads, levels: None })
    }

    /// How many pairs there are in all, 0 where that is not known.
    pub fn total(&self) -> usize {
        self.total
    }

    /// The next pair, after `done` of them; `None` after the last. Calls `progress` at least once.
    pub fn next(&mut self, done: usize, progress: &dyn Progress) -> Result<Option<GreyPair>> {
        progress.step(done, self.total)?;
        let Some(views) = self.pairs.next(|| progress.step(done, self.total))? else { return Ok(None) };
        let levels = match self.levels {
            Some(known) => known.revised(&views),
            None => GreyLevels::decide_together(&views),
        };
        self.levels = Some(levels);
        let prepared = |view: &AnyFrame| {
            let frame = self.threads.install(|| self.preprocess.apply(view.to_real::<f64>()));
            GreyLevels::scaled(frame, levels.gain(view)).map(|&value| value as f32)
        };
        let grey = [prepared(&views[0]), prepared(&views[1])];
        Ok(Some(GreyPair { views, grey }))
    }
}
