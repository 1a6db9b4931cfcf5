//! The one door: two views in, the disparity of the left edge pixels out.

use super::classes::{ClassMatch, match_classes};
use super::edges::{EdgeMap, EdgeSettings};
use super::options::{EdgeDisparityOptions, Method};
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
    /// How well both views agree there, 0 to 1: share of the window's classed pixels whose class agrees, or 1 less the matching cost over its truncation.
    pub scores: Vec<f32>,
    /// How many rows lower the right view shows a point: the one given, the estimate, or the most frequent one of the class matching (0 without matches).
    pub row_offset: f64,
}

/// One accepted edge pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Accepted {
    pub row: u32,
    pub column: u32,
    pub disparity: f32,
    pub score: f32,
}

impl EdgeDisparity {
    /// From accepted pixels in row-major order.
    fn new((width, height): (usize, usize), accepted: &[Accepted], row_offset: f64) -> Self {
        let mut disparity = Frame::filled(width, height, f32::NAN);
        for each in accepted {
            disparity.row_mut(each.row as usize)[each.column as usize] = each.disparity;
        }
        Self {
            disparity,
            rows: accepted.iter().map(|each| each.row).collect(),
            columns: accepted.iter().map(|each| each.column).collect(),
            values: accepted.iter().map(|each| each.disparity).collect(),
            scores: accepted.iter().map(|each| each.score).collect(),
            row_offset,
        }
    }
}

/// Disparity `d = x_left - x_right` of the edge pixels of the left view, in px, with `(x, y)` on the left at `(x - d, y + e)` on the right, `e` the row offset.
///
/// Views are (H, W) in 8-bit grey levels, which the thresholds are in. Samples that are not finite leave no edge where the gradient's kernel reaches them. A view without edges
/// gives an empty result. Source: the stereo paper, (1) to (5), and [`Method::SemiGlobal`]. Bit-identical for any number of threads.
///
/// # Errors
/// [`Error::Argument`](crate::Error::Argument) for an option out of range, views (or a prior) of different size, or views smaller than 17 px.
pub fn edge_disparity(
    left: &Frame<f32>,
    right: &Frame<f32>,
    options: &EdgeDisparityOptions,
) -> Result<EdgeDisparity> {
    options.check_views(left, right)?;
    Ok(options.threads.install(|| match options.method {
        Method::Classes | Method::SemiGlobal => by_classes(left, right, options),
    }))
}

/// Class matching with the rows that the options ask for.
fn by_classes(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> EdgeDisparity {
    let settings = EdgeSettings::of(options);
    let (edges, right) = (EdgeMap::new(left, &settings), EdgeMap::new(right, &settings));
    let rows = options.row_offset.map_or(options.row_range, |e| (e.round() as i32, e.round() as i32));
    let matches = match_classes(&edges, &right, options, rows, 1);
    let row_offset = options.row_offset.unwrap_or_else(|| f64::from(most_frequent_row(&matches, rows)));
    let accepted: Vec<_> = (edges.rows.iter().zip(&edges.columns).zip(&matches))
        .filter_map(|((&row, &column), found)| {
            found.map(|found| Accepted { row, column, disparity: found.disparity as f32, score: found.support })
        })
        .collect();
    EdgeDisparity::new(left.size(), &accepted, row_offset)
}

/// The row offset that most matches have; among equals the one nearest 0; 0 without matches.
pub(super) fn most_frequent_row(matches: &[Option<ClassMatch>], (least, greatest): (i32, i32)) -> i32 {
    let mut counts = vec![0usize; (greatest - least + 1) as usize];
    for found in matches.iter().flatten() {
        counts[(found.row_offset - least) as usize] += 1;
    }
    let most = (least..=greatest).max_by_key(|e| (counts[(e - least) as usize], -e.abs()));
    most.filter(|e| counts[(e - least) as usize] > 0).unwrap_or(0)
}

impl EdgeSettings {
    /// Those of a matcher.
    pub(super) fn of(options: &EdgeDisparityOptions) -> Self {
        Self { sigma: options.sigma, threshold: options.threshold, classes: options.classes }
    }
}

/// Row offset of the right view.
pub fn estimate_row_offset(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> Result<f64> {
    edge_disparity(left, right, options).map(|found| found.row_offset)
}
