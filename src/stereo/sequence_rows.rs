//! Row offset of a sequence: estimated at the first suitable pair and monitored from then on.
//!
//! Cameras are fixed, so one offset serves a sequence, and estimates of single pairs only add noise. But a
//! sequence may begin with black, a title or noise.

use super::agreement::{Agreement, RowOffset};
use super::align::match_aligned;
use super::contrast::balanced;
use super::disparity::{EdgeDisparity, edge_disparities, edge_disparity};
use super::options::{EdgeDisparityOptions, Method};
use super::row_offset::{misalignment, row_offset_of};
use super::semi_global::{Match, View};
use crate::error::Result;
use crate::types::Frame;

/// Misalignment above noise, rows: single pairs are within .05 of the truth.
const MAX_MISALIGNMENT: f64 = 0.2;

/// Matches a sequence pair by pair, and keeps its row offset.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SequenceRows {
    given: Option<f64>,
    found: Option<f64>,
}

impl SequenceRows {
    /// For a sequence with a given offset, rows, or one to be estimated.
    pub fn new(given: Option<f64>) -> Self {
        Self { given, found: None }
    }

    /// The offset for the pairs to come, rows: given, or estimated and still valid.
    pub fn known(&self) -> Option<f64> {
        self.given.or(self.found)
    }

    /// Matches the next pair as [`edge_disparity`]; `row_offset` of the options is ignored.
    ///
    /// [`Method::SemiGlobal`] aligns the rows by the known offset. It becomes known at the first pair with
    /// enough windows for vertical steps and three tenths of the edge pixels matched. It is estimated again
    /// where a later pair is matched worse, or a vertical step exceeds a fifth of a row. Pairs with too few
    /// edges change nothing. [`Method::Classes`] searches the rows at every pixel unless given.
    pub fn match_next(
        &mut self,
        left: &Frame<f32>,
        right: &Frame<f32>,
        options: &EdgeDisparityOptions,
    ) -> Result<EdgeDisparity> {
        let options = EdgeDisparityOptions { row_offset: self.given, ..options.clone() };
        if self.given.is_some() || options.method == Method::Classes {
            return edge_disparity(left, right, &options);
        }
        options.check_views(left, right)?;
        Ok(options.threads.install(|| self.align(left, right, &options)))
    }

    fn align(&mut self, left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> EdgeDisparity {
        let right = &*balanced(left, right);
        let pair = Pair { left, right, view: View::of(left, options), options };
        if let Some(rows) = self.found {
            let matches = pair.matched(rows);
            if !crate::ablation::keeps("edges.watched_rows") || !pair.contradicts(rows, &matches) {
                return edge_disparities(&pair.view, &matches, RowOffset::given(rows));
            }
        }
        let found = row_offset_of(left, &pair.view, right, options);
        let believed = found.is_believed(options);
        match self.found {
            // An estimate that is not reliable does not replace the known one.
            Some(known) if !believed => edge_disparities(&pair.view, &pair.matched(known), RowOffset::given(known)),
            _ => {
                self.found = Some(found.rows).filter(|_| believed);
                edge_disparities(&pair.view, &pair.matched(found.rows), found.row_offset(options))
            }
        }
    }
}

/// A pair of views.
struct Pair<'a> {
    left: &'a Frame<f32>,
    right: &'a Frame<f32>,
    view: View,
    options: &'a EdgeDisparityOptions,
}

impl Pair<'_> {
    fn matched(&self, rows: f64) -> Vec<Option<Match>> {
        match_aligned(self.left, &self.view, self.right, rows, self.options)
    }

    /// Whether the matches contradict their offset.
    fn contradicts(&self, rows: f64, matches: &[Option<Match>]) -> bool {
        let step = misalignment(self.left, &self.view, self.right, matches, rows);
        let misaligned = step.is_some_and(|step| step.abs() > MAX_MISALIGNMENT);
        misaligned || Agreement::of(matches).contradicts()
    }
}
