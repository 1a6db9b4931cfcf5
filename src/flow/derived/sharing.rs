//! How many estimates share one independent one.

use crate::types::{FieldLayout, Rect, SamplingGrid};

/// Most sites of a list whose correlations with all others are summed.
const SAMPLE: usize = 512;

/// By how much the variance of a mean over the sites exceeds that of independent estimates: the mean over the
/// sites of their summed correlations `exp(-d^2 / (4 l^2))`, with the field's correlation length `l`. At
/// least 1.
///
/// Exact for the flow; for its derivatives, whose correlations change sign at `sqrt(2) l` and cancel over a
/// large region, an upper bound that also covers what does not cancel there (bias).
pub fn sharing(layout: &FieldLayout) -> f64 {
    let length = layout.correlation_length;
    if !(length.is_finite() && length > 0.0) {
        return 1.0;
    }
    let correlation = |squared: f64| (-squared / (4.0 * length * length)).exp();
    match &layout.sites {
        SamplingGrid::Grid { region, stride } => {
            let (width, height) = layout.frame_size;
            let r = region.unwrap_or(Rect { x: 0, y: 0, width, height });
            let along = |side: usize| along(side.div_ceil((*stride).max(1)), *stride as f64, &correlation);
            along(r.width) * along(r.height)
        }
        SamplingGrid::Points(points) => scattered(points, &correlation),
    }
}

/// [`sharing`] of the sites `used` (indices) of a field `width` sites wide.
pub fn sharing_among(layout: &FieldLayout, width: usize, used: &[usize]) -> f64 {
    let length = layout.correlation_length;
    if used.is_empty() || !(length.is_finite() && length > 0.0) {
        return 1.0;
    }
    match &layout.sites {
        SamplingGrid::Points(points) => {
            let points: Vec<_> = used.iter().map(|&index| points[index]).collect();
            sharing(&FieldLayout { sites: SamplingGrid::Points(points), ..layout.clone() })
        }
        SamplingGrid::Grid { stride, .. } => on_lattice(width, used, length / *stride as f64),
    }
}

/// The share of the claimed variance that all estimates have in common: what they claim and do not scatter.
///
/// A covariance that holds a bias claims more than estimates with one bias scatter about their mean.
/// `scatter` is the sum of squares of `count` sites in units of the claimed variance, over its degrees of
/// freedom, `values` the estimates of each; of it [`sharing`] leaves `1 - sharing / count`. What chance
/// explains (one deviation of the ratio) is not counted.
pub(super) fn in_common(scatter: f64, (count, values): (usize, usize), sharing: f64) -> f64 {
    let independent = count as f64 / sharing;
    let left = 1.0 - 1.0 / independent;
    if left.is_nan() || left < 0.5 {
        return 0.0;
    }
    let chance = (2.0 / (independent * values as f64)).sqrt();
    (1.0 - chance - scatter / left).max(0.0)
}

/// Sums over the neighbourhoods of some of the sites; `length` in steps of the lattice.
fn on_lattice(width: usize, used: &[usize], length: f64) -> f64 {
    let rows = used.iter().max().map_or(0, |last| last / width + 1);
    let mut present = vec![false; rows * width];
    for &index in used {
        present[index] = true;
    }
    let reach = ((6.0 * length) as usize).min(rows.max(width));
    let table: Vec<f64> = (0..=reach).map(|d| (-((d * d) as f64) / (4.0 * length * length)).exp()).collect();
    let around = |centre: usize, end: usize| centre.saturating_sub(reach)..(centre + reach + 1).min(end);
    let sum_about = |&index: &usize| -> f64 {
        let (x, y) = (index % width, index / width);
        around(y, rows)
            .map(|row| {
                let line = around(x, width).filter(|&column| present[row * width + column]);
                table[row.abs_diff(y)] * line.map(|column| table[column.abs_diff(x)]).sum::<f64>()
            })
            .sum()
    };
    let sampled: Vec<f64> = used.iter().step_by(used.len().div_ceil(SAMPLE)).map(sum_about).collect();
    sampled.iter().sum::<f64>() / sampled.len() as f64
}

/// A row of `n` sites, `step` px apart. A Gaussian's correlations along x and y multiply.
fn along(n: usize, step: f64, correlation: &dyn Fn(f64) -> f64) -> f64 {
    let pairs = (1..n).map(|lag| 2.0 * (n - lag) as f64 * correlation((lag as f64 * step).powi(2)));
    1.0 + pairs.sum::<f64>() / n.max(1) as f64
}

fn scattered(points: &[(usize, usize)], correlation: &dyn Fn(f64) -> f64) -> f64 {
    let squared =
        |a: &(usize, usize), b: &(usize, usize)| (a.0 as f64 - b.0 as f64).powi(2) + (a.1 as f64 - b.1 as f64).powi(2);
    let step = points.len().div_ceil(SAMPLE).max(1);
    let sampled: Vec<f64> =
        points.iter().step_by(step).map(|a| points.iter().map(|b| correlation(squared(a, b))).sum()).collect();
    if sampled.is_empty() { 1.0 } else { sampled.iter().sum::<f64>() / sampled.len() as f64 }
}
