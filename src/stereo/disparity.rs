//! Entry point: two views in, the disparity of the left edge pixels out.

use super::agreement::{Agreement, RowOffset, at_an_end};
use super::align::match_aligned;
use super::classes::{match_classes, most_frequent_row};
use super::contrast::balanced;
use super::edges::{EdgeMap, EdgeSettings};
use super::options::{EdgeDisparityOptions, Method};
use super::row_offset::row_offset_of;
use super::semi_global::{Match, View};
use crate::error::Result;
use crate::types::Frame;

/// Disparities of the left view's edge pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeDisparity {
    /// `x_left - x_right` of every left pixel, (H, W), px; NaN where there is none.
    pub disparity: Frame<f32>,
    /// Rows of the pixels that have one, in row-major order.
    pub rows: Vec<u32>,
    /// Their columns.
    pub columns: Vec<u32>,
    /// Their disparities, px.
    pub values: Vec<f32>,
    /// Agreement of the views, 0 to 1: share of pixels whose class agrees, or 1 less the relative cost.
    pub scores: Vec<f32>,
    /// Whether `row_offset` was searched and the views disagree with it: the true one lies outside of the
    /// range, or the views do not belong together. Many disparities are then wrong.
    pub rows_doubtful: bool,
    /// Row offset of the right view: given, estimated, or the most frequent one (0 without matches).
    pub row_offset: f64,
}

impl EdgeDisparity {
    /// From the disparity and score of every edge pixel that has one.
    fn new(edges: &EdgeMap, found: impl Iterator<Item = Option<(f32, f32)>>, rows: RowOffset) -> Self {
        let (width, height) = edges.class.size();
        let disparity = Frame::filled(width, height, f32::NAN);
        let RowOffset { rows: row_offset, doubtful: rows_doubtful } = rows;
        let (rows, columns, values, scores) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut all = Self { disparity, rows, columns, values, scores, rows_doubtful, row_offset };
        for ((&row, &column), found) in edges.rows.iter().zip(&edges.columns).zip(found) {
            if let Some((disparity, score)) = found {
                all.disparity.row_mut(row as usize)[column as usize] = disparity;
                all.rows.push(row);
                all.columns.push(column);
                all.values.push(disparity);
                all.scores.push(score);
            }
        }
        all
    }
}

/// Disparity `d = x_left - x_right` of the edge pixels of the left view, in px, with `(x, y)` on the left at
/// `(x - d, y + e)` on the right, `e` the row offset.
///
/// Views are (H, W) in 8-bit grey levels, which the thresholds are in. Samples that are not finite leave no
/// edge where the gradient's kernel reaches them. A view without edges gives an empty result. Source: the
/// stereo paper, (1) to (5), and [`Method::SemiGlobal`]. Bit-identical for any number of threads.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) for an option out of range, views (or a prior) of different
/// size, or views smaller than 17 px.
pub fn edge_disparity(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> Result<EdgeDisparity> {
    options.check_views(left, right)?;
    Ok(options.threads.install(|| match options.method {
        Method::Classes => by_classes(left, right, options),
        Method::SemiGlobal => by_semi_global(left, right, options),
    }))
}

/// Class matching.
fn by_classes(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> EdgeDisparity {
    let settings = EdgeSettings::of(options);
    let (edges, right) = (EdgeMap::new(left, &settings), EdgeMap::new(right, &settings));
    let rows = options.row_offset.map_or(options.row_range, |e| (e.round() as i32, e.round() as i32));
    let matches = match_classes(&edges, &right, options, rows, 1);
    let found = options.row_offset.map_or_else(
        || {
            let row_offset = f64::from(most_frequent_row(&matches, rows));
            let agreement = Agreement::new(matches.iter().map(|found| found.map(|found| found.support)));
            RowOffset { rows: row_offset, doubtful: agreement.is_doubtful(at_an_end(row_offset, rows)) }
        },
        RowOffset::given,
    );
    EdgeDisparity::new(&edges, matches.iter().map(|m| m.map(|m| (m.disparity as f32, m.support))), found)
}

/// Semi-global matching after contrasts are balanced and the rows aligned.
fn by_semi_global(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> EdgeDisparity {
    let right = &*balanced(left, right);
    let view = View::of(left, options);
    let rows = options
        .row_offset
        .map_or_else(|| row_offset_of(left, &view, right, options).row_offset(options), RowOffset::given);
    edge_disparities(&view, &match_aligned(left, &view, right, rows.rows, options), rows)
}

/// Disparities of the matched left edge pixels.
pub(super) fn edge_disparities(view: &View, matches: &[Option<Match>], rows: RowOffset) -> EdgeDisparity {
    EdgeDisparity::new(&view.edges, matches.iter().map(|m| m.map(|m| (m.disparity, 1.0 - m.cost))), rows)
}
