//! Aligns the rows of the right view, and matches.

use super::options::EdgeDisparityOptions;
use super::semi_global::{Match, View, match_views};
use super::subpixel::refine;
use crate::image::{Border, Interpolation};
use crate::parallel::for_each_band;
use crate::types::Frame;

/// The view whose row `y` is row `y + offset` of `view`, by cubic convolution.
pub(super) fn rows_moved(view: &Frame<f32>, offset: f64) -> Frame<f32> {
    let (width, height) = view.size();
    let whole = offset.floor();
    let weights = Interpolation::Bicubic.weights(offset - whole).map(|w| w as f32);
    let mut out = Frame::filled(width, height, 0.0f32);
    for_each_band(out.data_mut(), width, |_, rows, band| {
        for (y, out) in rows.zip(band.chunks_exact_mut(width)) {
            for (j, &weight) in weights.iter().enumerate() {
                // Rows with zero weight must not spread NaN.
                if weight != 0.0 {
                    let at = Border::Replicate.index(y as isize + whole as isize + j as isize - 1, height);
                    for (out, value) in out.iter_mut().zip(view.row(at)) {
                        *out += weight * value;
                    }
                }
            }
        }
    });
    out
}

/// Matches of the left edge pixels with the right view moved up by `row_offset`.
pub(super) fn match_aligned(
    left: &Frame<f32>,
    view: &View,
    right: &Frame<f32>,
    row_offset: f64,
    options: &EdgeDisparityOptions,
) -> Vec<Option<Match>> {
    let aligned = rows_moved(right, row_offset);
    let mut matches = match_views(view, &View::of(&aligned, options), options);
    // A row that the right view does not have was replicated from its border.
    let last = left.height() as f64 - 1.0;
    for (found, &row) in matches.iter_mut().zip(&view.edges.rows) {
        if !(0.0..=last).contains(&(f64::from(row) + row_offset)) {
            *found = None;
        }
    }
    if options.subpixel {
        refine(left, view, &aligned, &mut matches);
    }
    matches
}
