//! Agreement of the views with a row offset.

use super::semi_global::Match;
use crate::math::median;

/// Smallest share of matched edge pixels with aligned rows.
const MIN_MATCHED_SHARE: f64 = 0.3;
/// Smallest number of edge pixels for a decision.
const MIN_EDGES: usize = 30;
/// Median score below which most matches are wrong: above .8 if aligned, below .55 two rows apart.
const MIN_SCORE: f64 = 0.7;

/// Row offset, given or estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowOffset {
    /// `y_right - y_left`, rows.
    pub rows: f64,
    /// Whether the views have edges and yet disagree at every offset in the range.
    pub doubtful: bool,
}

impl RowOffset {
    /// A given or known offset, not doubtful.
    pub(super) fn given(rows: f64) -> Self {
        Self { rows, doubtful: false }
    }
}

/// Agreement of the matches at a row offset.
#[derive(Debug, Clone, Copy)]
pub(super) struct Agreement {
    /// Number of edge pixels.
    edges: usize,
    /// Share of them with a match.
    matched: f64,
    /// Median score of the matches, 0 to 1; none without matches.
    score: Option<f64>,
}

impl Agreement {
    /// From the score of each edge pixel with a match.
    pub fn new(scores: impl Iterator<Item = Option<f32>>) -> Self {
        let (mut edges, mut found) = (0, Vec::new());
        for score in scores {
            edges += 1;
            found.extend(score.map(f64::from));
        }
        Self { edges, matched: found.len() as f64 / (edges as f64).max(1.0), score: median(&mut found) }
    }

    /// From semi-global matching.
    pub fn of(matches: &[Option<Match>]) -> Self {
        Self::new(matches.iter().map(|found| found.map(|found| 1.0 - found.cost)))
    }

    /// Whether enough edge pixels are matched to accept the offset.
    pub fn suffices(&self) -> bool {
        self.edges >= MIN_EDGES && self.matched >= MIN_MATCHED_SHARE
    }

    /// Whether there are enough edge pixels, and too few are matched.
    pub fn contradicts(&self) -> bool {
        self.edges >= MIN_EDGES && self.matched < MIN_MATCHED_SHARE
    }

    /// Whether too few edge pixels are matched, or the offset is `unsure`, and the matches are poor.
    pub fn is_doubtful(&self, unsure: bool) -> bool {
        let poor = self.score.is_some_and(|score| score < MIN_SCORE);
        self.edges >= MIN_EDGES && (unsure || !self.suffices()) && poor
    }
}

/// Whether an offset is at an end of the searched range, as the best of wrong ones usually is.
pub(super) fn at_an_end(rows: f64, (least, greatest): (i32, i32)) -> bool {
    least < greatest && (rows < f64::from(least) + 0.5 || rows > f64::from(greatest) - 0.5)
}
