//! How many rows lower the right camera sees a point: section 6.1.

use super::classes::{match_classes, most_frequent_row};
use super::disparity::match_aligned;
use super::edges::{EdgeMap, EdgeSettings};
use super::options::EdgeDisparityOptions;
use super::semi_global::{Match, View};
use crate::error::Result;
use crate::image::{Border, GaussianSmoother, Interpolation};
use crate::types::Frame;
use nalgebra::{Matrix3, Vector3};

/// Passes of disparity and vertical steps.
const PASSES: usize = 2;
/// Vertical steps of a pass.
const STEPS: usize = 6;
/// A step as short as this is the last, rows.
const SHORT: f64 = 1e-4;
/// Every how many edge pixels one is asked for its row.
const SAMPLED: usize = 4;
/// Least number of matched edge pixels that vertical steps are made with.
const LEAST_MATCHES: usize = 30;
/// Least scale of the residuals, grey levels: rounding.
const LEAST_SCALE: f64 = 0.5;

/// How many rows lower the right view shows a point: `y_right - y_left`, rows with fractions; 0 where nothing can be matched.
///
/// The most frequent row offset of the class matching (section 2.3) of some edge pixels within `row_range`, then twice: disparity by semi-global matching of the rows so aligned,
/// and Lucas-Kanade steps along y over all matched edge pixels, `L = a R(x - d, y + e) + b` with weights `1 / (1 + (r / 2 s)^2)^2`. `row_offset`, `prior` and the method of the options are not looked at.
/// Identical for any number of threads.
///
/// # Errors
/// As [`edge_disparity`](super::edge_disparity).
pub fn estimate_row_offset(left: &Frame<f32>, right: &Frame<f32>, options: &EdgeDisparityOptions) -> Result<f64> {
    options.check_views(left, right)?;
    Ok(options.threads.install(|| {
        let view = View::new(left, &EdgeSettings::of(options));
        row_offset_of(left, &view, right, options)
    }))
}

/// As [`estimate_row_offset`], for a left view that is prepared.
pub(super) fn row_offset_of(left: &Frame<f32>, view: &View, right: &Frame<f32>, options: &EdgeDisparityOptions) -> f64 {
    let options = EdgeDisparityOptions { prior: None, subpixel: true, check: true, ..options.clone() };
    let classes = EdgeMap::new(right, &EdgeSettings::of(&options));
    let matches = match_classes(&view.edges, &classes, &options, options.row_range, SAMPLED);
    let mut offset = f64::from(most_frequent_row(&matches, options.row_range));
    let smoother = GaussianSmoother { sigma: 1.0, truncate: 4.0, border: Border::Replicate };
    let (smooth_left, smooth_right) = rayon::join(|| smoother.apply(left), || smoother.apply(right));
    for _ in 0..PASSES {
        let matches = match_aligned(left, view, right, offset, &options);
        let Some(refined) = vertical_steps(&smooth_left, view, &smooth_right, &matches, offset) else { break };
        offset = refined;
    }
    offset
}

/// One matched edge pixel: brightness and vertical slope on the left, and where it is on the right for a row offset of 0.
struct Sample {
    brightness: f64,
    slope: f64,
    x: f64,
    y: f64,
}

impl Sample {
    /// What a row of offset, of gain and of bias change.
    fn row(&self) -> Vector3<f64> {
        Vector3::new(self.slope, self.brightness, 1.0)
    }

    /// What is left of the difference to the right view's brightness `value`.
    fn misfit(&self, value: f64, solution: &Vector3<f64>) -> f64 {
        self.brightness - value - self.row().dot(solution)
    }
}

/// The offset after Lucas-Kanade steps along y; none without enough matches, or when they leave the neighbourhood of the start.
fn vertical_steps(
    left: &Frame<f32>,
    view: &View,
    right: &Frame<f32>,
    matches: &[Option<Match>],
    start: f64,
) -> Option<f64> {
    let mut samples = Vec::new();
    for ((&row, &column), found) in view.edges.rows.iter().zip(&view.edges.columns).zip(matches) {
        let Some(found) = found else { continue };
        let (x, y) = (column as usize, row as usize);
        samples.push(Sample {
            brightness: f64::from(left.get(x, y)),
            slope: f64::from(view.along_y.get(x, y)),
            x: f64::from(column) - f64::from(found.disparity),
            y: f64::from(row),
        });
    }
    let mut offset = start;
    for _ in 0..STEPS {
        let step = vertical_step(&samples, right, offset)?;
        offset += step;
        if !((offset - start).abs() <= 1.5) {
            return None;
        }
        if step.abs() < SHORT {
            break;
        }
    }
    Some(offset)
}

/// One step: `r = L - R(y + e)` explained by `slope de + (gain - 1) L + bias`, first all alike, then weighted by how well each is explained.
fn vertical_step(samples: &[Sample], right: &Frame<f32>, offset: f64) -> Option<f64> {
    let seen: Vec<(&Sample, f64)> = samples
        .iter()
        .map(|sample| (sample, f64::from(Interpolation::Bicubic.at(right, sample.x, sample.y + offset))))
        .filter(|(_, value)| value.is_finite())
        .collect();
    if seen.len() < LEAST_MATCHES {
        return None;
    }
    let mut solution = Vector3::zeros();
    let mut scale = f64::INFINITY;
    for _ in 0..3 {
        let (mut normal, mut moment) = (Matrix3::zeros(), Vector3::zeros());
        for (sample, value) in &seen {
            let weight = (1.0 + (sample.misfit(*value, &solution) / (2.0 * scale)).powi(2)).powi(-2);
            normal += sample.row() * sample.row().transpose() * weight;
            moment += sample.row() * (weight * (sample.brightness - value));
        }
        solution = normal.cholesky()?.solve(&moment);
        let mut misfits: Vec<f64> = seen.iter().map(|(s, value)| s.misfit(*value, &solution).abs()).collect();
        let middle = misfits.len() / 2;
        let (_, median, _) = misfits.select_nth_unstable_by(middle, f64::total_cmp);
        scale = (1.4826 * *median).max(LEAST_SCALE);
    }
    Some(solution[0])
}
