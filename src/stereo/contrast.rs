//! Cameras of different gain: scales the right view to the contrast of the left one.

use crate::types::Frame;
use std::borrow::Cow;

/// Step of the sampled pixels along x and y.
const SAMPLED: usize = 2;
/// Upper quantiles of the differences in brightness that are compared.
const SHARES: [f64; 4] = [0.01, 0.02, 0.04, 0.08];
/// Floor of the differences, grey levels: noise.
const MIN_DIFFERENCE: f32 = 2.0;
/// Ratios that count as 1: different content of the views causes as much.
const EQUAL_CONTRAST: [f32; 2] = [0.92, 1.08];
/// Largest ratio of the ratios; above, the views differ by more than a gain.
const MAX_RATIO_SPREAD: f32 = 1.15;

/// The right view times the ratio of contrasts, unless that is nearly 1 or undefined.
pub(super) fn balanced<'a>(left: &Frame<f32>, right: &'a Frame<f32>) -> Cow<'a, Frame<f32>> {
    match ratio(left, right).filter(|_| crate::ablation::keeps("edges.contrast")) {
        Some(ratio) if !(EQUAL_CONTRAST[0]..=EQUAL_CONTRAST[1]).contains(&ratio) => {
            Cow::Owned(right.map(|&value| value * ratio))
        }
        _ => Cow::Borrowed(right),
    }
}

/// Ratio of the contrasts: median of the ratios of both views' upper quantiles, if these agree.
fn ratio(left: &Frame<f32>, right: &Frame<f32>) -> Option<f32> {
    let (left, right) = (greatest_differences(left)?, greatest_differences(right)?);
    let mut ratios: [f32; SHARES.len()] = std::array::from_fn(|i| left[i] / right[i]);
    ratios.sort_unstable_by(f32::total_cmp);
    let [least, below, above, most] = ratios;
    (most <= MAX_RATIO_SPREAD * least).then_some(0.5 * (below + above))
}

/// Upper quantiles of the differences across two pixels along x; `None` if they are noise.
fn greatest_differences(view: &Frame<f32>) -> Option<[f32; SHARES.len()]> {
    let rows = (0..view.height()).step_by(SAMPLED).map(|y| view.row(y));
    let sizes = rows.flat_map(|row| row.windows(3).step_by(SAMPLED).map(|three| (three[2] - three[0]).abs()));
    let mut sizes: Vec<f32> = sizes.filter(|size| size.is_finite()).collect();
    let count = sizes.len();
    let mut at = |share: f64| {
        let place = ((1.0 - share) * count as f64) as usize;
        let size = (place < count).then(|| *sizes.select_nth_unstable_by(place, f32::total_cmp).1);
        size.filter(|size| *size >= MIN_DIFFERENCE)
    };
    Some([at(SHARES[0])?, at(SHARES[1])?, at(SHARES[2])?, at(SHARES[3])?])
}
