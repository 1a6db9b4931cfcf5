//! What an offset of the rows is worth: how well the views agree with it.

use super::semi_global::Match;
use crate::math::median;

/// Least share of the edge pixels that are matched where the rows are aligned.
const LEAST_MATCHED: f64 = 0.3;
/// Fewer edge pixels say nothing of the rows.
const LEAST_EDGES: usize = 30;
/// A median score below this is that of matches most of which are wrong: one of rows that are aligned is
/// above .8 with noise of 2 grey levels, of rows that are two apart or more below .55.
const POOR: f64 = 0.7;

/// An estimate of the row offset, and what it is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowOffset {
    /// `y_right - y_left`, rows.
    pub rows: f64,
    /// Whether the views have edges and yet hardly agree at any offset that was searched: the true one lies
    /// outside of the range, or the views do not belong together.
    pub doubtful: bool,
}

impl RowOffset {
    /// One that is given, or known, is not to be doubted.
    pub(super) fn given(rows: f64) -> Self {
        Self { rows, doubtful: false }
    }
}

/// How well matches with some row offset agree.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agreement {
    /// Edge pixels that were to be matched.
    edges: usize,
    /// Share of them that were.
    matched: f64,
    /// Median score of these, 0 to 1; none of none.
    score: Option<f64>,
}

impl Agreement {
    /// Of as many edge pixels as there are items, from the scores of those that are matched.
    pub fn new(scores: impl Iterator<Item = Option<f32>>) -> Self {
        let (mut edges, mut found) = (0, Vec::new());
        for score in scores {
            edges += 1;
            found.extend(score.map(f64::from));
        }
        Self { edges, matched: found.len() as f64 / (edges as f64).max(1.0), score: median(&mut found) }
    }

    /// Of semi-global matching.
    pub fn of(matches: &[Option<Match>]) -> Self {
        Self::new(matches.iter().map(|found| found.map(|found| 1.0 - found.cost)))
    }

    /// Whether enough edge pixels are matched for the offset to be believed.
    pub fn suffices(&self) -> bool {
        self.edges >= LEAST_EDGES && self.matched >= LEAST_MATCHED
    }

    /// Whether there is much to be matched, and little was.
    pub fn contradicts(&self) -> bool {
        self.edges >= LEAST_EDGES && self.matched < LEAST_MATCHED
    }

    /// Whether there is much to be matched, too little of it was or the offset is `unsure` for another
    /// reason, and what was matched is matched badly.
    pub fn is_doubtful(&self, unsure: bool) -> bool {
        let poor = self.score.is_some_and(|score| score < POOR);
        self.edges >= LEAST_EDGES && (unsure || !self.suffices()) && poor
    }
}

/// Whether an offset is at or beyond an end of the rows that were searched: so is the best of those that are
/// all wrong.
pub(super) fn at_an_end(rows: f64, (least, greatest): (i32, i32)) -> bool {
    least < greatest && (rows < f64::from(least) + 0.5 || rows > f64::from(greatest) - 0.5)
}
